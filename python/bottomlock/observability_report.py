"""Observability of a scenario, or of the 2015 paper's cases: tables and figures in a directory."""

from dataclasses import dataclass
from pathlib import Path

import polars as pl

from bottomlock import schema
from bottomlock.errors import OutputError, ScenarioError
from bottomlock.figures import save_figure
from bottomlock.observability import Aiding, deviations, observe
from bottomlock.observability_figures import deviation_figure, figure_names
from bottomlock.observability_study import (
    MODELS,
    PAPER_CASES,
    manoeuvre_table,
    mask_table,
    paper_histories,
    paper_table,
)
from bottomlock.output import write_parquet
from bottomlock.planner import plan
from bottomlock.scenario import Scenario, load_scenario
from bottomlock.world import make_world

_ERRORS_OF = "straight"
"""The packaged scenario whose sensor errors stand behind figures 1-6: the 2015 paper prints initial biases alone."""


@dataclass(frozen=True, eq=False)
class Observed:
    """What was written, and the tables for the screen.

    Attributes:
        table: `schema.OBSERVABILITY`.
        own: the aiding set of the scenario itself; None for the paper's cases.
        manoeuvres: `schema.PLAN`, or None.
        figures: paths.
    """

    table: pl.DataFrame
    own: Aiding | None
    manoeuvres: pl.DataFrame | None
    figures: tuple[Path, ...]


def scenario_aiding(scenario: Scenario) -> Aiding:
    """What aids a scenario: the beams that are never lost as a whole, and the sensors that are switched on."""
    lost = set(scenario.dvl.beams_lost)
    return Aiding(
        beams=tuple(beam for beam in range(1, scenario.dvl.beams + 1) if beam not in lost),
        depth=scenario.depth.enabled,
        attitude=scenario.magnetometer.enabled,
        gps_position=scenario.gps.enabled,
        gps_velocity=scenario.gps.enabled,
    )


def observe_scenario(source: str | Path, out: Path) -> Observed:
    """Judges a scenario's truth for every mask of its instrument, and plans manoeuvres for its own mask.

    Writes observability.parquet (the truth, every mask), manoeuvres.parquet (every mask by six manoeuvres by three
    sets of further sensors, on an Earth at rest and a turning one), deviations.parquet, ranks.parquet, plan.parquet
    and a figure. Sensors are taken to measure together once a second, and lost beams to be lost throughout.

    Raises:
        ScenarioError: for a scenario that cannot be read, or that nothing aids.
        OutputError: where the directory cannot be written.
    """
    scenario = load_scenario(source)
    world = make_world(scenario)
    own = scenario_aiding(scenario)
    if own == Aiding():
        raise ScenarioError(f"scenario {scenario.name}: every beam is lost and no other sensor aids")
    truth, geometry = world.truth(), world.geometry
    motion = scenario.trajectory.kind
    earth_rate_radps = world.earth_rate_radps
    table = mask_table(
        truth, geometry, [own], case=scenario.name, motion=motion, earth_rate_radps=earth_rate_radps
    )
    model = scenario.kernel_model(world.gravity_mps2)
    history = deviations(truth, geometry, own, model)
    (found,) = observe(
        truth, geometry, [own], earth_rate_radps=earth_rate_radps, period_s=_growing_period_s(truth.time_ns[-1]),
        growing=True,
    )  # fmt: skip
    labels = {"case": scenario.name, "motion": motion, "model": MODELS["full"]}
    sds = pl.concat(
        _with(pl.DataFrame({"time_ns": history.time_ns, "sd": history.sd[:, k]}), labels | {"state": state})
        for k, state in enumerate(history.states)
    ).select(list(schema.DEVIATIONS))
    assert found.rank_history is not None
    assert found.decided_history is not None
    ranks = _with(
        pl.DataFrame(
            {
                "time_ns": found.time_ns[1:],
                "rank": found.rank_history[1:],
                "decided": found.decided_history[1:],
            }
        ),
        labels,
    ).with_columns(printed_rank=pl.lit(None, pl.Int64))
    ranks = ranks.select(list(schema.RANKS))
    manoeuvres = plan(geometry, own, model)
    figure = deviation_figure(
        sds, ranks, scenario.name, title=f"{scenario.name.replace('_', ' ')}, aided by {own.name}"
    )
    tables = {"observability": table, "deviations": sds, "ranks": ranks, "plan": manoeuvres}
    _write(out, tables | {"manoeuvres": manoeuvre_table(geometry)})
    path = out / "figures" / f"{scenario.name}.png"
    save_figure(figure, _made(path))
    return Observed(table, own, manoeuvres, (path,))


def observe_paper(out: Path) -> Observed:
    """The six cases of Klein & Diamant 2015, both windows and both signs: tables and figures 1-6.

    Raises:
        OutputError: where the directory cannot be written.
    """
    table = paper_table()
    model = load_scenario(_ERRORS_OF).kernel_model(9.8125)
    sds, ranks = paper_histories(model)
    _write(out, {"observability": table, "deviations": sds, "ranks": ranks})
    names = figure_names([case.name for case in PAPER_CASES])
    paths = []
    for case in PAPER_CASES:
        path = out / "figures" / f"{names[case.name]}.png"
        title = f"{case.name} (Klein & Diamant 2015, figure {case.figure})"
        hidden = _hidden_words(table.filter(case=case.name, model=MODELS["paper"]))
        save_figure(deviation_figure(sds, ranks, case.name, title=title, hidden=hidden), _made(path))
        paths.append(path)
    return Observed(table, None, None, tuple(paths))


_ROOM = 9
"""Lines of words that a panel holds."""


def _hidden_words(rows: pl.DataFrame) -> list[str]:
    """Unobservable directions of each window; none where they would not fit."""
    words: list[str] = []
    for row in rows.iter_rows(named=True):
        words += [f"{row['motion']}:"] if rows.height > 1 else []
        words += [f"   {direction}" for direction in row["unobservable"]]
    return words if len(words) <= _ROOM else []


def _growing_period_s(last_ns: int) -> float:
    """About a hundred windows, whole seconds apart."""
    return max(1.0, round(last_ns * 1e-11))


def _with(frame: pl.DataFrame, labels: dict[str, str]) -> pl.DataFrame:
    return frame.with_columns(**{name: pl.lit(value) for name, value in labels.items()})


def _made(path: Path) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path.parent}: cannot be made ({error.strerror})") from error
    return path


def _write(out: Path, tables: dict[str, pl.DataFrame]) -> None:
    for name, frame in tables.items():
        write_parquet(out / f"{name}.parquet", frame)
