"""`bottomlock fix` with and without measured noise and screened beams, and what it says where neither is possible."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import bottomlock
from tests.cli.calls import command, refused

PINGS = 400
AXES = ("surge", "sway", "heave")
COLUMNS = {
    "time_ns": pl.Int64(), "status": pl.String(), "rank": pl.UInt8(),
    **{f"{axis}_mps": pl.Float64() for axis in AXES},
    **{f"{axis}_{what}": pl.String() for what in ("status", "source") for axis in AXES},
    **{f"cov_{one}_{other}_m2ps2": pl.Float64() for k, one in enumerate(AXES) for other in AXES[k:]},
    **{f"beam{k}_used": pl.Boolean() for k in (1, 2, 3, 4)},
}  # fmt: skip
"""Columns of the fixes of an instrument with four beams."""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Pings at 1 m/s, noise twice that of `x_janus_20`, beam 3 of row 200 off by 2 m/s, beam 1 of row 5 lost."""
    janus = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
    beams = janus.beam_velocities(np.tile([1.0, 0.1, 0.0], (PINGS, 1)))
    beams += np.random.default_rng(2).standard_normal((PINGS, 4)) * 0.084
    beams[200, 2] += 2.0
    valid = np.ones((PINGS, 4), dtype=bool)
    valid[5, 0] = False
    columns: dict[str, Any] = {"time_ns": np.arange(PINGS) * 1_000_000_000}
    columns |= {f"beam{k + 1}_mps": beams[:, k] for k in range(4)}
    columns |= {f"beam{k + 1}_valid": valid[:, k] for k in range(4)}
    pl.DataFrame(columns).write_csv(tmp_path / "pings.csv")
    return tmp_path / "pings.csv"


def fixes(log: Path, *switches: str) -> tuple[pl.DataFrame, str]:
    """Table and output of the command; words are joined by single spaces."""
    out = log.with_suffix(".parquet")
    done = command(
        "fix", str(log), "--geometry", "x_janus_20", "--method", "lc", "--out", str(out), "--force", *switches
    )
    assert done.returncode == 0, done.stderr
    return pl.read_parquet(out), " ".join(done.stdout.split())


def test_robust_is_the_default(log: Path) -> None:
    frame, words = fixes(log)
    measured = ("beam_sd_factor", "halfwidth_2sigma_over_sd", "halfwidth_3sigma_over_sd")
    screened = {"outlier_test": pl.String(), **dict.fromkeys(measured, pl.Float64())}
    assert frame.schema == pl.Schema(COLUMNS | screened)
    assert frame.equals(fixes(log, "--robust")[0])
    assert "beam noise, all pings: claimed sd 42 mm/s, measured" in words
    assert "1 with a beam rejected" in words
    assert "1 untested (without redundant beams no outlier can be found)" in words
    bad, short = frame.row(200, named=True), frame.row(5, named=True)
    assert bad["outlier_test"] == "beam_rejected"
    assert [bad[f"beam{k}_used"] for k in (1, 2, 3, 4)] == [True, True, False, True]
    assert abs(bad["surge_mps"] - 1.0) < 5.0 * np.sqrt(bad["cov_surge_surge_m2ps2"])
    assert short["outlier_test"] == "untested"
    assert frame["beam_sd_factor"].median() == pytest.approx(2.0, rel=0.2)


def test_without_it_the_fixes_are_those_of_the_kernel(log: Path) -> None:
    frame, words = fixes(log, "--no-robust")
    assert frame.schema == pl.Schema(COLUMNS)
    assert "beam noise" not in words
    assert "outliers" not in words
    bad = frame.row(200, named=True)
    assert all(bad[f"beam{k}_used"] for k in (1, 2, 3, 4))
    assert abs(bad["surge_mps"] - 1.0) > 5.0 * np.sqrt(bad["cov_surge_surge_m2ps2"])


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"instrument_valid": False}, "the instrument flags its velocity invalid in all 400 pings"),
        ({f"beam{k}_mps": 0.0 for k in (1, 2, 3, 4)}, "every reading of 400 pings is exactly zero"),
        ({f"beam{k}_valid": False for k in (1, 2, 3, 4)}, "no beam is valid in any of 400 pings"),
    ],
)
def test_log_without_lock_is_refused(log: Path, changed: dict[str, Any], why: str) -> None:
    pl.read_csv(log).with_columns(pl.lit(value).alias(name) for name, value in changed.items()).write_csv(log)
    out = log.with_suffix(".parquet")
    said = refused("fix", str(log), "--geometry", "x_janus_20", "--method", "lc", "--out", str(out))
    assert f"never had bottom lock in this log: {why}." in " ".join(said.split())
    assert not out.exists()


def test_log_with_lock_somewhere_or_a_beam_lost_is_solved(log: Path) -> None:
    """One accepted ping is lock; without beam 4 the instrument accepts none, and the other three are solved."""
    table = pl.read_csv(log)
    table.with_columns(instrument_valid=pl.int_range(PINGS) == 17).write_csv(log)
    assert fixes(log)[0].height == PINGS
    table.with_columns(beam4_valid=pl.lit(False), instrument_valid=pl.lit(False)).write_csv(log)
    assert (fixes(log)[0]["status"] == "fix").sum() == PINGS - 1
