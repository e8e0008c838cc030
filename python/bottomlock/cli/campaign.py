"""The command `bottomlock run`."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from bottomlock.cli.common import ForceCampaign
from bottomlock.cli.console import say
from bottomlock.cli.parameters import CampaignOut, Json, Methods, Runs, Seed, Threads, load_scenarios
from bottomlock.errors import ScenarioError


def run(
    *scenario: str,
    out: CampaignOut | None = None,
    runs: Runs = None,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
    set_: Annotated[tuple[str, ...], Parameter(name="--set")] = (),
    force: ForceCampaign = False,
    json: Json = False,
    engine: Annotated[
        str, Parameter(help="local or dask: this process, or the workers of a Dask cluster.")
    ] = "local",
    scheduler: str | None = None,
) -> None:
    """Run a Monte Carlo campaign and print a table of RMS errors.

    Args:
        scenario: Packaged scenarios (see `bottomlock list scenarios`) or TOML files, one or more.
        set_: KEY=VALUE,VALUE...: a variant for each value, such as imu.gyro_bias_deg_per_h=0.01,3,50; more than one
            --set gives every combination.
        scheduler: Dask scheduler, tcp://host:port; by default worker processes on this machine.
    """
    from bottomlock.campaign.engine import check_engine
    from bottomlock.campaign.run import check_campaign, run_campaign
    from bottomlock.campaign.variants import check_variants, make_variants, parse_set, run_variants
    from bottomlock.cli.campaign_output import print_results, progress_bar

    loaded = load_scenarios(scenario, runs=runs, seed=seed, methods=methods, threads=threads)
    # Beside the first file, named as the scenarios; of packaged scenarios in this directory.
    out = out or Path(scenario[0]).with_name("+".join(Path(name).stem for name in scenario))
    settings: Any = {"threads": threads, "engine": engine, "scheduler": scheduler, "force": force}
    sets = [parse_set(text) for text in set_]
    for key, _ in sets:
        if [other for other, _ in sets].count(key) > 1:
            raise ScenarioError(f"--set {key} is given twice", expected="its values in one")
    variants = make_variants(loaded, dict(sets)) if sets else []
    check_engine(engine, threads=threads, scheduler=scheduler)
    # Whatever can be refused is refused before the bar.
    if variants:
        check_variants(variants, out, force=force)
    else:
        check_campaign(loaded, out, force=force)
    with progress_bar(out, sum(variant.runs for variant in variants) or None) as progress:
        if variants:
            run_variants(variants, out, progress=progress, **settings)
        else:
            results = run_campaign(loaded, out, progress=progress, **settings)
    if variants:
        _print_variants(out, len(variants), force=force)
    else:
        print_results(results, out, as_json=json)


def _print_variants(out: Path, count: int, *, force: bool) -> None:
    """Prints the variants in a directory side by side, where there are several."""
    from bottomlock.cli.campaign_output import print_comparison
    from bottomlock.report.compare import compare

    if count > 1 or (out / "compare.record.json").is_file():
        print_comparison(compare([out], out, force=force))
    say(f"{count} {'variant' if count == 1 else 'variants'} in {out}")
