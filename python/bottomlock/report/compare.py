"""Campaigns side by side as one page, with a table and a figure for each quantity."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.figures.compare import compare_figure
from bottomlock.figures.images import images_of
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Files, Result, digests_of
from bottomlock.pages.numbers import number
from bottomlock.pages.page import Page, Part, Picture, Table, html
from bottomlock.pages.pieces import difference, glossary, interval, title_of
from bottomlock.statistics.compare import QUANTITIES, comparison_table, differing_settings, why_unpaired
from bottomlock.support.nearest import did_you_mean
from bottomlock.tables.results import CampaignTables, read_campaign_tables
from bottomlock.tables.spreadsheet import csv_text
from bottomlock.tables.variants import campaign_folders

NAME = "compare"
"""Of the written files: `compare.html`, `.parquet` and `.csv`."""

ROOM = 14
"""Longest label that stands above a column beside its number."""

_INTERVALS = (
    "RMS over runs, NEES as the mean over runs and time; 95 % bootstrap intervals over whole runs. A difference is "
    "green where it is less than zero and red where it is more, its interval excluding zero. `compare.parquet` and "
    "`compare.csv` hold every number."
)


@dataclass(frozen=True)
class Comparison:
    """The table, why pairs are none, and the written page."""

    table: pl.DataFrame
    reference: str
    unpaired: dict[str, dict[str, str]]
    page: Path


def compare(
    folders: Sequence[str | Path], out: str | Path, *, against: str | None = None, force: bool = False
) -> Comparison:
    """Lays campaigns, or the variants in a folder, side by side; writes table, page and figures to `out`.

    Args:
        folders: directories of campaigns or of variants.
        out: directory for `compare.html`, `compare.parquet`, `compare.csv` and `figures/`.
        against: label of the campaign that differences are taken to; the first by default.
        force: replace a comparison of other campaigns, or of other tables of theirs, in a directory of its own.

    Raises:
        DataError: for fewer than two campaigns, one that is not finished, an unknown label, and campaigns without a
            common trajectory.
        OutputError: for a directory of something else but these campaigns, a comparison of others without `force`, and
            where the directory cannot be written.
    """
    out = Path(out)
    found = campaign_folders([Path(folder) for folder in folders])
    if len(found) < 2:
        raise DataError(
            f"{len(found)} campaign is named, expected two or more, or a folder of variants (bottomlock run --set)"
        )
    reference = next(iter(found)) if against is None else against
    if reference not in found:
        hint = did_you_mean(reference, found) or ","
        raise DataError(f"--against is '{reference}'{hint} expected one of {', '.join(found)}")
    made_from = digests_of(out, [folder / "manifest.json" for folder in found.values()]) | {
        "against": reference
    }
    beside = any(out.resolve() == folder.resolve() for folder in (*map(Path, folders), *found.values()))
    result = Result(out, NAME, NAME, made_from, beside=beside)
    result.check(force=force)
    campaigns = {label: read_campaign_tables(folder) for label, folder in found.items()}
    shared = [name for name in campaigns[reference].trajectories if _in_others(campaigns, reference, name)]
    if not shared:
        raise DataError(
            f"no other campaign has a trajectory of {reference} "
            f"({', '.join(campaigns[reference].trajectories)}); scenarios of one name are compared"
        )
    table = comparison_table(campaigns, reference)
    unpaired = _unpaired(campaigns, reference)
    files: Files = {
        f"{NAME}.parquet": parquet_bytes(table),
        f"{NAME}.csv": csv_text(table, float_precision=10),
    }
    numbered = {label: place for place, label in enumerate(campaigns, start=1)}
    parts = [_part(table, campaigns, name, numbered, files) for name in _trajectories(campaigns)]
    methods = glossary(table["method"].unique(maintain_order=True))
    settings = _settings_part(campaigns, numbered, reference, unpaired)
    laid_out = Page(
        f"{len(campaigns)} campaigns side by side", [],
        [*parts, settings, Part("methods", "Methods", [methods])],
        "bottomlock",
        about="\n".join(
            f"{place}. {label.replace(',', ', ')}: {campaigns[label].runs['run'].n_unique()} runs"
            f"{', the reference' if label == reference else ''}"
            for label, place in numbered.items()
        ),
    )  # fmt: skip
    page = out / f"{NAME}.html"
    result.write(files | {page.name: html(laid_out)}, force=force)
    return Comparison(table, reference, unpaired, page)


def _in_others(campaigns: Mapping[str, CampaignTables], reference: str, name: str) -> bool:
    return any(name in one.trajectories for label, one in campaigns.items() if label != reference)


def _trajectories(campaigns: Mapping[str, CampaignTables]) -> list[str]:
    return list(dict.fromkeys(name for campaign in campaigns.values() for name in campaign.trajectories))


def _unpaired(campaigns: Mapping[str, CampaignTables], reference: str) -> dict[str, dict[str, str]]:
    """Why a campaign is not paired with the reference, by trajectory and label."""
    found: dict[str, dict[str, str]] = {}
    for name in _trajectories(campaigns):
        for label, campaign in campaigns.items():
            why = "" if label == reference else why_unpaired(campaigns[reference], campaign, name)
            if why and name in campaign.trajectories:
                found.setdefault(name, {})[label] = why
    return found


def _short(label: str, numbered: Mapping[str, int]) -> str:
    """A campaign as the head of a column: its number, and a label that has room."""
    return f"{numbered[label]} {label}" if len(label) <= ROOM else str(numbered[label])


def _part(
    table: pl.DataFrame,
    campaigns: Mapping[str, CampaignTables],
    trajectory: str,
    numbered: Mapping[str, int],
    files: Files,
) -> Part:
    """A trajectory's part of the page; its figures go to the files."""
    rows = table.filter(pl.col("trajectory") == trajectory)
    labels = rows["campaign"].unique(maintain_order=True).to_list()
    pictures, tables = [], []
    for place, quantity in enumerate(QUANTITIES):
        here = rows.filter(pl.col("quantity") == quantity)
        if here.is_empty():
            continue
        images = images_of(compare_figure(table, trajectory, quantity))
        name = f"{NAME}_{trajectory}_{re.sub('[^a-z]+', '_', quantity.lower())}"
        own = images.files(f"figures/{name}")
        files |= own
        title = f"{quantity[0].upper()}{quantity[1:]} on {trajectory.replace('_', ' ')}"
        caption = f"{title}, 95 % intervals; numbers as above."
        if quantity == "NEES":
            degrees = {one.manifest.get("nees_degrees", {}).get(trajectory) for one in campaigns.values()}
            words = " or ".join(str(one) for one in sorted(degrees - {None}))
            caption += f" A consistent filter has {words}." if words else ""
        picture = Picture.of_svg(images.svg, f"f{place}_{trajectory}", caption, kind="", files=list(own))
        pictures.append(picture)
        unit = "" if here["unit"][0] == "1" else f", {here['unit'][0]}"
        tables.append(_quantity_table(here, labels, numbered, f"{title}{unit}"))
    return Part(trajectory, title_of(trajectory), [*pictures, *tables])


def _quantity_table(
    rows: pl.DataFrame, labels: Sequence[str], numbered: Mapping[str, int], title: str
) -> Table:
    """A row per method: its value in each campaign, then the differences to the reference."""
    compared = [label for label in labels if (rows["campaign"] == label).any()]
    differing = [
        label
        for label in compared
        if rows.filter(pl.col("campaign") == label)["difference"].is_not_null().any()
    ]
    cells = []
    for (method,), part in rows.group_by("method", maintain_order=True):
        of = {row["campaign"]: row for row in part.iter_rows(named=True)}
        values = [_value(of[label]) if label in of else "–" for label in compared]
        cells.append([f"`{method}`", *values, *(_difference(of.get(label)) for label in differing)])
    columns = [_short(label, numbered) for label in compared]
    columns += [f"{numbered[label]}: difference" for label in differing]
    return Table(["Method", *columns], cells, f"{title}, with 95 % intervals.")


def _value(row: Mapping[str, Any]) -> str:
    return interval(row["value"], row["lo"], row["hi"], number)


def _difference(row: Mapping[str, Any] | None) -> str:
    unpaired = row is not None and not row["paired"]
    return difference(row, lambda value: number(value, 2), " unpaired" if unpaired else "")


def _settings_part(
    campaigns: Mapping[str, CampaignTables],
    numbered: Mapping[str, int],
    reference: str,
    unpaired: Mapping[str, Mapping[str, str]],
) -> Part:
    """The settings that differ, and how the differences are made."""
    settings = differing_settings(campaigns)
    rows = [[f"`{key}`", *map(str, values)] for key, values in settings]
    columns = ["Setting", *(_short(label, numbered) for label in campaigns)]
    caption = "Settings of the first trajectory in which the campaigns differ."
    same = "run k of each has the same trajectory and the same random numbers"
    paired = f"All are paired: {same}, so that what both share drops out."
    if unpaired:
        these = "; ".join(
            ", ".join(
                f"{numbered[label]} on {trajectory.replace('_', ' ')} ({why})" for label, why in of.items()
            )
            for trajectory, of in unpaired.items()
        )
        paired = f"Not paired, so that their intervals are wider: {these}. All others are paired: {same}."
    return Part(
        "settings",
        "What differs",
        [
            Table(columns, rows, caption, left=len(columns))
            if rows
            else "No setting of the first trajectory differs.",
            f"Differences are to campaign {numbered[reference]}. {paired}",
            _INTERVALS,
        ],
    )
