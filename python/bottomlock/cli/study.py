"""The command `bottomlock study`: methods under sets of beams and sensors, with one verdict each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from bottomlock.cli.common import ForceStudy
from bottomlock.cli.console import console, print_json
from bottomlock.cli.parameters import (
    Json,
    Methods,
    Runs,
    Seed,
    StudyOut,
    Threads,
    World,
    load_scenarios,
    split,
)
from bottomlock.errors import ScenarioError

if TYPE_CHECKING:
    import polars as pl

    from bottomlock.pages.page import Table

CONFIGURED = "own"
"""For the beams or sensors of the scenario itself."""

MOST_ROWS = 60
"""Cells of a study whose every row is printed; of a larger one the sums by method."""


def study(
    *scenario: str,
    out: StudyOut,
    runs: Runs = None,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
    world: World = None,
    masks: Annotated[
        str | None,
        Parameter(
            help="Sets of returning beams, such as 1234,123,12; every set by default; "
            f"'{CONFIGURED}' for the scenario's own beam loss."
        ),
    ] = None,
    sensors: Annotated[
        str | None,
        Parameter(
            help="Sets of sensors beside the beams, such as none,depth,depth+attitude, of "
            f"depth, heading, attitude, gps, acoustic; '{CONFIGURED}' (the default) for the scenario's own."
        ),
    ] = None,
    force: ForceStudy = False,
    json: Json = False,
) -> None:
    """Compare the methods under sets of returning beams and sensors: errors, NEES, NIS, verdicts.

    Writes study.parquet. An interrupted study resumes.

    Args:
        scenario: Packaged scenarios or TOML files; the three trajectories of the paper by default.
    """
    from bottomlock.cli.campaign_output import progress_bar
    from bottomlock.cli.page_output import print_table
    from bottomlock.files.atomic_write import parquet_bytes
    from bottomlock.files.overwriting import Result
    from bottomlock.statistics.chi_squared import FALSE_ALARM
    from bottomlock.studies import cases
    from bottomlock.studies.study import cells
    from bottomlock.studies.study import study as run_study

    loaded = load_scenarios(
        scenario or cases.PAPER_TRAJECTORIES,
        runs=runs,
        seed=seed,
        methods=methods,
        threads=threads,
        world=world,
    )
    beams = {its.dvl.beams for its in loaded}
    if len(beams) != 1:
        raise ScenarioError(expected="scenarios whose instruments have the same number of beams")
    wanted = cells(loaded, masks=parse_masks(masks, beams.pop()), sensors=parse_sensors(sensors))
    for cell in wanted:
        cell.flown()
    given = {"--world": world, "--runs": runs, "--seed": seed, "--methods": methods}
    given |= {"--masks": masks, "--sensors": sensors}
    options = [f"{option} {value}" for option, value in given.items() if value is not None]
    command = " ".join(["bottomlock study", *scenario, "--out DIR", *options])
    files = [file for its in loaded for file in its.files()]
    result = Result(out, "study", "study", {"command": command}, inputs=files, resumes=True)
    result.check(force=force)
    if not result.record.exists() or force:
        # The folder is ours from now on, and the same command resumes.
        result.write({}, force=force)
    with progress_bar(out, kept="cells") as progress:
        table = run_study(wanted, folder=out / "cells", threads=threads, force=force, progress=progress)
    result.write({"study.parquet": parquet_bytes(table)}, force=force)
    if json:
        print_json({"out": str(out), "command": command, "cells": table.to_dicts()})
        return
    if table.height <= MOST_ROWS:
        for title, shown in cell_tables(table):
            print_table(title, shown)
    print_table("methods: cells by verdict, velocity error at the end", summary_table(table))
    console.print(f"false-alarm rate of all verdicts together: {FALSE_ALARM:.0%}; study.parquet in {out}")


def parse_masks(text: str | None, beams: int) -> list[tuple[int, ...] | None]:
    """Sets of beams from `1234,12,1`; every one for None.

    Raises:
        ScenarioError: for what is not a set of beams of the instrument.

    Examples:
        >>> parse_masks("1234,13", 4), parse_masks("own", 4)
        ([(1, 2, 3, 4), (1, 3)], [None])
    """
    from bottomlock.studies import cases

    known: dict[str, tuple[int, ...] | None] = {"".join(map(str, mask)): mask for mask in cases.masks(beams)}
    names = split(text) if text is not None else list(known)
    known[CONFIGURED] = None
    for name in names or [""]:
        if name not in known:
            raise ScenarioError(
                f"is no set of the beams 1 to {beams}",
                place="--masks",
                key=f"'{name}'",
                expected=f"digits in rising order, such as 12, or '{CONFIGURED}'",
            )
    return [known[name] for name in dict.fromkeys(names or [])]


def parse_sensors(text: str | None) -> list[tuple[str, ...] | None]:
    """Sets of sensors from `none,depth,depth+gps`; the scenario's own for None.

    >>> parse_sensors("none,depth+gps"), parse_sensors(None)
    ([(), ('depth', 'gps')], [None])
    """
    names = split(text) or [CONFIGURED]
    sets: dict[str, tuple[str, ...] | None] = {CONFIGURED: None, "none": ()}
    return [sets[name] if name in sets else tuple(name.split("+")) for name in dict.fromkeys(names)]


def cell_tables(table: pl.DataFrame) -> Iterator[tuple[str, Table]]:
    """A title and a table for each trajectory, beams and sensors, for 80 columns."""
    from bottomlock.cli.campaign_output import ATTITUDE, POSITION, error_rows
    from bottomlock.pages.page import Table

    columns = [
        ATTITUDE, POSITION, ("NEES 6", "nees_velocity_attitude", 1), ("NEES", "nees", 1), ("NIS", "nis", 2),
    ]  # fmt: skip
    for place, rows in table.group_by("trajectory", "beams", "sensors", maintain_order=True):
        heads, texts = error_rows(rows, columns)
        shown = [[*row, verdict or "-"] for row, verdict in zip(texts, rows["verdict"], strict=True)]
        title = "{}, beams {}, sensors {}: RMS over runs at the end".format(*place)
        yield title, Table([*heads, "verdict"], shown)


def summary_table(table: pl.DataFrame) -> Table:
    """A row a method of `files.columns.STUDY`: its cells by verdict, least and greatest velocity error, m/s."""
    import polars as pl

    from bottomlock.pages.page import Table
    from bottomlock.statistics.chi_squared import CONSERVATIVE, CONSISTENT, OVERCONFIDENT
    from bottomlock.text import plain

    velocity = pl.col("velocity_rms_over_runs_mps")
    verdicts = (CONSISTENT, OVERCONFIDENT, CONSERVATIVE)
    summed = table.group_by("method", maintain_order=True).agg(
        pl.len(),
        *((pl.col("verdict") == one).sum().alias(one) for one in verdicts),
        velocity.min().alias("least"),
        velocity.max().alias("most"),
    )
    rows = [
        [f"`{method}`", *map(str, counts), plain(least), plain(most)]
        for method, *counts, least, most in summed.rows()
    ]
    return Table(["method", "cells", *verdicts, "least, m/s", "greatest, m/s"], rows)
