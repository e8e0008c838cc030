"""The measured tables of docs/methods/sway_current.md, and of two more pages: `python -m tools.sway_measured [PAGE]`.

Beams 1 and 2 on the paper's trajectories, flown by the vehicle, in still water and across a current; four beams for
`lc`. `python -m tools.sway_measured consistent` makes those of docs/methods/consistent.md, with a pivot that the prior
does not have; `linear_range` that of docs/linear_range.md, where a bound on the speed helps. Writes the tables into the
page, and changes nothing else.
"""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.simulation.build import build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.studies.cases import PAPER_TRAJECTORIES
from bottomlock.studies.sensor_law import CROSS_CURRENT_MPS, variant
from tools.recorded_tables import number, table
from tools.score_recorded import write_tables

DOCS = Path(__file__).resolve().parent.parent / "docs"
RUNS, SEED, EVERY_S, RESAMPLES = 400, 20170222, 5.0, 1000
BEAMS: Mapping[str, tuple[int, ...]] = {"lc": (1, 2, 3, 4)}
"""Beams of a method; the others have the first and the second."""
STILL = ("lc", "tc", "weak_sway", "sway_current")
ACROSS = ("lc", "tc", "nsv", "elc", "weak_sway", "sway_current")
WORDS = {"lc": "LC, four beams", "tc": "TC", "nsv": "NSV", "elc": "selector"}
STILL_WATER: Mapping[str, float] = {}
CROSS_CURRENT: Mapping[str, float] = {"speed_mps": CROSS_CURRENT_MPS}
STEADY_S, DEFAULT_S, COST_RUNS = 21_600.0, 1_800.0, 100
"""Time constants of the current: the paper's scenarios', the default; and the runs that compare them."""
SELECTED_RUNS, SELECTED = 100, ("lc", "tc", "nsv", "weak_sway", "consistent")
CURRENT_RUNS, CURRENT_METHODS = 60, ("tc", "nsv", "sway_current")
CURRENTS: Mapping[str, Mapping[str, float]] = {
    "0.6 m/s across (2 sigma)": {"speed_mps": 0.6},
    "1.0 m/s across (3.3 sigma)": {"speed_mps": 1.0},
    "0.3 m/s, varying by 5 cm/s in 2 min": {"speed_mps": 0.3, "wander_sd_mps": 0.05, "wander_time_s": 120.0},
    "0.3 m/s, varying by 10 cm/s in 2 min": {"speed_mps": 0.3, "wander_sd_mps": 0.1, "wander_time_s": 120.0},
    "0.2 m/s, sheared by 1 cm/s per metre of depth": {"speed_mps": 0.2, "shear_east_mps_per_m": 0.01},
}
PIVOT_RUNS, PIVOTS_M, PIVOT_METHODS = 40, (0.6, -2.0, -5.0), ("tc", "sway_current", "consistent")
"""Sway of an analytic truth over its yaw rate; the prior has 0.6 ± 0.3 m."""
BOUND_RUNS, BOUND_FROM_S, SPEED_SD_MPS = 100, 50.0, 3.0
BOUND_BEAMS = ((1, 3), (2, 4), (1,), (1, 2))
TIMES_S = (10, 20, 30, 50, 100, 150, 200, 250)
VELOCITY, ATTITUDE, POSITION = slice(6, 9), slice(3, 6), slice(0, 3)

Array = NDArray[np.float64]


def flown(
    trajectory: str,
    current: Mapping[str, float],
    method: str,
    runs: int = RUNS,
    *,
    beams: tuple[int, ...] | None = None,
    sensors: tuple[str, ...] = (),
    keys: Mapping[str, Any] = MappingProxyType({}),
    analytic: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """The kernel's batch of one method, a sample every `EVERY_S`.

    Args:
        trajectory: packaged name.
        current: keys of `[mission.current]`, of one that sets to the east; empty for still water.
        method: its name.
        runs: number of runs.
        beams: that return.
        sensors: beside IMU and beams, as in the sensor law's study.
        keys: values of other keys of the scenario.
        analytic: keys of an analytic truth in place of the vehicle.
    """
    scenario = variant(load_scenario(trajectory), beams or BEAMS.get(method, (1, 2)), sensors, 0.0)
    if analytic is not None:
        scenario = scenario.with_trajectory(source="analytic", kind=trajectory, **analytic)
    scenario = scenario.replace(keys)
    if current:
        moved = {"current": {"towards_deg": 90.0} | dict(current)}
        scenario = scenario.model_copy(update={"mission": scenario.mission | moved})
    simulation = build_simulation(scenario)
    truth, key = simulation.truth(), trajectory_key(scenario.name)
    plan: Any = measurement_schedule(simulation, truth, trajectory_key=key)
    last_s = (plan["sample_time_ns"][-1] - truth.time_ns[0]) * 1e-9
    plan["sample_time_ns"] = (
        truth.time_ns[0] + np.arange(EVERY_S, last_s + 0.5, EVERY_S).astype(np.int64) * 10**9
    )
    model, arrays = scenario.kernel_model(simulation.gravity_mps2), truth.kernel_arrays()
    batch = kernel.run_batch(
        simulation.geometry, arrays, model, model, scenario.kernel_options(), plan, [method],  # type: ignore[arg-type]
        seed=SEED, trajectory_key=key, first_run=0, runs=runs, threads=0,
    )  # fmt: skip
    return dict(batch)


def squares(batch: Mapping[str, Any], which: slice) -> Array:
    """(runs, times) squared norms of the error."""
    return np.asarray(np.sum(batch["error"][:, 0, :, which] ** 2, axis=-1))


def row(words: str, batch: Mapping[str, Any]) -> list[str]:
    """Velocity with its interval, at the end, attitude, position, NEES."""
    velocity = squares(batch, VELOCITY)
    drawn = np.random.default_rng(SEED).integers(0, len(velocity), size=(RESAMPLES, len(velocity)))
    low, high = np.quantile(np.sqrt(velocity.mean(axis=1)[drawn].mean(axis=1)), [0.025, 0.975])
    digits = 3 if velocity.mean() < 1.0 else 2 if velocity.mean() < 50.0 else 1

    def nees(name: str, digits: int) -> str:
        means = batch[name][:, 0].mean(axis=1)
        half = stats.t.ppf(0.975, len(means) - 1) * means.std(ddof=1) / np.sqrt(len(means))
        return (
            f"{means.mean():.{digits}f} ± {half:.{digits}f}"
            if means.mean() < 100.0
            else f"{means.mean():.0f} ± {half:.0f}"
        )

    return [
        words,
        f"{np.sqrt(velocity.mean()):.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]",
        f"{np.sqrt(velocity[:, -1].mean()):.{digits}f}",
        f"{np.rad2deg(np.sqrt(squares(batch, ATTITUDE).mean())):.3f}",
        f"{np.sqrt(squares(batch, POSITION)[:, -1].mean()):.4g}",
        nees("nees_velocity_attitude", 2),
        nees("nees", 1),
    ]


def cost_row(trajectory: str, beams: tuple[int, ...], runs: int) -> list[str]:
    """What the default prior of the current adds to the velocity RMS and to its claim, %, where it is constant."""
    steady, default = (
        flown(
            trajectory,
            STILL_WATER,
            "sway_current",
            runs,
            beams=beams,
            keys={"filter.water.current_time_s": time_s},
        )
        for time_s in (STEADY_S, DEFAULT_S)
    )
    rms = [np.sqrt(squares(batch, VELOCITY).mean()) for batch in (steady, default)]
    claimed = [
        np.sqrt(np.sum(batch["sd"][:, 0, :, VELOCITY] ** 2, axis=-1).mean()) for batch in (steady, default)
    ]
    nees = default["nees_velocity_attitude"][:, 0].mean()
    more = [f"{100.0 * (pair[1] / pair[0] - 1.0):+.0f}" for pair in (rms, claimed)]
    return [trajectory, ",".join(map(str, beams)), *(f"{value:.3f}" for value in rms), *more, f"{nees:.1f}"]


def cost_table(runs: int = COST_RUNS) -> str:
    """The rows of three trajectories and four sets of beams."""
    head = [
        "Trajectory",
        "Beams",
        "RMS, m/s, six hours",
        "half an hour",
        "more, %",
        "claimed, %",
        "NEES of 6",
    ]
    sets = ((1, 2), (1, 3), (1,), (1, 2, 3, 4))
    rows = [cost_row(trajectory, beams, runs) for trajectory in PAPER_TRAJECTORIES for beams in sets]
    return table(head, rows, left=2)


def currents_table(runs: int = CURRENT_RUNS) -> str:
    """Currents other than the prior's 0.3 m/s for six hours: velocity RMS on the three trajectories, and NEES."""
    head = ["Current", *(f"`{method}`, m/s" for method in CURRENT_METHODS), "NEES (6) of `sway_current`"]
    rows = []
    for words, keys in CURRENTS.items():
        cells = []
        for method in CURRENT_METHODS:
            flights = [flown(trajectory, keys, method, runs) for trajectory in PAPER_TRAJECTORIES]
            cells.append(
                " / ".join(number(float(np.sqrt(squares(batch, VELOCITY).mean()))) for batch in flights)
            )
        nees = " / ".join(f"{batch['nees_velocity_attitude'][:, 0].mean():.1f}" for batch in flights)
        rows.append([words, *cells, nees])
    return table(head, rows)


def tables(runs: int = RUNS) -> dict[str, str]:
    """Every table by its mark."""
    head = [
        "Trajectory", "Method", "Velocity RMS, m/s", "at 250 s, m/s", "Attitude RMS, °", "Position at 250 s, m",
        "NEES (6)", "NEES (20)",
    ]  # fmt: skip
    still: list[list[str]] = []
    across: list[list[str]] = []
    times: list[list[str]] = []
    for trajectory in PAPER_TRAJECTORIES:
        for current, methods, rows in ((STILL_WATER, STILL, still), (CROSS_CURRENT, ACROSS, across)):
            for method in methods:
                batch = flown(trajectory, current, method, runs)
                words = WORDS.get(method, f"`{method}`")
                rows.append([trajectory, *row(words, batch)])
                if current and method in ("lc", "tc", "sway_current"):
                    at = [round(time_s / EVERY_S) - 1 for time_s in TIMES_S]
                    rms = np.sqrt(squares(batch, VELOCITY).mean(axis=0))[at]
                    times.append([trajectory, words, *(f"{value:.3f}" for value in rms)])
    return {
        "cost": cost_table(),
        "currents": currents_table(),
        "still": table(head, still, left=2),
        "across": table(head, across, left=2),
        "times": table(["Trajectory", "Method", *(f"{time_s} s" for time_s in TIMES_S)], times, left=2),
    }


def rms_and_nees(batch: Mapping[str, Any]) -> str:
    """Velocity RMS, m/s, and NEES of velocity and attitude of a batch of one method."""
    rms = number(float(np.sqrt(squares(batch, VELOCITY).mean())))
    return f"{rms} / {number(float(batch['nees_velocity_attitude'].mean()), 2)}"


def selected_table(runs: int = SELECTED_RUNS) -> str:
    """The table of docs/methods/consistent.md: velocity RMS / NEES of velocity and attitude."""
    rows = []
    for words, current, methods in (
        ("still", STILL_WATER, SELECTED),
        ("0.3 m/s across", CROSS_CURRENT, SELECTED[1:]),
    ):
        for method in methods:
            cells = []
            for trajectory in PAPER_TRAJECTORIES:
                batch = flown(trajectory, current, method, runs)
                cells.append(rms_and_nees(batch))
            rows.append([words, WORDS.get(method, f"`{method}`"), *cells])
    return table(["Water", "Method", *PAPER_TRAJECTORIES], rows, left=2)


def pivot_table(runs: int = PIVOT_RUNS) -> str:
    """Velocity RMS / NEES of velocity and attitude on analytic figures of eight."""
    rows = []
    for pivot_m in PIVOTS_M:
        path = {"dive_angle_deg": 5.0, "sway_gain_m": pivot_m}
        cells = [f"{pivot_m:g}".replace("-", "−")]
        for method in PIVOT_METHODS:
            batch = flown("figure_eight", STILL_WATER, method, runs, analytic=path)
            cells.append(rms_and_nees(batch))
        rows.append(cells)
    return table(["true pivot k, m", *(f"`{method}`" for method in PIVOT_METHODS)], rows)


def bound_row(beams: tuple[int, ...], sensors: tuple[str, ...], runs: int = BOUND_RUNS) -> list[str]:
    """`tc` on the straight leg without and with the bound from `BOUND_FROM_S` on: velocity RMS, NEES of 6 and of 20."""
    ways = []
    for sd_mps in (0.0, SPEED_SD_MPS):
        batch = flown(
            "straight",
            STILL_WATER,
            "tc",
            runs,
            beams=beams,
            sensors=sensors,
            keys={"filter.speed_sd_mps": sd_mps},
        )
        late = slice(round(BOUND_FROM_S / EVERY_S) - 1, None)
        ways.append((
            number(float(np.sqrt(squares(batch, VELOCITY)[:, late].mean())), 2),
            f"{batch['nees_velocity_attitude'][:, 0, late].mean():.1f}",
            f"{batch['nees'][:, 0, late].mean():.0f}",
        ))  # fmt: skip
    cells = [f"{without} → {bounded}" for without, bounded in zip(*ways, strict=True)]
    return [",".join(map(str, beams)), ", ".join(sensors) or "none", *cells]


def bound_table(runs: int = BOUND_RUNS) -> str:
    """The rows of four sets of beams, with depth and without."""
    rows = [bound_row(beams, sensors, runs) for sensors in ((), ("depth",)) for beams in BOUND_BEAMS]
    return table(["beams", "sensors", "velocity RMS, m/s: without → with", "(6)", "(20)"], rows, left=2)


PAGES: Mapping[str, tuple[Path, Callable[[], dict[str, str]]]] = {
    "sway_current": (DOCS / "methods" / "sway_current.md", tables),
    "consistent": (
        DOCS / "methods" / "consistent.md", lambda: {"selected": selected_table(), "pivots": pivot_table()},
    ),
    "linear_range": (DOCS / "linear_range.md", lambda: {"bound": bound_table()}),
}  # fmt: skip


def main(arguments: list[str]) -> None:
    """Writes the tables of the page that is named."""
    name = arguments[0] if arguments else "sway_current"
    if name not in PAGES or len(arguments) > 1:
        raise SystemExit(f"usage: python -m tools.sway_measured [{' | '.join(PAGES)}]")
    page, made = PAGES[name]
    write_tables(page, made())


if __name__ == "__main__":
    main(sys.argv[1:])
