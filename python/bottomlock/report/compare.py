"""Campaigns side by side: the errors of each, and their differences run by run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.campaign_tables import CampaignTables, campaign_folders, read_campaign_tables
from bottomlock.files.overwriting import Files, Result, digests_of
from bottomlock.pages.page import Coloured, Page, Part, Table, html
from bottomlock.pages.pieces import interval, title_of
from bottomlock.statistics.compare import comparison_table, differing_settings, why_unpaired
from bottomlock.text import did_you_mean, number

NAME = "compare"
"""Of the written files: `compare.html` and `.parquet`."""

_INTERVALS = (
    "RMS over runs, NEES as the mean over runs and time; 95 % bootstrap intervals over whole runs. A difference is "
    "green where it is less than zero and red where it is more, its interval excluding zero. Where run k of two "
    "campaigns has the same trajectory and the same random numbers they are paired, and what both share drops out."
)


@dataclass(frozen=True)
class Comparison:
    """The table (`files.columns.COMPARISON`), why pairs are none by trajectory and campaign, and the written page."""

    table: pl.DataFrame
    reference: str
    unpaired: dict[str, dict[str, str]]
    page: Path | None


def compare(
    folders: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    against: str | None = None,
    force: bool = False,
) -> Comparison:
    """Lays campaigns, or the variants in a folder, side by side.

    Args:
        folders: directories of campaigns or of variants.
        out: directory for `compare.html` and `compare.parquet`; nothing is written by default.
        against: label of the campaign that differences are taken to; the first by default.
        force: replace a comparison of other campaigns, or of other tables of theirs, in a directory of its own.

    Raises:
        DataError: for fewer than two campaigns, one that is not finished, an unknown label, and campaigns without a
            common trajectory.
        OutputError: for a directory of something else but these campaigns, a comparison of others without `force`, and
            where the directory cannot be written.
    """
    folders_by_label = campaign_folders([Path(folder) for folder in folders])
    if len(folders_by_label) < 2:
        raise DataError(
            f"{len(folders_by_label)} campaign is named",
            expected="two or more, or a folder of variants (bottomlock run --set)",
        )
    reference = next(iter(folders_by_label)) if against is None else against
    if reference not in folders_by_label:
        hint = did_you_mean(reference, folders_by_label) or ","
        raise DataError(
            f"is '{reference}'{hint} expected one of {', '.join(folders_by_label)}", key="--against"
        )
    result = None if out is None else _result(Path(out), folders, folders_by_label, reference)
    if result is not None:
        result.check(force=force)
    campaigns = {label: read_campaign_tables(folder) for label, folder in folders_by_label.items()}
    theirs = {
        name for label, campaign in campaigns.items() if label != reference for name in campaign.trajectories
    }
    if theirs.isdisjoint(campaigns[reference].trajectories):
        raise DataError(
            f"no other campaign has a trajectory of {reference} ({', '.join(campaigns[reference].trajectories)})",
            hint="scenarios of one name are compared",
        )
    table, unpaired = comparison_table(campaigns, reference), _unpaired(campaigns, reference)
    if result is None:
        return Comparison(table, reference, unpaired, None)
    files: Files = {
        f"{NAME}.parquet": parquet_bytes(table),
        f"{NAME}.html": html(_page(table, campaigns, reference, unpaired)),
    }
    result.write(files, force=force)
    return Comparison(table, reference, unpaired, result.out / f"{NAME}.html")


def _result(out: Path, folders: Sequence[str | Path], labelled: Mapping[str, Path], reference: str) -> Result:
    made_from = digests_of(out, [folder / "manifest.json" for folder in labelled.values()]) | {
        "against": reference
    }
    beside = any(out.resolve() == folder.resolve() for folder in (*map(Path, folders), *labelled.values()))
    return Result(out, NAME, "report", made_from, beside=beside)


def _unpaired(campaigns: Mapping[str, CampaignTables], reference: str) -> dict[str, dict[str, str]]:
    """Why a campaign is not paired with the reference, by trajectory and label."""
    reasons: dict[str, dict[str, str]] = {}
    for label, campaign in campaigns.items():
        for name in campaign.trajectories if label != reference else ():
            if why := why_unpaired(campaigns[reference], campaign, name):
                reasons.setdefault(name, {})[label] = why
    return reasons


def _page(
    table: pl.DataFrame,
    campaigns: Mapping[str, CampaignTables],
    reference: str,
    unpaired: Mapping[str, Mapping[str, str]],
) -> Page:
    """A part a trajectory with a table a quantity, then the settings that differ."""
    numbers = {label: str(place) for place, label in enumerate(campaigns, start=1)}
    parts = []
    for (trajectory,), rows in table.group_by("trajectory", maintain_order=True):
        tables = [
            _quantity_table(part, numbers, _with_unit(str(quantity), str(unit)))
            for (quantity, unit), part in rows.group_by("quantity", "unit", maintain_order=True)
        ]
        parts.append(Part(str(trajectory), title_of(str(trajectory)), tables))
    settings = [[f"`{key}`", *map(str, values)] for key, values in differing_settings(campaigns)]
    columns = ["Setting", *numbers.values()]
    why = [
        f"Not paired: {numbers[label]} on {name} ({why})."
        for name, of in unpaired.items()
        for label, why in of.items()
    ]
    about = "\n".join(
        f"{numbers[label]}. {label.replace(',', ', ')}: {campaign.runs['run'].n_unique()} runs"
        f"{', the reference' if label == reference else ''}"
        for label, campaign in campaigns.items()
    )
    caption = "Settings of the first trajectory in which the campaigns differ."
    parts.append(
        Part(
            "settings",
            "What differs",
            [Table(columns, settings, caption, left=len(columns)), _INTERVALS, *why],
        )
    )
    return Page(f"{len(campaigns)} campaigns side by side", parts, "bottomlock", about=about)


def _with_unit(quantity: str, unit: str) -> str:
    """A title: "NEES", "Velocity at the end, m/s"."""
    return quantity[:1].upper() + quantity[1:] + (f", {unit}" if unit != "1" else "")


def _quantity_table(rows: pl.DataFrame, numbers: Mapping[str, str], title: str) -> Table:
    """A row per method: its value in each campaign, then the differences to the reference."""
    labels = rows["campaign"].unique(maintain_order=True).to_list()
    differing = (
        rows.filter(pl.col("difference").is_not_null())["campaign"].unique(maintain_order=True).to_list()
    )
    cells = []
    for (method,), part in rows.group_by("method", maintain_order=True):
        of = {row["campaign"]: row for row in part.iter_rows(named=True)}
        values = [_value(of[label]) if label in of else "–" for label in labels]
        cells.append([f"`{method}`", *values, *(_difference(of.get(label)) for label in differing)])
    columns = [
        *(numbers[label] for label in labels),
        *(f"{numbers[label]}: difference" for label in differing),
    ]
    return Table(["Method", *columns], cells, f"{title}, with 95 % intervals.")


def _value(row: Mapping[str, Any]) -> str:
    return interval(row["value"], row["lo"], row["hi"])


def _difference(row: Mapping[str, Any] | None) -> str:
    """A difference with its interval, in colours where that excludes zero; a dash where there is none."""
    if row is None or row["difference"] is None:
        return "–"
    value, low, high = (row[f"difference{end}"] for end in ("", "_lo", "_hi"))
    sign, note = "+" if value > 0 else "", "" if row["paired"] else " unpaired"
    cell = f"{sign}{number(value, 2)}{note}<br>{number(low, 2)} … {number(high, 2)}"
    return Coloured(cell, "less" if high < 0 else "more" if low > 0 else "")
