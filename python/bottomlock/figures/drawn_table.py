"""What a figure shows as a table: every point, also those that the drawing leaves out as too close to tell apart."""

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl

from bottomlock.figures.series import Panel, Track


def panels_table(panels: Sequence[Panel]) -> pl.DataFrame:
    """A row per panel, curve and time: `panel`, `curve`, `time_ns`, `value`, `sd`; null where there is none."""
    parts = [
        pl.DataFrame(
            {
                "panel": [panel.title] * len(curve.time_ns),
                "curve": curve.label,
                "time_ns": curve.time_ns,
                "value": curve.value,
                "sd": np.full(len(curve.time_ns), np.nan) if curve.sd is None else curve.sd,
            }
        )
        for panel in panels
        for curve in panel.curves
    ]
    return pl.concat(parts).fill_nan(None)


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
