"""Nothing of the test split stands in the train split, and a planted leak is found."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from partialdvl_bench.leaks import leaks, without_closure
from partialdvl_bench.load import load_mission
from partialdvl_bench.make import make_missions
from partialdvl_bench.mission import Mission
from partialdvl_bench.mission_list import mission_list
from tests.bench.missions import missions


def test_nothing_leaks() -> None:
    assert leaks(missions()["train"], missions()["test"]) == []


def _with(mission: Mission, **changes: object) -> Mission:
    return replace(mission, **changes)  # type: ignore[arg-type]


def test_a_planted_ping_is_found() -> None:
    source, target = missions()["train"][0], missions()["test"][0]
    source = _with(source, name="source", geometry=target.geometry)
    beams = target.pings.velocity_mps.copy()
    row = int(np.flatnonzero(target.pings.valid.sum(axis=1) >= 2)[5])
    planted = _with(source, pings=replace(target.pings, velocity_mps=beams[row : row + 1] + 4e-10,
                    valid=target.pings.valid[row : row + 1], time_ns=target.pings.time_ns[row : row + 1]))  # fmt: skip
    (found,) = [leak for leak in leaks([planted], [target]) if leak.what == "a ping"]
    assert (found.test, found.train, found.test_s) == (target.name, "source", row + 1.0)
    apart = _with(planted, pings=replace(planted.pings, velocity_mps=planted.pings.velocity_mps + 1e-8))
    assert not [leak for leak in leaks([apart], [target]) if leak.what == "a ping"]


def test_a_planted_minute_is_found_at_another_time_of_day() -> None:
    source, target = missions()["train"][0], missions()["test"][0]
    hour_ns = 3_600_000_000_000
    imu = target.imu
    moved = _with(
        source,
        start=replace(source.start, time_ns=target.start.time_ns + hour_ns),
        imu=replace(imu, time_ns=imu.time_ns + hour_ns),
    )
    what = {leak.what for leak in leaks([moved], [target])}
    assert {"a window of the inertial readings", "an inertial reading"} <= what


def test_a_planted_state_is_found() -> None:
    source, target = missions()["train"][0], missions()["test"][0]
    assert "a state" in {leak.what for leak in leaks([_with(source, truth=target.truth)], [target])}


def test_beams_have_closure_and_beams_without_noise_are_found() -> None:
    every = [mission for split in missions().values() for mission in split]
    assert without_closure(every) == []
    one = next(
        m for m in every if m.geometry.beams == 4 and m.pings.valid.all(axis=1).any() and m.truth is not None
    )
    assert one.truth is not None
    perfect = one.truth.velocity_p_mps @ np.asarray(one.geometry.directions_p).T
    clean = _with(one, pings=replace(one.pings, velocity_mps=perfect))
    assert without_closure([clean]) == [one.name]


@pytest.mark.deep
def test_nothing_leaks_in_the_whole_benchmark(tmp_path: Path) -> None:
    """`BOTTOMLOCK_BENCH` names the folder of the missions of all splits, where they have been made."""
    folder = Path(os.environ.get("BOTTOMLOCK_BENCH", tmp_path))
    if folder == tmp_path:
        # The test split of another seed than the sealed one.
        make_missions(mission_list(), lambda spec: 99 if spec.split == "test" else 20261119, folder)
    train, test = (
        [load_mission(folder / s.split / s.name) for s in mission_list() if s.split == split]
        for split in ("train", "test")
    )
    assert leaks(train, test) == []
    assert without_closure([*train, *test]) == []
