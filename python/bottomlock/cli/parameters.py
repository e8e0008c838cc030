"""Parameters that several commands share, and the scenarios that they select."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from bottomlock.cli.console import say
from bottomlock.errors import OutputError, ScenarioError

if TYPE_CHECKING:
    from bottomlock.config.scenario import Scenario

Out = Annotated[Path | None, Parameter(alias="-o")]
CampaignOut = Annotated[
    Path,
    Parameter(
        alias="-o",
        help="Directory for the results: new, or of the same campaign to resume; by default one named as the "
        "scenarios, beside the first file, or in this directory.",
    ),
]
StudyOut = Annotated[
    Path, Parameter(alias="-o", help="Directory for the results: new, or of the same study to resume.")
]
Runs = Annotated[int | None, Parameter(alias="-n", help="Number of runs; the scenario's own by default.")]
Seed = Annotated[
    int | None, Parameter(alias="-s", help="Seed of the random numbers; the scenario's own by default.")
]
Threads = Annotated[int, Parameter(alias="-j", help="Number of threads; 0 for one per core.")]
Methods = Annotated[
    str | None,
    Parameter(
        alias="-m",
        help="Aiding methods, separated by commas; the scenario's own by default. There are ins, lc, tc, vb, nsv, "
        "plcf, vhv, elc, info, weak_sway, sway_current, and FILE.py:CLASS; in `bottomlock run` also dead_reckoning.",
    ),
]
Json = Annotated[bool, Parameter(help="Print JSON for a program in place of tables for a reader.")]
World = Annotated[
    str | None,
    Parameter(
        help="Packaged scenario or TOML file whose sensors, filter, seabed and current replace the trajectories'."
    ),
]
Robust = Annotated[
    bool,
    Parameter(
        negative="--no-robust",
        help="Measure the beam noise and its tail on the closure of the log, and reject outliers among the beams.",
    ),
]


def split(text: str | None) -> list[str] | None:
    """The words of a comma-separated list; None for None.

    >>> split("tc, vb,")
    ['tc', 'vb']
    """
    return None if text is None else [part.strip() for part in text.split(",") if part.strip()]


def check_option(option: str, value: object, expected: str, *, holds: bool) -> None:
    """Rejects the value of an option that does not hold what is expected.

    Raises:
        ScenarioError: naming the option.
    """
    if not holds:
        raise ScenarioError(f"is {value}", key=option, expected=expected)


def check_threads(threads: int) -> None:
    """Rejects a negative number of threads, as `check_option`."""
    check_option("--threads", threads, "0 or more", holds=threads >= 0)


def check_ending(path: Path, ending: str) -> None:
    """Rejects a file to write whose name ends otherwise.

    Raises:
        OutputError: naming it.
    """
    if path.suffix.lower() != ending:
        raise OutputError(place=path, expected=f"a name that ends in {ending}")


def check_case(case: Path) -> None:
    """Rejects what is no case file, by its name.

    Raises:
        ScenarioError: naming it.
    """
    if case.is_dir():
        raise ScenarioError(
            "is a folder",
            place=case,
            expected="a case file (TOML)",
            hint="of a replay's folder --export takes the tracks along",
        )
    if not case.exists():
        raise ScenarioError(
            "no such file or folder", place=case, expected="a case (TOML), or the folder of a replay"
        )
    if case.suffix.lower() != ".toml":
        raise ScenarioError(
            "not a case file (TOML)",
            place=case,
            hint=f"bottomlock replay --init {case} ... writes one from logs",
        )


def load_scenarios(
    names: Sequence[str],
    *,
    runs: int | None = None,
    seed: int | None = None,
    methods: str | None = None,
    threads: int = 0,
    world: str | None = None,
) -> list[Scenario]:
    """The scenarios of a command line, with its overrides, in a world of another one where it is named.

    Raises:
        ScenarioError: for no scenario, two of one name, a value out of range, and what `load_scenario` and
            `in_world` reject.
    """
    from bottomlock.config.scenario import load_scenario
    from bottomlock.simulation.path import resolved
    from bottomlock.studies.cases import in_world

    if not names:
        raise ScenarioError(
            "no scenario is named", hint="`bottomlock list scenarios` lists the packaged ones"
        )
    check_threads(threads)
    loaded = [
        resolved(load_scenario(name).with_overrides(runs=runs, seed=seed, methods=split(methods)))
        for name in names
    ]
    if world is not None:
        surroundings = load_scenario(world)
        loaded = [in_world(scenario, surroundings) for scenario in loaded]
    scenario_names = [scenario.name for scenario in loaded]
    if len(set(scenario_names)) != len(scenario_names):
        raise ScenarioError(expected=f"scenarios of different names, got {scenario_names}")
    return loaded


def beside(path: Path, what: str) -> Path:
    """Where results go by default: beside the input, under its name.

    >>> beside(Path("logs/dive.pd0"), "beams.parquet").as_posix()
    'logs/dive_beams.parquet'
    """
    return path.with_name(f"{path.stem}_{what}")


def geometry_of(log: Path, stated: str | None) -> str | None:
    """The geometry that is stated, or that `bottomlock convert` noted beside a table; None without either."""
    from bottomlock.io.beam_table import geometry_beside

    if stated is not None:
        return stated
    noted = geometry_beside(log)
    if noted:
        say(f"geometry: {noted}, as noted beside {log.name}")
    return noted or None
