"""CSV: every column of a track, the claimed standard deviations and the beams that were valid."""

import polars as pl

from bottomlock.replay.export.decimals import utc
from bottomlock.replay.export.tracks import ExportTrack


def comma_separated(track: ExportTrack, pings: pl.DataFrame) -> str:
    """The columns of `samples`, or of `reference`, after `utc`; with the beams of the last ping up to each time.

    Args:
        track: the track.
        pings: the table of the replay.

    `utc` is empty where the clock of the case is not UTC.
    """
    rows = track.rows
    times = [utc(time_ns) for time_ns in track.time_ns] if track.is_utc else [None] * rows.height
    rows = rows.select(pl.Series("utc", times, dtype=pl.String()), pl.all())
    if track.what_if:
        rows = rows.join_asof(_beams(pings, track), on="time_ns")
    return rows.write_csv()


def _beams(pings: pl.DataFrame, track: ExportTrack) -> pl.DataFrame:
    """A row a ping: its time, the number of its valid beams, and which."""
    valid = [name for name in pings.columns if name.endswith("_valid")]
    return pings.filter((pl.col("what_if") == track.what_if) & (pl.col("run") == pl.col("run").min())).select(
        "time_ns",
        pl.col("time_ns").alias("ping_time_ns"),
        pl.sum_horizontal(valid).cast(pl.Int64).alias("beams_valid"),
        *valid,
    )
