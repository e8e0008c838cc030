"""The readings of a mission in order of time: stretches of inertial samples, and what was read at their ends."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.recordings.streams import Inertial, WaterBeams
from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

PERIOD_NS = 100_000_000
"""A stretch is no longer than this, so that covariances are propagated at 10 Hz or more."""


@dataclass(frozen=True, eq=False)
class Positions:
    """Position fixes in the tangent frame (n, 3), m, with one 1 sigma for every axis; no part of a mission's data."""

    time_ns: Times
    position_t_m: Floats
    sd_m: float


@dataclass(frozen=True, eq=False)
class Stretch:
    """Inertial samples, means over steps of `step_s` (n,), in platform axes (n, 3)."""

    step_s: Floats
    omega_p_radps: Floats
    force_p_mps2: Floats

    @property
    def duration_s(self) -> float:
        """Length of all steps."""
        return float(self.step_s.sum())


@dataclass(frozen=True, eq=False)
class Stop:
    """The end of a stretch: its time, what was read at it as (kind, value), and the row of the grid, if it is one."""

    time_ns: int
    stretch: Stretch
    readings: tuple[tuple[str, Floats], ...]
    grid_row: int | None


ORDER = ("ping", "water", "depth", "heading", "position")
"""Of readings at one time, as in the kernel."""


def stops(mission: Mission, positions: Positions | None = None, period_ns: int = PERIOD_NS) -> Iterator[Stop]:
    """Every stop after the start, in order of time, by a sample no later than the period after the one before.

    A lost beam is NaN in the value of a ping; that of one that the water returned is (3, B), beams, their 1 sigma and
    the range. Where a stop is not at the time of a sample, the last sample that was received is held, so that nothing
    comes from the future.

    Raises:
        DataError: for inertial samples that end before the grid does.
    """
    start_ns, last_ns = mission.start.time_ns, int(mission.grid_ns[-1])
    if mission.imu.time_ns[-1] < last_ns:
        raise DataError(
            f"mission {mission.name}: inertial samples end at {mission.imu.time_ns[-1]} ns,"
            f" the grid asks for {last_ns} ns"
        )
    readings = _readings(mission, positions)
    grid = {int(time_ns): row for row, time_ns in enumerate(mission.grid_ns)}
    regular = np.arange(start_ns, last_ns + period_ns, period_ns)
    # At the sample before, where there is none at that time: so nothing is held for a stop that nothing asks for.
    sampled = mission.imu.time_ns[np.searchsorted(mission.imu.time_ns, regular, side="right") - 1]
    times = sorted(t for t in {*sampled.tolist(), *readings, *grid} if start_ns <= t <= last_ns)
    before = start_ns
    for time_ns in times:
        stretch = between(mission.imu, before, time_ns)
        yield Stop(time_ns, stretch, tuple(readings.get(time_ns, ())), grid.get(time_ns))
        before = time_ns


def between(imu: Inertial, from_ns: int, to_ns: int) -> Stretch:
    """The samples between two times."""
    first = int(np.searchsorted(imu.time_ns, from_ns, side="right"))
    after = int(np.searchsorted(imu.time_ns, to_ns, side="right"))
    ends = imu.time_ns[first:after]
    rows = np.arange(first, after)
    if to_ns > from_ns and (len(ends) == 0 or ends[-1] != to_ns):
        ends, rows = np.append(ends, to_ns), np.append(rows, max(after - 1, 0))
    step_s = np.diff(ends, prepend=from_ns) * 1e-9
    return Stretch(step_s, imu.omega_p_radps[rows], imu.force_p_mps2[rows])


def _water(water: WaterBeams) -> Floats:
    beams = np.where(water.valid, water.velocity_mps, np.nan)
    return np.stack([beams, water.sd_mps, np.broadcast_to(water.range_m[:, None], beams.shape)], axis=1)


def _readings(mission: Mission, positions: Positions | None) -> dict[int, list[tuple[str, Floats]]]:
    beams = np.where(mission.pings.valid, mission.pings.velocity_mps, np.nan)
    streams: dict[str, tuple[Times, Floats]] = {
        "ping": (mission.pings.time_ns, beams),
        "depth": (mission.depth.time_ns, mission.depth.value[:, None]),
        "heading": (mission.heading.time_ns, mission.heading.value[:, None]),
    }
    if mission.water is not None:
        streams["water"] = (mission.water.time_ns, _water(mission.water))
    if positions is not None:
        streams["position"] = (positions.time_ns, positions.position_t_m)
    by_time: dict[int, list[tuple[str, Floats]]] = {}
    for kind in ORDER:
        for time_ns, value in zip(*streams.get(kind, ((), ())), strict=True):
            by_time.setdefault(int(time_ns), []).append((kind, value))
    return by_time
