"""The command `bottomlock bench`: missions made, methods run, submissions checked and scored, the leaderboard."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from bottomlock.atomic_write import write_text
from bottomlock.bench.digests import published
from bottomlock.bench.make import make_missions
from bottomlock.bench.mission_list import MissionSpec, mission_list, missions_of
from bottomlock.bench.seeds import PUBLIC_SEED, read_seed
from bottomlock.cli.console import console, narrow_table
from bottomlock.cli.parameters import split as words
from bottomlock.cli.study_output import study_bar
from bottomlock.errors import DataError

bench = App(name="bench", help="PartialDVL-Bench: make missions, run methods, check and score submissions.")

Splits = Annotated[
    str | None, Parameter(help="train, validation or test, separated by commas; all that can be by default.")
]
Missions = Annotated[str | None, Parameter(help="Names of missions, separated by commas; all by default.")]


@bench.command(name="list")
def list_missions() -> None:
    """List the missions and their splits."""
    table = narrow_table("PartialDVL-Bench v1", ["split", "mission"], [])
    for spec in mission_list():
        table.add_row(spec.split, spec.name)
    console.print(table)


@bench.command
def make(
    *,
    out: Annotated[Path, Parameter(help="Directory for the missions.")],
    split: Splits = None,
    missions: Missions = None,
    seed_file: Annotated[
        Path | None, Parameter(help="File with the seed of the test split, which is not in the package.")
    ] = None,
    write_digests: Annotated[
        Path | None,
        Parameter(help="Write the digests to this file instead of comparing them with the published ones."),
    ] = None,
) -> None:
    """Make missions: readings, case file, truth; and compare their digests with the published ones."""
    named = words(split)
    splits = (
        tuple(named) if named else (("train", "validation", "test") if seed_file else ("train", "validation"))
    )
    names = words(missions)
    specs = missions_of(splits, None if names is None else tuple(names))
    if seed_file is None and any(spec.split == "test" for spec in specs):
        raise DataError(
            "the test split is made from a seed that is not in the package: give it with --seed-file"
        )
    sealed = None if seed_file is None else read_seed(seed_file)

    def seed_of(spec: MissionSpec) -> int:
        return PUBLIC_SEED if sealed is None or spec.split != "test" else sealed

    with study_bar(out) as report:
        digests = make_missions(
            specs, seed_of, out, lambda name, done: report(name[:22], done / max(1, len(specs)))
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


def _compare(digests: dict[str, dict[str, str]]) -> None:
    """Prints whether the digests are the published ones.

    Raises:
        DataError: naming the missions that differ.
    """
    known = published()
    other = [name for name, one in digests.items() if one != known.get(name)]
    if not other:
        console.print("all digests are the published ones")
        return
    raise DataError(
        f"{len(other)} of {len(digests)} missions have other digests than those published, the first is {other[0]}: "
        "made with another seed or version, or, where it is a single one, on a machine whose last bits differ"
    )
