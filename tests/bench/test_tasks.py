"""Tasks of the benchmark: which rows they score, what an unanswered row costs, and the leaderboard."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from partialdvl_bench.beam_submission import ping_answer, ping_table, velocity_answer, velocity_table
from partialdvl_bench.beam_tasks import (
    PING_ENTRANTS,
    VELOCITY_ENTRANTS,
    left_out,
    masked_pings,
    ping_scores,
    recorded_pings,
    velocity_scores,
)
from partialdvl_bench.leaderboard import OVERALL, leaderboard
from partialdvl_bench.methods import estimate
from partialdvl_bench.mission import Estimates, Mission
from partialdvl_bench.tables import SCORES
from partialdvl_bench.tasks import (
    CURRENT,
    NAVIGATION,
    RANKED,
    RECOVERY,
    after_outages,
    climatology,
    scores_of,
)
from tests.bench.missions import missions


def _four_beams() -> Mission:
    every = [mission for split in missions().values() for mission in split]
    return next(m for m in every if m.geometry.beams == 4 and m.pings.valid.all(axis=1).sum() > 10)


def _value(scores: pl.DataFrame, task: str, score: str) -> float:
    return float(scores.filter((pl.col("task") == task) & (pl.col("score") == score))["value"].item())


def test_recovery_is_the_half_minute_after_an_outage() -> None:
    """All beams at 1 to 20 s, two from 21 to 40 s, all again from 41 s: a gap of 21 s; a gap of 10 s is none."""
    mission = _four_beams()
    time_ns = np.arange(1, 91, dtype=np.int64) * 1_000_000_000
    valid = np.ones((90, 4), dtype=np.bool_)
    valid[20:40, 2:] = False
    valid[75:84] = False
    pings = replace(mission.pings, time_ns=time_ns, valid=valid, velocity_mps=np.zeros((90, 4)))
    scored = after_outages(replace(mission, pings=pings, grid_ns=time_ns))
    assert (np.flatnonzero(scored) + 1).tolist() == list(range(41, 71))


def test_a_perfect_answer_by_hand() -> None:
    """No error and σ of 0.1 m/s and 1 m: ½ log 2π + log σ a component, velocity and position alike."""
    mission = _four_beams()
    truth = mission.truth
    assert truth is not None
    count = len(truth.time_ns)
    answer = Estimates(
        truth.time_ns, truth.velocity_p_mps, np.tile(0.01 * np.eye(3), (count, 1, 1)),
        truth.position_t_m, np.tile(np.eye(3), (count, 1, 1)),
    )  # fmt: skip
    scores = scores_of(mission, answer, "perfect")
    expected = 0.5 * (0.9189385 + np.log(0.1)) + 0.5 * 0.9189385
    assert _value(scores, NAVIGATION, RANKED) == pytest.approx(expected, abs=1e-6)
    assert _value(scores, NAVIGATION, "velocity NEES a component") == 0.0
    assert _value(scores, NAVIGATION, "drift, % DT") == 0.0
    assert _value(scores, NAVIGATION, "velocity availability") == 1.0
    assert _value(scores, CURRENT, "current availability") == 0.0


def test_a_row_without_an_answer_costs_what_knowing_nothing_costs() -> None:
    mission = _four_beams()
    truth = mission.truth
    assert truth is not None
    count = len(truth.time_ns)
    mean, cov = climatology()["velocity"]
    usual = Estimates(truth.time_ns, np.tile(mean, (count, 1)), np.tile(cov, (count, 1, 1)))
    empty = Estimates(truth.time_ns, np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan))
    one, other = (scores_of(mission, answer, "a") for answer in (usual, empty))
    for task in (NAVIGATION, RECOVERY, CURRENT):
        if task in one["task"]:
            assert _value(one, task, RANKED) == pytest.approx(_value(other, task, RANKED), abs=1e-12)
    assert _value(other, NAVIGATION, "velocity availability") == 0.0


def test_a_mission_without_truth_is_not_scored() -> None:
    mission = _four_beams()
    with pytest.raises(DataError, match="has no truth"):
        scores_of(replace(mission, truth=None), estimate(mission, "tc"), "tc")


def test_overconfidence_loses_although_the_errors_are_the_same() -> None:
    mission = _four_beams()
    answer = estimate(mission, "sway_current")
    bold = replace(answer, velocity_cov=answer.velocity_cov / 400.0)
    assert _value(scores_of(mission, bold, "b"), NAVIGATION, RANKED) > _value(
        scores_of(mission, answer, "a"), NAVIGATION, RANKED
    )


def test_the_selector_answers_with_the_current_of_the_filter_it_selects() -> None:
    """`consistent` has the current of `sway_current` wherever it selects that, and is scored so."""
    mission = _four_beams()
    ours, theirs = estimate(mission, "consistent"), estimate(mission, "sway_current")
    assert ours.current_t_mps is not None
    assert ours.current_cov is not None
    assert theirs.current_t_mps is not None
    assert theirs.current_cov is not None
    answered = np.isfinite(ours.current_t_mps).all(axis=1)
    assert answered.mean() > 0.9
    np.testing.assert_array_equal(ours.current_t_mps[answered], theirs.current_t_mps[answered])
    np.testing.assert_array_equal(ours.current_cov[answered], theirs.current_cov[answered])
    assert np.isnan(ours.current_cov[~answered]).all()
    scores = scores_of(mission, ours, "consistent")
    assert _value(scores, CURRENT, "current availability") == pytest.approx(answered.mean())
    assert estimate(mission, "weak_sway").current_t_mps is None


def _scores(values: dict[str, list[float]]) -> pl.DataFrame:
    rows = [
        (method, f"m{k}", task, RANKED, value, 10)
        for task in (NAVIGATION, CURRENT)
        for method, every in values.items()
        for k, value in enumerate(every)
    ]
    return pl.DataFrame(rows, schema=dict(SCORES), orient="row")


def test_the_leaderboard_by_hand() -> None:
    """Means of 2 and 3; the paired difference is 1 on every mission, although missions differ by 10."""
    table = leaderboard(_scores({"worse": [-7.0, 3.0, 13.0], "better": [-8.0, 2.0, 12.0]}))
    first, second = table.filter(pl.col("task") == OVERALL).iter_rows(named=True)
    assert (first["method"], first["value"], first["difference"]) == ("better", 2.0, None)
    assert (second["method"], second["value"], second["reference"]) == ("worse", 3.0, "better")
    assert [second[f"difference{end}"] for end in ("", "_lo", "_hi")] == pytest.approx([1.0, 1.0, 1.0])
    assert second["lo"] < -3.0 < 9.0 < second["hi"]
    named = leaderboard(_scores({"worse": [3.0], "better": [2.0]}), "worse")
    assert (
        named.filter((pl.col("method") == "better") & (pl.col("task") == OVERALL))["difference"].item()
        == -1.0
    )


def test_velocity_from_beams_has_every_mask_and_bayes_is_not_worse_than_the_climatology() -> None:
    mission = _four_beams()
    pings, truth = masked_pings(mission)
    assert truth is not None
    assert len(set(pings.masks)) == 15
    assert np.isnan(pings.velocity_mps[~pings.valid]).all()
    scores = {name: velocity_scores(mission, call(pings), name) for name, call in VELOCITY_ENTRANTS.items()}
    ranked = {name: one.filter(pl.col("score") == RANKED)["value"].item() for name, one in scores.items()}
    assert ranked["bayes"] < ranked["climatology"]
    alone = scores["least_squares"]
    assert _value(alone, "T1 velocity from beams", "availability, 2 beams") == 0.0
    assert _value(alone, "T1 velocity from beams", "availability, 3 beams") == 1.0


def test_bayes_by_hand() -> None:
    """One beam b of σ and a prior P: gain P b / (bᵀPb + σ²)."""
    mission = _four_beams()
    pings, _ = masked_pings(mission)
    row = pings.masks.index("0010")
    velocity, cov = VELOCITY_ENTRANTS["bayes"](pings)
    mean, P = climatology()["velocity"]
    b = np.asarray(pings.geometry.directions_p)[2]
    gain = P @ b / (b @ P @ b + pings.sd_mps**2)
    assert np.allclose(velocity[row], mean + gain * (pings.velocity_mps[row, 2] - b @ mean), atol=1e-9)
    assert np.allclose(cov[row], P - np.outer(gain, b @ P), atol=1e-9)


def test_beam_submissions_there_and_back_and_their_faults() -> None:
    mission = _four_beams()
    pings, _ = masked_pings(mission)
    frame = velocity_table(mission, VELOCITY_ENTRANTS["least_squares"](pings))
    value, cov = velocity_answer(frame.reverse(), mission, "b")
    expected = VELOCITY_ENTRANTS["least_squares"](pings)
    solved = np.isfinite(expected[0]).all(axis=1)
    assert np.array_equal(value[solved], expected[0][solved])
    assert np.allclose(cov[solved], expected[1][solved], rtol=1e-12)
    with pytest.raises(DataError, match=r"lacks 1 of \d+ rows"):
        velocity_answer(frame.slice(1), mission, "b")
    worse = frame.with_columns(cov_surge_surge_m2ps2=-pl.col("cov_surge_surge_m2ps2").abs())
    with pytest.raises(DataError, match=r"row \d+, column 'cov_surge_surge_m2ps2': .*positive"):
        velocity_answer(worse, mission, "b")


def test_real_pings_are_predicted_from_what_was_known() -> None:
    _, _, readings = recorded_pings()
    rows = left_out(len(readings))
    # 14 proper masks leave 4·1 + 6·2 + 4·3 = 28 beams out.
    assert len(rows.ping) == 28 * len(readings)
    assert not rows.mask[np.arange(len(rows.beam)), rows.beam].any()
    value, cov = PING_ENTRANTS["last_reading"](rows)
    assert np.isnan(value[rows.ping == 0]).all()
    later = rows.ping == 7
    assert np.array_equal(value[later, 0], readings[6, rows.beam[later]])
    scores = ping_scores((value, cov), "last_reading")
    assert scores["mission"].n_unique() == -(-len(readings) // 30)
    back = ping_answer(ping_table((value, cov)), "p")
    assert np.array_equal(back[0], value, equal_nan=True)
    with pytest.raises(DataError, match="column 'sd_mps': is not above 0"):
        ping_answer(ping_table((value, cov)).with_columns(sd_mps=pl.lit(0.0)), "p")
