"""Does the velocity of a DVL follow the motion that the inertial sensors felt? Without attitude, start or filter."""
