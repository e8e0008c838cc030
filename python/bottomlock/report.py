"""A finished campaign as one page, with its figures and the verdicts on the paper's claims."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import polars as pl
from markupsafe import Markup
from matplotlib.figure import Figure

from bottomlock.advice import REFERENCES, advise, choose, warnings
from bottomlock.claims import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, claims_table
from bottomlock.output import write_bytes, write_parquet, write_text
from bottomlock.paper_claims import Claim, ImprovementClaim, Paper, ValueClaim, load_paper
from bottomlock.stats import summary_table
from bottomlock.study import Errors, Study, locked_out, read_errors, read_study
from bottomlock.study_figures.choices import choices_figure
from bottomlock.study_figures.curves import nees_figure, rms_figure
from bottomlock.study_figures.honesty import claimed_figure, normalised_figure
from bottomlock.study_figures.palette import inline_svg, png_bytes, stroke, svg_text
from bottomlock.study_figures.paths import paths_figure

ARM_WORDS = {
    "ins": "no beam: the inertial system alone",
    "lc": "all four beams, none lost, by least squares: the reference",
    "tc": "a row for every valid beam",
    "vb": "a virtual beam from the filter's own velocity, taken as independent",
    "nsv": "sway is zero, sharply",
    "plcf": "only the components that the beams determine",
    "vhv": "heave from the filter, to get sway",
    "elc": "per component the least variance of vb, nsv, plcf and vhv",
    "vb_exact": "vb with its correlation kept",
    "info": "the observable principal axes through a velocity port",
    "weak_sway": "sway is zero, weakly",
    "sway_current": "sway in proportion to the yaw rate, relative to water whose current is estimated",
    "consistent": "the most informative of tc, weak_sway and sway_current that the beams do not contradict",
}
"""What each arm does with the beams; an arm that is not named here is shown without words."""


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
            words = f"RMS over runs of the {quantity} error, {unit}; 95 % intervals shaded, all arms on the same runs"
            if numbers is not None:
                words += f" (the paper's Figure {getattr(numbers, f'{quantity}_figure')})"
            if printed:
                words += "; diamonds: printed in the paper"
            drawn = rms_figure(study.ensemble, name, quantity, printed)
            found.append(Drawing(f"{quantity}_{name}", words + ".", drawn, name))
        arms = study.arms(name)
        found += [
            Drawing(
                f"nees_{name}",
                "Mean NEES of the whole state: above the grey band an arm is overconfident.",
                nees_figure(study.ensemble, study.consistency, name),
                name,
            ),
            Drawing(
                f"claimed_{name}",
                "Velocity error made against claimed, a point per second; the dot is the end.",
                claimed_figure(errors[name], arms),
                name,
            ),
            Drawing(
                f"normalised_{name}",
                "Error over claimed standard deviation, RMS over runs and times, for the nine components.",
                normalised_figure(errors[name], arms),
                name,
            ),
        ]
        chosen = None if study.choices is None else choices_figure(study.choices, name)
        if chosen is not None:
            words = "What the arms that choose have chosen: share of the runs at each ping."
            found.append(Drawing(f"choices_{name}", words, chosen, name))
    return found


def _as_in_paper(study: Study, name: str, paper: Paper) -> bool:
    known = paper.trajectories.get(name)
    return known is not None and study.configuration(name)["trajectory"]["kind"] == known.kind


def _printed(paper: Paper, trajectory: str, quantity: str) -> list[tuple[str, float, float]]:
    return [
        (claim.arm, claim.time_s, claim.printed)
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
        "all_arms": [arm for name in study.trajectories for arm in study.arms(name)],
        "arm_words": ARM_WORDS,
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
    """A row per arm: errors at the end with intervals, NEES, gate, verdict."""
    table = summary_table(study.ensemble, study.runs).filter(pl.col("trajectory") == name)
    verdicts = study.consistency.filter(
        (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
    ).select("arm", "verdict", pl.col("mean").alias("nees_velocity_attitude"))
    rows = table.join(verdicts, on="arm", how="left", maintain_order="left").iter_rows(named=True)
    return [row | {"locked_out": locked_out(study, name, row["arm"])} for row in rows]


def _consistency_rows(study: Study, name: str) -> list[dict[str, Any]]:
    """A row per arm: what its two kinds of NEES say, under `part` (velocity and attitude) and `whole`."""
    rows: dict[str, dict[str, Any]] = {}
    for row in study.consistency.filter(pl.col("trajectory") == name).iter_rows(named=True):
        key = "whole" if row["quantity"] == "nees" else "part"
        rows.setdefault(row["arm"], {"arm": row["arm"]})[key] = row
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


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = 3) -> str:
    """A number to some significant digits, without needless zeros or exponents; a dash where there is none.

    >>> number(35.7344), number(0.04686), number(1532.3), number(2.3e6), number(None)
    ('35.7', '0.0469', '1530', '2.3×10⁶', '–')
    """
    if value is None or not np.isfinite(value):
        return "–"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.{digits - 2}e}".split("e")
        return f"{mantissa}×10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    rounded = float(f"{value:.{digits}g}")
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(rounded))))) if rounded else 0
    return f"{rounded:.{decimals}f}".replace("-", "−")


def render(template: str, content: dict[str, Any]) -> str:
    """A packaged page, its numbers, arms' colours and titles written as everywhere."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("bottomlock", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number
    environment.filters["colour"] = lambda arm: stroke(arm).colour
    environment.filters["title"] = lambda name: str(name).replace("_", " ").capitalize()
    return environment.get_template(template).render(content)
