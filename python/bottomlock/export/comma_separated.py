"""CSV: every column of a track, the claimed standard deviations and the beams that were valid."""

import polars as pl

from bottomlock.export.decimals import utc
from bottomlock.export.tracks import ExportTrack


def comma_separated(track: ExportTrack, pings: pl.DataFrame | None) -> str:
    """The columns of the track's rows after `utc`; with the beams of the last ping up to each time.

    Args:
        track: the track.
        pings: of its group; None for none.

    `utc` is empty where the clock is not UTC.
    """
    rows = track.rows
    times = [utc(time_ns) for time_ns in track.time_ns] if track.is_utc else [None] * rows.height
    rows = rows.select(pl.Series("utc", times, dtype=pl.String()), pl.all())
    if pings is not None:
        rows = rows.join_asof(_beams(pings), on="time_ns")
    return rows.write_csv()


def _beams(pings: pl.DataFrame) -> pl.DataFrame:
    """A row a ping: its time, the number of its valid beams, and which."""
    valid = [name for name in pings.columns if name.endswith("_valid")]
    return pings.select(
        "time_ns",
        pl.col("time_ns").alias("ping_time_ns"),
        pl.sum_horizontal(valid).cast(pl.Int64).alias("beams_valid"),
        *valid,
    )
