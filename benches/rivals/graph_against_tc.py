"""Tight coupling against the factor graph with a factor per beam: where the two agree, and where not.

    python -m benches.rivals.graph_against_tc [--runs 20] [--lag 20] [--table benches/rivals/graph_against_tc.md]

Both take the same missions: readings, start, claimed errors. A figure of a run is the RMS over its whole seconds; a
ratio is that of the RMS over all runs, TC over graph, with a 95 % interval by drawing runs again. NEES is of the
velocity, of three degrees.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benches.rivals import factor_graph
from benches.rivals.scenario_missions import scenario_mission, tightly_coupled
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.files.atomic_write import write_text
from bottomlock.simulation.build import build_simulation
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]
DRAWS = 2000
CLAIM = 0.02


@dataclass(frozen=True)
class World:
    """A scenario by its name, the beams lost throughout, and what else is changed."""

    name: str
    scenario: str
    changes: tuple[tuple[str, object], ...] = ()
    duration_s: float = 250.0

    def load(self) -> Scenario:
        """The scenario."""
        made = load_scenario(self.scenario).with_trajectory(duration_s=self.duration_s)
        return made.replace(dict(self.changes))


def _paper(trajectory: str, mask: str) -> World:
    lost = [beam for beam in (1, 2, 3, 4) if str(beam) not in mask.split(",")]
    return World(f"{trajectory}, beams {mask or 'none'}", trajectory, (("dvl.beams_lost", lost),))


GAUSSIAN = (("robust.enabled", False), ("dvl.outlier_fraction", 0.0))
WORLDS = (
    *(_paper("straight", mask) for mask in ("1,2,3,4", "1,2,3", "1,2", "1,3", "1,4", "1")),
    *(_paper("figure_eight", mask) for mask in ("1,2,3,4", "1,2", "1,3")),
    _paper("lawn_mower", "1,2"),
    World("survey_table2 without outliers", "survey_table2", GAUSSIAN),
    World("survey_table2", "survey_table2"),
)


def main() -> None:
    """Runs every world and writes the table."""
    parser = argparse.ArgumentParser(description="Tight coupling against the factor graph.")
    parser.add_argument("--runs", type=int, default=20, help="runs of each world (default 20)")
    parser.add_argument("--lag", type=float, default=factor_graph.LAG_S, help="window of the graph, s")
    parser.add_argument("--table", type=Path, default=Path(__file__).with_suffix(".md"))
    parser.add_argument("--only", default="", help="worlds whose name contains this")
    arguments = parser.parse_args()
    rows = []
    for world in WORLDS:
        if arguments.only in world.name:
            rows.append(row(world, arguments.runs, arguments.lag))
            print(rows[-1], flush=True)
    write_text(arguments.table, page(rows, arguments.runs, arguments.lag))


def row(world: World, runs: int, lag_s: float) -> str:
    """The line of a world."""
    scenario = world.load()
    simulation = build_simulation(scenario.replace({"imu.sampling": "averaged"}))
    errors: dict[str, list[Floats]] = {"tc": [], "graph": []}
    nees: dict[str, list[float]] = {"tc": [], "graph": []}
    seconds = dict.fromkeys(errors, 0.0)
    answers: dict[str, Callable[[Mission], Estimates]] = {
        "tc": tightly_coupled,
        "graph": lambda mission: factor_graph.estimate(mission, lag_s=lag_s),
    }
    for run in range(runs):
        mission = scenario_mission(scenario, run, simulation=simulation)
        assert mission.truth is not None
        for name, answer in answers.items():
            began = time.perf_counter()
            found = answer(mission)
            seconds[name] += time.perf_counter() - began
            error = mission.truth.velocity_p_mps - found.velocity_p_mps
            errors[name].append(np.square(error).sum(axis=1).mean())
            weighed = np.linalg.solve(found.velocity_cov, error[..., None])[..., 0]
            nees[name].append(float((error * weighed).sum(axis=1).mean()))
    ratio, (low, high) = ratio_of_rms(errors["tc"], errors["graph"])
    rms = {name: float(np.sqrt(np.mean(values))) for name, values in errors.items()}
    cells = [
        world.name,
        *(f"{rms[name]:.4f}" for name in errors),
        f"{ratio:.3f} ({low:.3f}–{high:.3f})",
        verdict(low, high),
        *(f"{np.mean(nees[name]):.2f}" for name in nees),
        *(f"{seconds[name] / runs:.2f}" for name in seconds),
    ]
    return "| " + " | ".join(cells) + " |"


def ratio_of_rms(a: Sequence[Floats], b: Sequence[Floats]) -> tuple[float, Floats]:
    """RMS of a over RMS of b over all runs, and the 95 % interval of the paired bootstrap.

    Args:
        a, b: mean square error of each run.
    """
    pairs = np.stack([a, b])
    drawn = np.random.default_rng(2017).integers(0, pairs.shape[1], (DRAWS, pairs.shape[1]))
    means = pairs[:, drawn].mean(axis=2)
    ratio = float(np.sqrt(pairs[0].mean() / pairs[1].mean()))
    return ratio, np.quantile(np.sqrt(means[0] / means[1]), [0.025, 0.975])


def verdict(low: float, high: float) -> str:
    """What an interval of the ratio says of the claim that the two agree within 2 %."""
    if low >= 1.0 - CLAIM and high <= 1.0 + CLAIM:
        return "within 2 %"
    if low > 1.0 + CLAIM:
        return "graph better"
    if high < 1.0 - CLAIM:
        return "TC better"
    return "not decided"


def page(rows: Sequence[str], runs: int, lag_s: float) -> str:
    """The table with what it needs to be read."""
    return "\n".join(
        [
            "# Tight coupling against the factor graph",
            "",
            f"Made by `python -m benches.rivals.graph_against_tc --runs {runs} --lag {lag_s:g}`: {runs} runs a row,",
            f"the window of the graph {lag_s:g} s. RMS of the velocity error (norm) over 250 s in m/s; ratio TC over",
            "graph with a 95 % interval (paired bootstrap over runs); mean NEES of the velocity, 3 for a consistent",
            "filter; seconds a mission.",
            "",
            "| World | RMS TC | RMS graph | Ratio | Within 2 %? | NEES TC | NEES graph | s TC | s graph |",
            "|---|---|---|---|---|---|---|---|---|",
            *rows,
            "",
        ]
    )


if __name__ == "__main__":
    main()
