"""Observability along a motion with given beams and sensors, after Klein & Diamant 2015."""
