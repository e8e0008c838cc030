"""Observability of a scenario, or of the 2015 paper's cases: tables and a figure in a directory."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.config.sensors import SENSORS
from bottomlock.errors import ScenarioError
from bottomlock.figures.drawing import on_paper
from bottomlock.figures.palette import STROKES, figure_files
from bottomlock.figures.series import Curve, Figure, Panel, spreads
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.columns import MANOEUVRE_RANKING, OBSERVABILITY
from bottomlock.files.overwriting import Result
from bottomlock.kernel import BeamGeometry, kernel_version
from bottomlock.kernel.models import DvlModel, Model
from bottomlock.observability.analysis import Aiding, Deviations, Finding, Kind, Schedule, deviations, observe
from bottomlock.observability.tables import mask_table, paper_table, table_row
from bottomlock.recordings.streams import Times
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.manoeuvres import MANOEUVRES, Manoeuvre, manoeuvre_truth
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.truth import Truth
from bottomlock.units import mps2_from_mg, radps_from_deg_per_h


def manoeuvre_ranking(
    geometry: BeamGeometry,
    aiding: Aiding,
    model: Model,
    *,
    manoeuvres: Iterable[Manoeuvre] = tuple(MANOEUVRES.values()),
    kind: Kind = "full",
    period_s: float = 1.0,
    rates_hz: Mapping[str, float] | None = None,
    rate_hz: float = 50.0,
) -> pl.DataFrame:
    """Every state after every manoeuvre: observable or not, and the filter's predicted standard deviation.

    Args:
        geometry: the beams.
        aiding: the beams that return and what else aids.
        model: sensor errors, initial deviations and environment in SI (`Scenario.kernel_model`).
        manoeuvres: the candidates.
        kind: "full", or "inertial" for a filter that does not estimate the DVL's errors.
        period_s: interval between measurements, all sensors at once.
        rates_hz: in place of the period a rate for each sensor, "beams" among them (`Schedule.regular`).
        rate_hz: rate at which the motion is sampled.

    Returns:
        `files.columns.MANOEUVRE_RANKING`, manoeuvres in their order, states in the filter's.

    Raises:
        KernelError: for an empty aiding set, or a model with a value out of range.

    Examples:
        With two beams sway is unobservable on a straight course; a figure of eight makes it observable:

        >>> from bottomlock.config.scenario import load_scenario
        >>> model = load_scenario("straight").kernel_model(9.8125)
        >>> table = manoeuvre_ranking(BeamGeometry.janus(0.35), Aiding(beams=(1, 2)), model, rate_hz=10.0)
        >>> table.filter(state="velocity y").sort("sd_after")["manoeuvre"][0]
        'figure_eight'
    """
    environment = model.environment
    earth_rate_radps = environment.earth_rate_radps
    initial_sd, frames = np.array(_initial_sd(model)), []
    for manoeuvre in manoeuvres:
        truth = manoeuvre_truth(
            manoeuvre,
            rate_hz=rate_hz,
            latitude_rad=environment.latitude_rad,
            gravity_mps2=environment.gravity_mps2,
            earth_rate_radps=earth_rate_radps,
        )
        settings: dict[str, Any] = {"kind": kind, "period_s": period_s}
        if rates_hz is not None:
            settings["schedule"] = Schedule.regular(truth.time_ns, geometry.beams, rates_hz)
        (found,) = observe(truth, geometry, [aiding], earth_rate_radps=earth_rate_radps, **settings)
        history = deviations(truth, geometry, aiding, model, **settings)
        count = len(found.states)
        columns = {
            "state": found.states,
            "verdict": [_word(found, k) for k in range(count)],
            "sd_before": initial_sd[:count],
            "sd_after": history.sd[-1, :count],
        }
        frames.append(
            pl.DataFrame(columns)
            .with_columns(
                manoeuvre=pl.lit(manoeuvre.name),
                aiding=pl.lit(aiding.name),
                fraction_left=pl.when(pl.col("sd_before") > 0.0).then(
                    pl.col("sd_after") / pl.col("sd_before")
                ),
            )
            .select(list(MANOEUVRE_RANKING))
        )
    return pl.concat(frames)


def _word(found: Finding, state: int) -> str:
    if not found.decided:
        return "undecided"
    return "observable" if found.states[state] in found.observable_states else "unobservable"


def _initial_sd(model: Model) -> list[float]:
    """Standard deviations of the 20 states at the start."""
    initial, imu, dvl = model.initial, model.imu, model.of(DvlModel)
    return [
        *initial.position_sd_m,
        *initial.attitude_sd_rad,
        *initial.velocity_sd_mps,
        *[imu.accel_bias_sd_mps2] * 3,
        *[imu.gyro_bias_sd_radps] * 3,
        *[dvl.beam_bias_sd_mps] * 4,
        dvl.scale_factor_sd,
    ]


@dataclass(frozen=True, eq=False)
class Observed:
    """Tables for the terminal.

    Attributes:
        table: `files.columns.OBSERVABILITY`.
        own: name of the aiding set of the scenario itself; None for the paper's cases.
        manoeuvres: `files.columns.MANOEUVRE_RANKING`, or None.
    """

    table: pl.DataFrame
    own: str | None = None
    manoeuvres: pl.DataFrame | None = None


def scenario_schedule(simulation: Simulation, truth: Truth) -> tuple[Schedule, Schedule]:
    """Measurement times along a truth in the first run of a campaign, and the same times with every beam.

    Rates, lost beams, outages, dropouts, loss by altitude, a recorded log's validity, range and incidence over a
    seabed, and GPS at the surface alone: all as a campaign has them. In the second schedule every beam returns at
    every ping.

    Raises:
        DataError: for a truth of less than a second.
    """
    plan = measurement_schedule(simulation, truth, trajectory_key=trajectory_key(simulation.scenario.name))
    others: dict[str, Times] = {}
    for sensor in SENSORS:
        times = plan[f"{sensor.name}_time_ns"]
        received = plan.get(f"{sensor.name}_received")
        others |= dict.fromkeys(
            sensor.updates, times if received is None or not len(times) else times[received]
        )
    pings = plan["dvl_time_ns"]
    valid = plan["beam_valid"].reshape(len(pings), simulation.geometry.beams)
    schedule, every = (
        Schedule.of(truth.time_ns, dvl_time_ns=pings, beam_valid=beams, others=others)
        for beams in (valid, np.ones_like(valid))
    )
    return schedule, every


def observe_scenario(source: str | Path, out: str | Path, *, force: bool = False) -> Observed:
    """Analyses a scenario's truth for every mask of its instrument, and ranks manoeuvres for its own mask.

    Writes observability.parquet (the truth, every mask; a further row where beams come and go),
    manoeuvre_ranking.parquet, and the figure deviations.png and .svg. The measurement times are those of the
    campaign's first run (`scenario_schedule`); the truth is the vehicle's controlled on the truth. Manoeuvres are
    ranked with all the beams that ever return, and without GPS if anything else aids. With `force` the analysis of
    another scenario in the directory is replaced.

    Raises:
        ScenarioError: for a scenario that cannot be read, that nothing aids, or with more than 5000 epochs.
        DataError: for a truth of less than a second.
        OutputError: for a directory of something else, or of another scenario without `force`, and where it cannot be
            written.
    """
    out = Path(out)
    scenario = load_scenario(source)
    simulation = build_simulation(scenario)
    result = _result(out, {scenario.name: simulation.fingerprint()}, [Path(source), *scenario.files()])
    result.check(force=force)
    truth, geometry = simulation.truth(), simulation.geometry
    scheduled, every = scenario_schedule(simulation, truth)
    own = Aiding.scheduled(scheduled)
    _check_schedule(scenario, own, every)
    kind: Kind = "full" if scenario.filter.estimate_dvl else "inertial"
    model = scenario.kernel_model(simulation.gravity_mps2)
    settings: Any = {"kind": kind, "earth_rate_radps": simulation.earth_rate_radps}
    labels: Any = {"case": scenario.name, "motion": str(scenario.trajectory.kind)}
    table = mask_table(truth, geometry, own, schedule=every, **labels, **settings)
    own_name = own.name
    # Beams that come and go get a row of their own beside the mask in which they would all stay.
    returned = scheduled.beams[:, [beam - 1 for beam in own.beams]]
    if not np.array_equal(returned, every.beams[:, : len(own.beams)]):
        own_name += ", as they return"
        (found,) = observe(truth, geometry, [own], schedule=scheduled, **settings)
        row = table_row(labels["case"], own, labels["motion"], kind, found) | {"aiding": own_name}
        table = pl.concat([table, pl.DataFrame([row], schema=dict(OBSERVABILITY))])
    history = deviations(truth, geometry, own, model, kind=kind, schedule=scheduled)
    ranking = manoeuvre_ranking(geometry, _under_water(own), model, kind=kind, rates_hz=_rates_hz(scenario))
    title = f"{scenario.name.replace('_', ' ')}, aided by {own_name}: 1 sigma of every state"
    tables = {"observability": table, "manoeuvre_ranking": ranking}
    files = {f"{name}.parquet": parquet_bytes(frame) for name, frame in tables.items()}
    result.write(
        files | figure_files(on_paper(deviation_figure(history, title=title)), "deviations"), force=force
    )
    return Observed(table, own_name, ranking)


def _check_schedule(scenario: Scenario, own: Aiding, every: Schedule) -> None:
    """Checks that something aids the scenario, at no more epochs than the kernel takes.

    Raises:
        ScenarioError: naming the scenario, for nothing that aids, or too many epochs.
    """
    if own == Aiding():
        raise ScenarioError(
            "nothing aids it, no beam returns and no other sensor measures", place=f"scenario {scenario.name}"
        )
    if len(every.time_ns) > MOST_EPOCHS:
        raise ScenarioError(
            f"its sensors measure at {len(every.time_ns)} times",
            place=f"scenario {scenario.name}",
            expected=f"at most {MOST_EPOCHS}: a shorter trajectory.duration_s or slower sensors",
        )


MOST_EPOCHS = 5000
"""Epochs that the kernel takes in a window."""


def _under_water(own: Aiding) -> Aiding:
    """The aiding of a manoeuvre under water: without GPS, which is received at the surface only."""
    under_water = replace(own, gps_position=False, gps_velocity=False)
    return own if under_water == Aiding() else under_water


def _rates_hz(scenario: Scenario) -> dict[str, float]:
    rates = {"beams": scenario.dvl.rate_hz}
    for sensor in SENSORS:
        rates |= dict.fromkeys(sensor.updates, getattr(scenario, sensor.name).rate_hz)
    return rates


def observe_paper(out: str | Path, *, force: bool = False) -> Observed:
    """The six cases of Klein & Diamant 2015, both windows and both signs, in observability.parquet.

    Raises:
        OutputError: as `observe_scenario`.
    """
    result = _result(Path(out), {"Klein & Diamant 2015": kernel_version()})
    result.check(force=force)
    table = paper_table()
    result.write({"observability.parquet": parquet_bytes(table)}, force=force)
    return Observed(table)


def _result(out: Path, made_from: dict[str, str], inputs: Sequence[Path] = ()) -> Result:
    return Result(out, "observe", "observe", made_from, inputs)


GROUPS = (
    (("position",), "position, m", 1.0),
    (("velocity",), "velocity, m/s", 1.0),
    (("tilt", "yaw"), "misalignment, °", math.radians(1.0)),
    (("accel bias",), "accelerometer bias, mg", mps2_from_mg(1.0)),
    (("gyro bias",), "gyro bias, °/h", radps_from_deg_per_h(1.0)),
    (("beam bias",), "beam bias, m/s", 1.0),
    (("scale factor",), "scale factor, %", 0.01),
)
"""First words of the states that share a panel, its title, and the size of its unit in SI."""
_COLOURS = [STROKES[method].colour for method in ("tc", "vhv", "nsv", "weak_sway")]
_DASHES = ((), (6.0, 2.0), (2.0, 2.0), (6.0, 2.0, 2.0, 2.0))


def deviation_figure(history: Deviations, *, title: str) -> Figure:
    """1 sigma of every state against time; a line that stays where it began is of a state that nothing shows."""
    return Figure(title, deviation_panels(history), int(history.time_ns[0]))


def deviation_panels(history: Deviations) -> list[Panel]:
    """A panel for each group of states that the model has."""
    panels = []
    for words, title, unit_si in GROUPS:
        members = [k for k, state in enumerate(history.states) if state.startswith(words)]
        if members:
            curves = [_curve(history, k, place, unit_si) for place, k in enumerate(members)]
            panels.append(Panel(title, curves, log=spreads(curve.value for curve in curves)))
    return panels


def _curve(history: Deviations, state: int, place: int, unit_si: float) -> Curve:
    look = place % len(_COLOURS)
    return Curve(
        history.states[state],
        _COLOURS[look],
        history.time_ns,
        history.sd[:, state] / unit_si,
        dash=_DASHES[look],
    )
