"""Folders of variants, and the table that lays campaigns side by side."""

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
