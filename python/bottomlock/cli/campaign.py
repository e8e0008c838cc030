"""The commands `bottomlock run` and `bottomlock merge`."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from bottomlock.campaign.engine import ENGINES
from bottomlock.campaign.merge import merge_shards
from bottomlock.campaign.partition import Shard
from bottomlock.campaign.run import run_campaign, run_shard
from bottomlock.cli.campaign_output import print_results, progress_bar
from bottomlock.cli.console import console, interrupted
from bottomlock.cli.parameters import (
    CampaignOut,
    ForceCampaign,
    Methods,
    Recover,
    Runs,
    Seed,
    Threads,
    load_scenarios,
)


def run(
    *scenario: str,
    out: CampaignOut,
    runs: Runs = None,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
    force: ForceCampaign = False,
    recover: Recover = False,
    shard: Annotated[
        str | None,
        Parameter(help="k/n: run every n-th chunk from the k-th on; `bottomlock merge` joins the shards."),
    ] = None,
    engine: Annotated[
        str, Parameter(help=f"{' or '.join(ENGINES)}: this process, or the workers of a Dask cluster.")
    ] = "local",
    scheduler: Annotated[
        str | None,
        Parameter(help="Dask scheduler, tcp://host:port; by default worker processes on this machine."),
    ] = None,
) -> None:
    """Run a Monte Carlo campaign and print a table of RMS errors.

    Parameters
    ----------
    scenario
        Packaged scenarios (see `bottomlock scenarios`) or TOML files, one or more.
    """
    loaded = load_scenarios(scenario, runs=runs, seed=seed, methods=methods, threads=threads)
    part = None if shard is None else Shard.parse(shard)
    settings: Any = {
        "threads": threads, "engine": engine, "scheduler": scheduler, "force": force, "recover": recover,
    }  # fmt: skip
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


def merge(out: Path, *shards: Path, force: ForceCampaign = False, recover: Recover = False) -> None:
    """Join the shards of a campaign and print its table.

    The tables equal those of the campaign run in one go, bit for bit.

    Parameters
    ----------
    out
        Directory for the results.
    shards
        Directories of all shards, in any order.
    """
    print_results(merge_shards(out, shards, force=force, recover=recover), out)
