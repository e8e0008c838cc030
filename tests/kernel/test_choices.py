"""What the selector of the paper chose: in the report of each ping, and counted over the runs of a campaign."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel, run_campaign
from bottomlock.campaign.chunk import choice_counts, merged
from bottomlock.config.scenario import load_scenario
from bottomlock.files.columns import CHOICES, check
from bottomlock.kernel import Method
from tests.property import settings


def reports(method: Method, beams_mps: list[list[float]]) -> list[Any]:
    """A vehicle at rest, pings with beams 1 and 2 a second apart."""
    start: Any = settings.start()
    navigator = kernel.Navigator(
        kernel.BeamGeometry.janus(0.35), settings.table_2(), settings.options(), start, method=method
    )
    heard: list[Any] = []
    gravity = settings.table_2()["environment"]["gravity_mps2"]
    for second, reading in enumerate(beams_mps):
        for step in range(50):
            navigator.push_imu(
                (50 * second + step) * 20_000_000, omega_p_radps=[0.0] * 3, force_p_mps2=[0.0, 0.0, -gravity]
            )
        heard += navigator.push_beams(
            (50 * second + 49) * 20_000_000, reading, [True, True, False, False], sd_mps=[0.042] * 4
        )
    return heard


def test_each_ping_says_what_was_chosen() -> None:
    """Of the method that chooses; the others say nothing."""
    still = [[0.01, -0.01, np.nan, np.nan]] * 5
    assert all(report.choice is None for report in reports("tc", still))
    for report in reports("elc", still):
        sources = {kernel.SOURCES[report.choice[axis]] for axis in ("surge", "sway", "heave")}
        assert sources <= {"vb", "nsv", "plcf", "vhv"}


def test_counts_of_choices_by_hand() -> None:
    """Two runs, two pings; the first method does not choose, the second does."""
    none = np.full((2, 2, 3), 255, dtype=np.uint8)
    components = np.array([[[2, 3, 0], [2, 3, 5]], [[4, 3, 0], [2, 3, 5]]], dtype=np.uint8)
    codes = np.stack([none, components], axis=1)
    table = choice_counts(codes, trajectory="t", methods=["tc", "elc"], dvl_time_ns=np.array([10, 20]))
    check(table, CHOICES, place="choices")
    rows = {(method, time, part, source): runs for _, method, time, part, source, runs in table.iter_rows()}
    assert rows["elc", 10, "surge", "vb"] == 1
    assert rows["elc", 10, "surge", "plcf"] == 1
    assert rows["elc", 20, "heave", "vhv"] == 2
    assert rows["elc", 10, "heave", "none"] == 2
    assert not any(method == "tc" for method, *_ in rows)
    twice = merged([table, table])
    assert twice["runs_chosen"].sum() == 2 * table["runs_chosen"].sum()
    assert twice.height == table.height


def test_a_campaign_counts_every_ping_of_every_run(tmp_path: Path) -> None:
    """Runs times components at each ping."""
    scenario = load_scenario("figure_eight").with_trajectory(duration_s=30.0)
    run_campaign([scenario.with_overrides(runs=3, methods=["tc", "elc"])], tmp_path / "o", threads=1)
    table = check(pl.read_parquet(tmp_path / "o" / "choices.parquet"), CHOICES, place="choices")
    totals = table.group_by("method", "component", "time_ns").agg(pl.col("runs_chosen").sum())
    assert (totals["runs_chosen"] == 3).all()
    assert totals.height == 30 * 3
