"""Campaigns side by side: values and differences against numbers made by hand, pairing and its reasons, the page."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.files.campaign_tables import read_campaign_tables
from bottomlock.files.columns import COMPARISON
from bottomlock.report.compare import compare
from bottomlock.report.page import make_report
from bottomlock.statistics.compare import difference_of, why_unpaired
from tests.report.synthetic_campaign import edit_manifest, write_campaign

pytestmark = pytest.mark.usefixtures("undrawn")


def _size(velocity_mps: float) -> Any:  # noqa: ANN401 - as `write_campaign` takes it
    return lambda *_: (velocity_mps, 1.0)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two campaigns of one seed, 0.1 and 0.2 m/s, whose runs scatter alike."""
    folder = tmp_path_factory.mktemp("pair")
    for name, size in (("a", 0.1), ("b", 0.2)):
        write_campaign(folder / name, _size(size), runs=12, trajectories=["straight"], methods=["tc", "vb"])
    return folder / "a", folder / "b"


def test_a_paired_interval_is_that_of_the_runs_differences() -> None:
    """Errors that scatter by 100 and differ by 1 in each run: the paired interval knows the 1, the other does not."""
    scatter = np.random.default_rng(5).normal(500.0, 100.0, size=200)
    middle, low, high = difference_of(scatter + 1.0, scatter, is_rms=False, paired=True)
    assert (middle, low, high) == pytest.approx((1.0, 1.0, 1.0))
    _, low, high = difference_of(scatter + 1.0, scatter, is_rms=False, paired=False)
    # 1.96 * 100 * sqrt(2 / 200) on either side
    assert high - low == pytest.approx(2.0 * 1.96 * 10.0, rel=0.2)


def test_values_and_differences_are_those_of_the_tables(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """RMS at the end by construction; a campaign that errs twice as much differs by as much again."""
    made = compare(list(pair), tmp_path)
    assert dict(made.table.schema) == dict(COMPARISON)
    rows = made.table.filter((pl.col("quantity") == "velocity at the end") & (pl.col("method") == "tc"))
    assert rows["value"].to_list() == pytest.approx([0.1, 0.2])
    assert rows["difference"].to_list() == [None, pytest.approx(0.1)]
    assert rows["paired"].to_list() == [None, True]
    ensemble = read_campaign_tables(pair[0]).ensemble.filter(pl.col("method") == "tc")
    assert rows["lo"][0] == pytest.approx(ensemble["velocity_rms_over_runs_lo_mps"][-1])
    assert pl.read_parquet(tmp_path / "compare.parquet").equals(made.table)
    assert made.page is not None
    assert "0.100<br>" in made.page.read_text(encoding="utf-8")
    assert compare(list(pair)).table.equals(made.table)


@pytest.mark.first_cases(1)
@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda one: one.update(seed=2), "the seeds are 1 and 2"),
        (lambda one: one["configuration"]["trajectory"].update(speed_mps=1.0), r"\[trajectory\] differs"),
        (
            lambda one: one["configuration"]["environment"].update(latitude_deg=1.0),
            r"\[environment\] differs",
        ),
    ],
)
def test_what_is_not_paired_says_why(pair: tuple[Path, Path], tmp_path: Path, change: Any, why: str) -> None:  # noqa: ANN401 - an edit
    """Another seed or another trajectory: the difference stays, with an interval of independent runs."""
    other = write_campaign(
        tmp_path / "other", _size(0.2), runs=12, trajectories=["straight"], methods=["tc", "vb"]
    )
    edit_manifest(other, lambda manifest: change(manifest["scenarios"]["straight"]))
    made = compare([pair[0], other], tmp_path / "out")
    assert list(made.unpaired["straight"]) == ["other"]
    base, changed = (read_campaign_tables(folder) for folder in (pair[0], other))
    assert not why_unpaired(base, base, "straight")
    assert re.fullmatch(why, why_unpaired(base, changed, "straight"))
    rows = made.table.filter((pl.col("campaign") == "other") & (pl.col("quantity") == "velocity at the end"))
    assert not rows["paired"].any()
    paired = compare(list(pair), tmp_path / "paired").table.filter(
        (pl.col("campaign") == "b") & (pl.col("quantity") == "velocity at the end")
    )
    widths = [one["difference_hi"].to_numpy() - one["difference_lo"].to_numpy() for one in (rows, paired)]
    assert (widths[0] > widths[1]).all()


def test_campaigns_without_a_common_trajectory_are_refused(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """And a reference that is not among them."""
    other = write_campaign(tmp_path / "c", _size(0.2), runs=12, trajectories=["lawn_mower"], methods=["tc"])
    with pytest.raises(DataError, match=r"no other campaign has a trajectory of a \(straight\)"):
        compare([pair[0], other], tmp_path / "out")
    with pytest.raises(DataError, match="--against is 'z', expected one of a, b"):
        compare(list(pair), tmp_path / "out", against="z")


def test_the_papers_claims_are_of_the_papers_scenarios_alone(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """A campaign with another tilt speaks of its own figures; one of the paper's speaks of the claims on it."""
    own = write_campaign(
        tmp_path / "own", _size(0.1), runs=12, trajectories=["straight"], methods=["ins", "tc"]
    )
    edit_manifest(
        own, lambda manifest: manifest["scenarios"]["straight"]["configuration"]["imu"].update(rate_hz=100.0)
    )
    made = make_report(own)
    page = made.page.read_text(encoding="utf-8")
    assert made.claims.is_empty()
    assert not (own / "tables" / "claims.parquet").exists()
    assert 'id="claims"' not in page
    assert "#claims" not in page
    assert "paper" not in page.split("</style>")[1].split('id="final"')[0]
    theirs = make_report(pair[0])
    assert set(theirs.claims["trajectory"]) == {"straight"}
    assert 'href="#claims"' in theirs.page.read_text(encoding="utf-8")
