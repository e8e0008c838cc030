"""The report of a finished replay, from its tables alone, and a replay from its case to its report."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from matplotlib.figure import Figure as Paper

from bottomlock.errors import DataError
from bottomlock.figures.drawing import on_paper
from bottomlock.figures.series import Figure, Panel
from bottomlock.files.overwriting import Files, Result, digests_of, remove_outdated
from bottomlock.files.records import DIGESTS, read_record, read_recorded_table
from bottomlock.files.replay_tables import FORWARD, SMOOTHED, ReplayTables
from bottomlock.kernel.models import Robust
from bottomlock.pages.page import Pictures, html
from bottomlock.pages.pieces import explained
from bottomlock.pages.plots import Plots
from bottomlock.replay.case import Case
from bottomlock.replay.dive_plots import map_of, plots_of
from bottomlock.replay.findings.innovations import least_ratio
from bottomlock.replay.page import TIMELINE, VALIDITY, Drawing, featured_in, page_of
from bottomlock.replay.panels import (
    beams_panel,
    current_panels,
    error_panels,
    innovation_panels,
    nis_panel,
    plain,
)
from bottomlock.replay.run import open_folder, replay_case, write_replay
from bottomlock.statistics.replay import summary_table

PAGE = "report.html"
BEAM_ROWS = ("tc", "sway_current")
"""Methods whose innovations are of single beams; the first of them that was run is drawn."""


def read_replay(folder: str | Path) -> ReplayTables:
    """Reads the tables of a finished replay.

    Raises:
        DataError: for a directory without a replay, or a table that is missing or has changed since it was written.
    """
    folder = Path(folder)
    if folder.is_file():
        raise DataError(
            "is a file",
            place=folder,
            expected="the directory of a replay",
            hint="`bottomlock replay` makes one",
        )
    manifest = read_record(folder / "manifest.json")
    if manifest is None or manifest.get("kind") != "replay":
        raise DataError(
            "holds no replay (no manifest.json of one)", place=folder, hint="`bottomlock replay` makes one"
        )
    if manifest.get("status") != "complete":
        raise DataError(
            "its replay was interrupted", place=folder, hint="the same `bottomlock replay` writes it again"
        )

    def table(name: str) -> pl.DataFrame:
        return read_recorded_table(
            folder / f"{name}.parquet", manifest, remedy="the same `bottomlock replay` writes it again"
        )

    def optional(name: str) -> pl.DataFrame | None:
        return table(name) if f"{name}.parquet" in manifest[DIGESTS] else None

    return ReplayTables(
        manifest=manifest,
        runs=table("runs"),
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
    files = report_files(tables)
    result.write(files, force=force)
    return folder / PAGE


def report_files(tables: ReplayTables) -> Files:
    """The contents of the page and of the figures."""
    pictures, plots = Pictures(), dive_of(tables)
    figures = [
        (drawing, pictures.add(drawing.figure, drawing.name, drawing.caption, ""))
        for drawing in drawings(tables, plots)
    ]
    return pictures.files | {PAGE: html(explained(page_of(tables, figures, plots)))}


def dive_of(tables: ReplayTables) -> Plots:
    """The dive to look into, with the methods that the figures show."""
    summary, manifest = summary_table(tables.runs), tables.manifest
    methods = {name: featured_in(manifest, summary, name) for name, _ in manifest["what_if"]}
    return plots_of(tables, methods=methods, least_ratio=least_ratio_of(manifest))


def least_ratio_of(manifest: dict[str, Any]) -> float:
    """What NIS over its degrees is of noise as claimed, under the weights of the replay."""
    robust = manifest.get("options", {}).get("robust")
    return least_ratio(None if robust is None else Robust(**robust))


def drawings(tables: ReplayTables, plots: Plots) -> list[Drawing]:
    """Every figure of a replay: valid beams, and for each what-if case map, errors, innovations and NIS.

    The first case also has the curves against time that `plots` shows first.
    """
    manifest = tables.manifest
    tail = " (semi-synthetic)" if manifest["semi_synthetic"] else ""
    name, cases = f"{plain(manifest['case'])}{tail}", [case for case, _ in manifest["what_if"]]

    def stacked(panels: Sequence[Panel], title: str) -> Paper:
        return on_paper(Figure(title, panels, plots.first.start_ns))

    first = [choice.first for choice in plots.choices]
    caption = (
        f"Estimates of {first[-1]} against time; shaded: ±σ as claimed, of NIS the 95 % band of a consistent "
    )
    figure = stacked(plots.first.panels, f"{name}, {', '.join(first)}")
    found = [Drawing(TIMELINE, f"{caption}filter; dashed: dead reckoning.", figure)]
    panels = [beams_panel(tables.of(case).pings, case) for case in cases]
    caption = "Beams given to the filters: a line where a beam is valid."
    found.append(Drawing(VALIDITY, caption, stacked(panels, name)))
    for case in cases:
        own, title = tables.of(case), f"{name}, {plain(case)}"
        shown = featured_in(manifest, summary_table(tables.runs), case)
        found += _of_methods(tables, stacked, case, shown, title)
        method = next((method for method in BEAM_ROWS if method in manifest["methods"]), None)
        if method is not None:
            figure = stacked(innovation_panels(own.innovations, method), f"{title}, method {method}")
            caption = f"Innovations of each beam, method {method}; shaded: their ±2 sigma."
            found.append(Drawing(f"innovations_{case}", caption, figure, case))
        panels = [panel for method in shown for panel in current_panels(own.currents, method)]
        if panels:
            caption = "Current as each method estimates it; shaded: ±1 sigma."
            found.append(Drawing(f"current_{case}", caption, stacked(panels, title), case))
    return found


def _of_methods(
    tables: ReplayTables,
    stacked: Callable[[Sequence[Panel], str], Paper],
    what_if: str,
    methods: list[str],
    title: str,
) -> list[Drawing]:
    """Map, errors of each pass and NIS of some methods in one what-if case."""
    manifest, own, found = tables.manifest, tables.of(what_if), []

    def add(name: str, caption: str, figure: Paper) -> None:
        found.append(Drawing(f"{name}_{what_if}", caption, figure, what_if))

    passes = [name for name in (FORWARD, SMOOTHED) if (own.samples["pass"] == name).any()]
    charted = map_of(tables, what_if, methods)
    figure = on_paper(replace(charted, title=title))
    ways = [track for track in charted.tracks if track.kind == "way"]
    claims = [track.label for track in ways if track.sd_east_m is not None]
    caption = "Plan view"
    caption += "; broad grey: the reference" if any(one.kind == "reference" for one in charted.tracks) else ""
    caption += "; dotted: smoothed" if SMOOTHED in passes else ""
    caption += f"; ellipses: 2 sigma of north and east of {' and '.join(claims)}"
    add("map", f"{caption}{_origin_words(manifest.get('origin'))}.", figure)
    for name in passes if manifest["has_reference"] else ():
        figure = stacked(error_panels(own.samples, methods, name), f"{title}, {name}")
        add(f"errors_{name}", f"Errors against the reference, {name}; dotted: the claimed 1 sigma.", figure)
    nis = nis_panel(own.innovations, methods, least_ratio_of(manifest))
    caption = "NIS over its degrees of freedom: above the band the filter is overconfident."
    add("nis", caption, stacked([nis], title))
    return found


def _origin_words(origin: Mapping[str, float] | None) -> str:
    """Where metres count from, where that is known."""
    if origin is None:
        return ""
    latitude, longitude = (float(np.rad2deg(origin[f"{name}_rad"])) for name in ("latitude", "longitude"))
    return (
        f"; metres from {abs(latitude):.6f}° {'N' if latitude >= 0.0 else 'S'}, "
        f"{abs(longitude):.6f}° {'E' if longitude >= 0.0 else 'W'}"
    )


def run_and_report(
    case: Case,
    out: str | Path,
    *,
    inputs: Iterable[Path] = (),
    threads: int = 0,
    force: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> ReplayTables:
    """Replays a case, and writes tables, page and figures to a folder.

    Args:
        case: the case.
        out: the folder: new, empty, or of the same case.
        inputs: files read beside those that the case names; none of all these may be among those written.
        threads: number of threads, 0 for one per core; the results do not depend on it.
        force: start over in a folder of another case.
        progress: as of `replay_case`.

    Raises:
        DataError, ScenarioError, KernelError: as `replay_case`.
        OutputError: as `open_folder`.
    """
    out = Path(out)
    read = (*inputs, Path(case.dvl.geometry), *case.files().values())
    with open_folder(out, case.content_hash(), inputs=read, force=force):
        replayed = replay_case(case, threads=threads, progress=progress)
        write_replay(replayed, out)
        make_replay_report(out, force=force)
        remove_outdated(out)
    return replayed
