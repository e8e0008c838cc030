"""The command `bottomlock replay`: recorded dives with all their beams and with fewer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from bottomlock.cli.console import console, late_bar, say
from bottomlock.cli.parameters import Out, Threads, beside, check_case, check_ending, check_threads, split
from bottomlock.errors import ScenarioError

if TYPE_CHECKING:
    from bottomlock.files.replay_tables import ReplayTables


def replay(
    *files: Path,
    out: Out = None,
    init: bool = False,
    without: list[str] | None = None,
    methods: str | None = None,
    threads: Threads = 0,
    force: bool = False,
    write_calibration: Path | None = None,
    export: Annotated[
        str | None,
        Parameter(
            help="Formats of the tracks, written to the folder `export` in DIR, separated by commas: "
            "kml, geojson, csv, tum, mcap. With the folder of a replay as FILE nothing else is done."
        ),
    ] = None,
) -> None:
    """Navigate a recorded dive again, also with fewer beams.

    Args:
        files: The case: a TOML file that names the tables, their columns, units and clocks, the start, and the what-if
            cases. With --export: that, or the folder of a replay, of which the tracks are exported. With --init: the
            log of a DVL, and tables, bags or logs of an autopilot with IMU, depth, attitude, positions.
        out: Directory for tables and report: new, or of the same case; CASE_replay by default. With --init the case to
            write, case.toml beside the first FILE by default.
        init: Write a commented case from logs, tables and bags; every FILE is one.
        without: With --init: a topic of a bag or a message of an autopilot's log that is left out, such as 'IMU 0';
            once for each.
        methods: Aiding methods, separated by commas; the case's own by default. Of a folder: methods to export.
        force: Start over in a directory that holds another replay.
        write_calibration: TOML file for a copy of the DVL's file with the estimated calibration and its 1 sigma.
    """
    from rich.progress import MofNCompleteColumn

    from bottomlock.export.formats import check_formats
    from bottomlock.files.overwriting import check_free
    from bottomlock.io.beams import read_geometry
    from bottomlock.io.calibrated_file import require_toml
    from bottomlock.replay.calibration import write_calibration as write
    from bottomlock.replay.calibration import writing_method
    from bottomlock.replay.case import load_case
    from bottomlock.replay.reading import has_origin
    from bottomlock.replay.report import PAGE, run_and_report

    if init:
        init_case(files, out or first_of(files).with_name("case.toml"), force=force, without=without or ())
        return
    case, formats = _only(files), split(export)
    if case.is_dir() and formats is not None:
        given = {"--out": out, "--write-calibration": write_calibration}
        if names := [name for name, value in given.items() if value is not None]:
            raise ScenarioError(
                f"nothing is run in {case}, which is finished; its tracks go to {case / 'export'}",
                place=", ".join(names),
                hint="leave it out",
            )
        _export(case, formats, split(methods), force=force)
        return
    check_case(case)
    out = out or beside(case, "replay")
    check_threads(threads)
    loaded, chosen = load_case(case), split(methods)
    if chosen is not None:
        loaded = loaded.with_methods(chosen)
    if formats is not None:
        check_formats(formats, has_origin=has_origin(loaded))
    inputs = (case, Path(loaded.dvl.geometry), *loaded.files().values())
    if write_calibration is not None:
        require_toml(write_calibration)
        check_free(write_calibration, inputs=inputs, force=force)
        writing_method(loaded, read_geometry(loaded.dvl.geometry))
    reruns = 1 + len(loaded.what_if)
    nothing = f"nothing was written to {out}"
    with late_bar("replaying", MofNCompleteColumn(), interrupted=nothing) as report:
        replayed = run_and_report(
            loaded, out, inputs=[case], threads=threads, force=force,
            progress=lambda done: report(total=reruns, completed=done),
        )  # fmt: skip
    print_results(replayed)
    if write_calibration is not None:
        instrument = read_geometry(loaded.dvl.geometry)
        write(write_calibration, instrument, replayed.calibration, loaded, force=force)
        say(f"wrote {write_calibration}")
    if formats is not None:
        _export(out, formats, split(methods), force=force)
    say(f"{replayed.manifest['wall_time_s']:.1f} s; tables in {out}, wrote {out / PAGE}")


def first_of(files: Sequence[Path]) -> Path:
    """The first file that is named, beside which a case is written."""
    if not files:
        raise ScenarioError("no file is named", expected="logs of a DVL, tables, bags or logs of autopilots")
    return files[0]


def _only(files: Sequence[Path]) -> Path:
    """The one file that is named."""
    if len(files) != 1:
        raise ScenarioError(
            f"{len(files)} files are named",
            expected="one, the case",
            hint="bottomlock replay --init FILE... writes one from logs",
        )
    return files[0]


def _export(folder: Path, formats: Sequence[str], methods: Sequence[str] | None, *, force: bool) -> None:
    """Exports a replay and names the files."""
    from bottomlock.export.replay import export_replay

    for path in export_replay(folder, formats, methods=methods, force=force):
        say(f"wrote {path}")


def init_case(files: Sequence[Path], out: Path, *, force: bool, without: Sequence[str]) -> None:
    """Writes a first case and says what it is made of."""
    from bottomlock.replay.init.entries import assumed
    from bottomlock.replay.init.make import make_case

    check_ending(out, ".toml")
    first = make_case(files, out, force=force, without=without)
    for line in first.words:
        say(line)
    beside = f", and beside it {', '.join(path.name for path in first.written)}" if first.written else ""
    say(
        f"wrote {out}{beside}: {first.guesses} guesses with their reasons, {len(assumed(first.entries))} assumptions, "
        f"{len(first.questions)} questions (# ?) to answer"
    )
    for question in first.questions:
        say(f"? {question}")
    say(f"now: bottomlock replay {out}")


def print_results(replayed: ReplayTables) -> None:
    """Prints whether the replay can be trusted, findings, faults of the clocks, and the tables of each what-if case."""
    from bottomlock.cli.page_output import print_blocks, print_headline, print_part
    from bottomlock.pages.page import Table, plain_text
    from bottomlock.replay.calibration import calibration_words
    from bottomlock.replay.page import page_of

    manifest = replayed.manifest
    page = page_of(replayed)
    print_headline(page.headline)
    parts = {part.id: part for part in page.parts}
    for name in ("trust", "findings"):
        print_part(parts[name])
    for line in calibration_words(replayed.calibration, manifest["methods"]):
        say(line)
    for name, clock in manifest["clocks"].items():
        for kind in ("gaps", "jumps", "repeats", "backward", "empty"):
            if clock[kind] != "none":
                console.print(f"{name}: {kind} {clock[kind]}", highlight=False)
    for fault in manifest["imu_faults"]:
        console.print(fault, highlight=False)
    for what_if, _ in manifest["what_if"]:
        part = parts[what_if]
        table = next(block for block in part.blocks if isinstance(block, Table))
        print_blocks(part.heading, [part.blocks[0], table])
    for line in page.about.split("\n\n"):
        console.print(plain_text(line), highlight=False)
