"""The commands `bottomlock run` and `bottomlock merge`."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from bottomlock.campaign.engine import ENGINES, check_engine
from bottomlock.campaign.merge import merge_shards
from bottomlock.campaign.partition import Shard
from bottomlock.campaign.run import run_campaign, run_shard
from bottomlock.cli.campaign_output import print_results, progress_bar
from bottomlock.cli.console import console, interrupted
from bottomlock.config.scenario import load_scenario
from bottomlock.errors import ScenarioError


def _split(methods: str | None) -> list[str] | None:
    return None if methods is None else [method.strip() for method in methods.split(",") if method.strip()]


def run(
    *scenario: str,
    out: Annotated[
        Path, Parameter(help="Directory for the results: new, or of the same campaign to resume.")
    ],
    runs: Annotated[int | None, Parameter(help="Number of runs; the scenario's own by default.")] = None,
    seed: Annotated[int | None, Parameter(help="Seed; the scenario's own by default.")] = None,
    threads: Annotated[int, Parameter(help="Threads; 0 for as many as there are cores.")] = 0,
    methods: Annotated[
        str | None, Parameter(help="Methods, separated by commas; the scenario's own by default.")
    ] = None,
    force: Annotated[
        bool, Parameter(negative="", help="Start over in a directory of another campaign.")
    ] = False,
    shard: Annotated[
        str | None,
        Parameter(help="k/n: fly every n-th chunk from the k-th; `bottomlock merge` joins the shards."),
    ] = None,
    engine: Annotated[
        str, Parameter(help=f"{' or '.join(ENGINES)}: this process, or the workers of a cluster.")
    ] = "local",
    scheduler: Annotated[
        str | None, Parameter(help="Dask scheduler, tcp://host:port; without it, processes on this machine.")
    ] = None,
) -> None:
    """Flies a Monte Carlo campaign and prints the table of RMS errors.

    Parameters
    ----------
    scenario
        Packaged names (see `bottomlock scenarios`) or TOML files, one or more.
    """
    if not scenario:
        raise ScenarioError("no scenario is named; `bottomlock scenarios` lists those that ship")
    if threads < 0:
        raise ScenarioError(f"--threads is {threads}, expected 0 or more")
    loaded = [
        load_scenario(name).with_overrides(runs=runs, seed=seed, methods=_split(methods)) for name in scenario
    ]
    check_engine(engine, threads=threads, scheduler=scheduler)
    part = None if shard is None else Shard.parse(shard)
    settings: Any = {"threads": threads, "engine": engine, "scheduler": scheduler, "force": force}
    try:
        with progress_bar() as progress:
            if part is None:
                results = run_campaign(loaded, out, progress=progress, **settings)
            else:
                manifest = run_shard(loaded, out, part, progress=progress, **settings)
    except KeyboardInterrupt:
        interrupted(out)
    if part is None:
        print_results(results, out)
    else:
        console.print(
            f"shard {part} in {out}, {manifest['wall_time_s']:.1f} s; `bottomlock merge` joins all {part.n}"
        )


def merge(
    out: Path,
    *shards: Path,
    force: Annotated[
        bool, Parameter(negative="", help="Start over in a directory of another campaign.")
    ] = False,
) -> None:
    """Joins the shards of a campaign: the tables are those of the campaign flown in one go.

    Parameters
    ----------
    out
        Directory for the results.
    shards
        Directories of all shards, in any order.
    """
    print_results(merge_shards(out, shards, force=force), out)
