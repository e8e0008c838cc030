"""What a figure shows as a table: every point, also those that the drawing leaves out as too close to tell apart."""

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl

from bottomlock.figures.series import Panel, Track


def panels_table(panels: Sequence[Panel]) -> pl.DataFrame:
    """A row per time, `time_ns`, with a column `PANEL: CURVE` of each curve and `PANEL: CURVE, σ` where it has one.

    A curve without a value at a time has null there.
    """
    parts = [
        _numbered(
            pl.DataFrame(
                {"time_ns": curve.time_ns, f"{panel.title}: {curve.label}": curve.value}
                | ({} if curve.sd is None else {f"{panel.title}: {curve.label}, σ": curve.sd})
            )
        )
        for panel in panels
        for curve in panel.curves
    ]
    joined = parts[0]
    for part in parts[1:]:
        joined = joined.join(part, on=["time_ns", "nth"], how="full", coalesce=True)
    return joined.sort("time_ns", "nth").drop("nth").fill_nan(None)


def _numbered(curve: pl.DataFrame) -> pl.DataFrame:
    """The rows of one time numbered, so that a log with two at one time keeps both."""
    return curve.with_columns(pl.int_range(pl.len()).over("time_ns").alias("nth"))


def tracks_table(tracks: Mapping[str, Track]) -> pl.DataFrame:
    """A row per track and time: `track`, `time_ns`, `north_m`, `east_m`, `sd_north_m`, `sd_east_m`, `beams_lost`.

    Args:
        tracks: by the name that they have in the table.
    """
    parts = []
    for name, track in tracks.items():
        count = len(track.time_ns)
        columns = {
            "north_m": track.north_m,
            "east_m": track.east_m,
            "sd_north_m": track.sd_north_m,
            "sd_east_m": track.sd_east_m,
            "beams_lost": track.lost,
        }
        parts.append(
            pl.DataFrame(
                {"track": [name] * count, "time_ns": track.time_ns}
                | {key: np.full(count, np.nan) if one is None else one for key, one in columns.items()}
            )
        )
    return pl.concat(parts).fill_nan(None)
