"""Rivals where no beam returns from the bottom, beside our methods: a glider's dive, and simulated ten minutes.

    python -m benches.rivals.water_outages --runs 20    # water_outages.csv, a row a case and method; then water.md

Rows that are there are kept, so that a run that was cut off goes on. The glider's windows need its recording
(`BOTTOMLOCK_RECORDINGS`); without it they are left out. Everything is fixed beforehand: the windows are those of
`tests/statistical/glider.py`, the worlds those of `tests/statistical/diving.py`, the runs count from 0.
"""

import argparse
import csv
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from benches.rivals import held_velocity, pose_ukf, water_reckoning
from benches.rivals.development import averaged, mission_along
from benches.rivals.kinetic_model import Controls
from benches.rivals.model_aided import estimate_with_controls
from bottomlock.plant import Vehicle
from bottomlock.simulation.build import Simulation, build_simulation
from partialdvl_bench.methods import replayed, without_water
from partialdvl_bench.mission import Estimates, Mission
from tests.statistical import diving, glider

HERE = Path(__file__).parent
ROWS, PAGE = HERE / "water_outages.csv", HERE / "water.md"
FIRST_MARK, LAST_MARK = "<!-- table: {} -->\n", "<!-- end -->"

HIDDEN_S = (60.0, 300.0, 600.0)
SIMULATED = ("steady", "sheared", "turning")
GLIDER = "glider"

Answer = Callable[[Mission], Estimates]


class Row(NamedTuple):
    """A case and a method: horizontal error at the end, m, and over the claimed sigma, NaN where none is claimed."""

    world: str
    hidden_s: int
    case: int
    method: str
    error_m: float
    error_over_sd: float


def ours() -> dict[str, Answer]:
    """Our methods, with and without the water."""
    return {
        "tc": lambda mission: replayed(mission, "tc"),
        "sway_current": lambda mission: replayed(mission, "sway_current"),
        "tc, no water": lambda mission: replayed(without_water(mission), "tc"),
        "sway_current, no water": lambda mission: replayed(without_water(mission), "sway_current"),
    }


WITHOUT_IMU: Mapping[str, Answer] = {
    "last velocity": water_reckoning.estimate_held,
    "water alone": water_reckoning.estimate_alone,
    "water, recent current": water_reckoning.estimate_recent,
    "pose_ukf": pose_ukf.estimate,
    **ours(),
}
"""On the glider: it has no inertial sensor, and no model of the vehicle is at hand."""

LEAD = 200
"""Pings before a window, ten minutes, with which rivals begin on the glider, for their cost; ours have all before."""


def simulated_methods(simulation: Simulation) -> dict[str, Answer]:
    """Those of the glider, the INS that is fed the last velocity, and the model with the flight's fins and shaft."""
    flight, vehicle = simulation.flight(), simulation.vehicle
    assert isinstance(vehicle, Vehicle)
    history = flight.history
    controls = Controls(history.time_ns, history.state[:, 13:17], history.state[:, 17])
    return {
        **WITHOUT_IMU,
        "held_velocity": held_velocity.estimate,
        "model_aided": lambda mission: estimate_with_controls(mission, vehicle, controls),
    }


def simulated(world: str) -> Simulation:
    """A world with water track, whose inertial samples are means."""
    scenario = diving.diving_scenario(diving.STEADY | diving.WORLDS[world], water_track={})
    return build_simulation(averaged(scenario))


def at_the_end(mission: Mission, estimates: Estimates) -> tuple[float, float]:
    """Horizontal error of the position, m, and over its sigma."""
    assert mission.truth is not None
    assert estimates.position_t_m is not None
    off = (mission.truth.position_t_m - estimates.position_t_m)[-1, :2]
    error_m = float(np.hypot(*off))
    if estimates.position_cov is None:
        return error_m, float("nan")
    return error_m, error_m / float(np.sqrt(np.trace(estimates.position_cov[-1, :2, :2])))


def simulated_rows(world: str, runs: int, done: set[tuple[str, int, int, str]]) -> Iterator[Row]:
    """Every run of a world by every method that is not done yet."""
    simulation = simulated(world)
    methods = simulated_methods(simulation)
    hidden_s = round(diving.DURATION_S - diving.LOCK_S)
    for run in range(runs):
        due = [name for name in methods if (world, hidden_s, run, name) not in done]
        if not due:
            continue
        mission = mission_along(simulation, simulation.truth(), run=run)
        for name in due:
            yield Row(world, hidden_s, run, name, *at_the_end(mission, methods[name](mission)))


def glider_rows(recordings: Path, done: set[tuple[str, int, int, str]]) -> Iterator[Row]:
    """Every window by every method that is not done yet; a case is the first ping that is hidden."""
    with TemporaryDirectory() as folder:
        dive = glider.read_dive(recordings, Path(folder))
    for seconds in HIDDEN_S:
        for first, last in glider.windows(dive, seconds):
            due = [name for name in WITHOUT_IMU if (GLIDER, round(seconds), first, name) not in done]
            if not due:
                continue
            whole = glider.mission_of_window(dive, first, last, water=True)
            begin = int(np.flatnonzero(glider.known(dive.velocity_p_mps)[: max(first - LEAD, 0) + 1])[-1])
            late = glider.mission_of_window(dive, first, last, water=True, begin=begin)
            for name in due:
                answer = WITHOUT_IMU[name](whole if name in ours() else late)
                found = glider.errors_of_window(dive, first, last, answer)
                yield Row(GLIDER, round(seconds), first, name, found.error_m, found.over_sd)


def read_rows(path: Path = ROWS) -> list[Row]:
    """The rows of a file, none where it is not there."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Row(
                one["world"], int(one["hidden_s"]), int(one["case"]), one["method"],
                float(one["error_m"]), float(one["error_over_sd"]),
            )
            for one in csv.DictReader(file)
        ]  # fmt: skip


def table(rows: list[Row], *, of_glider: bool) -> str:
    """Markdown: a line a method, for each world median (90 %, greatest) of the error and RMS of error over sigma."""
    kept = [row for row in rows if (row.world == GLIDER) == of_glider]
    worlds = list(dict.fromkeys((row.world, row.hidden_s) for row in kept))
    heads = [f"{hidden} s" if of_glider else world for world, hidden in worlds]
    lines = [
        "| method | " + " | ".join(f"{head}, m | error/σ" for head in heads) + " |",
        "|---|" + "---|---|" * len(heads),
    ]
    for name in dict.fromkeys(row.method for row in kept):
        cells = [name]
        for world in worlds:
            of = [row for row in kept if (row.world, row.hidden_s, row.method) == (*world, name)]
            errors = np.array([row.error_m for row in of])
            ratio = float(np.sqrt(np.mean(np.square([row.error_over_sd for row in of]))))
            middle, most = np.quantile(errors, [0.5, 0.9])
            cells.append(f"{middle:.3g} ({most:.3g}, {errors.max():.3g})")
            cells.append("–" if np.isnan(ratio) else f"{ratio:.2f}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def tables(rows: list[Row]) -> dict[str, str]:
    """Both tables of the page."""
    return {name: table(rows, of_glider=name == GLIDER) for name in ("simulated", GLIDER)}


def write_page(rows: list[Row], page: Path = PAGE) -> None:
    """Replaces the tables between their marks."""
    text = page.read_text(encoding="utf-8")
    for name, content in tables(rows).items():
        head, rest = text.split(FIRST_MARK.format(name), 1)
        text = head + FIRST_MARK.format(name) + content + LAST_MARK + rest.split(LAST_MARK, 1)[1]
    page.write_text(text, encoding="utf-8")


def main() -> None:
    """Adds the rows that are missing, and writes the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--worlds", nargs="+", choices=(GLIDER, *SIMULATED), default=(GLIDER, *SIMULATED))
    words = parser.parse_args()
    before = read_rows(words.rows)
    done = {row[:4] for row in before}
    recordings = os.environ.get("BOTTOMLOCK_RECORDINGS")
    with words.rows.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if not before:
            writer.writerow(Row._fields)
        for world in words.worlds:
            if world == GLIDER:
                if recordings is None:
                    continue
                found = glider_rows(Path(recordings), done)
            else:
                found = simulated_rows(world, words.runs, done)
            for row in found:
                writer.writerow([*row[:4], f"{row.error_m:.4f}", f"{row.error_over_sd:.4f}"])
                file.flush()
    if words.rows == ROWS:
        order = {name: k for k, name in enumerate((GLIDER, *SIMULATED))}
        rows = sorted(read_rows(), key=lambda row: (order[row.world], row.hidden_s, row.case))
        write_page(rows)


if __name__ == "__main__":
    main()
