"""Statistics of a campaign: data frames in, data frames out."""

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.files.columns import CONSISTENCY_MEANS, ENSEMBLE, RUNS
from bottomlock.statistics.chi_squared import family_band, judged_samples, verdict
from bottomlock.statistics.rms import bootstrap_rms, combined_rms, rms_column
from bottomlock.units import DEGREES_PER_RADIAN

NORMS = ("velocity_mps", "attitude_deg", "position_m", "nees", "nees_velocity_attitude")
"""Columns of `error_norms` beside its keys."""


def _norm(prefix: str) -> pl.Expr:
    return pl.sum_horizontal(pl.col(f"^{prefix}.*$").cast(pl.Float64) ** 2).sqrt()


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
        pl.col("nees", "nees_velocity_attitude").cast(pl.Float64),
    )


def runs_table(norms: pl.DataFrame, counts: pl.DataFrame) -> pl.DataFrame:
    """A row per trajectory, run and method (`files.columns.RUNS`)."""
    keys = ["trajectory", "run", "method"]
    ordered = norms.sort("time_ns", maintain_order=True)
    table = ordered.group_by(keys, maintain_order=True).agg(
        rms_column("velocity_mps").alias("velocity_rms_over_time_mps"),
        rms_column("attitude_deg").alias("attitude_rms_over_time_deg"),
        rms_column("position_m").alias("position_rms_over_time_m"),
        pl.col("velocity_mps").last().alias("velocity_final_mps"),
        pl.col("attitude_deg").last().alias("attitude_final_deg"),
        pl.col("position_m").last().alias("position_final_m"),
        pl.col("nees").mean().alias("nees_mean_over_time"),
    )
    return table.join(counts, on=keys, how="left", maintain_order="left").select(list(RUNS))


def ensemble_rows(
    trajectory: str, method: str, time_ns: NDArray[np.int64], errors: Mapping[str, NDArray[np.float64]]
) -> pl.DataFrame:
    """A row per second of one method (`files.columns.ENSEMBLE`).

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
            "velocity_rms_over_runs_mps": combined_rms(squares["velocity_mps"]),
            "velocity_rms_over_runs_lo_mps": velocity_lo,
            "velocity_rms_over_runs_hi_mps": velocity_hi,
            "attitude_rms_over_runs_deg": combined_rms(squares["attitude_deg"]),
            "attitude_rms_over_runs_lo_deg": attitude_lo,
            "attitude_rms_over_runs_hi_deg": attitude_hi,
            "position_rms_over_runs_m": combined_rms(squares["position_m"]),
            # A method without NEES has none: null.
            "nees_mean_over_runs": pl.Series(errors["nees"].mean(axis=0)).fill_nan(None),
        },
        schema=dict(ENSEMBLE),
    )


def consistency_rows(
    trajectory: str,
    method: str,
    nees_at_time: Mapping[str, NDArray[np.float64]],
    *,
    runs: int,
    full_degrees: int,
) -> pl.DataFrame:
    """A row per kind of NEES of one method, for `judge`: its means are null where it has none.

    Args:
        trajectory: its name.
        method: its name.
        nees_at_time: means over the runs of `nees_velocity_attitude` and `nees`, (times,) each.
        runs: number of runs behind the means.
        full_degrees: degrees of freedom of `nees`.
    """
    rows: list[tuple[object, ...]] = []
    for quantity, degrees in (("nees_velocity_attitude", 6), ("nees", full_degrees)):
        at_time = nees_at_time[quantity]
        judged = at_time[judged_samples(len(at_time))]
        means = (float(np.mean(at_time)), float(judged.min()), float(judged.max()))
        absent = np.isnan(means).any()
        rows.append(
            (trajectory, method, quantity, degrees, runs, len(judged), *((None,) * 3 if absent else means))
        )
    return pl.DataFrame(rows, schema=dict(CONSISTENCY_MEANS), orient="row")


def judge(means: pl.DataFrame) -> pl.DataFrame:
    """The verdicts (`files.columns.CONSISTENCY`) on all means of a campaign or study, which are one family."""
    family = max(1, int(means.filter(pl.col("mean").is_not_null())["times"].sum()))
    rows = means.select("least", "greatest", "runs", "degrees").rows()
    bands = [family_band(degrees, runs, family) for _, _, runs, degrees in rows]
    verdicts = [
        None if least is None else verdict([least, greatest], runs, degrees, family)
        for least, greatest, runs, degrees in rows
    ]
    return means.with_columns(
        pl.Series("band_lo", [low for low, _ in bands], pl.Float64),
        pl.Series("band_hi", [high for _, high in bands], pl.Float64),
        pl.Series("verdict", verdicts, pl.String),
    )


def norm_arrays(norms: pl.DataFrame, runs: int, methods: int) -> NDArray[np.float64]:
    """The norms (`NORMS`, runs, methods, times) of a table that is ordered by run, method and time."""
    return norms.select(NORMS).to_numpy(order="fortran").T.reshape(len(NORMS), runs, methods, -1)


def ensemble_and_consistency(
    trajectory: str,
    methods: Sequence[str],
    time_ns: NDArray[np.int64],
    norms: Sequence[NDArray[np.float64]],
    *,
    full_degrees: int,
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The tables over all runs of a trajectory: `files.columns.ENSEMBLE`, and means of NEES for `judge`.

    Args:
        trajectory: its name.
        methods: their names.
        time_ns: (times,).
        norms: of parts of the runs, as `norm_arrays` gives them.
        full_degrees: degrees of freedom of `nees`.
    """
    ensemble, consistency = [], []
    for k, method in enumerate(methods):
        values = np.concatenate([part[:, :, k] for part in norms], axis=1)
        errors = dict(zip(NORMS, values, strict=True))
        ensemble.append(ensemble_rows(trajectory, method, time_ns, errors))
        at_time = {name: errors[name].mean(axis=0) for name in ("nees", "nees_velocity_attitude")}
        runs = values.shape[1]
        consistency.append(
            consistency_rows(trajectory, method, at_time, runs=runs, full_degrees=full_degrees)
        )
    return pl.concat(ensemble), pl.concat(consistency)


def summary_table(ensemble: pl.DataFrame, runs: pl.DataFrame) -> pl.DataFrame:
    """A row per trajectory and method: RMS over runs at the last second, NEES and gate.

    Args:
        ensemble: `files.columns.ENSEMBLE`.
        runs: `files.columns.RUNS`.

    Returns:
        The columns of `ensemble` at the last second, without its NEES, and `nees_mean_over_runs_and_time`,
        `nis_mean_over_runs_and_fixes`, `rejected_fraction` of all fixes and `cross_track_rms_over_runs_and_time_m`.
    """
    last = ensemble.group_by("trajectory", "method", maintain_order=True).last()
    gate = runs.group_by("trajectory", "method", maintain_order=True).agg(
        pl.col("nees_mean_over_time").mean().alias("nees_mean_over_runs_and_time"),
        pl.col("nis_mean_over_fixes").mean().alias("nis_mean_over_runs_and_fixes"),
        (pl.col("fixes_rejected").sum() / (pl.col("fixes_accepted") + pl.col("fixes_rejected")).sum()).alias(
            "rejected_fraction"
        ),
        rms_column("cross_track_rms_over_time_m").alias("cross_track_rms_over_runs_and_time_m"),
    )
    return last.drop("nees_mean_over_runs").join(gate, on=["trajectory", "method"], maintain_order="left")


def runs_mostly_rejected(runs: pl.DataFrame) -> int:
    """Number of runs (`files.columns.RUNS`) in which the gate rejects more than half of the fixes."""
    return int((runs["fixes_rejected"] > runs["fixes_accepted"]).sum())
