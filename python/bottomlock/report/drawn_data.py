"""What each figure of a campaign's page shows, as a table: every point, also those that the drawing leaves out."""

from collections.abc import Mapping, Sequence

import polars as pl

from bottomlock.statistics.rms import Array
from bottomlock.tables.campaign import COMPONENTS


def rms_data(
    ensemble: pl.DataFrame,
    trajectory: str,
    quantity: str,
    methods: list[str],
    printed: Sequence[tuple[str, float, float]] = (),
) -> pl.DataFrame:
    """A row per method and second: RMS over runs with its 95 % interval, and what the paper prints where it does.

    Args:
        ensemble: `tables.campaign.ENSEMBLE`.
        trajectory: one of its trajectories.
        quantity: "velocity" or "attitude".
        methods: that are drawn.
        printed: method, time in s and value of the paper; without any there is no column for them.
    """
    at = ["method", "time_s"]
    unit = "mps" if quantity == "velocity" else "deg"
    curves = _of(ensemble, trajectory, methods).select(*at, f"^{quantity}_rms_over_runs_.*$")
    if not printed:
        return curves
    # A time in seconds is a whole number of nanoseconds, but not always the same float.
    time_ns = (pl.col("time_s") * 1e9).round().cast(pl.Int64).alias("time_ns")
    marks = pl.DataFrame(printed, schema=[*at, f"printed_in_paper_{unit}"], orient="row")
    both = curves.with_columns(time_ns).join(
        marks.with_columns(time_ns),
        on=["method", "time_ns"],
        how="full",
        coalesce=True,
        maintain_order="left_right",
    )
    time_s = pl.col("time_s").fill_null(pl.col("time_s_right"))
    return both.with_columns(time_s).drop("time_ns", "time_s_right")


def nees_data(
    ensemble: pl.DataFrame, consistency: pl.DataFrame, trajectory: str, methods: list[str]
) -> pl.DataFrame:
    """A row per method and second: mean NEES of the whole state, and the band of a consistent filter."""
    band = consistency.filter(trajectory=trajectory, quantity="nees").row(0, named=True)
    rows = _of(ensemble, trajectory, methods).drop_nulls("nees_mean_over_runs")
    return rows.select(
        "method",
        "time_s",
        "nees_mean_over_runs",
        band_lo=pl.lit(band["band_lo"]),
        band_hi=pl.lit(band["band_hi"]),
    )


def calibration_data(time_s: Array, curves: Mapping[str, tuple[Array, Array]]) -> pl.DataFrame:
    """A row per method and second: claimed σ and error of velocity, (times,) each, RMS over runs, m/s."""
    return pl.concat(
        pl.DataFrame(
            {"time_s": time_s, "velocity_sd_rms_over_runs_mps": sd, "velocity_rms_over_runs_mps": error}
        ).select(pl.lit(method).alias("method"), pl.all())
        for method, (sd, error) in curves.items()
    )


def normalised_data(normalised_rms: Mapping[str, Array]) -> pl.DataFrame:
    """A row per method and component: error/σ, RMS over runs and times."""
    rows = [
        (method, component, value)
        for method, values in normalised_rms.items()
        for component, value in zip(COMPONENTS, values.tolist(), strict=True)
    ]
    return pl.DataFrame(rows, schema=["method", "component", "error_over_sd_rms"], orient="row")


def sweep_data(rows: pl.DataFrame, level: tuple[str, float] | None) -> pl.DataFrame:
    """A row per value and method: the error in m/s; the level that is drawn across has a row without a value."""
    data = rows.select("trajectory", "parameter", "value", "method", "velocity_rms_over_runs_mps")
    if level is None:
        return data
    across = (*data.row(0)[:2], None, *level)
    return pl.concat([data, pl.DataFrame([across], schema=data.schema, orient="row")])


def _of(table: pl.DataFrame, trajectory: str, methods: list[str]) -> pl.DataFrame:
    """Rows of methods on a trajectory."""
    return table.filter((pl.col("trajectory") == trajectory) & pl.col("method").is_in(methods))
