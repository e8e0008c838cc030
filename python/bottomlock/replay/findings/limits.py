"""Thresholds of the first line: from which number on a replay is called wrong, doubtful, or right.

Where a threshold was set by recordings, the comment says what right ones have and what wrong ones have; `python -m
tools.first_line` shows both.
"""

from scipy.stats import norm

from bottomlock.statistics.chi_squared import each_probability

# Innovations of the method that stands for all.
PROBABILITY = 0.9999
"""Of the band of the mean NIS of a consistent filter, and of errors over claimed σ."""
WRONG_REJECTED, MANY_REJECTED = 0.15, 0.04
"""Part of the pings that is rejected, from which the beams do not fit, and from which the filter claims too much."""
WRONG_RATIO, HIGH_RATIO = 2.5, 1.5
"""NIS over its degrees: a little too small a noise gives up to the second; beyond the first the filter is wrong."""
SMALL_CLAIM, WRONG_CLAIM = 1.5, 2.5
"""Measured over claimed noise of the beams from which the claim is a warning, and a fault."""

# A method against dead reckoning.
AXES = ("north", "east")
FALSE_ALARM, TIMES = 1e-4, 20
"""Chance that a right pair of tracks is reported, at so many places along them."""
LIMIT = float(norm.isf(0.5 * (1.0 - each_probability(FALSE_ALARM, TIMES * len(AXES)))))
"""Largest difference in combined σ that chance explains."""
LOST = 10.0
"""Claimed σ over that of dead reckoning from which a method has no position to speak of."""
VAGUE = 3.0
"""The same from which its position is worth less than that of dead reckoning."""
WORSE = 1.25
"""RMS of the position over that of dead reckoning from which a method is worse."""
OF_WAY = 0.005
"""RMS of the position over the distance travelled up to which it does not matter who is nearer to the reference."""
NEAR_SIGMAS = 1.0
"""Distance from dead reckoning, in σ of both, up to which a mistake has not moved the track: dives of St Pere and of
tests/dive.py whose track is right have 1.1 at most, planted mistakes that move it 1.6 or more."""

# A method against a reference.
REFERENCE_SIGMAS = 2.5
"""Distance from the reference at the end, in σ of both, up to which it agrees: 1 in 500 right tracks is beyond."""
REFERENCE_RMS_SIGMAS = 2.0
"""The same of the RMS over time, whose errors last: 1 in 50."""
TURNED_SIGMAS = 2.5
"""Rotation of a track over the claimed slow error of the heading up to which that explains it: 1 in 80."""

# What the track covers.
UNUSED = 0.15
"""Part of the dive, which is the time of IMU and pings, before the first or after the last ping of the track from which
the answer is "partly", and after the last position of a reference from which this confirms nothing: right rows of
tools.first_line have 0.10 at most, half a file 0.4."""

# Sensors beside the beams.
REJECTED = 0.1
"""Part of a sensor's readings whose rejection is a doubt: right dives of tests/dive.py have 0.02 at most, St Pere,
A-KIT, BlueROV2 and the boat 0.01; the glider's depth, which its surfacings contradict, 0.26."""
FEWEST_READINGS = 20
SLOW_SIGMAS = 4.0
"""Slow error of a sensor, in σ of what the case states, that is a doubt: 2.5 at most on those dives, 1.7 on right
recordings; depths that jump, or are pressures, have 6 and more."""

# An assumption on the sway.
PARTIAL = 0.1
"""Part of the pings with fewer than three beams from which it helps."""
SLIP_FACTOR = 2.0
"""Sway over the assumed one up to which it holds."""
