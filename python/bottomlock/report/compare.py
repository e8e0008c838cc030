"""Campaigns side by side as one page, with a table and a figure for each quantity."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from markupsafe import Markup

from bottomlock.errors import DataError
from bottomlock.figures.compare import compare_figure
from bottomlock.figures.inline_svg import inline_svg
from bottomlock.figures.palette import png_bytes, svg_text
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Files, Result, digests_of
from bottomlock.pages.render import render
from bottomlock.statistics.compare import QUANTITIES, comparison_table, differing_settings, why_unpaired
from bottomlock.support.nearest import did_you_mean
from bottomlock.tables.results import CampaignTables, read_campaign_tables
from bottomlock.tables.spreadsheet import csv_text
from bottomlock.tables.variants import campaign_folders

NAME = "compare"
"""Of the written files: `compare.html`, `.parquet` and `.csv`."""


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
    content = {
        "campaigns": campaigns,
        "numbers": {label: number for number, label in enumerate(campaigns, start=1)},
        "reference": reference,
        "settings": differing_settings(campaigns),
        "unpaired": unpaired,
        "parts": [_part(table, campaigns, name, files) for name in _trajectories(campaigns)],
    }
    page = out / f"{NAME}.html"
    result.write(files | {page.name: render("compare.html.j2", content)}, force=force)
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


def _part(
    table: pl.DataFrame,
    campaigns: Mapping[str, CampaignTables],
    trajectory: str,
    files: Files,
) -> dict[str, Any]:
    """A trajectory's part of the page; its figures go to the files."""
    rows = table.filter(pl.col("trajectory") == trajectory)
    quantities = []
    for number, quantity in enumerate(QUANTITIES):
        here = rows.filter(pl.col("quantity") == quantity)
        if here.is_empty():
            continue
        figure = compare_figure(table, trajectory, quantity)
        svg, name = svg_text(figure), f"{NAME}_{trajectory}_{re.sub('[^a-z]+', '_', quantity.lower())}"
        files |= {f"figures/{name}.svg": svg, f"figures/{name}.png": png_bytes(figure)}
        title = f"{quantity[0].upper()}{quantity[1:]} on {trajectory.replace('_', ' ')}"
        caption = f"{title}, 95 % intervals; numbers as above."
        if quantity == "NEES":
            degrees = {one.manifest.get("nees_degrees", {}).get(trajectory) for one in campaigns.values()}
            words = " or ".join(str(one) for one in sorted(degrees - {None}))
            caption += f" A consistent filter has {words}." if words else ""
        quantities.append(
            {
                "name": quantity,
                "unit": here["unit"][0],
                "svg": Markup(inline_svg(svg, f"f{number}_{trajectory}", caption)),  # noqa: S704 - our own, escaped there
                "caption": caption,
                "cells": {
                    method: {row["campaign"]: row for row in part.iter_rows(named=True)}
                    for (method,), part in here.group_by("method", maintain_order=True)
                },
            }
        )
    labels = rows["campaign"].unique(maintain_order=True).to_list()
    methods = rows["method"].unique(maintain_order=True).to_list()
    return {"trajectory": trajectory, "labels": labels, "methods": methods, "quantities": quantities}
