"""What is wrong with a replay, and which key of the case to change: ranked findings with their numbers."""
