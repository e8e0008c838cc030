"""The table of what was sent: a row a ping, with its truth, so that a test can judge what a receiver made of it."""

from typing import Any

import numpy as np
import polars as pl

from bottomlock.instruments.readings import Readings
from bottomlock.instruments.schedule import Record

_AXES = {
    "position_t_m": ("true_north_m", "true_east_m", "true_down_m"),
    "velocity_p_mps": ("true_surge_mps", "true_sway_mps", "true_heave_mps"),
    "rpy_rad": ("true_roll_rad", "true_pitch_rad", "true_yaw_rad"),
}


def sent_table(readings: Readings, records: list[Record]) -> pl.DataFrame:
    """A row a ping that was due.

    Returns:
        Columns: number; time_ns, trigger_ns and transmission_ns on the true clock; stated_time_ns and
        stated_transmission_ns as the record states them; bytes sent; faults, joined by "+", "" for none; beamK_mps,
        beamK_valid, beamK_range_m as measured, null where lost; sent_beamK_mps as the record holds them (those of
        another ping in a stale one); velocity_valid, whether the record states a velocity; and the true states at the
        ping (true_surge_mps ...), null for a recording.
    """
    pairs = [
        (one, one.ping, one.stated) for one in records if one.ping is not None and one.stated is not None
    ]
    columns: dict[str, Any] = {
        "number": pl.Series([ping.number for _, ping, _ in pairs], dtype=pl.Int64),
        "time_ns": pl.Series([ping.time_ns for _, ping, _ in pairs], dtype=pl.Int64),
        "trigger_ns": pl.Series([ping.sent_ns for _, ping, _ in pairs], dtype=pl.Int64),
        "transmission_ns": pl.Series([one.due_ns for one, _, _ in pairs], dtype=pl.Int64),
        "stated_time_ns": pl.Series([stated.time_ns for _, _, stated in pairs], dtype=pl.Int64),
        "stated_transmission_ns": pl.Series([s.transmission_ns for _, _, s in pairs], dtype=pl.Int64),
        "bytes": pl.Series([len(one.data) for one, _, _ in pairs], dtype=pl.Int64),
        "faults": pl.Series(["+".join(sorted(one.faults)) for one, _, _ in pairs], dtype=pl.String),
        "velocity_valid": pl.Series([s.velocity_p_mps is not None for _, _, s in pairs], dtype=pl.Boolean),
    }
    beams = readings.geometry.beams
    own = np.array([ping.beam_velocity_mps for _, ping, _ in pairs], dtype=np.float64).reshape(-1, beams)
    held = np.array([s.beam_velocity_mps for _, _, s in pairs], dtype=np.float64).reshape(-1, beams)
    ranges = np.array([ping.range_m for _, ping, _ in pairs], dtype=np.float64).reshape(-1, beams)
    for k in range(beams):
        columns[f"beam{k + 1}_mps"] = own[:, k]
        columns[f"beam{k + 1}_valid"] = np.isfinite(own[:, k])
        columns[f"beam{k + 1}_range_m"] = ranges[:, k]
        columns[f"sent_beam{k + 1}_mps"] = held[:, k]
    rows = [ping.number - 1 for _, ping, _ in pairs]
    for name, axes in _AXES.items():
        states = None if readings.truth is None else getattr(readings.truth, name)[rows]
        for k, axis in enumerate(axes):
            columns[axis] = np.full(len(rows), np.nan) if states is None else states[:, k]
    return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None))
