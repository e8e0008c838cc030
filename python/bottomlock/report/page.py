"""A finished campaign as one page, with its figures and the verdicts on the paper's claims."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from markupsafe import Markup
from matplotlib.figure import Figure

from bottomlock.atomic_write import write_bytes, write_parquet, write_text
from bottomlock.figures.consistency import calibration_figure, normalised_figure
from bottomlock.figures.curves import nees_figure, rms_figure
from bottomlock.figures.palette import inline_svg, png_bytes, svg_text
from bottomlock.figures.paths import paths_figure
from bottomlock.figures.selector import choices_figure
from bottomlock.pages.method_words import METHOD_WORDS
from bottomlock.pages.render import render
from bottomlock.paper.claims import Claim, ImprovementClaim, Paper, ValueClaim, load_paper
from bottomlock.paper.notes import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED
from bottomlock.paper.verdicts import claims_table, flown
from bottomlock.report.advice import REFERENCES, advise, choose, swept_current, untested_in_current, warnings
from bottomlock.statistics.campaign import runs_mostly_rejected, summary_table
from bottomlock.statistics.run_errors import RunErrors, read_run_errors, velocity_calibration
from bottomlock.tables.results import CampaignTables, read_campaign_tables


@dataclass(frozen=True)
class Drawing:
    """A figure of the page: name of its file, caption, figure; `trajectory` is None where it shows all of them."""

    name: str
    caption: str
    figure: Figure
    trajectory: str | None = None
    wide: bool = False


@dataclass(frozen=True)
class Report:
    """The written files: page, figures and table of claims."""

    page: Path
    figures: list[Path]
    claims: pl.DataFrame


def make_report(folder: Path) -> Report:
    """Writes `report.html` and `figures/` from the tables of a finished campaign.

    Where the paper's scenarios were flown with its settings, its claims on them are tested, and `tables/claims.parquet`
    holds the verdicts. The same tables give the same bytes.

    Raises:
        DataError: for a directory that holds no finished campaign of this version, or a damaged one.
        OutputError: where the directory cannot be written.
    """
    campaign = read_campaign_tables(folder)
    errors = {name: read_run_errors(campaign, name) for name in campaign.trajectories}
    paper = load_paper()
    theirs = flown(campaign, paper)
    claims = claims_table(campaign, errors, paper).filter(pl.col("trajectory").is_in(theirs))
    if theirs:
        write_parquet(folder / "tables" / "claims.parquet", claims)
    else:
        # Of a campaign that was here before.
        (folder / "tables" / "claims.parquet").unlink(missing_ok=True)
    paths, inline = [], []
    for drawing in drawings(campaign, errors, paper):
        svg = svg_text(drawing.figure)
        write_text(folder / "figures" / f"{drawing.name}.svg", svg)
        write_bytes(folder / "figures" / f"{drawing.name}.png", png_bytes(drawing.figure))
        paths += [folder / "figures" / f"{drawing.name}.{suffix}" for suffix in ("svg", "png")]
        inline.append(
            {
                "name": drawing.name,
                "caption": drawing.caption,
                "trajectory": drawing.trajectory,
                "wide": drawing.wide,
                "svg": Markup(inline_svg(svg, drawing.name, drawing.caption)),  # noqa: S704 - our own, escaped there
            }
        )
    page = folder / "report.html"
    write_text(
        page, render("report.html.j2", _content(campaign, errors, paper, claims) | {"figures": inline})
    )
    return Report(page, paths, claims)


def drawings(campaign: CampaignTables, errors: Mapping[str, RunErrors], paper: Paper) -> list[Drawing]:
    """Every figure of a campaign: the trajectories where their truth is there, then those of each of them."""
    found, paths = [], _paths_drawings(campaign, paper)
    # Of several trajectories their overview comes first; of one, after its errors.
    single = len(campaign.trajectories) == 1
    found += [] if single else paths
    for name in campaign.trajectories:
        found += [
            _rms_drawing(campaign, name, paper, "velocity", "velocity error, m/s"),
            _rms_drawing(campaign, name, paper, "attitude", "misalignment, degrees"),
            *_consistency_drawings(campaign, name, errors[name]),
        ]
        chosen = None if campaign.choices is None else choices_figure(campaign.choices, name)
        if chosen is not None:
            words = "What the selectors choose: share of the runs at each ping."
            found.append(Drawing(f"choices_{name}", words, chosen, name))
    return found + (paths if single else [])


def _paths_drawings(campaign: CampaignTables, paper: Paper) -> list[Drawing]:
    """The trajectories, where their truth is there."""
    known = set() if campaign.paths is None else set(campaign.paths["trajectory"])
    names = [name for name in campaign.trajectories if name in known]
    if campaign.paths is None or not names:
        return []
    words = "The trajectories: plan view and depth"
    words += " (the paper's Figure 8)." if flown(campaign, paper) else "."
    single = campaign.trajectories[0] if len(campaign.trajectories) == 1 else None
    return [Drawing("trajectories", words, paths_figure(campaign.paths, names), single, wide=single is None)]


def _rms_drawing(campaign: CampaignTables, name: str, paper: Paper, quantity: str, words: str) -> Drawing:
    in_paper = name in flown(campaign, paper)
    printed = _printed(paper, name, quantity) if in_paper else []
    caption = f"RMS over runs of the {words}; shaded: 95 % interval; every method on the same runs"
    if in_paper:
        caption += f" (the paper's Figure {getattr(paper.trajectories[name], f'{quantity}_figure')})"
    if printed:
        caption += "; diamonds: printed in the paper"
    figure = rms_figure(campaign.ensemble, name, quantity, printed)
    return Drawing(f"{quantity}_{name}", f"{caption}.", figure, name)


def _consistency_drawings(campaign: CampaignTables, name: str, errors: RunErrors) -> list[Drawing]:
    methods = campaign.methods(name)
    return [
        Drawing(
            f"nees_{name}",
            "Mean NEES of the whole state; above the grey band a method is overconfident.",
            nees_figure(campaign.ensemble, campaign.consistency, name),
            name,
        ),
        Drawing(
            f"calibration_{name}",
            "Velocity error against its claimed σ, a point per second; the dot is the end.",
            calibration_figure({method: velocity_calibration(errors, method) for method in methods}),
            name,
        ),
        Drawing(
            f"normalised_{name}",
            "Error over claimed standard deviation, RMS over runs and times, for the nine components.",
            normalised_figure({method: errors.normalised_rms[method] for method in methods}),
            name,
        ),
    ]


def _printed(paper: Paper, trajectory: str, quantity: str) -> list[tuple[str, float, float]]:
    return [
        (claim.method, claim.time_s, claim.printed)
        for claim in paper.claim
        if isinstance(claim, ValueClaim) and claim.trajectory == trajectory and claim.quantity == quantity
    ]


def _content(
    campaign: CampaignTables, errors: Mapping[str, RunErrors], paper: Paper, claims: pl.DataFrame
) -> dict[str, Any]:
    """Everything that the template needs besides the figures."""
    advice = advise(campaign, errors)
    return {
        "campaign": campaign,
        "all_methods": [method for name in campaign.trajectories for method in campaign.methods(name)],
        "method_words": METHOD_WORDS,
        "references": REFERENCES,
        "advice": advice,
        "choice": choose(advice),
        "warnings": warnings(advice),
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
