"""A finished campaign as one page, with its figures and the verdicts on the paper's claims."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from markupsafe import Markup

from bottomlock.figures.images import Images, image_process
from bottomlock.figures.inline_svg import inline_svg
from bottomlock.figures.palette import STROKES
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Files, Result, digests_of
from bottomlock.pages.featured import featured
from bottomlock.pages.render import render
from bottomlock.paper.claims import Claim, ImprovementClaim, Paper, ValueClaim, load_paper
from bottomlock.paper.notes import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED
from bottomlock.paper.verdicts import claims_table, flown
from bottomlock.report.advice import REFERENCES, advise, choose, swept_current, untested_in_current
from bottomlock.report.drawings import Drawing, drawings
from bottomlock.report.swept import virtual_beams
from bottomlock.statistics.campaign import runs_mostly_rejected, summary_table
from bottomlock.statistics.run_errors import read_run_errors
from bottomlock.tables.results import CampaignTables, read_campaign_tables


@dataclass(frozen=True)
class Report:
    """The written files: page, figures and table of claims."""

    page: Path
    figures: list[Path]
    claims: pl.DataFrame


def make_report(folder: str | Path, *, force: bool = False) -> Report:
    """Writes `report.html` and `figures/` from the tables of a finished campaign.

    Where the paper's scenarios were flown with its settings, its claims on them are tested, and `tables/claims.parquet`
    holds the verdicts. The same tables give the same bytes.

    Args:
        folder: directory of the campaign.
        force: replace a report that has changed since it was written.

    Raises:
        DataError: for a directory that holds no finished campaign of this version, or a damaged one.
        OutputError: for a file of these names that is not of ours, one that has changed since it was written without
            `force`, and where the directory cannot be written.
    """
    folder = Path(folder)
    campaign = read_campaign_tables(folder)
    records = (
        folder / "manifest.json",
        folder / "sweep.record.json",
        *sorted(folder.glob("without_*/manifest.json")),
    )
    result = Result(folder, "report", "report", digests_of(folder, records), beside=True)
    result.check(force=force)
    with image_process() as draw:
        errors = {name: read_run_errors(campaign, name) for name in campaign.trajectories}
        paper = load_paper()
        theirs = flown(campaign, paper)
        claims = claims_table(campaign, errors, paper).filter(pl.col("trajectory").is_in(theirs))
        advice = advise(campaign, errors)
        choice = choose(advice)
        recommended = (
            [] if choice is None else sorted(choice.recommended, key=lambda method: method not in choice.best)
        )
        drawn = draw(drawings(campaign, errors, paper, recommended))
    files: Files = {"tables/claims.parquet": parquet_bytes(claims)} if theirs else {}
    for drawing, image in drawn:
        files |= {f"figures/{drawing.name}.svg": image.svg, f"figures/{drawing.name}.png": image.png}
    paths = [folder / name for name in files if name.startswith("figures/")]
    inline = [_inline(drawing, image) for drawing, image in drawn]
    page = folder / "report.html"
    shown = {name: featured(campaign.methods(name), recommended) for name in campaign.trajectories}
    content = _content(campaign, paper, claims)
    content |= {"advice": advice, "choice": choice, "featured": shown, "figures": inline}
    result.write(files | {page.name: render("report.html.j2", content)}, force=force)
    return Report(page, paths, claims)


def _inline(drawing: Drawing, image: Images) -> dict[str, Any]:
    """What the template needs of a figure."""
    svg = Markup(inline_svg(image.svg, drawing.name, drawing.caption))  # noqa: S704 - our own, escaped there
    keys = ("name", "caption", "place", "trajectory", "parameter")
    return {key: getattr(drawing, key) for key in keys} | {"svg": svg}


def _content(campaign: CampaignTables, paper: Paper, claims: pl.DataFrame) -> dict[str, Any]:
    """Everything that the template needs besides the advice and the figures."""
    return {
        "campaign": campaign,
        "all_methods": [method for name in campaign.trajectories for method in campaign.methods(name)],
        "method_words": {name: look.words for name, look in STROKES.items()},
        "references": REFERENCES,
        "untested": untested_in_current(campaign),
        "in_current": {name: swept_current(campaign.sweep, name) for name in campaign.trajectories},
        "final": {name: _final_rows(campaign, name) for name in campaign.trajectories},
        "consistency": {name: _consistency_rows(campaign, name) for name in campaign.trajectories},
        "paper": paper,
        "claims": _claim_rows(paper, claims),
        "verdicts": {
            word: int((claims["verdict"] == word).sum())
            for word in (REPRODUCED, NOT_REPRODUCED, NOT_TESTABLE)
        },
        "sweep": None if campaign.sweep is None else list(campaign.sweep.iter_rows(named=True)),
        "virtual_beams": virtual_beams(campaign.sweep, campaign.trajectories),
        "settings": _settings(campaign),
        "manifest": json.dumps(campaign.manifest, indent=2, sort_keys=True, ensure_ascii=False),
    }


def _final_rows(campaign: CampaignTables, name: str) -> list[dict[str, Any]]:
    """A row per method: errors at the end with intervals, NEES, gate, verdict."""
    table = summary_table(campaign.ensemble, campaign.runs).filter(pl.col("trajectory") == name)
    verdicts = campaign.consistency.filter(
        (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
    ).select("method", "verdict", pl.col("mean").alias("nees_velocity_attitude"))
    rows = table.join(verdicts, on="method", how="left", maintain_order="left").iter_rows(named=True)
    runs = campaign.runs.filter(pl.col("trajectory") == name)
    return [
        row | {"mostly_rejected": runs_mostly_rejected(runs.filter(pl.col("method") == row["method"]))}
        for row in rows
    ]


def _consistency_rows(campaign: CampaignTables, name: str) -> list[dict[str, Any]]:
    """A row per method: both kinds of NEES, under `velocity_attitude` and `whole`."""
    rows: dict[str, dict[str, Any]] = {}
    for row in campaign.consistency.filter(pl.col("trajectory") == name).iter_rows(named=True):
        key = "whole" if row["quantity"] == "nees" else "velocity_attitude"
        rows.setdefault(row["method"], {"method": row["method"]})[key] = row
    return list(rows.values())


def _claim_rows(paper: Paper, claims: pl.DataFrame) -> dict[str, list[dict[str, Any]]]:
    """The table of claims by trajectory, with what the paper says, where, and how we read it."""
    by_id: dict[str, Claim] = {claim.id: claim for claim in paper.claim}
    rows: dict[str, list[dict[str, Any]]] = {}
    for row in claims.iter_rows(named=True):
        claim = by_id[row["claim"]]
        unit = " ×"
        if isinstance(claim, ImprovementClaim):
            unit = " %"
        elif isinstance(claim, ValueClaim):
            unit = " m/s" if claim.quantity == "velocity" else "°"
        words = {"says": claim.says, "place": claim.place, "reading": claim.reading, "rule": claim.rule}
        rows.setdefault(claim.trajectory, []).append(row | words | {"unit": unit})
    return rows


def _settings(campaign: CampaignTables) -> list[tuple[str, list[str]]]:
    """Every setting by its dotted name, with its value on each trajectory; one value where all agree."""
    flat = [_flatten(campaign.configuration(name)) for name in campaign.trajectories]
    keys = list(dict.fromkeys(key for part in flat for key in part))
    rows = []
    for key in keys:
        values = [part.get(key, "–") for part in flat]
        rows.append((key, values[:1] if len(set(values)) == 1 else values))
    return rows


def _flatten(table: dict[str, Any], prefix: str = "") -> dict[str, str]:
    flat: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat |= _flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = json.dumps(value, ensure_ascii=False).strip('"')
    return flat
