"""Dead reckoning on the missions: as far from the truth as it claims, and from no reading of the future."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from partialdvl_bench.dead_reckoning import estimate
from partialdvl_bench.methods import estimator
from partialdvl_bench.mission import Mission
from tests.bench.missions import missions


@pytest.fixture(scope="module")
def mission() -> Mission:
    return missions()["train"][0]


def test_it_is_a_method_of_the_benchmark() -> None:
    assert estimator("dead_reckoning") == ("dead_reckoning", estimate)


@pytest.mark.long
def test_errors_are_of_the_size_that_it_claims() -> None:
    """Normalised position errors of several missions, horizontally: within 0.1 and 3 in the mean square."""
    squares = []
    for one in missions()["train"]:
        assert one.truth is not None
        found = estimate(one)
        assert found.position_t_m is not None
        assert found.position_cov is not None
        off = (found.position_t_m - one.truth.position_t_m)[:, :2]
        sd2 = np.trace(found.position_cov[:, :2, :2], axis1=1, axis2=2)
        squares.append(float(np.mean((off**2).sum(axis=1) / sd2)))
    assert 0.1 < np.median(squares) < 3.0, squares


def test_no_reading_of_the_future(mission: Mission) -> None:
    """Without any reading after the middle the estimates up to there are the same."""
    middle = len(mission.grid_ns) // 2
    end_ns = mission.grid_ns[middle]

    def until(part: object) -> object:
        kept = part.time_ns <= end_ns  # type: ignore[attr-defined]
        names = [field.name for field in dataclasses.fields(part)]  # type: ignore[arg-type]
        return dataclasses.replace(part, **{name: getattr(part, name)[kept] for name in names})  # type: ignore[type-var]

    parts = {name: until(getattr(mission, name)) for name in ("imu", "pings", "depth", "heading")}
    shorter = dataclasses.replace(mission, grid_ns=mission.grid_ns[: middle + 1], **parts)  # type: ignore[arg-type]
    whole, part = estimate(mission), estimate(shorter)
    assert whole.position_t_m is not None
    assert part.position_t_m is not None
    np.testing.assert_allclose(part.position_t_m, whole.position_t_m[: middle + 1], atol=1e-9)
    rows = slice(0, middle)
    np.testing.assert_allclose(part.velocity_p_mps[rows], whole.velocity_p_mps[rows], atol=1e-9)
