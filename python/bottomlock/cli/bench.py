"""The command `bottomlock bench`: missions made, methods run, submissions checked and scored, the leaderboard."""

import time
from pathlib import Path
from typing import Annotated

import polars as pl
from cyclopts import App, Parameter

from bottomlock.cli.console import console, narrow_table
from bottomlock.cli.engine_parameters import EngineName, Scheduler
from bottomlock.cli.examples import epilogue
from bottomlock.cli.force import Force
from bottomlock.cli.parameters import check_threads
from bottomlock.cli.parameters import split as words
from bottomlock.cli.study_output import study_bar
from bottomlock.errors import DataError
from bottomlock.files.atomic_write import write_parquet, write_text
from bottomlock.files.overwriting import check_free
from bottomlock.files.table_file import read_parquet
from bottomlock.kernel import METHODS
from bottomlock.pages.numbers import plain
from partialdvl_bench.beam_submission import (
    BEAMS,
    PINGS,
    beam_table_names,
    our_beam_tables,
    score_beam_submissions,
)
from partialdvl_bench.beam_tasks import PINGS_TASK, VELOCITY_TASK
from partialdvl_bench.digests import published
from partialdvl_bench.leaderboard import (
    OVERALL,
    check_reference,
    leaderboard,
    read_submissions,
    score_submissions,
)
from partialdvl_bench.load import load_mission
from partialdvl_bench.make import RECORD, make_missions
from partialdvl_bench.methods import estimator
from partialdvl_bench.mission_list import MissionSpec, mission_list, missions_of
from partialdvl_bench.page import write_page
from partialdvl_bench.run import Shard, run_missions, write_submissions
from partialdvl_bench.seeds import PUBLIC_SEED, commitment, commitments, read_sealed
from partialdvl_bench.seeds import seal as write_seed
from partialdvl_bench.submission import check_submission, write_tum
from partialdvl_bench.tables import BLOCKS
from partialdvl_bench.tasks import RANKED, TASKS

bench = App(
    name="bench",
    help="PartialDVL-Bench: make missions, run methods, check and score submissions.",
    help_epilogue=epilogue("bench"),
)

Splits = Annotated[
    str | None, Parameter(help="train, validation or test, separated by commas; all that can be by default.")
]
Data = Annotated[Path, Parameter(help="Directory of the missions that `bottomlock bench make` has written.")]
Version = Annotated[
    str,
    Parameter(
        help="Version of the list of missions: 1; 1.1: slow errors of the heading, slip, a hovering vehicle; 1.2: "
        "water track, and minutes without the bottom."
    ),
]
SeedFile = Annotated[
    Path | None, Parameter(help="File with the seed of the test split, which is not in the package.")
]
Missions = Annotated[str | None, Parameter(help="Names of missions, separated by commas; all by default.")]


@bench.command(name="list")
def list_missions() -> None:
    """List the missions with their versions and splits."""
    for spec in mission_list():
        console.print(f"{spec.version:<5}{spec.split:<11}{spec.name}", soft_wrap=True, highlight=False)


@bench.command
def make(
    *,
    out: Annotated[Path, Parameter(alias="-o", help="Directory for the missions.")],
    split: Splits = None,
    version: Version = "1",
    missions: Missions = None,
    seed_file: SeedFile = None,
    write_digests: Annotated[
        Path | None,
        Parameter(help="Write the digests to this file instead of comparing them with the published ones."),
    ] = None,
    force: Force = False,
) -> None:
    """Make missions: readings, case file, truth; and compare their digests with the published ones."""
    named = words(split)
    splits = (
        tuple(named) if named else (("train", "validation", "test") if seed_file else ("train", "validation"))
    )
    names = words(missions)
    specs = missions_of(splits, None if names is None else tuple(names), version)
    if seed_file is None and any(spec.split == "test" for spec in specs):
        raise DataError(
            f"the test split of version {version} is made from a sealed seed, which is not in the package: only who "
            "holds it can make this split, with --seed-file; train and validation need none"
        )
    if write_digests is not None:
        check_free(write_digests, inputs=[] if seed_file is None else [seed_file], force=force)
    sealed = None if seed_file is None else _sealed(seed_file, version)

    def seed_of(spec: MissionSpec) -> int:
        return PUBLIC_SEED if sealed is None or spec.split != "test" else sealed

    with study_bar(out) as report:
        digests = make_missions(
            specs, seed_of, out, lambda name, done: report(name[:22], done / max(1, len(specs))), force=force
        )
    console.print(f"{len(digests)} missions in {out}")
    if write_digests is not None:
        write_text(write_digests, digests_text(digests))
        return
    _compare(digests)


def digests_text(digests: dict[str, dict[str, str]]) -> str:
    """The file of digests, TOML."""
    head = (
        "# Written by `bottomlock bench make --write-digests`; bench/digests.py says what a digest is of.\n"
    )
    parts = [
        f'\n[{name}]\ndata = "{one["data"]}"\ntruth = "{one["truth"]}"\n' for name, one in digests.items()
    ]
    return head + "".join(parts)


@bench.command
def seal(
    *,
    out: Annotated[Path, Parameter(alias="-o", help="New file for the seed; keep it to yourself.")],
    version: Version = "1.1",
) -> None:
    """Draw a sealed seed for the test split into a new file, and print its commitment, to be published before use."""
    missions_of(("test",), version=version)
    console.print(f'"{version}" = "{write_seed(out, version)}"', soft_wrap=True, highlight=False)
    console.print(
        f"the seed is in {out}; publish the line above in bench/sealed.toml before anything is scored"
    )


def _sealed(path: Path, version: str) -> int:
    """The sealed seed; says its commitment where neither that nor the digests of the split are published.

    Raises:
        DataError: as `read_sealed`.
    """
    seed = read_sealed(path, version)
    tests = {spec.name for spec in missions_of(("test",), version=version)}
    if version not in commitments() and not tests <= set(published()):
        console.print(
            f"no commitment is published for the test split of version {version}; this seed's is "
            f"{commitment(seed, version)}",
            soft_wrap=True,
        )
    return seed


def _compare(digests: dict[str, dict[str, str]]) -> None:
    """Prints whether the digests are the published ones.

    Raises:
        DataError: naming the missions that differ.
    """
    known = published()
    new = [name for name in digests if name not in known]
    if new:
        console.print(
            f"{len(new)} missions have no published digests yet, the first is {new[0]}; --write-digests writes them",
            soft_wrap=True,
        )
    other = [name for name, one in digests.items() if name in known and one != known[name]]
    if not other:
        if len(new) < len(digests):
            console.print("all digests are the published ones")
        return
    raise DataError(
        f"{len(other)} of {len(digests)} missions have other digests than those published, the first is {other[0]}: "
        "made with another seed or version, or, where it is a single one, on a machine whose last bits differ"
    )


@bench.command
def run(
    *,
    data: Data,
    out: Annotated[
        Path, Parameter(alias="-o", help="Directory for the estimates: new, or of the same run to resume.")
    ],
    methods: Annotated[
        str | None,
        Parameter(
            alias="-m",
            help=f"Our methods, separated by commas; by default {', '.join(METHODS)}. And dead_reckoning.",
        ),
    ] = None,
    rival: Annotated[
        tuple[str, ...],
        Parameter(help="NAME=MODULE:FUNCTION of another estimator; may be given again.", negative=""),
    ] = (),
    split: Splits = None,
    version: Version = "1",
    missions: Missions = None,
    shard: Annotated[
        str | None, Parameter(help="k/n: run every n-th mission from the k-th on, into the same directory.")
    ] = None,
    engine: EngineName = "local",
    scheduler: Scheduler = None,
    threads: Annotated[
        int,
        Parameter(alias="-j", help="Worker processes of --engine dask on this machine; 0 for one per core."),
    ] = 0,
    force: Force = False,
) -> None:
    """Run methods and rivals on missions; finished missions are kept, and submissions written."""
    specs = _present(data, words(split), words(missions), version)
    check_threads(threads)
    named = words(methods)
    ours = list(METHODS) if named is None and not rival else (named or [])
    estimators = dict(estimator(name) for name in (*ours, *rival))
    began = time.perf_counter()
    with study_bar(out) as report:
        ran = run_missions(
            specs, data, estimators, out, shard=None if shard is None else Shard.parse(shard),
            engine=engine, scheduler=scheduler, threads=threads, force=force,
            progress=lambda name, fraction: report(name[:22], fraction),
        )  # fmt: skip
        written = write_submissions(specs, list(estimators), out, force=force)
    console.print(
        f"{ran} of {len(specs) * len(estimators)} run in {time.perf_counter() - began:.1f} s, {len(written)} "
        f"submissions in {out}"
    )


@bench.command
def beams(
    *,
    data: Data,
    out: Annotated[Path, Parameter(alias="-o", help="Directory for the submissions.")],
    split: Splits = None,
    version: Version = "1",
    force: Force = False,
) -> None:
    """Write our submissions of T1 (velocity from the beams of a ping) and T5 (real pings with beams left out)."""
    specs = _present(data, words(split), None, version)
    check_free(*(out / f"{name}.parquet" for name in beam_table_names()), force=force)
    missions = [load_mission(data / spec.split / spec.name, truth=False) for spec in specs]
    for name, table in our_beam_tables(missions).items():
        write_parquet(out / f"{name}.parquet", table)
        console.print(f"{out / name}.parquet: {table.height} rows")


@bench.command
def check(
    submission: Path,
    /,
    *,
    tum: Annotated[
        Path | None, Parameter(help="Also write a TUM file per mission into this directory.")
    ] = None,
    force: Force = False,
) -> None:
    """Check a submission against its rules; the first fault is named with row and column."""
    frame = check_submission(read_parquet(submission), str(submission))
    missions = frame["mission"].n_unique()
    answered = {block: frame[values[0]].count() for block, (values, _) in BLOCKS.items()}
    console.print(f"{submission}: {frame.height} rows of {missions} missions keep the rules")
    console.print(
        "answered: " + ", ".join(f"{block} {count / frame.height:.1%}" for block, count in answered.items())
    )
    if tum is not None:
        check_free(
            *(tum / f"{name}.tum" for name in frame["mission"].unique()), inputs=[submission], force=force
        )
        console.print(f"{len(write_tum(frame, tum))} TUM files in {tum}")


@bench.command(usage="Usage: bottomlock bench score --data PATH [OPTIONS] SUBMISSIONS...")
def score(
    *submissions: Path,
    data: Data,
    out: Annotated[Path | None, Parameter(alias="-o", help="Write the scores to this Parquet file.")] = None,
    split: Splits = None,
    version: Version = "1",
    missions: Missions = None,
    seed_file: SeedFile = None,
    reference: Annotated[
        str | None, Parameter(help="Method to which differences are taken; the first by default.")
    ] = None,
    force: Force = False,
) -> None:
    """Score submissions on missions whose truth is there, and print the ranking.

    A submission answers every one of these missions; where they are not the whole split, that is said. With the seed
    file the missions of the test split are made anew or found to be of this seed, so that no truth need be there.

    Parameters
    ----------
    submissions
        Files of `bottomlock bench run`, or of one's own estimator; the name of a file is the name of the method.
    """
    if not submissions:
        raise DataError("no submission is named, expected one or more Parquet files")
    if out is not None:
        check_free(out, inputs=submissions, force=force)
    if seed_file is not None:
        _make_sealed(seed_file, data, words(missions), version, force=force)
    specs = _present(data, words(split), words(missions), version)
    of_beams = [path for path in submissions if path.suffixes[:-1] in ([f".{BEAMS}"], [f".{PINGS}"])]
    frames = read_submissions([path for path in submissions if path not in of_beams], specs)
    check_reference(reference, {*frames, *(path.name.split(".")[0] for path in of_beams)})
    tables = [read_parquet(path) for path in of_beams]
    with study_bar(data) as report:
        scores = score_submissions(frames, data, specs, lambda name, fraction: report(name[:22], fraction))
        scores = pl.concat([score_beam_submissions(of_beams, tables, data, specs), scores])
    if out is not None:
        write_parquet(out, scores)
    _print_part(scores)
    table = leaderboard(scores, reference)
    for task in (OVERALL, *(one for one in (VELOCITY_TASK, *TASKS, PINGS_TASK) if one in table["task"])):
        shown = narrow_table(f"{task}: {RANKED}", ["method"], ["mean", "95 %", "to the reference", "95 %"])
        for row in table.filter((pl.col("task") == task) & (pl.col("score") == RANKED)).iter_rows(named=True):
            shown.add_row(
                row["method"], plain(row["value"]), f"{plain(row['lo'])} .. {plain(row['hi'])}",
                plain(row["difference"]), f"{plain(row['difference_lo'])} .. {plain(row['difference_hi'])}",
            )  # fmt: skip
        console.print(shown)


def _make_sealed(seed_file: Path, data: Path, names: list[str] | None, version: str, *, force: bool) -> None:
    """Makes the missions of the test split, readings and truth, where they are not there whole.

    Raises:
        OutputError: where those that are there are of another seed or version, without `force`.
        DataError: for digests that are not the published ones.
    """
    sealed = _sealed(seed_file, version)
    specs = missions_of(("test",), None if names is None else tuple(names), version)
    with study_bar(data) as report:
        digests = make_missions(
            specs,
            lambda _: sealed,
            data,
            lambda name, done: report(name[:22], done / max(1, len(specs))),
            force=force,
        )
    _compare(digests)


def _print_part(scores: pl.DataFrame) -> None:
    """Says of each split of which only a part was scored, how much of it."""
    scored = set(scores["mission"])
    whole: dict[tuple[str, str], list[str]] = {}
    for spec in mission_list():
        whole.setdefault((spec.version, spec.split), []).append(spec.name)
    for (version, split), names in whole.items():
        count = len(scored.intersection(names))
        if 0 < count < len(names):
            console.print(
                f"scored {count} of {len(names)} missions of the split {split}, version {version}: no result for the "
                "leaderboard, which is of all of them"
            )


def _present(
    data: Path, split: list[str] | None, names: list[str] | None, version: str
) -> tuple[MissionSpec, ...]:
    """The missions of this version, or of these names, and of these splits, that are in a folder of missions.

    Raises:
        DataError: where there is none.
    """
    wanted = missions_of(
        None if split is None else tuple(split), None if names is None else tuple(names), version
    )
    there = tuple(spec for spec in wanted if (data / spec.split / spec.name / RECORD).is_file())
    if not there:
        raise DataError(
            f"{data}: holds none of these missions of version {version}; make them with "
            f"`bottomlock bench make --version {version} --out {data}`"
        )
    return there


@bench.command
def page(
    scores: Path,
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="Directory for leaderboard.html, .parquet and .csv.")],
    reference: Annotated[
        str | None, Parameter(help="Method to which differences are taken; the one that leads by default.")
    ] = None,
    force: Force = False,
) -> None:
    """Write the leaderboard as one self-contained page, from the scores alone.

    Parameters
    ----------
    scores
        The file that `bottomlock bench score --out` has written.
    """
    console.print(f"{write_page(scores, out, reference=reference, force=force)}")
