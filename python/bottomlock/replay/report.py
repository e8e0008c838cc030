"""The report of a finished replay, from its tables alone: the same tables give the same bytes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from matplotlib.figure import Figure

from bottomlock.errors import DataError
from bottomlock.figures.images import image_process
from bottomlock.files.overwriting import Files, Result, digests_of
from bottomlock.files.records import DIGESTS, read_record, read_recorded_table
from bottomlock.kernel.models import Robust
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.pages.page import Picture, html
from bottomlock.replay.figures import (
    current_figure,
    error_figure,
    innovation_figure,
    map_figure,
    nis_figure,
    validity_figure,
)
from bottomlock.replay.findings.expected_nis import least_ratio
from bottomlock.replay.page import Shown, featured_in, page_of
from bottomlock.statistics.replay import summary_table
from bottomlock.tables.replay import FORWARD, SMOOTHED

BEAM_ROWS = ("tc", "sway_current", "consistent")
"""Methods whose innovations are of single beams; the first of them that was run is drawn."""
FAR = 25.0
"""A method that goes this many times further from the start than the median method is left off the map."""
FAR_OF_RECKONING = 5.0
"""The same against dead reckoning, which does not run away."""


@dataclass(frozen=True, eq=False)
class ReplayTables:
    """The files of a finished replay."""

    manifest: dict[str, Any]
    runs: pl.DataFrame
    ensemble: pl.DataFrame
    samples: pl.DataFrame
    innovations: pl.DataFrame
    pings: pl.DataFrame
    path: pl.DataFrame | None
    calibration: pl.DataFrame | None
    currents: pl.DataFrame | None = None


@dataclass(frozen=True)
class Drawing:
    """A figure of the page."""

    name: str
    caption: str
    figure: Figure
    what_if: str | None = None
    folded: bool = False


def read_replay(folder: str | Path) -> ReplayTables:
    """Reads the tables of a finished replay.

    Raises:
        DataError: for a directory without a replay, or a table that is missing or has changed since it was written.
    """
    folder = Path(folder)
    manifest = read_record(folder / "manifest.json")
    if manifest is None or manifest.get("kind") != "replay":
        raise DataError(f"{folder}: holds no replay (no manifest.json of one); `bottomlock replay` makes one")
    if manifest.get("status") != "complete":
        raise DataError(f"{folder}: its replay was interrupted; the same `bottomlock replay` writes it again")

    def table(name: str) -> pl.DataFrame:
        return read_recorded_table(
            folder / f"{name}.parquet", manifest, remedy="the same `bottomlock replay` writes it again"
        )

    def optional(name: str) -> pl.DataFrame | None:
        return table(name) if f"{name}.parquet" in manifest[DIGESTS] else None

    return ReplayTables(
        manifest=manifest,
        runs=table("runs"),
        ensemble=table("ensemble"),
        samples=table("samples"),
        innovations=table("innovations"),
        pings=table("pings"),
        path=optional("reference"),
        calibration=optional("calibration"),
        currents=optional("currents"),
    )


def is_replay(folder: Path) -> bool:
    """Whether a directory holds a replay.

    Raises:
        DataError: for a manifest that cannot be read.
    """
    manifest = read_record(folder / "manifest.json")
    return manifest is not None and manifest.get("kind") == "replay"


def make_replay_report(folder: str | Path, *, force: bool = False) -> Path:
    """Writes `report.html` and `figures/` from the tables of a replay.

    Args:
        folder: directory of the replay.
        force: replace a report that has changed since it was written.

    Raises:
        DataError: as `read_replay`.
        OutputError: for a file of these names that is not of ours, one that has changed since it was written without
            `force`, and where the directory cannot be written.
    """
    folder = Path(folder)
    tables = read_replay(folder)
    result = Result(folder, "report", "report", digests_of(folder, [folder / "manifest.json"]), beside=True)
    result.check(force=force)
    files: Files = {}
    figures = []
    with image_process() as draw:
        drawn = draw(drawings(tables))
    for drawing, image in drawn:
        files |= {f"figures/{drawing.name}.svg": image.svg, f"figures/{drawing.name}.png": image.png}
        kind = "wide" if drawing.what_if is None else ""
        picture = Picture.of_svg(image.svg, drawing.name, drawing.caption, kind=kind)
        figures.append(Shown(drawing.name, picture, drawing.what_if, drawing.folded))
    page = folder / "report.html"
    files[page.name] = html(
        page_of(tables.manifest, tables.runs, tables.samples, tables.calibration, figures)
    )
    result.write(files, force=force)
    return page


def drawings(tables: ReplayTables) -> list[Drawing]:
    """Every figure of a replay: valid beams, and for each what-if case map, errors, innovations and NIS."""
    manifest = tables.manifest
    tail = " (semi-synthetic)" if manifest["semi_synthetic"] else ""
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    found = [
        Drawing(
            "validity",
            f"Beams given to the filters: coloured where a beam is valid{tail}.",
            validity_figure(tables.pings, start_ns, title=f"valid beams, from beam 1 down{tail}"),
        )
    ]
    for what_if, _ in manifest["what_if"]:
        shown = featured_in(manifest, summary_table(tables.runs), what_if)
        found += _of_methods(tables, what_if, shown, tail)
        innovations = tables.innovations.filter(pl.col("what_if") == what_if)
        method = next((method for method in BEAM_ROWS if method in manifest["methods"]), None)
        if method is not None:
            title = f"{_title(tables, what_if)}{tail}, method {method}"
            drawn = innovation_figure(innovations, start_ns, method=method, title=title)
            caption = (
                f"Innovations of each beam, method {method}{tail}; shaded: their ±2 sigma; hollow: rejected."
            )
            found.append(Drawing(f"innovations_{what_if}", caption, drawn, what_if))
        if tables.currents is not None:
            rows = tables.currents.filter(pl.col("what_if") == what_if)
            title = f"{_title(tables, what_if)}{tail}"
            drawn = current_figure(rows, start_ns, methods=shown, title=title)
            caption = f"Current as each method estimates it{tail}; shaded: ±1 sigma."
            found.append(Drawing(f"current_{what_if}", caption, drawn, what_if))
        if len(shown) < len(manifest["methods"]):
            found += _of_methods(tables, what_if, manifest["methods"], tail, folded=True)
    return found


def _title(tables: ReplayTables, what_if: str) -> str:
    return f"{tables.manifest['case'].replace('_', ' ')}, {what_if.replace('_', ' ')}"


def _of_methods(
    tables: ReplayTables, what_if: str, methods: list[str], tail: str, *, folded: bool = False
) -> list[Drawing]:
    """Map, errors of each pass and NIS of some methods in one what-if case."""
    manifest, found = tables.manifest, []
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    samples, innovations, ensemble = (
        table.filter(pl.col("what_if") == what_if)
        for table in (tables.samples, tables.innovations, tables.ensemble)
    )
    title, end = f"{_title(tables, what_if)}{tail}", "_all_methods" if folded else ""

    def add(name: str, caption: str, figure: Figure) -> None:
        found.append(Drawing(f"{name}_{what_if}{end}", caption, figure, what_if, folded))

    near, far = _near_and_far(samples, methods)
    caption = f"Plan view{tail}"
    caption += "; broad grey: the reference" if tables.path is not None else ""
    caption += "; dotted: smoothed" if (samples["pass"] == SMOOTHED).any() else ""
    claims = _claiming(manifest, near)
    caption += f"; ellipses: 2 sigma of north and east of {' and '.join(claims)}" if claims else ""
    caption += f"; off the map: {', '.join(far)}" if far else ""
    add("map", caption + ".", map_figure(samples, tables.path, methods=near, title=title, claims=claims))
    for name in (FORWARD, SMOOTHED):
        if manifest["has_reference"] and (ensemble["pass"] == name).any():
            drawn = error_figure(ensemble, methods=methods, title=f"{title}, {name}", which=name)
            caption = (
                f"Errors against the reference, {name}{tail}; dotted: the filter's own standard deviation."
            )
            add(f"errors_{name}", caption, drawn)
    robust = manifest.get("options", {}).get("robust")
    ratio = least_ratio(None if robust is None else Robust(**robust))
    caption = f"NIS over its degrees of freedom{tail}: above the band the filter is overconfident."
    add("nis", caption, nis_figure(innovations, start_ns, methods=methods, title=title, least_ratio=ratio))
    return found


def _claiming(manifest: dict[str, Any], methods: list[str]) -> list[str]:
    """Of these methods the one whose track is to be taken and dead reckoning, whose ellipses are drawn."""
    taken = manifest.get("answer", {}).get("method") or "tc"
    wanted = dict.fromkeys([taken if taken != DEAD_RECKONING else "tc", DEAD_RECKONING])
    return [method for method in wanted if method in methods]


def _near_and_far(samples: pl.DataFrame, methods: list[str]) -> tuple[list[str], list[str]]:
    """Methods that share one map, and those too far off to draw at its scale."""
    end = (
        samples.filter(pl.col("pass") == FORWARD)
        .group_by("method", maintain_order=True)
        .agg((pl.col("north_m") ** 2 + pl.col("east_m") ** 2).sqrt().max().alias("reach"))
    )
    reach = dict(end.iter_rows())
    usual = float(end["reach"].median())  # type: ignore[arg-type]
    most = FAR_OF_RECKONING * reach[DEAD_RECKONING] if DEAD_RECKONING in reach else FAR * usual
    far = [method for method in methods if reach[method] > max(most, 10.0)]
    return [method for method in methods if method not in far], far
