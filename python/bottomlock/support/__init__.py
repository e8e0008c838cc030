"""Helpers of every room: modules imported late, optional extras, the nearest name."""
