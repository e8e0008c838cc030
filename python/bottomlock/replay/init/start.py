"""The start of a first case: when every stream has begun, and from what."""

import numpy as np

from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.text import Section

WINDOW_S = 10.0
SHORT_WINDOW_S = 2.0
UNKNOWN_DEG = 180.0
"""1 sigma of a heading that nothing tells. A heading, positions or gyros better than the Earth's rate find it."""
UNDER_WAY_MPS = [2.0, 0.5, 0.5]
"""1 sigma of a velocity of which nothing is known."""


def put_start(section: Section, parts: Parts) -> None:
    """Sources of the start, and a time at which each of them has data."""
    imu, attitude = parts.imu, parts.attitude
    begin = int(imu.time_ns[0])
    length_s = float(imu.time_ns[-1] - begin) * 1e-9
    from_attitude = attitude is not None and attitude.frame.known and attitude.offset.known
    window_s = WINDOW_S if length_s > 6.0 * WINDOW_S else SHORT_WINDOW_S
    earliest_s = 0.5 if from_attitude else window_s
    if attitude is not None and from_attitude:
        times = attitude.found.times.time_ns
        assert times is not None  # guessed from them
        earliest_s = max(earliest_s, (int(times[0]) - begin) * 1e-9 + attitude.offset.seconds + 0.02)
    pings_s = (parts.dvl.time_ns - begin) * 1e-9 + parts.dvl.offset_s
    later = pings_s[(pings_s >= earliest_s) & (pings_s < length_s)]
    has_ping = bool(later.size)
    at_s = float(later[0]) + 0.02 if has_ping else earliest_s
    section.put(
        "at_s",
        round(at_s, 3),
        "the first ping with a whole velocity after the sensors have begun" if has_ping else "",
    )
    if from_attitude:
        section.put("level", "attitude")
        section.put("heading", "attitude")
    else:
        section.put(
            "level",
            "levelling",
            "the mean specific force before the start; is the vehicle calm then?",
            known=False,
        )
        section.put("window_s", window_s)
        section.put(
            "heading", "given", "nothing in the files gives it: the whole track turns with it", known=False
        )
        section.put("heading_deg", 0.0)
        section.put(
            "heading_sd_deg", UNKNOWN_DEG, "unknown: the track is relative until something observes it"
        )
    if has_ping:
        section.put("velocity", "beams")
    else:
        why = (
            "no ping there gives a whole velocity: is it at rest? The sigma below covers a vehicle under way"
        )
        section.put("velocity_mps", [0.0, 0.0, 0.0], why, known=False)
    section.put("velocity_sd_mps", [0.1, 0.1, 0.1] if has_ping else UNDER_WAY_MPS)
    _position(section, parts, at_s)


def _position(section: Section, parts: Parts, at_s: float) -> None:
    reference = parts.reference
    if reference is not None:
        section.put("position", "reference")
        sd = reference.sd_m
        section.put("position_sd_m", [sd, sd, sd], "how good is the reference?", known=False)
        return
    down = 0.0
    if parts.depth is not None:
        times = parts.depth.found.times.time_ns
        assert times is not None  # guessed from them
        seconds = (times - int(parts.imu.time_ns[0])) * 1e-9 + parts.depth.offset.seconds
        good = np.isfinite(parts.depth.depth_m)
        if good.any():
            nearest = np.flatnonzero(good)[int(np.argmin(np.abs(seconds[good] - at_s)))]
            down = float(parts.depth.depth_m[nearest])
    section.put(
        "position_m",
        [0.0, 0.0, round(down, 3)],
        "where it starts is the origin" + ("; depth by its sensor" if down else ""),
    )
    section.put("position_sd_m", [1.0, 1.0, 0.5])
