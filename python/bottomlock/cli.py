"""The command `bottomlock`: campaigns, packaged scenarios, velocity fixes from logs."""

import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import cyclopts
import numpy as np
import polars as pl
from cyclopts import App, Parameter
from rich.table import Table

from bottomlock import __version__, campaign
from bottomlock import reproduce as whole_study
from bottomlock.conditions import met
from bottomlock.engine import ENGINES, check_engine
from bottomlock.errors import BottomlockError, DataError, OutputError, ScenarioError
from bottomlock.figures import flight_figure, save_figure
from bottomlock.io.beams import read_beams, read_geometry
from bottomlock.kernel import KernelError, solve_velocity
from bottomlock.merge import merge_shards
from bottomlock.output import write_parquet
from bottomlock.plan import Shard
from bottomlock.plant import telemetry
from bottomlock.replay_report import is_replay, make_replay_report
from bottomlock.report import Report, make_report
from bottomlock.scenario import copy_scenario, load_scenario, packaged_scenarios
from bottomlock.screen import conclude, console, errors, flying
from bottomlock.streams import sensor_streams
from bottomlock.trajectory import Truth
from bottomlock.world import World, make_world, trajectory_key

EXIT_USAGE = 2
EXIT_INTERRUPTED = 130

app = App(
    name="bottomlock",
    help="Aided inertial navigation with whatever Doppler velocity log beams are left.",
    version=__version__,
    console=console,
)


def _split(arms: str | None) -> list[str] | None:
    return None if arms is None else [arm.strip() for arm in arms.split(",") if arm.strip()]


def _interrupted(out: Path) -> NoReturn:
    errors.print(f"interrupted; finished chunks are kept in {out}: the same command resumes")
    sys.exit(EXIT_INTERRUPTED)


@app.command
def run(
    *scenario: str,
    out: Annotated[
        Path, Parameter(help="Directory for the results: new, or of the same campaign to resume.")
    ],
    runs: Annotated[int | None, Parameter(help="Number of runs; the scenario's own by default.")] = None,
    seed: Annotated[int | None, Parameter(help="Seed; the scenario's own by default.")] = None,
    threads: Annotated[int, Parameter(help="Threads; 0 for as many as there are cores.")] = 0,
    arms: Annotated[
        str | None, Parameter(help="Arms, separated by commas; the scenario's own by default.")
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
        load_scenario(name).with_overrides(runs=runs, seed=seed, arms=_split(arms)) for name in scenario
    ]
    part = None if shard is None else Shard.parse(shard)
    check_engine(engine, threads=threads, scheduler=scheduler)
    for one in loaded:
        make_world(one)  # a fault shows before a progress bar does
    settings: Any = {"threads": threads, "engine": engine, "scheduler": scheduler, "force": force}
    try:
        with flying(campaign.runs_to_fly(loaded, part)) as tell:
            if part is None:
                results = campaign.run_campaign(loaded, out, tell=tell, **settings)
            else:
                manifest = campaign.run_shard(loaded, out, part, tell=tell, **settings)
    except KeyboardInterrupt:
        _interrupted(out)
    if part is None:
        conclude(results, out)
    else:
        console.print(
            f"shard {part} in {out}, {manifest['wall_time_s']:.1f} s; `bottomlock merge` joins all {part.n}"
        )


@app.command
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
    conclude(merge_shards(out, shards, force=force), out)


@app.command
def fly(
    *scenario: str,
    out: Annotated[Path, Parameter(help="Directory for tables and figures.")],
    vehicle: Annotated[
        str | None, Parameter(help="Packaged vehicle or TOML file; the scenario's own by default.")
    ] = None,
    sensors: Annotated[
        int | None, Parameter(help="Write what the sensors of this run read, a table per sensor.")
    ] = None,
) -> None:
    """Swims scenarios with the vehicle: truth and telemetry to Parquet, one figure per trajectory.

    Parameters
    ----------
    scenario
        Packaged names or TOML files, one or more.
    """
    if not scenario:
        raise ScenarioError("no scenario is named; `bottomlock scenarios` lists those that ship")
    if sensors is not None and sensors < 0:
        raise ScenarioError(f"--sensors is {sensors}, expected the number of a run, 0 or more")
    for name in scenario:
        loaded = load_scenario(name)
        change = {"source": "vehicle"} | ({} if vehicle is None else {"vehicle": vehicle})
        loaded = loaded.with_trajectory(**change)
        world = make_world(loaded)
        flight = world.flight()
        frame, beams = telemetry(flight), _beams(world, flight.truth)
        write_parquet(out / f"{loaded.name}_truth.parquet", pl.DataFrame(_wide(flight.truth)))
        write_parquet(out / f"{loaded.name}_telemetry.parquet", frame)
        write_parquet(out / f"{loaded.name}_beams.parquet", beams)
        save_figure(flight_figure(frame, beams), out / f"{loaded.name}.png")
        if sensors is not None:
            for sensor, readings in sensor_streams(world, flight.truth, run=sensors).items():
                write_parquet(out / f"{loaded.name}_run{sensors}_{sensor}.parquet", readings)
        legs = frame.filter("leg") if frame["leg"].any() else frame
        astray = float(np.sqrt(np.mean(legs["cross_track_m"].to_numpy() ** 2)))
        speed, sway = (frame[f"{part}_mps"].to_numpy() for part in ("speed", "sway"))
        console.print(
            f"{loaded.name}: {speed.mean():.3f} m/s, cross-track {astray:.2f} m rms, "
            f"greatest sway {np.abs(sway).max():.3f} m/s"
        )
    console.print(f"tables and figures in {out}")


def _beams(world: World, truth: Truth) -> pl.DataFrame:
    """Which beams return in the first run and, over a seabed, from how far (m) and how obliquely (rad)."""
    plan, hits = met(world, truth, trajectory_key=trajectory_key(world.scenario.name))
    valid = plan["beam_valid"].reshape(-1, world.geometry.beams)
    columns = {"time_ns": plan["dvl_time_ns"]}
    for k in range(world.geometry.beams):
        columns[f"beam{k + 1}_valid"] = valid[:, k]
        if hits is not None:
            columns[f"beam{k + 1}_range_m"] = hits.range_m[:, k]
            columns[f"beam{k + 1}_incidence_rad"] = hits.incidence_rad[:, k]
    return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None))


def _wide(truth: Truth) -> dict[str, np.ndarray[Any, Any]]:
    """A truth as columns: one per component."""
    columns: dict[str, np.ndarray[Any, Any]] = {"time_ns": truth.time_ns}
    for name, values in truth.kernel_arrays().items():
        if name != "time_ns":
            axes = "wxyz" if values.shape[1] == 4 else "xyz"
            columns |= {f"{name}_{axis}": values[:, k] for k, axis in enumerate(axes)}
    return columns


@app.command
def scenarios(
    *,
    copy: Annotated[str | None, Parameter(help="Write this packaged scenario out to edit.")] = None,
    to: Annotated[Path | None, Parameter(help="Where to; NAME.toml here by default.")] = None,
) -> None:
    """Lists the packaged scenarios, or copies one."""
    if copy is not None:
        console.print(f"wrote {copy_scenario(copy, to or Path(f'{copy}.toml'))}")
        return
    table = Table()
    table.add_column("scenario")
    table.add_column("what it is")
    for name, description in packaged_scenarios().items():
        table.add_row(name, description)
    console.print(table)


@app.command
def fix(
    log: Path,
    *,
    geometry: Annotated[str, Parameter(help="TOML file of the DVL, or a packaged name.")],
    method: Annotated[str, Parameter(help="lc, vb, nsv, plcf, vhv, elc, info or weak_sway.")],
    out: Annotated[Path, Parameter(help="Parquet file for the fixes.")],
) -> None:
    """Turns recorded pings into velocity fixes with covariance, status and the beams used.

    Parameters
    ----------
    log
        CSV or Parquet with the columns time_ns, beam1_mps ..., beam1_valid ...; the geometry file may map others.
    """
    if out.suffix.lower() != ".parquet":
        raise OutputError(f"{out}: expected a name that ends in .parquet")
    instrument = read_geometry(geometry)
    pings = read_beams(log, beams=instrument.geometry.beams, columns=instrument.columns)
    cov = None if pings.prior_sd_mps is None else pings.prior_sd_mps[:, :, None] ** 2 * np.eye(3)
    fixes = solve_velocity(
        instrument.geometry,
        pings.velocity_mps,
        pings.valid,
        method=method,
        beam_sd_mps=instrument.beam_sd_mps,
        prior_velocity_p_mps=pings.prior_velocity_p_mps,
        prior_cov_m2ps2=cov,
    )
    frame = fixes.to_frame(pings.time_ns)
    if (frame["status"] == "prior_required").any() and pings.prior_velocity_p_mps is None:
        raise DataError(
            f"{log}: method '{method}' needs the columns prior_surge_mps, prior_sway_mps, prior_heave_mps and their sds"
        )
    write_parquet(out, frame)
    table = Table(title=f"{frame.height} pings, method {method}", title_justify="left")
    for name in ("beams", "status", "pings"):
        table.add_column(name, justify="right" if name == "pings" else "left")
    count = pl.sum_horizontal(pl.col("^beam[0-9]+_used$").cast(pl.Int64)).alias("beams")
    for row in (
        frame.group_by(count, "status").len().sort("beams", "status", descending=[True, False]).iter_rows()
    ):
        table.add_row(*(str(value) for value in row))
    console.print(table)
    console.print(f"wrote {out}")


@app.command
def reproduce(
    *,
    out: Annotated[Path, Parameter(help="Directory for the study: new, or of the same study to resume.")],
    runs: Annotated[int, Parameter(help="Runs of each trajectory.")] = whole_study.RUNS,
    seed: Annotated[int | None, Parameter(help="Seed; the scenarios' own by default.")] = None,
    threads: Annotated[int, Parameter(help="Threads; 0 for as many as there are cores.")] = 0,
    force: Annotated[
        bool, Parameter(negative="", help="Start over in a directory of another study.")
    ] = False,
) -> None:
    """Flies the whole study of the 2017 paper, judges its claims, and writes the report."""
    if threads < 0:
        raise ScenarioError(f"--threads is {threads}, expected 0 or more")
    try:
        with flying(whole_study.study_runs(runs)) as tell:
            made = whole_study.reproduce(out, runs=runs, seed=seed, threads=threads, force=force, tell=tell)
    except KeyboardInterrupt:
        _interrupted(out)
    _say(made)


@app.command
def report(directory: Path) -> None:
    """Makes report.html and figures from the tables of a campaign or a replay; of a campaign, the paper's claims too.

    Parameters
    ----------
    directory
        Where `bottomlock run` has written a finished campaign, or `bottomlock replay` a replay.
    """
    if is_replay(directory):
        console.print(f"wrote {make_replay_report(directory)}")
    else:
        _say(make_report(directory))


def _say(made: Report) -> None:
    verdicts = made.claims["verdict"].value_counts().sort("verdict")
    console.print(
        "the paper's claims: " + ", ".join(f"{count} {word}" for word, count in verdicts.iter_rows())
    )
    console.print(f"wrote {made.page}, {len(made.figures)} figures and tables/claims.parquet")


# By name: they are imported when they are called for, and the other commands start without them.
app.command(
    "bottomlock.study_commands:masks", name="masks", help="Flies every partial mask, dropouts and a slope."
)
app.command(
    "bottomlock.replay_commands:replay",
    name="replay",
    help="Navigates a recorded dive again, with fewer beams too.",
)
app.command("bottomlock.replay_commands:score", name="score", help="Leaves beams out of recorded pings.")
app.command("bottomlock.study_commands:certify", name="certify", help="Writes the honesty certificate.")
app.command("bottomlock.audit_commands:audit", name="audit", help="Says what a log tells of its DVL.")
app.command(
    "bottomlock.observe_command:observe",
    name="observe",
    help="Tells what can be estimated, and by which manoeuvre.",
)
app.command(
    "bottomlock.convert_command:convert", name="convert", help="Converts a recorded DVL log to a beam table."
)


def _fail(message: str) -> NoReturn:
    for line in message.splitlines():
        errors.print(f"bottomlock: {line}", markup=False)
    sys.exit(EXIT_USAGE)


def main() -> None:
    """Entry point: faults of usage and data end with exit code 2 and a line that names the place."""
    try:
        app(exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        _fail(" ".join(str(error).split()) + "; see `bottomlock --help`")
    except (BottomlockError, KernelError) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
