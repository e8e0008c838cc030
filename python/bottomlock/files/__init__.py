"""What is written and read: whole or not at all, with digests, never over what is not ours."""
