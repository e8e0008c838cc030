"""The start of a first case: a source of each part of the state, and a time at which each of them has data."""

from collections.abc import Iterator

import numpy as np

from bottomlock.replay.init.entries import Entry
from bottomlock.replay.init.guess import round_up
from bottomlock.replay.init.rig import Parts

WINDOW_S, SHORT_WINDOW_S = 10.0, 2.0
UNKNOWN_DEG = 180.0
"""1 sigma of a heading that nothing tells. A heading, positions or gyros better than the Earth's rate find it."""
UNDER_WAY_MPS = [2.0, 0.5, 0.5]
"""1 sigma of a velocity of which nothing is known."""


def start(parts: Parts) -> Iterator[Entry]:
    """Sources of the start, and a time at which each of them has data."""
    imu, attitude = parts.imu, parts.attitude
    begin = int(imu.time_ns[0])
    length_s = float(imu.time_ns[-1] - begin) * 1e-9
    # Readings that are made of an attitude have no gravity to be levelled by.
    from_attitude = attitude is not None and (imu.made or (attitude.frame.known and attitude.offset.known))
    window_s = WINDOW_S if length_s > 6.0 * WINDOW_S else SHORT_WINDOW_S
    earliest_s = 0.5 if from_attitude else window_s
    if attitude is not None and from_attitude:
        times = attitude.found.times.time_ns
        assert times is not None  # guessed from them
        earliest_s = max(earliest_s, (int(times[0]) - begin) * 1e-9 + attitude.offset.value + 0.02)
    pings_s = (parts.dvl.time_ns - begin) * 1e-9 + parts.dvl.offset.value
    later = pings_s[(pings_s >= earliest_s) & (pings_s < length_s)]
    at_s = float(later[0]) + 0.02 if later.size else earliest_s
    why = "the first ping with a whole velocity after the sensors have begun" if later.size else ""
    yield Entry("start.at_s", round(at_s, 3), why)
    if from_attitude:
        yield Entry("start.level", "attitude")
        yield Entry("start.heading", "attitude")
    else:
        why = "the mean specific force before the start; the vehicle is calm then"
        yield Entry("start.level", "levelling", why, known=False)
        yield Entry("start.window_s", window_s)
        why = "nothing in the files gives it: the whole track turns with it"
        yield Entry("start.heading", "given", why, known=False, asks="heading")
        yield Entry("start.heading_deg", 0.0)
        why = "unknown: the track is relative until something observes it"
        yield Entry("start.heading_sd_deg", UNKNOWN_DEG, why)
    if later.size:
        yield Entry("start.velocity", "beams")
    else:
        why = "no ping there gives a whole velocity; the sigma below covers a vehicle under way"
        yield Entry("start.velocity_mps", [0.0, 0.0, 0.0], why, known=False)
    yield Entry("start.velocity_sd_mps", [0.1, 0.1, 0.1] if later.size else UNDER_WAY_MPS)
    down, reference = _depth_at(parts, at_s), parts.reference
    if reference is not None:
        sd_m, why = reference.sd_m, "that of the reference"
        roles = reference.columns or {**reference.found.columns, **reference.found.extra}
        down_sd_m = sd_m if {"height", "down"} & set(roles) else max(sd_m, round_up(abs(down)))
        yield Entry("start.position", "reference")
        why += ", which has no height: down by the depth at the start" * (down_sd_m > sd_m)
        yield Entry("start.position_sd_m", [sd_m, sd_m, down_sd_m], why)
        return
    why = "where it starts is the origin" + ("; depth by its sensor" if down else "")
    yield Entry("start.position_m", [0.0, 0.0, round(down, 3)], why)
    yield Entry("start.position_sd_m", [1.0, 1.0, 0.5])


def _depth_at(parts: Parts, at_s: float) -> float:
    """The depth that is recorded nearest to a time, m; 0 without one."""
    depth = parts.depth
    if depth is None:
        return 0.0
    times = depth.found.times.time_ns
    assert times is not None  # guessed from them
    good = np.flatnonzero(np.isfinite(depth.depth_m))
    if not good.size:
        return 0.0
    seconds = (times[good] - int(parts.imu.time_ns[0])) * 1e-9 + depth.offset.value
    return float(depth.depth_m[good[int(np.argmin(np.abs(seconds - at_s)))]])
