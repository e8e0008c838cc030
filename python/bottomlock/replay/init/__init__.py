"""A first case file from recorded files: what they hold, guessed with reasons, and what they cannot tell."""
