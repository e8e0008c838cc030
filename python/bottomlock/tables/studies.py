"""Tables of the studies over many campaigns: column names, types, meanings."""

from pathlib import Path

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.records import read_record
from bottomlock.tables.schema import Schema, schema

VARIANTS = "variants.json"
"""In a folder of variants: their folders and values."""

KIND = "variants"

COMPARISON: Schema = schema(
    "campaign trajectory method quantity unit: text",
    "runs: int",
    "value lo hi: float",
    "reference: text",
    "paired: flag",
    "difference difference_lo difference_hi: float",
)
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


SWEEP: Schema = schema(
    "parameter value trajectory method: text",
    "velocity_rms_over_runs_mps attitude_rms_over_runs_deg nees_mean_over_runs_and_time: float",
    "rejected_fraction: float",
)
"""A row per value of a swept setting, trajectory and method: norms of the error vectors at the last second, RMS over
runs; mean NEES of the whole state; fraction of the fixes that the gate rejects, null without fixes."""

VIRTUAL_BEAM_FACTOR = "n_f of VB"
"""The swept factor of `vb` that the paper does not print, in `parameter`."""

CURRENT = "current to the east, m/s"
"""The swept setting in `parameter` that no method without a current as a state holds."""

STUDY: Schema = schema(
    "trajectory beams sensors method: text",
    "runs: int",
    "velocity_rms_over_runs_mps velocity_rms_over_runs_lo_mps velocity_rms_over_runs_hi_mps: float",
    "velocity_greatest_mps attitude_rms_over_runs_deg attitude_rms_over_runs_lo_deg: float",
    "attitude_rms_over_runs_hi_deg position_rms_over_runs_m: float",
    {
        f"{quantity}{end}": pl.Float64()
        for quantity in ("nees_velocity_attitude", "nees")
        for end in ("", "_least", "_greatest", "_lo", "_hi")
    },
    "nis rejected_fraction: float",
    "verdict_velocity_attitude verdict_whole_state verdict: text",
)
"""A row per cell of a study. Errors at the last second, RMS over runs with 95 % bootstrap interval (`_lo_`, `_hi_`),
and the greatest velocity error of a run. Mean NEES over runs and time, the least and the greatest mean over runs at the
judged times, and the band of these means (`_lo`, `_hi`). Mean NIS over runs and fixes, and the fraction of the fixes
that the gate rejects, both null without fixes. The verdict is "overconfident" where either NEES is, else that of
velocity and attitude."""

PUBLISHED: Schema = schema("world method trajectory beams verdict_velocity_attitude verdict: text")
"""A row per cell of the published studies, as `STUDY` has it."""


CLAIMS: Schema = schema("claim trajectory quantity: text", "paper ours lo hi: float", "verdict note: text")
"""A row per claim of the paper: the printed number (null where it prints an ordering), ours with its 95 % bootstrap
interval (null where it cannot be tested), the verdict and what was measured about it."""
