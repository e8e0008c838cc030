"""Statistics of a replay: tables in, tables out."""

import polars as pl

from bottomlock.files.replay_tables import REPLAY_RUNS, SIGMAS
from bottomlock.statistics.rms import rms_column, root_mean
from bottomlock.units import DEGREES_PER_RADIAN

_KEYS = ["case", "what_if", "method", "pass"]
_NAMED = (("position", "m"), ("velocity", "mps"), ("attitude", "deg"))


_ENDS = {
    "position": ("north_m", "east_m", "down_m"),
    "misalignment": ("north_rad", "east_rad", "down_rad"),
    "velocity": ("surge_mps", "sway_mps", "heave_mps"),
}


def _norm(kind: str, what: str, ends: tuple[str, ...]) -> pl.Expr:
    # A row with a missing component has no norm.
    return sum((pl.col(f"{kind}_{what}_{end}") ** 2 for end in ends), pl.lit(0.0)).sqrt()


def _compared(samples: pl.DataFrame, what: str) -> tuple[str, ...]:
    """Axes that are compared: without down where the reference has positions and no height."""
    ends = _ENDS[what]
    level = ends[:2]
    if what == "position" and samples["err_position_down_m"].count() == 0:
        return level if samples["err_position_north_m"].count() else ends
    return ends


def _fraction_within(what: str, sigmas: int, ends: tuple[str, ...]) -> pl.Expr:
    """Fraction of the axes whose error is at most so many claimed σ."""
    pairs = [(f"err_{what}_{end}", f"sd_{what}_{end}") for end in ends]
    within = [(pl.col(e).abs() <= sigmas * pl.col(s)).cast(pl.Float64) for e, s in pairs]
    return sum(within, pl.lit(0.0)) / len(within)


def error_norms(samples: pl.DataFrame) -> pl.DataFrame:
    """Norms of the errors and of the claimed σ; over the axes, mean square of error/σ and fraction within 1, 2, 3 σ.

    Positions are compared on the level alone where the reference has no height.
    """
    columns = []
    for what, unit, scale in (
        ("position", "m", 1.0),
        ("velocity", "mps", 1.0),
        ("misalignment", "deg", DEGREES_PER_RADIAN),
    ):
        name = "attitude" if what == "misalignment" else what
        ends = _compared(samples, what)
        columns += [
            (_norm("err", what, ends) * scale).alias(f"{name}_{unit}"),
            (_norm("sd", what, ends) * scale).alias(f"{name}_sd_{unit}"),
            (
                sum(
                    ((pl.col(f"err_{what}_{end}") / pl.col(f"sd_{what}_{end}")) ** 2 for end in ends),
                    pl.lit(0.0),
                )
                / len(ends)
            ).alias(f"{name}_normalised_square"),
            *(_fraction_within(what, k, ends).alias(f"{name}_within_{k}sigma") for k in SIGMAS),
        ]
    return samples.select(*_KEYS, "time_ns", *columns)


def runs_table(
    samples: pl.DataFrame,
    innovations: pl.DataFrame,
    pings: pl.DataFrame,
    imu_faults: pl.DataFrame,
    path: pl.DataFrame | None,
    start_ns: int,
) -> pl.DataFrame:
    """A row per what-if case, method and pass (`files.replay_tables.REPLAY_RUNS`); distance from `start_ns` on.

    The counts of `imu_faults` (`files.replay_tables.IMU_FAULTS`) are those of every method.
    """
    norms = error_norms(samples)
    reached = pl.col("time_ns").is_between(start_ns, pl.lit(samples["time_ns"].max()))
    distance = None if path is None else _distance(path.filter(reached))
    table = norms.group_by(_KEYS, maintain_order=True).agg(
        pl.col("position_m").last().alias("position_final_m"),
        rms_column("position_m").alias("position_rms_over_time_m"),
        pl.col("velocity_mps").last().alias("velocity_final_mps"),
        rms_column("velocity_mps").alias("velocity_rms_over_time_mps"),
        pl.col("attitude_deg").last().alias("attitude_final_deg"),
        rms_column("attitude_deg").alias("attitude_rms_over_time_deg"),
        # The first row is the start itself, whose standard deviations are given.
        *(
            root_mean(pl.col(f"{name}_normalised_square").slice(1)).alias(f"{name}_normalised_rms_over_time")
            for name, _ in _NAMED
        ),
        *(
            pl.col(f"{name}_within_{k}sigma").slice(1).mean().alias(f"{name}_covered_{k}sigma")
            for name, _ in _NAMED
            for k in SIGMAS
        ),
    )
    gate = innovations.group_by("case", "what_if", "method", maintain_order=True).agg(
        pl.col("nis").mean().alias("nis_mean_over_fixes"),
        pl.col("degrees").filter(pl.col("nis").is_not_null()).mean().alias("nis_degrees_mean_over_fixes"),
        *(
            (pl.col("status") == status).sum().cast(pl.Int64).alias(f"fixes_{name}")
            for status, name in (
                ("accepted", "accepted"),
                ("accepted_in_part", "in_part"),
                ("rejected", "rejected"),
            )
        ),
    )
    beams = pings.with_columns(pl.sum_horizontal(pl.col("^beam[0-9]+_valid$").cast(pl.Int64)).alias("beams"))
    returning = beams.group_by("case", "what_if", maintain_order=True).agg(
        pl.col("beams").mean().alias("beams_mean_over_pings")
    )
    joined = table.join(gate, on=["case", "what_if", "method"], how="left", maintain_order="left").join(
        returning, on=["case", "what_if"], how="left", maintain_order="left"
    )
    joined = joined.join(imu_faults, on=["case", "what_if"], how="left", maintain_order="left")
    joined = joined.with_columns(pl.lit(distance, dtype=pl.Float64).alias("distance_m"))
    percent = (100.0 * pl.col("position_final_m") / pl.col("distance_m")).alias("position_final_percent")
    return joined.with_columns(percent).select(list(REPLAY_RUNS))


def _distance(path: pl.DataFrame) -> float:
    """Distance travelled by the reference, m."""
    steps = [pl.col(f"{axis}_m").diff() ** 2 for axis in ("north", "east", "down")]
    return float(path.select(pl.sum_horizontal(steps).sqrt().sum()).item())


_FATES = ("accepted", "in_part", "rejected")


def summary_table(runs: pl.DataFrame) -> pl.DataFrame:
    """A row per what-if case, method and pass: the numbers of the runs, and fixes; for a terminal and a report."""
    fixes = sum((pl.col(f"fixes_{name}") for name in _FATES), pl.lit(0))
    return runs.with_columns(fixes=fixes, rejected_fraction=pl.col("fixes_rejected") / fixes)


def track_table(samples: pl.DataFrame) -> pl.DataFrame:
    """A row per what-if case, method and pass: where its track ends, σ there, its way and mean speed.

    The way is that of the horizontal positions at the times of the samples.
    """
    step = (pl.col("north_m").diff() ** 2 + pl.col("east_m").diff() ** 2).sqrt()
    seconds = (pl.col("time_ns").last() - pl.col("time_ns").first()) * 1e-9
    keys = ["what_if", "method", "pass"]
    table = samples.group_by(keys, maintain_order=True).agg(
        *(pl.col(f"{axis}_m").last() for axis in ("north", "east", "down")),
        *(pl.col(f"sd_position_{axis}_m").last() for axis in ("north", "east", "down")),
        step.sum().alias("way_m"),
        seconds.alias("seconds"),
    )
    return table.with_columns((pl.col("way_m") / pl.col("seconds")).alias("speed_mps"))
