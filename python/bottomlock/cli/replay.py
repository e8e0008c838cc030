"""The command `bottomlock replay`: recorded dives with all their beams and with fewer."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import polars as pl
from cyclopts import Parameter
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from bottomlock.cli.console import console, errors, late_bar, narrow_table
from bottomlock.cli.parameters import Threads, check_threads, split
from bottomlock.cli.tune import tune as tune_command
from bottomlock.errors import EXIT_INTERRUPTED, BottomlockError, OutputError, ScenarioError
from bottomlock.files.overwriting import check_free
from bottomlock.io.beams import read_geometry
from bottomlock.io.calibrated_file import require_toml
from bottomlock.pages.numbers import number
from bottomlock.replay.calibration import calibration_words, writing_method
from bottomlock.replay.calibration import write_calibration as write
from bottomlock.replay.case import load_case
from bottomlock.replay.findings.trust import NOTHING
from bottomlock.replay.init.make import Made, make_case
from bottomlock.replay.report import make_replay_report
from bottomlock.replay.run import ReplayResult, open_folder, replay_case, run_count, write_replay
from bottomlock.replay.tune.passes import horizons_of
from bottomlock.statistics.replay import summary_table, track_table

FIRST_PART = 0.5
"""Part of a recording that is tuned on, the command's own default."""


def replay(
    *files: Path,
    out: Annotated[
        Path | None,
        Parameter(
            alias="-o",
            help="Directory for tables and report: new, or of the same case. With --init the case to write.",
        ),
    ] = None,
    init: Annotated[
        bool,
        Parameter(negative="", help="Write a commented case from logs, tables and bags; every FILE is one."),
    ] = False,
    tune: Annotated[
        bool,
        Parameter(help="With --init: end with `bottomlock tune`, where the log is long enough."),
    ] = True,
    methods: Annotated[
        str | None, Parameter(help="Aiding methods, separated by commas; the case's own by default.")
    ] = None,
    runs: Annotated[
        int | None, Parameter(help="Number of draws of noise and dropouts; the case's own by default.")
    ] = None,
    seed: Annotated[
        int | None, Parameter(help="Seed of the random numbers; the case's own by default.")
    ] = None,
    threads: Threads = 0,
    force: Annotated[
        bool, Parameter(negative="", help="Start over in a directory that holds another replay.")
    ] = False,
    write_calibration: Annotated[
        Path | None,
        Parameter(
            help="TOML file for a copy of the DVL's file with the estimated calibration and its 1 sigma."
        ),
    ] = None,
) -> None:
    """Navigate a recorded dive again, also with fewer beams.

    Parameters
    ----------
    files
        The case: a TOML file that names the tables, their columns, units and clocks, the start, and the what-if cases.
        With --init: the log of a DVL, and tables or bags with IMU, depth, attitude, positions.
    """
    if init:
        made = _init(files, Path("case.toml") if out is None else out, force=force)
        if tune:
            _tune(made, threads=threads, force=force)
        return
    if len(files) != 1:
        raise ScenarioError(
            f"{len(files)} files are named, expected one, the case; bottomlock replay --init FILE... writes one "
            "from logs"
        )
    if out is None:
        raise OutputError("--out is missing, expected a directory for tables and report")
    case = files[0]
    if case.suffix.lower() != ".toml":
        raise ScenarioError(
            f"{case}: not a case file (TOML); bottomlock replay --init {case} ... writes one from logs"
        )
    check_threads(threads)
    loaded = load_case(case).with_overrides(methods=split(methods), runs=runs, seed=seed)
    inputs = (case, Path(loaded.dvl.geometry), *loaded.files().values())
    if write_calibration is not None:
        require_toml(write_calibration)
        check_free(write_calibration, inputs=inputs, force=force)
        writing_method(loaded, read_geometry(loaded.dvl.geometry))
    reruns = run_count(loaded) * (1 + len(loaded.what_if))
    columns = (
        TextColumn("replaying"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    try:
        with open_folder(out, loaded.content_hash(), inputs=inputs, force=force):
            with late_bar(Progress(*columns, console=errors)) as bar:
                task = bar.add_task("", total=reruns)

                def report(done: int) -> None:
                    bar.start()
                    bar.update(task, completed=done)

                replayed = replay_case(loaded, threads=threads, progress=report)
                write_replay(replayed, out)
            page = make_replay_report(out, force=force)
    except KeyboardInterrupt:
        errors.print(f"interrupted; nothing was written to {out}")
        sys.exit(EXIT_INTERRUPTED)
    print_results(replayed)
    if write_calibration is not None:
        instrument = read_geometry(loaded.dvl.geometry)
        write(write_calibration, instrument, replayed.calibration, loaded, force=force)
        console.print(f"wrote {write_calibration}", highlight=False)
    console.print(f"{replayed.manifest['wall_time_s']:.1f} s; tables in {out}, wrote {page}")


def _init(files: Sequence[Path], out: Path, *, force: bool) -> Made:
    """Writes a first case and says what it is made of."""
    if out.suffix.lower() != ".toml":
        raise OutputError(f"{out}: expected a name that ends in .toml, the case to write")
    made = make_case(files, out, force=force)
    for line in made.words:
        console.print(line, highlight=False, soft_wrap=True)
    beside = f", and beside it {', '.join(path.name for path in made.written)}" if made.written else ""
    console.print(
        f"wrote {out}{beside}: {made.guesses} guesses with their reasons, {made.questions} questions (# ?) to answer",
        highlight=False,
        soft_wrap=True,
    )
    console.print(f"now: bottomlock replay {out} --out {out.stem}_replay", highlight=False, soft_wrap=True)
    return made


def _tune(made: Made, *, threads: int, force: bool) -> None:
    """Tunes a first case, in a case beside it; of a log that cannot be tuned the first case stands alone."""
    if not horizons_of(FIRST_PART * made.duration_s):
        return
    try:
        tune_command(made.case, threads=threads, force=force)
    except BottomlockError as error:
        console.print(f"not tuned: {error}", highlight=False, soft_wrap=True)


_COLOURS = {"fault": "red", "warning": "yellow", "note": "dim"}


_VERDICTS = {"yes": "green", "partly": "yellow", "no": "red"}


def print_answer(answer: Mapping[str, Any]) -> None:
    """Prints whether the replay can be trusted, the numbers that decide it, and what to change."""
    first = (f"{answer['verdict']}: ", f"bold {_VERDICTS[answer['verdict']]}")
    parts: list[Any] = ["Can I trust this? ", first, (answer["sentence"], "bold")]
    parts += [f"\n   {line}" for line in answer["numbers"]]
    change = "" if answer["change"] == NOTHING else f"Change: {answer['change']} "
    parts.append(f"\n   {change}Track to take: {answer['method'] or 'none, until it is changed'}.")
    parts += [f"\n   {answer['vehicle']}"] if answer["vehicle"] else []
    console.print(Text.assemble(*parts), highlight=False)


def print_findings(findings: Sequence[Mapping[str, Any]]) -> None:
    """Prints the verdict and the likely causes, each with its numbers and what to change."""
    for rank, finding in enumerate(findings):
        parts: list[Any] = [
            f"{rank}. " if rank else "",
            (finding["severity"], _COLOURS[finding["severity"]]),
            " ",
        ]
        parts.append((finding["text"], "bold"))
        # The numbers of the verdict stand in the answer.
        parts += [f"\n   {finding['evidence']}"] if rank and finding["evidence"] else []
        parts += [f"\n   → {finding['advice']}"] if finding["advice"] else []
        console.print(Text.assemble(*parts), highlight=False)


def print_results(replayed: ReplayResult) -> None:
    """Prints faults of the clocks, a table per what-if case, and what is not as it was measured."""
    manifest = replayed.manifest
    print_answer(manifest["answer"])
    print_findings(manifest["findings"])
    for line in calibration_words(replayed.calibration, manifest["methods"]):
        console.print(line, highlight=False, soft_wrap=True)
    for line in manifest["answers"]:
        console.print(line, highlight=False)
    for name, clock in manifest["clocks"].items():
        faults = {
            key: clock[key]
            for key in ("gaps", "jumps", "repeats", "backward", "empty")
            if clock[key] != "none"
        }
        for kind, words in faults.items():
            console.print(f"{name}: {kind} {words}", highlight=False)
    for fault in manifest["imu_faults"]:
        console.print(fault, highlight=False)
    summary = summary_table(replayed.runs)
    tracks = {
        (row["what_if"], row["method"], row["pass"]): row
        for row in track_table(replayed.samples).iter_rows(named=True)
    }
    label = ", semi-synthetic" if manifest["semi_synthetic"] else ""
    for what_if, words in manifest["what_if"]:
        against = (
            ["end m", "% DT", "v m/s", "att deg"] if manifest["has_reference"] else ["north m", "east m"]
        )
        table = narrow_table(
            f"{manifest['case']}, {what_if}{label}: {words}",
            ["method", "pass"],
            [*against, "σ m", "NIS", "of", "fixes", "rej %"],
        )
        for row in summary.filter(pl.col("what_if") == what_if).iter_rows(named=True):
            numbers = [
                "position_final_m",
                "position_final_percent",
                "velocity_rms_over_time_mps",
                "attitude_rms_over_time_deg",
            ]
            track = tracks[what_if, row["method"], row["pass"]]
            shown = [number(row[name]) for name in numbers]
            if not manifest["has_reference"]:
                shown = [number(track["north_m"]), number(track["east_m"])]
            sd = (track["sd_position_north_m"] ** 2 + track["sd_position_east_m"] ** 2) ** 0.5
            part = row["rejected_fraction"]
            table.add_row(
                row["method"], row["pass"], *shown, number(sd),
                number(row["nis_mean_over_fixes"]), number(row["nis_degrees_mean_over_fixes"]),
                "–" if row["fixes"] is None else str(row["fixes"]), "-" if not row["fixes"] else f"{100.0 * part:.1f}",
            )  # fmt: skip
        console.print(table)
    if manifest["semi_synthetic"]:
        console.print(f"Semi-synthetic: {'; '.join(manifest['semi_synthetic'])}.")
    if manifest["reference_note"]:
        console.print(f"About the reference: {manifest['reference_note']}")
