"""Statistics of a campaign: data frames in, data frames out."""

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.tables.campaign import CONSISTENCY, ENSEMBLE, RUNS
from bottomlock.units import DEGREES_PER_RADIAN

BOOTSTRAP_RESAMPLES = 1000
BOOTSTRAP_SEED = 20170222

WEIGHTS_HELD = 8_000_000
"""Bootstrap weights in memory at a time, 64 MB: up to 8,000 runs they are drawn at once."""

NORMS = ("velocity_mps", "attitude_deg", "position_m", "nees", "nees_velocity_attitude")
"""What `error_norms` makes of the samples."""


def _norm(prefix: str) -> pl.Expr:
    return pl.sum_horizontal(pl.col(f"^{prefix}.*$") ** 2).sqrt()


def error_norms(samples: pl.DataFrame) -> pl.DataFrame:
    """Norms of the velocity, misalignment and position errors beside their keys and the NEES."""
    return samples.select(
        "trajectory",
        "run",
        "method",
        "time_ns",
        _norm("err_velocity_").alias("velocity_mps"),
        (_norm("err_misalignment_") * DEGREES_PER_RADIAN).alias("attitude_deg"),
        _norm("err_position_").alias("position_m"),
        "nees",
        "nees_velocity_attitude",
    )


def _rms(column: str) -> pl.Expr:
    return (pl.col(column) ** 2).mean().sqrt()


def runs_table(norms: pl.DataFrame, counts: pl.DataFrame) -> pl.DataFrame:
    """A row per trajectory, run and method (`tables.campaign.RUNS`)."""
    keys = ["trajectory", "run", "method"]
    ordered = norms.sort("time_ns", maintain_order=True)
    table = ordered.group_by(keys, maintain_order=True).agg(
        _rms("velocity_mps").alias("velocity_rms_mps"),
        _rms("attitude_deg").alias("attitude_rms_deg"),
        _rms("position_m").alias("position_rms_m"),
        pl.col("velocity_mps").last().alias("velocity_final_mps"),
        pl.col("attitude_deg").last().alias("attitude_final_deg"),
        pl.col("position_m").last().alias("position_final_m"),
        pl.col("nees").mean().alias("nees_mean"),
    )
    return table.join(counts, on=keys, how="left", maintain_order="left").select(list(RUNS))


def bootstrap_rms(squares: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """95 % bootstrap interval of the RMS over the first axis (runs); it depends on nothing but the data.

    Whole runs are drawn, so the times of a run stay together.

    >>> low, high = bootstrap_rms(np.ones((5, 2)))
    >>> low.tolist(), high.tolist()
    ([1.0, 1.0], [1.0, 1.0])
    """
    drawn = np.sqrt(np.concatenate([squares.T @ weights.T for weights in _weights(squares.shape[0])], axis=1))
    # Times are rows, which numpy sorts fast; rows that are sorted it partitions faster than rows in disorder.
    drawn.sort(axis=1)
    low, high = np.percentile(drawn, [2.5, 97.5], axis=1)
    return low, high


def _weights(runs: int) -> Iterable[NDArray[np.float64]]:
    """Weights of whole runs (resamples, runs), in blocks that memory can hold."""
    return _few_weights(runs) if BOOTSTRAP_RESAMPLES * runs <= WEIGHTS_HELD else _draw_weights(runs)


@lru_cache(maxsize=1)
def _few_weights(runs: int) -> list[NDArray[np.float64]]:
    """Every method and quantity of a campaign has the same ones."""
    return list(_draw_weights(runs))


def _draw_weights(runs: int) -> Iterator[NDArray[np.float64]]:
    generator = np.random.default_rng(BOOTSTRAP_SEED)
    at_once = max(1, WEIGHTS_HELD // runs)
    # One generator over all blocks: the draws are those of a single call.
    for first in range(0, BOOTSTRAP_RESAMPLES, at_once):
        size = min(at_once, BOOTSTRAP_RESAMPLES - first)
        yield generator.multinomial(runs, np.full(runs, 1.0 / runs), size=size) / runs


def ensemble_rows(
    trajectory: str, method: str, time_ns: NDArray[np.int64], errors: Mapping[str, NDArray[np.float64]]
) -> pl.DataFrame:
    """A row per second of one method (`tables.campaign.ENSEMBLE`).

    Args:
        trajectory: its name.
        method: its name.
        time_ns: (times,).
        errors: `velocity_mps`, `attitude_deg`, `position_m` and `nees`, (runs, times) each.
    """
    squares = {name: errors[name] ** 2 for name in ("velocity_mps", "attitude_deg", "position_m")}
    velocity_lo, velocity_hi = bootstrap_rms(squares["velocity_mps"])
    attitude_lo, attitude_hi = bootstrap_rms(squares["attitude_deg"])
    return pl.DataFrame(
        {
            "trajectory": [trajectory] * len(time_ns),
            "method": [method] * len(time_ns),
            "time_s": time_ns * 1e-9,
            "velocity_rms_mps": np.sqrt(squares["velocity_mps"].mean(axis=0)),
            "velocity_rms_lo_mps": velocity_lo,
            "velocity_rms_hi_mps": velocity_hi,
            "attitude_rms_deg": np.sqrt(squares["attitude_deg"].mean(axis=0)),
            "attitude_rms_lo_deg": attitude_lo,
            "attitude_rms_hi_deg": attitude_hi,
            "position_rms_m": np.sqrt(squares["position_m"].mean(axis=0)),
            "nees": errors["nees"].mean(axis=0),
        },
        schema=dict(ENSEMBLE),
    )


def ensemble_table(norms: pl.DataFrame) -> pl.DataFrame:
    """A row per trajectory, method and second (`tables.campaign.ENSEMBLE`), from norms that are all in memory."""
    return pl.concat(
        [
            ensemble_rows(trajectory, method, time_ns, errors)
            for trajectory, method, time_ns, errors in _methods(norms)
        ]
    )


def _methods(
    norms: pl.DataFrame,
) -> Iterator[tuple[str, str, NDArray[np.int64], dict[str, NDArray[np.float64]]]]:
    """Trajectory, method, times and the errors as (runs, times)."""
    for (trajectory, method), group in norms.group_by("trajectory", "method", maintain_order=True):
        ordered = group.sort("run", "time_ns")
        time_ns = ordered["time_ns"].unique().sort().to_numpy()
        shape = (-1, len(time_ns))
        yield (
            str(trajectory),
            str(method),
            time_ns,
            {name: ordered[name].to_numpy().reshape(shape) for name in NORMS},
        )


def nees_band(degrees: int, runs: int, probability: float = 0.95) -> tuple[float, float]:
    """Band of the mean of `runs` independent NEES values of an honest filter.

    >>> low, high = nees_band(6, 200)
    >>> round(low, 2), round(high, 2)
    (5.53, 6.49)
    """
    tails = (0.5 * (1.0 - probability), 0.5 * (1.0 + probability))
    low, high = chi2.ppf(tails, degrees * runs) / runs
    return float(low), float(high)


def consistency_rows(
    trajectory: str,
    method: str,
    nees_at_time: Mapping[str, NDArray[np.float64]],
    *,
    runs: int,
    full_degrees: int,
) -> pl.DataFrame:
    """A row per kind of NEES of one method (`tables.campaign.CONSISTENCY`).

    The verdict is on the mean over time, held against the band of the mean over runs: it is conservative,
    since the mean over time scatters less than the value at one time.

    Args:
        trajectory: its name.
        method: its name.
        nees_at_time: means over the runs of `nees_velocity_attitude` and `nees`, (times,) each.
        runs: how many runs the means are of.
        full_degrees: degrees of freedom of `nees`.
    """
    rows = []
    for quantity, degrees in (("nees_velocity_attitude", 6), ("nees", full_degrees)):
        low, high = nees_band(degrees, runs)
        at_time = nees_at_time[quantity]
        mean = float(np.mean(at_time))
        inside = float(np.mean((at_time >= low) & (at_time <= high)))
        verdict = (
            "consistent" if low <= mean <= high else ("overconfident" if mean > high else "conservative")
        )
        rows.append((trajectory, method, quantity, degrees, runs, mean, low, high, inside, verdict))
    return pl.DataFrame(rows, schema=dict(CONSISTENCY), orient="row")


def consistency_table(norms: pl.DataFrame, *, full_degrees: int) -> pl.DataFrame:
    """A row per trajectory, method and kind of NEES (`tables.campaign.CONSISTENCY`), from norms in memory."""
    parts = []
    for trajectory, method, _, errors in _methods(norms):
        at_time = {name: errors[name].mean(axis=0) for name in ("nees", "nees_velocity_attitude")}
        runs = len(errors["nees"])
        parts.append(consistency_rows(trajectory, method, at_time, runs=runs, full_degrees=full_degrees))
    return pl.concat(parts)


def summary_table(ensemble: pl.DataFrame, runs: pl.DataFrame) -> pl.DataFrame:
    """RMS over runs at the last second, NEES and gate, per trajectory and method: what a person wants to see."""
    last = ensemble.group_by("trajectory", "method", maintain_order=True).last()
    gate = runs.group_by("trajectory", "method", maintain_order=True).agg(
        pl.col("nees_mean").mean(),
        pl.col("nis_mean").mean(),
        (pl.col("fixes_rejected").sum() / (pl.col("fixes_accepted") + pl.col("fixes_rejected")).sum()).alias(
            "rejected_fraction"
        ),
        _rms("cross_track_rms_m").alias("cross_track_rms_m"),
    )
    return last.drop("nees").join(gate, on=["trajectory", "method"], maintain_order="left")
