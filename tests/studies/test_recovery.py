"""Steps and innovations after an outage, against numbers worked by hand."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.errors import Note, ScenarioError
from bottomlock.simulation.run_events import Fix
from bottomlock.studies.recovery import (
    jump_chance,
    run_recovery,
    summary,
    two_beam_outages,
)
from bottomlock.tables.check import check
from bottomlock.tables.studies import RECOVERY, RECOVERY_EPOCHS, RECOVERY_SUMMARY


def fix(after: list[float], *, used: bool = True) -> Fix:
    return Fix(
        time_ns=0,
        step_p_mps=np.zeros(3),
        before_sd_mps=np.ones(3),
        after_sd_mps=np.array(after),
        nis=4.0,
        degrees=4,
        used=used,
    )


def test_jump_chance_by_hand() -> None:
    """An axis learned from nothing passes three sigma in 0.27 %; one that learns a half, at 3·√2 sigma of its step."""
    assert jump_chance(fix([0.0, 1.0, 1.0])) == pytest.approx(0.0026998, rel=1e-4)
    assert jump_chance(fix([0.0, 0.0, 0.0])) == pytest.approx(3 * 0.0026998, rel=1e-4)
    half = float(np.sqrt(0.5))
    # 2 Φ(−4.2426) = 2.21e-5.
    assert jump_chance(fix([half, 1.0, 1.0])) == pytest.approx(2.21e-5, rel=1e-2)
    assert jump_chance(fix([0.0, 0.0, 0.0], used=False)) == 0.0


def rows(nis: list[float], sigmas: float = 1.0, runs: int = 20) -> pl.DataFrame:
    """Runs that all show the same."""
    found = []
    for run in range(runs):
        for epoch, value in enumerate(nis, start=1):
            numbers = [
                float(epoch),
                0.0,
                0.0,
                0.0,
                1.0,
                1.0,
                1.0,
                sigmas,
                0.003,
                value,
                4,
                0.1,
                18.0,
                True,
                True,
            ]
            found.append(("t", "beams_12", "1,2", "tc", run, epoch, *numbers))
    return pl.DataFrame(found, schema=RECOVERY, orient="row")


@pytest.mark.parametrize(
    ("nis", "back"),
    [([4.0] * 5, 1), ([40.0, 40.0, 4.0, 4.0, 4.0], 3), ([4.0, 4.0, 4.0, 4.0, 40.0], None), ([0.1] * 5, None)],
)
def test_back_in_band(nis: list[float], back: int | None) -> None:
    """The epoch from which the mean stays inside; a mean that leaves at the end, or lies below, is not back."""
    (row,) = summary(rows(nis)).iter_rows(named=True)
    assert row["back_at_epoch"] == back
    assert row["recovered"] is (back is not None)


def test_jumps_are_counted_against_chance() -> None:
    """Twenty runs of twenty above three sigma are no chance; with 1.5 % a run, two of twenty still are."""
    (row,) = summary(rows([4.0] * 5, sigmas=3.5)).iter_rows(named=True)
    assert (row["jumps"], row["recovered"]) == (20, False)
    assert 1 <= row["jumps_allowed"] <= 5


def test_outages_need_time_and_beams() -> None:
    with pytest.raises(ScenarioError, match="expected 70 s or more"):
        two_beam_outages(load_scenario("straight").with_trajectory(duration_s=60.0))
    outages = two_beam_outages(load_scenario("straight"))
    assert [case.beams for case in outages] == ["1,2", "1,3", "1,4", "2,3", "2,4", "3,4"]
    (rule,) = outages[0].scenario.dvl.outages
    assert (rule.beams, rule.from_s, rule.to_s) == ((3, 4), 95.0, 155.0)


def test_recovery_tables_and_resumption(tmp_path: Path) -> None:
    """A row per mask, method, run and epoch; `ins` has no fixes; a second call reads what the first has run."""
    scenario = (
        load_scenario("straight")
        .with_trajectory(duration_s=80.0)
        .with_overrides(runs=2, methods=["ins", "tc"])
    )
    table, judged = run_recovery([scenario], tmp_path)
    check(table, RECOVERY, place="recovery")
    check(judged, RECOVERY_SUMMARY, place="summary")
    assert table.height == 6 * 1 * 2 * RECOVERY_EPOCHS
    # An outage from 10 s to 70 s: the ping at 70 s is the first of full lock.
    assert table["time_s"].unique().sort().to_list() == [70.0, 71.0, 72.0, 73.0, 74.0]
    (part,) = (tmp_path / "recovery" / "straight").glob("*.parquet")
    stamp = part.stat().st_mtime_ns
    again, _ = run_recovery([scenario], tmp_path)
    assert part.stat().st_mtime_ns == stamp
    assert again.equals(table)
    part.write_bytes(part.read_bytes().replace(b"tc", b"vb"))
    with pytest.warns(Note, match=rf"{part.name}: has changed since .* the part is run again"):
        again, _ = run_recovery([scenario], tmp_path)
    assert again.equals(table)
