"""Does anything of the test split stand in the train split: rows, windows of a minute, beams without noise."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bottomlock.recordings.closure import closure_rows
from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]

NEAR = 1e-9
"""Rows and windows this near, in SI units and in the greatest of their components, are taken for the same."""

WINDOW_S = 60.0
STEP_S = 1.0
"""A window is the body's velocities through the beams, depth changes and turns of a minute, a value a second."""

NO_CLOSURE_MPS = 1e-5
"""A mission whose closures are all below this, ten steps of its readings, has beams without noise."""

MISSING = 1e3
"""Stands for a beam that did not return: two pings are near only if the same beams did."""


@dataclass(frozen=True)
class Leak:
    """What leaks: the two missions, what of them, and the times of the first such place, s after their starts."""

    test: str
    train: str
    what: str
    test_s: float
    train_s: float

    def __str__(self) -> str:
        """One line."""
        return f"{self.what} of {self.test} at {self.test_s:g} s is within {NEAR:g} of {self.train}, {self.train_s:g} s"


def leaks(train: Sequence[Mission], test: Sequence[Mission]) -> list[Leak]:
    """The first row and the first window of each test mission that also stand in a train mission.

    Rows are inertial readings (force and rate together), pings with two beams or more, and states of the truth;
    windows are a minute of readings a second apart, whatever the time of day. Sensors that differ in their number of
    beams share no pings.
    """
    found: list[Leak] = []
    for what, rows in (("an inertial reading", _inertial), ("a ping", _pings), ("a state", _states)):
        found += _near(train, test, what, rows)
    return found + _near(train, test, "a window of the inertial readings", _windows)


def without_closure(missions: Iterable[Mission]) -> list[str]:
    """Names of missions with redundant beams whose readings lie in the range of the geometry matrix throughout.

    With three beams every reading is some velocity's, and there is nothing to test.
    """
    names = []
    for mission in missions:
        if mission.geometry.beams <= mission.geometry.rank:
            continue
        whole = mission.pings.valid.all(axis=1)
        closure = mission.pings.velocity_mps[whole] @ closure_rows(mission.geometry.directions_p).T
        if whole.any() and np.abs(closure).max() < NO_CLOSURE_MPS:
            names.append(mission.name)
    return names


def _near(train: Sequence[Mission], test: Sequence[Mission], what: str, rows_of: object) -> list[Leak]:
    """The first row of each test mission that is near one of the train missions."""
    assert callable(rows_of)
    parts = [(mission, *rows_of(mission)) for mission in train]
    found = []
    for width in {values.shape[1] for _, _, values in parts}:
        same = [part for part in parts if part[2].shape[1] == width and len(part[2])]
        if not same:
            continue
        tree = cKDTree(np.concatenate([values for _, _, values in same]))
        owner = np.concatenate([np.full(len(values), k) for k, (_, _, values) in enumerate(same)])
        times = np.concatenate([time_s for _, time_s, _ in same])
        for mission in test:
            time_s, values = rows_of(mission)
            if values.shape[1] != width or not len(values):
                continue
            distance, index = tree.query(values, p=np.inf, distance_upper_bound=NEAR)
            hits = np.flatnonzero(np.isfinite(distance))
            if hits.size:
                first = int(hits[0])
                other = same[int(owner[index[first]])][0].name
                found.append(
                    Leak(mission.name, other, what, float(time_s[first]), float(times[index[first]]))
                )
    return found


def _seconds(mission: Mission, time_ns: NDArray[np.int64]) -> Floats:
    return np.asarray((time_ns - mission.start.time_ns) * 1e-9)


def _inertial(mission: Mission) -> tuple[Floats, Floats]:
    values = np.hstack([mission.imu.omega_p_radps, mission.imu.force_p_mps2])
    return _seconds(mission, mission.imu.time_ns), values


def _pings(mission: Mission) -> tuple[Floats, Floats]:
    # One beam alone is one number, which two missions may share by chance.
    some = mission.pings.valid.sum(axis=1) >= 2
    values = np.where(mission.pings.valid, mission.pings.velocity_mps, MISSING)[some]
    return _seconds(mission, mission.pings.time_ns[some]), values


def _states(mission: Mission) -> tuple[Floats, Floats]:
    truth = mission.truth
    if truth is None:
        return np.zeros(0), np.zeros((0, 10))
    values = np.hstack([truth.position_t_m, truth.velocity_p_mps, truth.attitude_t_p])
    return _seconds(mission, truth.time_ns), values


def _windows(mission: Mission) -> tuple[Floats, Floats]:
    """The mean inertial readings of every second, a minute of them a row, from every second."""
    second = ((mission.imu.time_ns - mission.start.time_ns - 1) // round(STEP_S * 1e9)).astype(np.int64)
    inside = second >= 0
    values = np.hstack([mission.imu.omega_p_radps, mission.imu.force_p_mps2])[inside]
    count = np.bincount(second[inside])
    means = np.stack([np.bincount(second[inside], column) / count for column in values.T], axis=1)
    length = round(WINDOW_S / STEP_S)
    if len(means) < length:
        return np.zeros(0), np.zeros((0, length * means.shape[1]))
    rows = np.lib.stride_tricks.sliding_window_view(means, length, axis=0).reshape(
        len(means) - length + 1, -1
    )
    return np.arange(len(rows), dtype=np.float64), rows
