"""Tables of the studies over many campaigns: column names, types, meanings."""

from collections.abc import Mapping
from pathlib import Path

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.records import read_record

VARIANTS = "variants.json"
"""In a folder of variants: their folders and values."""

KIND = "variants"

COMPARISON: Mapping[str, pl.DataType] = {
    "campaign": pl.String(),
    "trajectory": pl.String(),
    "method": pl.String(),
    "quantity": pl.String(),
    "unit": pl.String(),
    "runs": pl.Int64(),
    "value": pl.Float64(),
    "lo": pl.Float64(),
    "hi": pl.Float64(),
    "reference": pl.String(),
    "paired": pl.Boolean(),
    "difference": pl.Float64(),
    "difference_lo": pl.Float64(),
    "difference_hi": pl.Float64(),
}
"""A row per campaign, trajectory, method and quantity: the value over the runs with its 95 % interval, and its
difference to the same of the reference campaign with its own; null for the reference, and where it has no such row."""


def campaign_folders(folders: list[Path]) -> dict[str, Path]:
    """Campaigns by a short label, in order: a folder of variants stands for each of them.

    Raises:
        DataError: for a folder that is not there, a variant that has not been run, and one campaign named twice.
    """
    found: dict[str, Path] = {}
    for folder in folders:
        if not folder.is_dir():
            raise DataError("no such directory", place=folder, hint="`bottomlock run` makes one")
        record = read_record(folder / VARIANTS)
        if record is None or record.get("kind") != KIND:
            inside = {_label(folder, folders): folder}
        else:
            parent = f"{_label(folder, folders)}/" if len(folders) > 1 else ""
            inside = {f"{parent}{name}": folder / name for name in record["variants"]}
        for label, path in inside.items():
            if path.resolve() in {other.resolve() for other in found.values()}:
                raise DataError("is named twice", place=path)
            found[label] = path
    return found


def _label(folder: Path, folders: list[Path]) -> str:
    """The folder's name, or the path where two share it."""
    names = [one.resolve().name for one in folders]
    name = folder.resolve().name
    return str(folder) if names.count(name) > 1 else name


SWEEP: Mapping[str, pl.DataType] = {
    "parameter": pl.String(),
    "value": pl.String(),
    "trajectory": pl.String(),
    "method": pl.String(),
    "velocity_rms_over_runs_mps": pl.Float64(),
    "attitude_rms_over_runs_deg": pl.Float64(),
    "nees_mean_over_runs_and_time": pl.Float64(),
    "rejected_fraction": pl.Float64(),
}
"""A row per value of a swept setting, trajectory and method: norms of the error vectors at the last second, RMS over
runs; mean NEES of the whole state; fraction of the fixes that the gate rejects, null without fixes."""

VIRTUAL_BEAM_FACTOR = "n_f of VB"
"""The swept factor of `vb` that the paper does not print, in `parameter`."""

CURRENT = "current to the east, m/s"
"""The swept setting in `parameter` that no method without a current as a state holds."""

STUDY: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "beams": pl.String(),
    "sensors": pl.String(),
    "method": pl.String(),
    "runs": pl.Int64(),
    "velocity_rms_over_runs_mps": pl.Float64(),
    "velocity_rms_over_runs_lo_mps": pl.Float64(),
    "velocity_rms_over_runs_hi_mps": pl.Float64(),
    "velocity_greatest_mps": pl.Float64(),
    "attitude_rms_over_runs_deg": pl.Float64(),
    "attitude_rms_over_runs_lo_deg": pl.Float64(),
    "attitude_rms_over_runs_hi_deg": pl.Float64(),
    "position_rms_over_runs_m": pl.Float64(),
    **{
        f"{quantity}{end}": pl.Float64()
        for quantity in ("nees_velocity_attitude", "nees")
        for end in ("", "_least", "_greatest", "_lo", "_hi")
    },
    "nis": pl.Float64(),
    "rejected_fraction": pl.Float64(),
    "verdict_velocity_attitude": pl.String(),
    "verdict_whole_state": pl.String(),
    "verdict": pl.String(),
}
"""A row per cell of a study. Errors at the last second, RMS over runs with 95 % bootstrap interval (`_lo_`, `_hi_`),
and the greatest velocity error of a run. Mean NEES over runs and time, the least and the greatest mean over runs at the
judged times, and the band of these means (`_lo`, `_hi`). Mean NIS over runs and fixes, and the fraction of the fixes
that the gate rejects, both null without fixes. The verdict is "overconfident" where either NEES is, else that of
velocity and attitude."""

PUBLISHED: Mapping[str, pl.DataType] = {
    "world": pl.String(),
    "method": pl.String(),
    "trajectory": pl.String(),
    "beams": pl.String(),
    "verdict_velocity_attitude": pl.String(),
    "verdict": pl.String(),
}
"""A row per cell of the published studies, as `STUDY` has it."""


CLAIMS: Mapping[str, pl.DataType] = {
    "claim": pl.String(),
    "trajectory": pl.String(),
    "quantity": pl.String(),
    "paper": pl.Float64(),
    "ours": pl.Float64(),
    "lo": pl.Float64(),
    "hi": pl.Float64(),
    "verdict": pl.String(),
    "note": pl.String(),
}
"""A row per claim of the paper: the printed number (null where it prints an ordering), ours with its 95 % bootstrap
interval (null where it cannot be tested), the verdict and what was measured about it."""
