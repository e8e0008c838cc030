"""Submissions: there and back without loss, and every fault named with row and column."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from partialdvl_bench.methods import estimate, estimator
from partialdvl_bench.mission import Estimates
from partialdvl_bench.submission import check_submission, estimates_of, grid_ns, join, table_of, write_tum
from tests.bench.missions import missions, short_specs

TRAIN = [spec for spec in short_specs() if spec.split == "train"]


@cache
def submission() -> pl.DataFrame:
    """That of `sway_current` on the short train missions."""
    return join(table_of(mission.name, estimate(mission, "sway_current")) for mission in missions()["train"])


def test_a_submission_keeps_the_rules_and_every_number() -> None:
    frame = check_submission(submission(), "s", short_specs())
    mission = missions()["train"][0]
    answer, back = (
        estimate(mission, "sway_current"),
        estimates_of(frame.filter(pl.col("mission") == mission.name)),
    )
    for name in ("time_ns", "velocity_p_mps", "position_t_m", "attitude_t_p", "current_t_mps"):
        assert np.array_equal(getattr(answer, name), getattr(back, name)), name
    for name in ("velocity_cov", "position_cov", "current_cov"):
        value = getattr(answer, name)
        assert np.allclose(value, getattr(back, name), rtol=0.0, atol=1e-12 * np.abs(value).max()), name


def test_what_is_not_answered_is_none_and_nan() -> None:
    mission = missions()["train"][0]
    count = len(mission.grid_ns)
    velocity = np.ones((count, 3))
    velocity[3] = np.nan
    answer = Estimates(mission.grid_ns, velocity, np.tile(np.eye(3), (count, 1, 1)))
    frame = table_of(mission.name, answer)
    assert frame["surge_mps"].null_count() == frame["cov_surge_surge_m2ps2"].null_count() == 1
    back = estimates_of(frame)
    assert back.position_t_m is None
    assert back.wall_s is None
    assert np.isnan(back.velocity_p_mps[3]).all()


def _set(row: int, **values: object) -> Callable[[pl.DataFrame], pl.DataFrame]:
    def change(frame: pl.DataFrame) -> pl.DataFrame:
        here = pl.int_range(pl.len()) == row
        return frame.with_columns(
            pl.when(here).then(pl.lit(value, dtype=frame.schema[name])).otherwise(pl.col(name)).alias(name)
            for name, value in values.items()
        )

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_set(4, surge_mps=np.nan), r"row 5, column 'surge_mps': is not finite"),
        (_set(4, north_m=np.inf), r"row 5, column 'north_m': is not finite"),
        (_set(7, sway_mps=None), r"row 8, column 'sway_mps': is null beside values"),
        (
            _set(2, cov_surge_surge_m2ps2=-1.0),
            r"row 3, column 'cov_surge_surge_m2ps2': .*not positive definite",
        ),
        (
            _set(2, cov_surge_sway_m2ps2=1e3),
            r"row 3, column 'cov_surge_surge_m2ps2': .*not positive definite",
        ),
        (_set(0, attitude_w=2.0), r"row 1, column 'attitude_w': the quaternion has"),
        (_set(0, attitude_x=None), r"row 1, column 'attitude_w': the quaternion has nulls"),
        (_set(1, wall_s=-1.0), r"row 2, column 'wall_s': is negative"),
        (_set(1, time_ns=2), r"row 2, column 'time_ns': 2 is not on the grid .*other units"),
        (_set(1, time_ns=1_000_000_000), r"row 2, column 'time_ns': 1000000000 stands twice"),
        (_set(9, mission="nothing"), r"row 10, column 'mission': 'nothing' is no mission"),
        (lambda frame: frame.slice(1), r"lacks 1 of 90 times, the first is time_ns 1000000000"),
        (
            lambda frame: frame.filter(pl.col("mission") != TRAIN[0].name),
            r"lacks 1 missions of the split train",
        ),
        (lambda frame: frame.drop("sway_mps"), r"column 'sway_mps' is missing"),
        (lambda frame: frame.cast({"time_ns": pl.Float64}), r"column 'time_ns' is Float64, expected Int64"),
        (lambda frame: frame.with_columns(extra=1), r"column 'extra' is unknown"),
        (lambda frame: frame.clear(), r"has no rows"),
    ],
)
def test_a_fault_is_named(change: Callable[[pl.DataFrame], pl.DataFrame], words: str) -> None:
    with pytest.raises(DataError, match=words):
        check_submission(change(submission()), "s", short_specs())


def test_the_grid_is_that_of_the_missions() -> None:
    for spec, mission in zip(TRAIN, missions()["train"], strict=True):
        assert np.array_equal(grid_ns(spec), mission.grid_ns)


def test_tum_files_hold_position_and_attitude_scalar_last(tmp_path: Path) -> None:
    written = write_tum(submission(), tmp_path)
    assert [path.stem for path in written] == sorted(spec.name for spec in TRAIN)
    row = submission().row(0, named=True)
    time_s, *numbers = (tmp_path / f"{row['mission']}.tum").read_text().splitlines()[0].split()
    assert time_s == "1.000000000"
    names = ("north_m", "east_m", "down_m", "attitude_x", "attitude_y", "attitude_z", "attitude_w")
    assert [float(value) for value in numbers] == pytest.approx([row[name] for name in names], abs=1e-9)


def test_a_method_is_as_good_as_the_replay_and_its_current_is_known() -> None:
    mission = missions()["train"][0]
    answer = estimate(mission, "sway_current")
    truth = mission.truth
    assert truth is not None
    assert answer.current_t_mps is not None
    assert answer.current_cov is not None
    error = answer.current_t_mps[-1] - truth.current_t_mps[-1]
    assert error @ np.linalg.solve(answer.current_cov[-1], error) < 30.0
    assert estimate(mission, "tc").current_t_mps is None


def test_an_estimate_is_from_readings_up_to_its_time_alone() -> None:
    mission = missions()["train"][0]
    half = int(mission.grid_ns[40])
    kept = mission.pings.time_ns <= half
    pings = replace(
        mission.pings, time_ns=mission.pings.time_ns[kept], velocity_mps=mission.pings.velocity_mps[kept],
        valid=mission.pings.valid[kept],
    )  # fmt: skip
    whole, cut = estimate(mission, "sway_current"), estimate(replace(mission, pings=pings), "sway_current")
    assert np.array_equal(whole.velocity_p_mps[:41], cut.velocity_p_mps[:41])
    assert whole.current_t_mps is not None
    assert cut.current_t_mps is not None
    assert np.array_equal(whole.current_t_mps[:41], cut.current_t_mps[:41])


def test_a_rival_is_imported_by_its_name() -> None:
    found: tuple[str, object] = estimator("mine=tests.bench.test_submission:grid_ns")
    assert found == ("mine", grid_ns)
    with pytest.raises(DataError, match="unknown method 'tcc', did you mean 'tc'"):
        estimator("tcc")
    with pytest.raises(DataError, match="cannot be imported"):
        estimator("tests.nowhere:estimate")
