"""Missions of version 1.2: the bottom lost for minutes with water track, and the task that scores the time without."""

from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import polars as pl
import pytest

from partialdvl_bench.load import load_mission
from partialdvl_bench.make import make_mission, make_missions
from partialdvl_bench.methods import estimate, tc_without_water, without_water
from partialdvl_bench.mission import Estimates, Mission
from partialdvl_bench.mission_list import levels, missions_of
from partialdvl_bench.seeds import PUBLIC_SEED
from partialdvl_bench.tasks import BLACKOUT, RANKED, scores_of, without_bottom
from partialdvl_bench.worlds import scenario_of
from tests.bench.dealt import water_list
from tests.bench.missions import SEED, missions


@pytest.fixture(scope="module")
def mission() -> Mission:
    """Five minutes of a mission: the bottom is lost after two and does not come back."""
    spec = replace(
        next(s for s in missions_of(version="1.2") if s.current == "steady" and s.split == "train"),
        duration_s=300.0,
    )
    out = Path(mkdtemp(prefix="bench"))
    make_missions([spec], lambda _: SEED, out)
    return load_mission(out / spec.split / spec.name)


def value(scores: pl.DataFrame, score: str) -> float:
    return float(scores.filter((pl.col("task") == BLACKOUT) & (pl.col("score") == score))["value"].item())


def test_the_list_is_what_the_rule_deals() -> None:
    assert list(missions_of(version="1.2")) == water_list()


def test_a_loaded_mission_has_the_water_that_was_made(mission: Mission) -> None:
    spec = next(s for s in missions_of(version="1.2") if s.current == "steady" and s.split == "train")
    table = make_mission(replace(spec, duration_s=300.0), SEED).tables["water"]
    water, level = mission.water, levels()["water"]["water_track"]
    assert water is not None
    assert mission.options.water_track
    beams = table.select("beam2_mps").fill_null(np.nan).to_numpy()[:, 0]
    # A ping of four beams that do not agree is left out, as of any log.
    kept = water.valid[:, 1]
    assert kept.mean() > 0.98
    np.testing.assert_array_equal(water.velocity_mps[kept, 1], beams[kept])
    np.testing.assert_allclose(water.sd_mps, level["noise_mps"], atol=1e-6)
    np.testing.assert_array_equal(water.range_m, level["range_m"])
    # In the current of 0.3 m/s bottom and water differ.
    both = mission.pings.valid.all(axis=1)
    apart = np.sqrt(np.mean((mission.pings.velocity_mps[both] - water.velocity_mps[both]) ** 2))
    assert 0.05 < apart < 0.3


def test_all_beams_are_lost_once_and_within_the_stated_times() -> None:
    level = levels()["loss"]["blackout"]
    for spec in missions_of(version="1.2"):
        (outage,) = scenario_of(spec, PUBLIC_SEED).dvl.outages
        beams = 3 if spec.dvl == "three_beams" else 4
        assert list(outage.beams) == list(range(1, beams + 1))
        assert level["lock_s"][0] <= outage.from_s <= level["lock_s"][1]
        assert level["lasting_s"][0] - 0.01 <= outage.to_s - outage.from_s <= level["lasting_s"][1] + 0.01
        assert outage.to_s < spec.duration_s


def test_rows_without_bottom_by_hand(mission: Mission) -> None:
    """Beams at 1 to 100 s and from 161 s on: 60 s apart are none; until 162 s they are, and to the end as well."""
    grid_ns = np.arange(1, 301, dtype=np.int64) * 1_000_000_000
    beams = mission.geometry.beams

    def rows(seen: np.ndarray) -> list[int]:
        valid = np.repeat(seen[:, None], beams, axis=1)
        valid[:, 1:] = False
        pings = replace(mission.pings, time_ns=grid_ns, valid=valid, velocity_mps=np.zeros(valid.shape))
        found = without_bottom(replace(mission, pings=pings, grid_ns=grid_ns))
        return (np.flatnonzero(found) + 1).tolist()

    at = np.arange(1, 301)
    assert rows((at <= 100) | (at >= 159)) == []
    assert rows((at <= 100) | (at >= 160)) == list(range(101, 160))
    assert rows(at <= 100) == list(range(101, 301))


def test_a_mission_without_water_has_no_such_rows() -> None:
    for one in (m for split in missions().values() for m in split):
        assert one.water is None
        assert not without_bottom(one).any()


def test_an_answer_by_hand(mission: Mission) -> None:
    """Three metres north and four east off at σ of 5 m each axis: 5 m at the end, over √50 m."""
    truth = mission.truth
    assert truth is not None
    count = len(truth.time_ns)
    answer = Estimates(
        truth.time_ns, truth.velocity_p_mps, np.tile(0.01 * np.eye(3), (count, 1, 1)),
        truth.position_t_m - np.array([3.0, 4.0, 0.0]), np.tile(25.0 * np.eye(3), (count, 1, 1)),
    )  # fmt: skip
    scores = scores_of(mission, answer, "off")
    assert value(scores, "horizontal error at the end, m") == pytest.approx(5.0, abs=1e-9)
    assert value(scores, "error at the end over σ") == pytest.approx(5.0 / np.sqrt(50.0), abs=1e-9)
    nats = 0.9189385 + 0.5 * (np.log(0.1) + np.log(5.0)) + 0.5 * 1.0 / 6.0
    assert value(scores, RANKED) == pytest.approx(nats, abs=1e-6)


def test_the_water_is_worth_what_the_task_says(mission: Mission) -> None:
    """The same mission and rows for who uses the water and who does not."""
    with_it = scores_of(mission, estimate(mission, "tc"), "tc")
    without = scores_of(mission, tc_without_water(mission), "without")
    rows = [s.filter(pl.col("task") == BLACKOUT)["rows"].max() for s in (with_it, without)]
    assert rows[0] == rows[1] == without_bottom(mission).sum()
    assert value(with_it, RANKED) < value(without, RANKED) - 1.0
    end = "horizontal error at the end, m"
    assert value(with_it, end) < 0.1 * value(without, end)
    assert without_water(mission).water is None


def test_every_method_with_water_states_the_current(mission: Mission) -> None:
    found = estimate(mission, "tc")
    assert mission.truth is not None
    assert found.current_t_mps is not None
    error = found.current_t_mps - mission.truth.current_t_mps
    assert np.hypot(*error[-1]) < 0.15
    assert estimate(mission, "ins").current_t_mps is None
