"""Errors against a reference beyond the claimed σ are a finding; errors that last are one value, however many rows."""

import numpy as np
import polars as pl
import pytest
from scipy.signal import lfilter

from bottomlock.recordings.robust import correlation_rows
from bottomlock.replay.findings.claims import claims_findings

ENDS = {
    "position": ("north_m", "east_m", "down_m"),
    "velocity": ("surge_mps", "sway_mps", "heave_mps"),
    "misalignment": ("north_rad", "east_rad", "down_rad"),
}


def samples(seed: int, rows: int, correlation: float, factor: dict[str, float]) -> pl.DataFrame:
    """Errors of unit variance over σ = 2, AR(1) in time, times a factor."""
    rng = np.random.default_rng(seed)
    columns: dict[str, object] = {"pass": ["forward"] * rows, "method": ["tc"] * rows}
    for what, ends in ENDS.items():
        for end in ends:
            drawn = rng.normal(size=rows)
            drawn[1:] *= np.sqrt(1.0 - correlation**2)
            z = np.asarray(lfilter([1.0], [1.0, -correlation], drawn))
            columns[f"err_{what}_{end}"] = 2.0 * z * factor.get(what, 1.0)
            columns[f"sd_{what}_{end}"] = np.full(rows, 2.0)
    return pl.DataFrame(columns)


@pytest.mark.parametrize("correlation", [0.0, 0.9, 0.99, 0.9999])
def test_consistent_errors_are_no_finding(correlation: float) -> None:
    """40 dives with three quantities each; at a chance of 1e-4 of one 120 tests have one in 100 repeats."""
    found = [claims_findings(samples(seed, 300, correlation, {}), ["ins", "tc"]) for seed in range(40)]
    assert [one for one in found if one] == []


def test_errors_far_beyond_are_named() -> None:
    (found,) = claims_findings(samples(1, 300, 0.9, {"velocity": 4.0}), ["tc"])
    assert (found.kind, found.severity) == ("claims", "warning")
    assert "velocity is" in found.text
    assert float(found.text.split()[5]) == pytest.approx(4.0, rel=0.2)


def test_the_noise_of_the_reference_is_in_its_errors() -> None:
    """Positions by acoustics scatter by three times the claim of a filter that is right."""
    frame = samples(4, 300, 0.0, {"position": np.hypot(1.0, 3.0)})
    for sd_m, kinds in ((0.0, ["claims"]), (6.0, [])):
        assert [one.kind for one in claims_findings(frame, ["tc"], sd_m)] == kinds


def test_one_long_error_is_one_value() -> None:
    """An offset of two σ that stays is 2σ of one value an axis; of ten σ it is far beyond."""
    frame = samples(2, 300, 0.0, {"position": 0.0})
    for shift, kinds in ((2.0, []), (10.0, ["claims"])):
        moved = frame.with_columns(
            pl.lit(2.0 * shift).alias(f"err_position_{end}") for end in ENDS["position"]
        )
        assert [one.kind for one in claims_findings(moved, ["tc"])] == kinds


def test_no_reference_no_finding() -> None:
    frame = samples(3, 50, 0.0, {})
    empty = frame.with_columns(
        pl.lit(None, pl.Float64).alias(name) for name in frame.columns if name[:3] == "err"
    )
    assert claims_findings(empty, ["tc"]) == []


def test_correlation_about_zero_keeps_an_offset() -> None:
    white = np.random.default_rng(4).normal(size=400)
    assert correlation_rows(white + 3.0) < 2.0
    assert correlation_rows(white + 3.0, centred=False) > 100.0
