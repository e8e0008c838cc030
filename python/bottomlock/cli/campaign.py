"""The commands `bottomlock run` and `bottomlock merge`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from bottomlock.campaign.engine import check_engine
from bottomlock.campaign.merge import merge_shards
from bottomlock.campaign.partition import Shard
from bottomlock.campaign.run import check_campaign, run_campaign, run_shard
from bottomlock.campaign.until import QUANTITIES, Until, run_until
from bottomlock.cli.campaign_output import print_results, progress_bar, say_cost
from bottomlock.cli.compare import print_comparison
from bottomlock.cli.console import console, interrupted
from bottomlock.cli.engine_parameters import EngineName, Scheduler
from bottomlock.cli.force import ForceCampaign
from bottomlock.cli.parameters import (
    CampaignOut,
    Json,
    Methods,
    Recover,
    Runs,
    Seed,
    Threads,
    load_scenarios,
)
from bottomlock.config.scenario import Scenario
from bottomlock.errors import ScenarioError
from bottomlock.report.compare import compare
from bottomlock.studies.variants import (
    Variant,
    known_variants,
    make_variants,
    parse_set,
    run_variants,
    variant_runs,
)


def run(
    *scenario: str,
    out: CampaignOut,
    runs: Runs = None,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
    set_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set",
            negative="",
            help="KEY=VALUE,VALUE...: a variant for each value, such as imu.gyro_bias_deg_per_h=0.01,3,50; more than "
            "one --set gives every combination.",
        ),
    ] = (),
    force: ForceCampaign = False,
    recover: Recover = False,
    until: Annotated[
        str | None,
        Parameter(
            help="METHOD.QUANTITY<PERCENT%, such as 'tc.velocity_rms<2%': stop at the end of the chunk after which "
            "half of the 95 % interval is narrower than that, on every trajectory; --runs is the most. Quantities: "
            f"{', '.join(QUANTITIES)}."
        ),
    ] = None,
    json: Json = False,
    shard: Annotated[
        str | None,
        Parameter(help="k/n: run every n-th chunk from the k-th on; `bottomlock merge` joins the shards."),
    ] = None,
    engine: EngineName = "local",
    scheduler: Scheduler = None,
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
    parted_by = "--set" if set_ else "--shard" if part else ""
    condition = None if until is None else _condition(until, loaded, parted_by)
    variants = _variants(loaded, set_, out, part) if set_ else []
    check_engine(engine, threads=threads, scheduler=scheduler)
    campaigns = [(one.scenarios, out / one.folder) for one in variants] or [(tuple(loaded), out)]
    for scenarios, folder in campaigns:
        check_campaign(scenarios, folder, shard=part, force=force, recover=recover)
    # Whatever can be refused has been.
    parts = 1 if part is None else part.n
    say_cost([one for scenarios, _ in campaigns for one in scenarios], threads=threads, parts=parts)
    try:
        with progress_bar(variant_runs(variants) if variants else None) as progress:
            if variants:
                run_variants(variants, out, progress=progress, **settings)
            elif condition is not None:
                results = run_until(loaded, out, condition, progress=progress, **settings)
            elif part is None:
                results = run_campaign(loaded, out, progress=progress, **settings)
            else:
                manifest = run_shard(loaded, out, part, progress=progress, **settings)
    except KeyboardInterrupt:
        interrupted(out)
    if variants:
        _print_variants(out, len(variants), force=force)
    elif part is None:
        print_results(results, out, as_json=json)
    else:
        console.print(
            f"shard {part} in {out}, {manifest['wall_time_s']:.1f} s; `bottomlock merge` joins all {part.n}"
        )


def _print_variants(out: Path, count: int, *, force: bool) -> None:
    """Prints the variants in a directory side by side, where there are several."""
    if count > 1 or (out / "compare.record.json").is_file():
        print_comparison(compare([out], out, force=force))
    console.print(f"{count} {'variant' if count == 1 else 'variants'} in {out}")


def _condition(until: str, scenarios: Sequence[Scenario], parted_by: str) -> Until:
    """The condition of --until, of a campaign that no other option parts."""
    condition = Until.parse(until)
    if parted_by:
        raise ScenarioError(f"--until and {parted_by} are both given, expected one of them")
    condition.check(scenarios)
    return condition


def _variants(
    scenarios: Sequence[Scenario], sets: Sequence[str], out: Path, part: Shard | None
) -> list[Variant]:
    """The variants of --set, in a directory that can hold them."""
    if part is not None:
        raise ScenarioError("--shard and --set are both given, expected one of them")
    parsed = [parse_set(text) for text in sets]
    for key, _ in parsed:
        if [other for other, _ in parsed].count(key) > 1:
            raise ScenarioError(f"--set {key} is given twice, expected its values in one")
    known_variants(out)
    return make_variants(scenarios, dict(parsed))


def merge(
    out: Annotated[Path, Parameter(alias="-o")],
    *shards: Path,
    json: Json = False,
    force: ForceCampaign = False,
    recover: Recover = False,
) -> None:
    """Join the shards of a campaign and print its table.

    The tables equal those of the campaign run in one go, bit for bit.

    Parameters
    ----------
    out
        Directory for the results.
    shards
        Directories of all shards, in any order.
    """
    print_results(merge_shards(out, shards, force=force, recover=recover), out, as_json=json)
