"""The advice of a report: consistent in the campaign, and in the published studies, too."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.files.campaign_tables import read_campaign_tables
from bottomlock.files.columns import PUBLISHED
from bottomlock.report.advice import Advice, advise, choose
from bottomlock.report.page import make_report
from bottomlock.statistics.run_errors import read_run_errors
from tests.recorded import add_table
from tests.report.synthetic_campaign import edit_manifest, write_campaign

pytestmark = pytest.mark.usefixtures("undrawn")


def test_references_are_not_advice(tmp_path: Path) -> None:
    """A campaign of references alone advises nothing and still has its page."""
    folder = write_campaign(tmp_path / "c", trajectories=["straight"], methods=["ins", "lc"], runs=2)
    assert "No method of this campaign is consistent" in make_report(folder).page.read_text(encoding="utf-8")


def _overconfident(folder: Path, trajectory: str, method: str) -> None:
    path = folder / "consistency.parquet"
    here = (pl.col("trajectory") == trajectory) & (pl.col("method") == method)
    verdict = pl.when(here).then(pl.lit("overconfident")).otherwise("verdict").alias("verdict")
    add_table(folder, path.name, pl.read_parquet(path).with_columns(verdict))


def studies(*methods: str, overconfident: Sequence[tuple[str, str, str]] = ()) -> pl.DataFrame:
    """Published studies of one trajectory in which all is consistent but some cells: method, beams, verdict."""
    rows = [
        (
            "survey", method, "straight", beams,
            *("overconfident" if (method, beams, name) in overconfident else "consistent"
              for name in ("verdict_velocity_attitude", "verdict")),
        )
        for method in methods
        for beams in ("1,2,3,4", "1,2", "1,3")
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=dict(PUBLISHED), orient="row")


def test_the_advice_follows_the_tables(tmp_path: Path) -> None:
    """The best recommended method wins; once it is overconfident somewhere it is no advice for everywhere."""

    def size(trajectory: str, method: str, _: np.ndarray[Any, Any]) -> tuple[Any, Any]:
        return {"nsv": 0.05, "tc": 0.2, "plcf": 2.0}.get(method, 30.0), 1.0 + (trajectory == "straight")

    folder = write_campaign(tmp_path / "c", size, runs=12, methods=["ins", "tc", "nsv", "plcf"])

    def advice() -> list[Advice]:
        campaign = read_campaign_tables(folder)
        errors = {name: read_run_errors(campaign, name) for name in campaign.trajectories}
        return advise(campaign, errors, studies("tc", "nsv", "plcf"))

    first = choose(advice())
    assert first is not None
    assert first.best == ("nsv",)
    _overconfident(folder, "lawn_mower", "nsv")
    parts = advice()
    assert [part.best for part in parts] == [("tc",)] * 3
    assert [part.overconfident for part in parts] == [(), (), ("nsv",)]
    assert parts[0].consistent_here_only == {"nsv": "overconfident on lawn mower"}
    for part in parts:
        for other in parts:
            warned = {*other.consistent_here_only, *other.overconfident, *other.mostly_rejected}
            assert not warned.intersection(part.recommended)
    second = choose(parts)
    assert second is not None
    assert second.best == second.recommended[:1] == ("tc",)
    assert second.worst_ratio == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("lost", "cell", "recommended"),
    [
        ([3, 4], ("nsv", "1,2", "verdict"), ("tc",)),
        ([3, 4], ("nsv", "1,3", "verdict"), ("nsv", "tc")),
        ([4], ("nsv", "1,3", "verdict"), ("tc",)),
    ],
)
def test_a_method_is_recommended_where_the_published_studies_bear_it_out(
    tmp_path: Path, lost: list[int], cell: tuple[str, str, str], recommended: tuple[str, ...]
) -> None:
    """Overconfident there under the campaign's beams; under any beams where its own are not there."""

    def size(_: str, method: str, __: np.ndarray[Any, Any]) -> tuple[Any, Any]:
        return {"nsv": 0.05, "elc": 0.01}.get(method, 0.2), 1.0

    folder = write_campaign(
        tmp_path / "c", size, runs=12, trajectories=["straight"], methods=["tc", "nsv", "elc"]
    )
    edit_manifest(
        folder, lambda m: m["scenarios"]["straight"]["configuration"]["dvl"].update(beams_lost=lost)
    )
    campaign = read_campaign_tables(folder)
    errors = {"straight": read_run_errors(campaign, "straight")}
    (part,) = advise(campaign, errors, studies("tc", "nsv", overconfident=[cell]))
    assert part.consistent == ("elc", "nsv", "tc")
    assert part.recommended == recommended
    assert part.best == recommended[:1]
    assert part.beams == ("1,2" if lost == [3, 4] else None)
    assert part.consistent_here_only["elc"] == "in no published study"
    assert ("nsv" in part.consistent_here_only) == ("nsv" not in recommended)


@pytest.mark.parametrize(("world", "speed_mps"), [("paper", 0.0), ("survey", 0.0), ("paper", 0.3)])
def test_a_method_without_sway_is_recommended_only_if_a_current_tested_it(
    tmp_path: Path, world: str, speed_mps: float
) -> None:
    """In the campaign or in a published study: still water says nothing about it."""
    folder = write_campaign(tmp_path / "c", runs=12, trajectories=["straight"], methods=["tc", "weak_sway"])
    mission = {"current": {"speed_mps": speed_mps}}
    edit_manifest(folder, lambda m: m["scenarios"]["straight"]["configuration"].update(mission=mission))
    campaign = read_campaign_tables(folder)
    published = studies("tc", "weak_sway").with_columns(pl.lit(world).alias("world"))
    (part,) = advise(campaign, {"straight": read_run_errors(campaign, "straight")}, published)
    tested = world == "survey" or speed_mps > 0.0
    assert ("weak_sway" in part.recommended) == tested
    assert tested or "tests in a current" in part.consistent_here_only["weak_sway"]


def test_a_method_whose_gate_rejects_most_fixes_is_not_recommended(tmp_path: Path) -> None:
    """One run in twelve is enough: the mean does not show it, and at sea there is one run."""
    folder = write_campaign(tmp_path / "c", trajectories=["straight"], methods=["ins", "tc", "nsv"], runs=12)
    path = folder / "runs.parquet"
    here = (pl.col("method") == "nsv") & (pl.col("run") == 7)
    rejected = pl.when(here).then(240).otherwise("fixes_rejected").alias("fixes_rejected")
    accepted = pl.when(here).then(10).otherwise("fixes_accepted").alias("fixes_accepted")
    add_table(folder, path.name, pl.read_parquet(path).with_columns(rejected, accepted))
    campaign = read_campaign_tables(folder)
    errors = {"straight": read_run_errors(campaign, "straight")}
    (part,) = advise(campaign, errors, studies("tc", "nsv"))
    assert part.consistent == part.recommended == ("tc",)
    assert part.mostly_rejected == {"nsv": 1}
