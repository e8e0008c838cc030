"""Numbers and times as text, and the formats of rows of numbers: CSV, and TUM, `time_s x y z qx qy qz qw` a line."""

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.export.tracks import ExportTrack

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


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


def tum(track: ExportTrack) -> str:
    """A trajectory, m, after a line with frames and description that begins with #.

    Of a track without an attitude the orientation is the identity, not to be compared.

    Raises:
        DataError: for a track without positions.
    """
    orientation = track.orientation_enu_flu
    if orientation is None:
        orientation = np.tile(IDENTITY, (len(track.time_ns), 1))
    position = track.position_enu_m
    if position is None:
        raise DataError(
            "has velocities and no positions, which TUM needs", place=track.name, hint="export csv or mcap"
        )
    rows = np.hstack([position, orientation])
    lines = (
        " ".join([seconds(time_ns), *map(decimal, row)])
        for time_ns, row in zip(track.time_ns, rows, strict=True)
    )
    described = track.description.replace("\n", " ")
    frames = f"east north up from the origin, orientation of forward left up; {described}"
    return "\n".join([f"# {frames}", *lines]) + "\n"


def decimal(value: float) -> str:
    """The shortest decimal number that reads back as the same double, without an exponent.

    >>> decimal(54.1), decimal(-1e-7), decimal(12.0)
    ('54.1', '-0.0000001', '12')
    """
    return np.format_float_positional(value, trim="-")


def seconds(time_ns: int) -> str:
    """A time in seconds, exact to the nanosecond.

    >>> seconds(1_767_225_610_250_000_001), seconds(-1)
    ('1767225610.250000001', '-0.000000001')
    """
    whole, rest = divmod(abs(int(time_ns)), 10**9)
    return f"{'-' if time_ns < 0 else ''}{whole}.{rest:09d}"


def utc(time_ns: int) -> str:
    """Unix time in ISO 8601, exact to the nanosecond; the fraction is left out where it is zero.

    >>> utc(1_767_225_610_250_000_001), utc(1_767_225_610 * 10**9)
    ('2026-01-01T00:00:10.250000001Z', '2026-01-01T00:00:10Z')
    """
    whole, rest = divmod(int(time_ns), 10**9)
    fraction = f".{rest:09d}".rstrip("0").rstrip(".")
    return f"{np.datetime64(whole, 's')}{fraction}Z"
