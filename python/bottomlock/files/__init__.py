"""Files, whole or not at all, with digests, never over what is not ours; and the columns of every table."""
