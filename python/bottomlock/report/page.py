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
from bottomlock.figures.consistency import claimed_figure, normalised_figure
from bottomlock.figures.curves import nees_figure, rms_figure
from bottomlock.figures.palette import inline_svg, png_bytes, svg_text
from bottomlock.figures.paths import paths_figure
from bottomlock.figures.selector import choices_figure
from bottomlock.pages.method_words import METHOD_WORDS
from bottomlock.pages.render import render
from bottomlock.paper.claims import Claim, ImprovementClaim, Paper, ValueClaim, load_paper
from bottomlock.paper.verdicts import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, claims_table
from bottomlock.report.advice import REFERENCES, advise, choose, warnings
from bottomlock.statistics.campaign import summary_table
from bottomlock.tables.results import Errors, Study, locked_out, read_errors, read_study


@dataclass(frozen=True)
class Drawing:
    """A figure of the page: its file's name, what it shows, and itself."""

    name: str
    caption: str
    figure: Figure
    trajectory: str | None = None
    wide: bool = False


@dataclass(frozen=True)
class Report:
    """What was written."""

    page: Path
    figures: list[Path]
    claims: pl.DataFrame


def make_report(folder: Path) -> Report:
    """Writes `report.html`, `figures/` and `tables/claims.parquet` from the tables of a finished campaign.

    The same tables give the same bytes.

    Raises:
        DataError: for a directory that holds no finished campaign of this version, or a damaged one.
        OutputError: where the directory cannot be written.
    """
    study = read_study(folder)
    errors = {name: read_errors(study, name) for name in study.trajectories}
    paper = load_paper()
    claims = claims_table(study, errors, paper)
    write_parquet(folder / "tables" / "claims.parquet", claims)
    paths, inline = [], []
    for drawing in drawings(study, errors, paper):
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
    write_text(page, render("report.html.j2", _content(study, errors, paper, claims) | {"figures": inline}))
    return Report(page, paths, claims)


def drawings(study: Study, errors: Mapping[str, Errors], paper: Paper) -> list[Drawing]:
    """Every figure of a campaign: the trajectories where their truth is there, then five for each of them."""
    found = []
    flown = study.paths
    if flown is not None:
        known = [name for name in study.trajectories if name in set(flown["trajectory"])]
        if known:
            words = "The trajectories: plan view and depth (the paper's Figure 8)."
            found.append(Drawing("trajectories", words, paths_figure(flown, known), wide=True))
    for name in study.trajectories:
        numbers = paper.trajectories.get(name)
        for quantity, unit in (("velocity", "m/s"), ("attitude", "degrees")):
            printed = _printed(paper, name, quantity) if _as_in_paper(study, name, paper) else []
            words = (
                f"RMS over runs of the {quantity} error, {unit}; 95 % intervals shaded, the same runs for all"
            )
            if numbers is not None:
                words += f" (the paper's Figure {getattr(numbers, f'{quantity}_figure')})"
            if printed:
                words += "; diamonds: printed in the paper"
            drawn = rms_figure(study.ensemble, name, quantity, printed)
            found.append(Drawing(f"{quantity}_{name}", words + ".", drawn, name))
        methods = study.methods(name)
        found += [
            Drawing(
                f"nees_{name}",
                "Mean NEES of the whole state: above the grey band a method is overconfident.",
                nees_figure(study.ensemble, study.consistency, name),
                name,
            ),
            Drawing(
                f"claimed_{name}",
                "Velocity error made against claimed, a point per second; the dot is the end.",
                claimed_figure(errors[name], methods),
                name,
            ),
            Drawing(
                f"normalised_{name}",
                "Error over claimed standard deviation, RMS over runs and times, for the nine components.",
                normalised_figure(errors[name], methods),
                name,
            ),
        ]
        chosen = None if study.choices is None else choices_figure(study.choices, name)
        if chosen is not None:
            words = "What the methods that choose have chosen: share of the runs at each ping."
            found.append(Drawing(f"choices_{name}", words, chosen, name))
    return found


def _as_in_paper(study: Study, name: str, paper: Paper) -> bool:
    known = paper.trajectories.get(name)
    return known is not None and study.configuration(name)["trajectory"]["kind"] == known.kind


def _printed(paper: Paper, trajectory: str, quantity: str) -> list[tuple[str, float, float]]:
    return [
        (claim.method, claim.time_s, claim.printed)
        for claim in paper.claim
        if isinstance(claim, ValueClaim) and claim.trajectory == trajectory and claim.quantity == quantity
    ]


def _content(
    study: Study, errors: Mapping[str, Errors], paper: Paper, claims: pl.DataFrame
) -> dict[str, Any]:
    """Everything that the page says, as words and numbers."""
    advice = advise(study, errors)
    return {
        "study": study,
        "all_methods": [method for name in study.trajectories for method in study.methods(name)],
        "method_words": METHOD_WORDS,
        "references": REFERENCES,
        "advice": advice,
        "choice": choose(advice),
        "warnings": warnings(advice),
        "final": {name: _final_rows(study, name) for name in study.trajectories},
        "consistency": {name: _consistency_rows(study, name) for name in study.trajectories},
        "paper": paper,
        "claims": _claim_rows(paper, claims),
        "verdicts": {
            word: int((claims["verdict"] == word).sum())
            for word in (REPRODUCED, NOT_REPRODUCED, NOT_TESTABLE)
        },
        "sweep": None if study.sweep is None else list(study.sweep.iter_rows(named=True)),
        "settings": _settings(study),
        "manifest": json.dumps(study.manifest, indent=2, sort_keys=True, ensure_ascii=False),
    }


def _final_rows(study: Study, name: str) -> list[dict[str, Any]]:
    """A row per method: errors at the end with intervals, NEES, gate, verdict."""
    table = summary_table(study.ensemble, study.runs).filter(pl.col("trajectory") == name)
    verdicts = study.consistency.filter(
        (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
    ).select("method", "verdict", pl.col("mean").alias("nees_velocity_attitude"))
    rows = table.join(verdicts, on="method", how="left", maintain_order="left").iter_rows(named=True)
    return [row | {"locked_out": locked_out(study, name, row["method"])} for row in rows]


def _consistency_rows(study: Study, name: str) -> list[dict[str, Any]]:
    """A row per method: what its two kinds of NEES say, under `part` (velocity and attitude) and `whole`."""
    rows: dict[str, dict[str, Any]] = {}
    for row in study.consistency.filter(pl.col("trajectory") == name).iter_rows(named=True):
        key = "whole" if row["quantity"] == "nees" else "part"
        rows.setdefault(row["method"], {"method": row["method"]})[key] = row
    return list(rows.values())


def _claim_rows(paper: Paper, claims: pl.DataFrame) -> dict[str, list[dict[str, Any]]]:
    """The table of claims by trajectory, with the paper's side of each: its words, place and our reading."""
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


def _settings(study: Study) -> list[tuple[str, list[str]]]:
    """Every setting by its dotted name, with its value on each trajectory; one value where all agree."""
    flat = [_flatten(study.configuration(name)) for name in study.trajectories]
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
