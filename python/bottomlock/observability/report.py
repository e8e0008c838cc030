"""Observability of a scenario, or of the 2015 paper's cases: tables and figures in a directory."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.config.sensors import SENSORS
from bottomlock.errors import ScenarioError
from bottomlock.figures.palette import png_bytes
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Files, Result
from bottomlock.kernel import kernel_version
from bottomlock.observability.analysis import Aiding, Deviations, Finding, Kind, deviations, observe
from bottomlock.observability.figures import deviation_figure, figure_names
from bottomlock.observability.manoeuvre_ranking import manoeuvre_ranking
from bottomlock.observability.mask_figure import mask_figure
from bottomlock.observability.page import page
from bottomlock.observability.schedule import Schedule, Times
from bottomlock.observability.tables import (
    MODELS,
    PAPER_CASES,
    manoeuvre_table,
    mask_table,
    paper_histories,
    paper_table,
    table_row,
)
from bottomlock.pages.page import Picture, html
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.tables.observability import DEVIATIONS, OBSERVABILITY, RANKS
from bottomlock.truth.truth import Truth

_ERRORS_OF = "straight"
"""The packaged scenario whose sensor errors are used for figures 1-6: the 2015 paper prints initial biases only."""


@dataclass(frozen=True, eq=False)
class Observed:
    """Tables for the terminal, and paths of the figures.

    Attributes:
        table: `tables.observability.OBSERVABILITY`.
        own: name of the aiding set of the scenario itself; None for the paper's cases.
        manoeuvres: `tables.observability.MANOEUVRE_RANKING`, or None.
        figures: paths.
    """

    table: pl.DataFrame
    own: str | None
    manoeuvres: pl.DataFrame | None
    figures: tuple[Path, ...]


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

    Writes observability.parquet (the truth, every mask; a further row where beams come and go), manoeuvres.parquet
    (every mask by six manoeuvres by three sets of further sensors, on an Earth at rest and a turning one),
    deviations.parquet, ranks.parquet, manoeuvre_ranking.parquet, two figures and
    observability.html. The measurement times are those of the
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
    table = mask_table(truth, geometry, [own], schedule=every, **labels, **settings)
    own_name = own.name
    # Beams that come and go get a row of their own beside the mask in which they would all stay.
    returned = scheduled.beams[:, [beam - 1 for beam in own.beams]]
    if not np.array_equal(returned, every.beams[:, : len(own.beams)]):
        own_name += ", as they return"
        (found,) = observe(truth, geometry, [own], schedule=scheduled, **settings)
        row = table_row(labels["case"], own, labels["motion"], kind, found) | {"aiding": own_name}
        table = pl.concat([table, pl.DataFrame([row], schema=dict(OBSERVABILITY))])
    history = deviations(truth, geometry, own, model, kind=kind, schedule=scheduled)
    (found,) = observe(
        truth, geometry, [own], schedule=scheduled.gathered(_WINDOWS), growing=True, **settings
    )
    labels = labels | {"model": MODELS[kind]}
    sds, ranks = _deviations(history, found, labels), _ranks(found, labels)
    ranking = manoeuvre_ranking(geometry, _under_water(own), model, kind=kind, rates_hz=_rates_hz(scenario))
    every_mask = manoeuvre_table(geometry)
    tables = {"observability": table, "deviations": sds, "ranks": ranks, "manoeuvre_ranking": ranking}
    names = (scenario.name, "masks_by_manoeuvres")
    title = f"{scenario.name.replace('_', ' ')}, aided by {own_name}"
    words = (
        "Standard deviation of every state, and rank of the window, against time.",
        "Observable states by valid beams and manoeuvre, with further sensors to the right; Earth at rest and turning.",
    )
    drawn = (
        deviation_figure(sds, ranks, scenario.name, title=title),
        mask_figure(every_mask, title="masks by manoeuvres, 20 states"),
    )
    drawings = [_Drawing(*one) for one in zip(names, words, drawn, strict=True)]
    tables |= {"manoeuvres": every_mask}
    return _written(result, Observed(table, own_name, ranking, ()), tables, drawings, force=force)


def _check_schedule(scenario: Scenario, own: Aiding, every: Schedule) -> None:
    """Checks that something aids the scenario, at no more epochs than the kernel takes.

    Raises:
        ScenarioError: naming the scenario, for nothing that aids, or too many epochs.
    """
    if own == Aiding():
        raise ScenarioError(
            f"scenario {scenario.name}: nothing aids it, no beam returns and no other sensor measures"
        )
    if len(every.time_ns) > MOST_EPOCHS:
        raise ScenarioError(
            f"scenario {scenario.name}: its sensors measure at {len(every.time_ns)} times, expected at most "
            f"{MOST_EPOCHS}: a shorter trajectory.duration_s or slower sensors"
        )


def _deviations(history: Deviations, found: Finding, labels: dict[str, str]) -> pl.DataFrame:
    """Standard deviations of every state against time (`DEVIATIONS`)."""
    return pl.concat(
        _with(pl.DataFrame({"time_ns": history.time_ns, "sd": history.sd[:, k]}), labels | {"state": state})
        for k, state in enumerate(found.states)
    ).select(list(DEVIATIONS))


MOST_EPOCHS = 5000
"""Epochs that the kernel takes in a window."""

_WINDOWS = 120
"""Windows of the rank's history."""


def _under_water(own: Aiding) -> Aiding:
    """The aiding of a manoeuvre under water: without GPS, which is received at the surface only."""
    under_water = replace(own, gps_position=False, gps_velocity=False)
    return own if under_water == Aiding() else under_water


def _rates_hz(scenario: Scenario) -> dict[str, float]:
    rates = {"beams": scenario.dvl.rate_hz}
    for sensor in SENSORS:
        rates |= dict.fromkeys(sensor.updates, getattr(scenario, sensor.name).rate_hz)
    return rates


def _ranks(found: Finding, labels: dict[str, str]) -> pl.DataFrame:
    assert found.rank_history is not None
    assert found.decided_history is not None
    columns = {
        "time_ns": found.time_ns[1:],
        "rank": found.rank_history[1:],
        "decided": found.decided_history[1:],
    }
    frame = _with(pl.DataFrame(columns), labels).with_columns(printed_rank=pl.lit(None, pl.Int64))
    return frame.select(list(RANKS))


def observe_paper(out: str | Path, *, force: bool = False) -> Observed:
    """The six cases of Klein & Diamant 2015, both windows and both signs: tables and figures 1-6.

    Raises:
        OutputError: as `observe_scenario`.
    """
    out = Path(out)
    result = _result(out, {"Klein & Diamant 2015": kernel_version()})
    result.check(force=force)
    table = paper_table()
    model = load_scenario(_ERRORS_OF).kernel_model(9.8125)
    sds, ranks = paper_histories(model)
    names = figure_names([case.name for case in PAPER_CASES])
    drawings = []
    for case in PAPER_CASES:
        title = f"{case.name} (Klein & Diamant 2015, figure {case.figure})"
        unobservable = _unobservable_directions(table.filter(case=case.name, model=case.model("paper")))
        figure = deviation_figure(sds, ranks, case.name, title=title, unobservable=unobservable)
        words = f"{case.name}: standard deviations and rank against time."
        drawings.append(_Drawing(names[case.name], words, figure))
    tables = {"observability": table, "deviations": sds, "ranks": ranks}
    return _written(result, Observed(table, None, None, ()), tables, drawings, force=force)


class _Drawing(NamedTuple):
    name: str
    caption: str
    figure: Figure


def _result(out: Path, made_from: dict[str, str], inputs: Sequence[Path] = ()) -> Result:
    return Result(out, "observe", "observe", made_from, inputs)


def _written(
    result: Result,
    made: Observed,
    tables: dict[str, pl.DataFrame],
    drawings: Sequence[_Drawing],
    *,
    force: bool,
) -> Observed:
    """Tables, figures and page on the disk, and where the figures are."""
    pictures = [Picture.of(one.figure, one.name, one.caption) for one in drawings]
    figures: Files = {f"figures/{one.name}.png": png_bytes(one.figure) for one in drawings}
    files = {f"{name}.parquet": parquet_bytes(frame) for name, frame in tables.items()}
    text = html(page(made.table, made.manoeuvres, pictures))
    result.write(figures | files | {"observability.html": text}, force=force)
    return replace(made, figures=tuple(result.out / name for name in figures))


_ROOM = 9
"""Lines of words that a panel holds."""


def _unobservable_directions(rows: pl.DataFrame) -> list[str]:
    """Unobservable directions of each window; none where they would not fit."""
    words: list[str] = []
    for row in rows.iter_rows(named=True):
        words += [f"{row['motion']}:"] if rows.height > 1 else []
        words += [f"   {direction}" for direction in row["unobservable"]]
    return words if len(words) <= _ROOM else []


def _with(frame: pl.DataFrame, labels: dict[str, str]) -> pl.DataFrame:
    return frame.with_columns(**{name: pl.lit(value) for name, value in labels.items()})
