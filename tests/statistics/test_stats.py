"""Statistics against values worked by hand."""

import numpy as np
import polars as pl
import pytest

from bottomlock.files.columns import CONSISTENCY, ENSEMBLE, OUTCOMES, RUNS, SAMPLES, check
from bottomlock.statistics import campaign
from bottomlock.statistics.chi_squared import family_band
from bottomlock.statistics.rms import bootstrap_rms, rms_column


def samples() -> pl.DataFrame:
    """Two runs, one method, two times: velocity errors 3-4-0 and 0, then 0-0-5 and 0."""
    zero = dict.fromkeys((name for name in SAMPLES if name.startswith(("err_", "sd_"))), 0.0)
    rows = []
    for run, time_s, surge, sway, heave in (
        (0, 1, 3.0, 4.0, 0.0),
        (0, 2, 0.0, 0.0, 0.0),
        (1, 1, 0.0, 0.0, 5.0),
        (1, 2, 0.0, 0.0, 1.0),
    ):
        errors = {
            "err_velocity_surge_mps": surge,
            "err_velocity_sway_mps": sway,
            "err_velocity_heave_mps": heave,
        }
        keys = {"trajectory": "t", "run": run, "method": "tc", "time_ns": time_s * 10**9}
        rows.append(
            keys
            | zero
            | errors
            | {"err_misalignment_north_rad": np.pi / 180.0, "nees": 20.0, "nees_velocity_attitude": 6.0}
        )
    return check(pl.DataFrame(rows, schema=dict(SAMPLES)), SAMPLES, place="test")


def counts() -> pl.DataFrame:
    """Fixes of the two runs."""
    return pl.DataFrame(
        [
            ("t", 0, "tc", 2.0, 2, 0, 1, 1.0, 2.0, *([0.1] * 12)),
            ("t", 1, "tc", None, 0, 0, 0, None, None, *([None] * 12)),
        ],
        schema=dict(OUTCOMES),
        orient="row",
    )


def tables(norms: pl.DataFrame) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Ensemble and means of NEES of the two runs."""
    arrays = campaign.norm_arrays(norms, 2, 1)
    time_ns = np.array([1, 2]) * 10**9
    return campaign.ensemble_and_consistency(
        "t", ["tc"], time_ns, [arrays[:, :1], arrays[:, 1:]], full_degrees=20
    )


def test_runs_table_by_hand() -> None:
    """RMS over time and last value of the norms; no fix leaves a null, not a NaN."""
    table = check(campaign.runs_table(campaign.error_norms(samples()), counts()), RUNS, place="runs")
    assert table["velocity_rms_over_time_mps"].to_list() == pytest.approx([np.sqrt(12.5), np.sqrt(13.0)])
    assert table["velocity_final_mps"].to_list() == pytest.approx([0.0, 1.0])
    assert table["attitude_rms_over_time_deg"].to_list() == pytest.approx([1.0, 1.0])
    assert table["nis_mean_over_fixes"].to_list() == [2.0, None]


def test_ensemble_by_hand() -> None:
    """RMS over runs at each second, inside its bootstrap interval."""
    table = check(tables(campaign.error_norms(samples()))[0], ENSEMBLE, place="ensemble")
    assert table["time_s"].to_list() == [1.0, 2.0]
    assert table["velocity_rms_over_runs_mps"].to_list() == pytest.approx([5.0, np.sqrt(0.5)])
    assert table["velocity_rms_over_runs_lo_mps"].to_list() == pytest.approx([5.0, 0.0])
    assert table["velocity_rms_over_runs_hi_mps"].to_list() == pytest.approx([5.0, 1.0])


def test_nulls_are_left_out() -> None:
    """√((3² + 4²)/2) with nulls among them as without; of nulls alone there is no RMS."""
    column = pl.DataFrame({"x": [3.0, None, 4.0, None, None]})
    assert column.select(rms_column("x")).item() == pytest.approx(np.sqrt(12.5))
    assert column.filter(pl.col("x").is_null()).select(rms_column("x")).item() is None


def test_bootstrap_covers_as_it_says() -> None:
    """A 95 % interval of an RMS over 100 normal runs holds the true value 95 times in 100 (400 trials)."""
    generator = np.random.default_rng(20170222)
    squares = generator.normal(size=(100, 400)) ** 2
    low, high = bootstrap_rms(squares)
    inside = np.mean((low <= 1.0) & (high >= 1.0))
    assert 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / 400) - 0.02 < inside < 0.99


def test_consistency_verdicts() -> None:
    """A NEES at its expectation is consistent; ten times that is overconfident; a tenth is conservative."""
    norms = campaign.error_norms(samples())
    for factor, verdict in ((1.0, "consistent"), (10.0, "overconfident"), (0.1, "conservative")):
        scaled = norms.with_columns(pl.col("nees", "nees_velocity_attitude") * factor)
        table = campaign.judge(tables(scaled)[1])
        assert table["verdict"].to_list() == [verdict, verdict]


def test_means_are_judged_at_their_times_as_one_family() -> None:
    """Two methods and two quantities at five of ten times: twenty means; one above its band counts."""
    _, high = family_band(6, 2, 20)
    spike = {
        name: np.full(10, degrees) for name, degrees in (("nees_velocity_attitude", 6.0), ("nees", 20.0))
    }
    between = {name: values.copy() for name, values in spike.items()}
    spike["nees_velocity_attitude"][3] = 1.001 * high
    between["nees_velocity_attitude"][2] = 1.001 * high
    rows = [
        campaign.consistency_rows("t", method, means, runs=2, full_degrees=20)
        for method, means in (("tc", spike), ("vb", between))
    ]
    table = check(campaign.judge(pl.concat(rows)), CONSISTENCY, place="consistency")
    assert table["degrees"].to_list() == [6, 20] * 2
    assert table["verdict"].to_list() == ["overconfident", "consistent", "consistent", "consistent"]
    assert table["greatest"].to_list() == pytest.approx([1.001 * high, 20.0, 6.0, 20.0])
    assert table.select("band_lo", "band_hi").row(1) == family_band(20, 2, 20)


def test_a_method_without_nees_has_no_verdict_and_is_not_of_the_family() -> None:
    none = {name: np.full(5, np.nan) for name in ("nees_velocity_attitude", "nees")}
    some = {"nees_velocity_attitude": np.full(5, 6.0), "nees": np.full(5, 20.0)}
    rows = [
        campaign.consistency_rows("t", method, means, runs=9, full_degrees=20)
        for method, means in (("dead_reckoning", none), ("tc", some))
    ]
    table = campaign.judge(pl.concat(rows))
    assert table.select("mean", "greatest", "verdict").row(0) == (None, None, None)
    assert table.select("band_lo", "band_hi").row(2) == family_band(6, 9, 10)


def test_rejected_fraction_is_of_all_fixes() -> None:
    """Two accepted and one rejected of the first run, none of the second: a third."""
    norms = campaign.error_norms(samples())
    fixes = counts().with_columns(fixes_accepted=pl.Series([2, 0]), fixes_rejected=pl.Series([1, 0]))
    runs = campaign.runs_table(norms, fixes)
    summary = campaign.summary_table(tables(norms)[0], runs)
    assert summary["rejected_fraction"].to_list() == pytest.approx([1.0 / 3.0])


def test_runs_mostly_rejected_are_those_beyond_half() -> None:
    """Exactly half of the fixes, and a run without any, do not count."""
    runs = pl.DataFrame({"fixes_rejected": [3, 2, 0, 5], "fixes_accepted": [2, 2, 0, 6]})
    assert campaign.runs_mostly_rejected(runs) == 1
