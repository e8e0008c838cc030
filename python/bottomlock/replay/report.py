"""A finished replay as one page, from its tables alone: the same tables give the same bytes."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from markupsafe import Markup
from matplotlib.figure import Figure

from bottomlock.atomic_write import read_json, write_bytes, write_text
from bottomlock.errors import DataError
from bottomlock.figures.palette import inline_svg, png_bytes, svg_text
from bottomlock.pages.method_words import METHOD_WORDS
from bottomlock.pages.render import render
from bottomlock.replay.figures import error_figure, innovation_figure, map_figure, nis_figure, validity_figure
from bottomlock.statistics.replay import summary_table
from bottomlock.tables.replay import FORWARD, RECORDED, SMOOTHED

BEAM_ROWS = ("tc", "sway_current", "consistent")
"""Methods whose innovations are beams, the first that was flown is drawn."""
FAR = 25.0
"""A method whose error exceeds the median method's by this factor is left off the map, and the page says so."""


@dataclass(frozen=True, eq=False)
class Tables:
    """A replay as it stands on disk."""

    manifest: dict[str, Any]
    runs: pl.DataFrame
    ensemble: pl.DataFrame
    samples: pl.DataFrame
    innovations: pl.DataFrame
    pings: pl.DataFrame
    path: pl.DataFrame | None


@dataclass(frozen=True)
class Drawing:
    """A figure of the page."""

    name: str
    caption: str
    figure: Figure
    what_if: str | None = None


def read_replay(folder: Path) -> Tables:
    """The tables of a finished replay.

    Raises:
        DataError: for a directory that holds none, or a damaged one.
    """
    manifest = read_json(folder / "manifest.json")
    if manifest is None or manifest.get("kind") != "replay":
        raise DataError(f"{folder}: holds no replay; `bottomlock replay` makes one")

    def table(name: str) -> pl.DataFrame:
        try:
            return pl.read_parquet(folder / f"{name}.parquet")
        except (OSError, pl.exceptions.PolarsError) as error:
            raise DataError(
                f"{folder / name}.parquet: cannot be read ({str(error).splitlines()[0]})"
            ) from error

    path = table("reference") if (folder / "reference.parquet").is_file() else None
    return Tables(
        manifest=manifest,
        runs=table("runs"),
        ensemble=table("ensemble"),
        samples=table("samples"),
        innovations=table("innovations"),
        pings=table("pings"),
        path=path,
    )


def is_replay(folder: Path) -> bool:
    """Whether a directory holds a replay.

    Raises:
        DataError: for a manifest that cannot be read.
    """
    manifest = read_json(folder / "manifest.json")
    return manifest is not None and manifest.get("kind") == "replay"


def make_replay_report(folder: Path) -> Path:
    """Writes `report.html` and `figures/` from the tables of a replay.

    Raises:
        DataError: as `read_replay`.
        OutputError: where the directory cannot be written.
    """
    tables = read_replay(folder)
    inline = []
    for drawing in drawings(tables):
        svg = svg_text(drawing.figure)
        write_text(folder / "figures" / f"{drawing.name}.svg", svg)
        write_bytes(folder / "figures" / f"{drawing.name}.png", png_bytes(drawing.figure))
        inline.append(
            {
                "name": drawing.name,
                "caption": drawing.caption,
                "what_if": drawing.what_if,
                "svg": Markup(inline_svg(svg, drawing.name, drawing.caption)),  # noqa: S704 - our own, escaped there
            }
        )
    page = folder / "report.html"
    write_text(page, render("replay.html.j2", _content(tables) | {"figures": inline}))
    return page


def drawings(tables: Tables) -> list[Drawing]:
    """Every figure of a replay: which beams returned, and for each question map, errors, innovations and NIS."""
    manifest = tables.manifest
    label = "semi-synthetic" if manifest["semi_synthetic"] else ""
    tail = f" ({label})" if label else ""
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    found = [
        Drawing(
            "validity",
            f"Which beams the filters had: coloured where a beam returned{tail}.",
            validity_figure(tables.pings, start_ns, words=f"beams that returned, from beam 1 down{tail}"),
        )
    ]
    for question, _ in manifest["what_if"]:
        samples = tables.samples.filter(pl.col("what_if") == question)
        innovations = tables.innovations.filter(pl.col("what_if") == question)
        title = f"{manifest['case'].replace('_', ' ')}, {question.replace('_', ' ')}{tail}"
        near, far = _near_and_far(samples, manifest["methods"])
        words = f"Plan view{tail}"
        words += "; broad grey: the reference" if tables.path is not None else ""
        words += "; dotted: smoothed" if (samples["pass"] == SMOOTHED).any() else ""
        words += f"; off the map: {', '.join(far)}" if far else ""
        drawn = map_figure(samples, tables.path, methods=near, words=title)
        found.append(Drawing(f"map_{question}", words + ".", drawn, question))
        ensemble = tables.ensemble.filter(pl.col("what_if") == question)
        for name in (FORWARD, SMOOTHED):
            if manifest["has_reference"] and (ensemble["pass"] == name).any():
                drawn = error_figure(
                    ensemble, methods=manifest["methods"], words=f"{title}, {name}", which=name
                )
                words = (
                    f"Errors against the reference, {name}{tail}; dotted: what the method claims, 1 sigma."
                )
                found.append(Drawing(f"errors_{name}_{question}", words, drawn, question))
        method = next((method for method in BEAM_ROWS if method in manifest["methods"]), None)
        if method is not None:
            drawn = innovation_figure(innovations, start_ns, method=method, words=f"{title}, method {method}")
            words = f"Innovations of each beam, method {method}{tail}; shaded: ±2 sigma as claimed; hollow: rejected."
            found.append(Drawing(f"innovations_{question}", words, drawn, question))
        drawn = nis_figure(innovations, start_ns, methods=manifest["methods"], words=title)
        words = f"NIS over its degrees of freedom{tail}: above the band a method claims more than it knows."
        found.append(Drawing(f"nis_{question}", words, drawn, question))
    return found


def _near_and_far(samples: pl.DataFrame, methods: list[str]) -> tuple[list[str], list[str]]:
    """Methods that fit on one map, and those that would shrink it to a dot."""
    end = (
        samples.filter(pl.col("pass") == FORWARD)
        .group_by("method", maintain_order=True)
        .agg((pl.col("north_m") ** 2 + pl.col("east_m") ** 2).sqrt().max().alias("reach"))
    )
    reach = dict(end.iter_rows())
    usual = float(end["reach"].median())  # type: ignore[arg-type]
    far = [method for method in methods if reach[method] > max(FAR * usual, 10.0)]
    return [method for method in methods if method not in far], far


def _content(tables: Tables) -> dict[str, Any]:
    manifest = tables.manifest
    summary = summary_table(tables.runs)
    return {
        "manifest": manifest,
        "recorded": RECORDED,
        "summary": {
            question: list(summary.filter(pl.col("what_if") == question).iter_rows(named=True))
            for question, _ in manifest["what_if"]
        },
        "best": {
            question: _best(summary.filter(pl.col("what_if") == question))
            for question, _ in manifest["what_if"]
        },
        "method_words": METHOD_WORDS,
        "dump": json.dumps(manifest, indent=2, sort_keys=True, ensure_ascii=False),
    }


def _best(rows: pl.DataFrame) -> dict[str, Any] | None:
    """The forward method with the least position error at the end."""
    forward = rows.filter((pl.col("pass") == FORWARD) & pl.col("position_final_m").is_not_null())
    return forward.sort("position_final_m").row(0, named=True) if forward.height else None
