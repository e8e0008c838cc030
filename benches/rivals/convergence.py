"""Who converges from a start with a wrong attitude, and how fast: our `tc` and `consistent` against the rivals.

    PYTHONPATH=$PWD/python:$PWD python -m benches.rivals.convergence [--runs 20] [--out convergence.csv]

A vehicle mows a lawn at 2 m/s with the inertial sensors of Table 2 of Tal et al. 2017, all four beams and depth. The
start is wrong by 30°, 60° or 90° of yaw, by 10° of tilt about a level axis of random direction, or by both; the
claimed 1 sigma is the error itself, and the model's own about the other axes. Beams and depth do not show the yaw:
position fixes each 5 s of 1 m per axis do, against the velocity integrated in platform axes. One case has tilt alone,
and no fixes.

A run has converged when the whole attitude error is below 2° from some second to the end; that time is reported.
Nothing is gated. Every filter has the same readings, start and claim; the seeds are 0, 1, 2, … of the scenario's own
seed.
"""

import argparse
import csv
import dataclasses
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.development import mission_along, wrong_start
from benches.rivals.error_state import ErrorStateFilter, grid_rows
from benches.rivals.iterated import IteratedFilter
from benches.rivals.state import MISALIGNMENT, Additive, RightInvariant
from benches.rivals.timeline import Positions, stops
from benches.rivals.unscented import UnscentedFilter
from bottomlock import Navigator
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import BottomlockError
from bottomlock.kernel import Method
from bottomlock.kernel.models import DepthModel, DvlModel, InitialState
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from bottomlock.truth.truth import Truth
from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]

LIMIT_RAD = np.deg2rad(2.0)
FIX_SD_M, FIX_INTERVAL_S = 1.0, 5.0
OURS = ("tc", "consistent")
COLUMNS = ("case", "run", "filter", "converged_s", "final_deg", "final_nees")
RIVALS: dict[str, Callable[[Mission], ErrorStateFilter]] = {
    "additive EKF": lambda mission: ErrorStateFilter(mission, Additive()),
    "invariant EKF": lambda mission: ErrorStateFilter(mission, RightInvariant()),
    "iterated invariant EKF": lambda mission: IteratedFilter(mission, RightInvariant()),
    "unscented": lambda mission: UnscentedFilter(mission, RightInvariant()),
}
FILTERS = (*OURS, *RIVALS)


@dataclasses.dataclass(frozen=True)
class Case:
    """Errors of the start, deg, and whether there are position fixes."""

    yaw_deg: float
    tilt_deg: float
    fixes: bool = True

    @property
    def name(self) -> str:
        """For tables."""
        parts = [
            f"{size:g}° {word}" for size, word in ((self.yaw_deg, "yaw"), (self.tilt_deg, "tilt")) if size
        ]
        return " and ".join(parts) + ("" if self.fixes else ", no fixes")


CASES = (
    Case(30.0, 0.0), Case(60.0, 0.0), Case(90.0, 0.0),
    Case(0.0, 10.0, fixes=False), Case(30.0, 10.0), Case(90.0, 10.0),
)  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class Track:
    """Attitude errors at the grid's times, as rotation vectors (n, 3), rad, and their claimed covariances (n, 3, 3)."""

    time_s: Floats
    error_rad: Floats
    cov_rad2: Floats

    def converged_s(self) -> float:
        """From when on the error is within the limit; infinite if it is not at the end."""
        size = np.linalg.norm(self.error_rad, axis=1)
        beyond = np.flatnonzero(~(size < LIMIT_RAD))
        if len(beyond) == 0:
            return float(self.time_s[0])
        return float("inf") if beyond[-1] == len(size) - 1 else float(self.time_s[beyond[-1] + 1])

    def final_nees(self) -> float:
        """Of the attitude at the end, three degrees."""
        error, cov = self.error_rad[-1], self.cov_rad2[-1]
        if not (np.isfinite(error).all() and np.isfinite(cov).all()):
            return float("inf")
        return float(error @ np.linalg.solve(cov, error))


def world(duration_s: float) -> Scenario:
    """The packaged lawn mower with all beams, depth and position fixes, and no gate."""
    settings: dict[str, Any] = {
        "imu.sampling": "averaged",
        "imu.rate_hz": 50.0,
        "dvl.beams_lost": [],
        "depth.enabled": True,
        "depth.rate_hz": 1.0,
        "filter.gate": "off",
        "acoustic_position.enabled": True,
        "acoustic_position.rate_hz": 1.0 / FIX_INTERVAL_S,
        "acoustic_position.noise_m": FIX_SD_M,
        "acoustic_position.noise_percent_of_range": 0.0,
    }
    return load_scenario("lawn_mower").with_trajectory(duration_s=duration_s).replace(settings)


def wrong(mission: Mission, truth: Truth, case: Case, generator: np.random.Generator) -> Mission:
    """The mission with a start that is wrong as the case says, and claims so."""
    initial = mission.model.initial
    sd = np.array(initial.attitude_sd_rad)
    misalignment = sd * generator.standard_normal(3)
    side, direction = generator.choice([-1.0, 1.0]), generator.uniform(0.0, 2.0 * np.pi)
    if case.yaw_deg:
        sd[2] = np.deg2rad(case.yaw_deg)
        misalignment[2] = side * sd[2]
    if case.tilt_deg:
        sd[:2] = np.deg2rad(case.tilt_deg)
        misalignment[:2] = np.deg2rad(case.tilt_deg) * np.array([np.cos(direction), np.sin(direction)])
    position = np.array(initial.position_sd_m) * generator.standard_normal(3)
    velocity = np.array(initial.velocity_sd_mps) * generator.standard_normal(3)
    return dataclasses.replace(
        mission,
        model=mission.model.replace(initial=initial.replace(attitude_sd_rad=tuple(sd))),
        start=wrong_start(truth, position, misalignment, velocity),
    )


def rival_track(rival: ErrorStateFilter, mission: Mission, positions: Positions | None) -> Track:
    """Of a filter of this folder."""
    with np.errstate(all="ignore"):
        found = [
            (rival.state.motion.rotation, rival.additive_covariance()[MISALIGNMENT, MISALIGNMENT])
            for _ in grid_rows(rival, mission, positions)
        ]
    return track(mission, found)


def our_track(method: str, mission: Mission, positions: Positions | None) -> Track:
    """Of a navigator of the package, fed with the same readings at the same times."""
    start = mission.start
    navigator = Navigator(
        mission.geometry,
        mission.model,
        mission.options,
        InitialState(
            time_ns=start.time_ns,
            position_t_m=start.position_t_m,
            attitude_t_p=start.attitude_t_p,
            velocity_p_mps=start.velocity_p_mps,
        ),
        method=cast(Method, method),
    )
    imu, dvl, depth = mission.imu, mission.model.of(DvlModel), mission.model.of(DepthModel)
    answers, pushed = [], int(np.searchsorted(imu.time_ns, start.time_ns, side="right"))
    beam_sd = np.full(mission.geometry.beams, dvl.beam_noise_sd_mps)
    try:
        for stop in stops(mission, positions):
            until = int(np.searchsorted(imu.time_ns, stop.time_ns, side="right"))
            if until > pushed:
                rows = slice(pushed, until)
                navigator.push_imu_block(
                    imu.time_ns[rows],
                    omega_p_radps=imu.omega_p_radps[rows],
                    force_p_mps2=imu.force_p_mps2[rows],
                )
            pushed = until
            for kind, value in stop.readings:
                if kind == "ping":
                    navigator.push_beams(
                        stop.time_ns, np.nan_to_num(value), np.isfinite(value), sd_mps=beam_sd
                    )
                elif kind == "depth":
                    navigator.push_depth(stop.time_ns, float(value[0]), sd_m=depth.sd_m)
                elif kind == "position":
                    navigator.push_acoustic_position(
                        time_ns=stop.time_ns, position_t_m=value, sd_m=np.full(3, FIX_SD_M)
                    )
            if stop.grid_row is not None:
                state = navigator.state()
                answers.append((rotations.matrix(state["attitude_t_p"]), navigator.covariance()[3:6, 3:6]))
    except BottomlockError as error:
        print(f"{method}: {error}", file=sys.stderr)
    return track(mission, answers)


def track(mission: Mission, answers: list[tuple[Floats, Floats]]) -> Track:
    """Errors against the truth; NaN where a filter has no answer any more."""
    assert mission.truth is not None
    rows = len(mission.grid_ns)
    error, cov = np.full((rows, 3), np.nan), np.full((rows, 3, 3), np.nan)
    true = rotations.matrix(mission.truth.attitude_t_p)
    for row, (rotation, covariance) in enumerate(answers):
        if np.isfinite(rotation).all():
            error[row], cov[row] = rotations.log(true[row] @ rotation.T), covariance
    time_s = np.asarray((mission.grid_ns - mission.start.time_ns) / 1e9, dtype=np.float64)
    return Track(time_s, error, cov)


def tracks(runs: int, duration_s: float, filters: Sequence[str]) -> Iterator[tuple[Case, int, str, Track]]:
    """Every case, run and filter."""
    simulation = build_simulation(world(duration_s))
    truth = simulation.truth()
    for run in range(runs):
        mission = mission_along(simulation, truth, run=run)
        fixes = sensor_streams(simulation, truth, run=run)["acoustic_position"]
        places = fixes.select(f"position_{axis}_m" for axis in ("north", "east", "down")).to_numpy()
        positions = Positions(fixes["time_ns"].to_numpy(), places, FIX_SD_M)
        for index, case in enumerate(CASES):
            begun = wrong(mission, truth, case, np.random.default_rng([run, index]))
            given = positions if case.fixes else None
            for name in filters:
                made = RIVALS.get(name)
                found = (
                    our_track(name, begun, given) if made is None else rival_track(made(begun), begun, given)
                )
                yield case, run, name, found


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: a line a case and filter, quartiles of the time of the runs that converged, medians of the rest."""
    lines = [
        "| start | filter | converged | within 2° after, s (quartiles) | final error, ° | final attitude NEES |",
        "|---|---|---|---|---|---|",
    ]
    for case in CASES:
        for name in FILTERS:
            of = [row for row in rows if row["case"] == case.name and row["filter"] == name]
            if not of:
                continue
            times = np.array([row["converged_s"] for row in of])
            inside = times[np.isfinite(times)]
            quartiles = "–"
            if len(inside):
                low, middle, high = np.percentile(inside, [25, 50, 75])
                quartiles = f"{middle:.0f} ({low:.0f} to {high:.0f})"
            final = np.median([row["final_deg"] for row in of])
            nees = np.median([row["final_nees"] for row in of])
            lines.append(
                f"| {case.name} | {name} | {len(inside)} of {len(times)} | {quartiles} | {final:.2g} | {nees:.2g} |"
            )
    return "\n".join(lines)


def main() -> None:
    """Runs the study, writes a row for each run and prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--duration-s", type=float, default=150.0)
    parser.add_argument("--filters", nargs="+", choices=FILTERS, default=FILTERS)
    parser.add_argument("--out", type=Path, default=Path("convergence.csv"))
    args = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with args.out.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for case, run, name, one in tracks(args.runs, args.duration_s, args.filters):
            final = float(np.rad2deg(np.linalg.norm(one.error_rad[-1])))
            values = (
                case.name,
                run,
                name,
                one.converged_s(),
                final if np.isfinite(final) else float("inf"),
                one.final_nees(),
            )
            rows.append(dict(zip(COLUMNS, values, strict=True)))
            writer.writerow(rows[-1])
            file.flush()
    print(table(rows))


if __name__ == "__main__":
    main()
