"""The table of docs/ellipsoid.md: 50 km in several directions and latitudes, `python -m tools.long_way`.

Runs of the packaged scenario `long_way`, whose truth is on the ellipsoid, by the method `tc` on the ellipsoid and on a
tangent plane. Seed, runs, latitudes and headings were fixed before the first run. Writes the table into the page.
"""

from pathlib import Path
from typing import Any, Literal

import numpy as np

from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import run_batch
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tools.recorded_tables import table
from tools.score_recorded import write_tables

PAGE = Path(__file__).resolve().parent.parent / "docs" / "ellipsoid.md"
SEED = 20261124
RUNS = 24
PLANE_RUNS = 4
LATITUDES_DEG = (0.0, 45.0, 70.0, 85.0)
HEADINGS_DEG = (0.0, 90.0, 225.0)
POSITION, ATTITUDE, VELOCITY = slice(0, 3), slice(3, 6), slice(6, 9)


def fly(
    latitude_deg: float,
    heading_deg: float,
    runs: int,
    earth: Literal["ellipsoid", "tangent_plane"] = "ellipsoid",
) -> dict[str, Any]:
    """The kernel's batch of runs of one way; `earth` is what the filter takes the Earth for."""
    scenario = load_scenario("long_way").replace({"environment.latitude_deg": latitude_deg})
    simulation = build_simulation(scenario.replace({"trajectory.heading_deg": heading_deg}))
    truth = simulation.truth()
    schedule: Any = measurement_schedule(simulation, truth)
    schedule["sample_time_ns"] = schedule["sample_time_ns"][499::500]
    model = scenario.kernel_model(simulation.gravity_mps2)
    arrays: Any = truth.kernel_arrays()
    batch = run_batch(
        simulation.geometry,
        arrays,
        model,
        model.replace(environment=model.environment.replace(earth=earth)),
        scenario.kernel_options(),
        schedule,
        ["tc"],
        seed=SEED,
        trajectory_key=31,
        first_run=0,
        runs=runs,
        threads=1,
    )
    return dict(batch)


def row(latitude_deg: float, heading_deg: float) -> list[str]:
    """One way: NEES over it, errors at its end with their claims, and the position on a tangent plane."""
    batch = fly(latitude_deg, heading_deg, RUNS)
    plane = fly(latitude_deg, heading_deg, PLANE_RUNS, "tangent_plane")
    error, sd = batch["error"][:, 0, -1], batch["sd"][:, 0, -1]

    def rms(values: Any) -> float:  # noqa: ANN401 - an array of the kernel's
        return float(np.sqrt(np.mean(np.sum(np.asarray(values) ** 2, axis=-1))))

    def pair(which: slice, factor: float, digits: int) -> str:
        return f"{factor * rms(error[:, which]):.{digits}f} / {factor * rms(sd[:, which]):.{digits}f}"

    return [
        f"{latitude_deg:g}°",
        f"{heading_deg:g}°",
        f"{batch['nees_velocity_attitude'][:, 0].mean():.2f}",
        pair(slice(8, 9), 1e3, 1),
        pair(slice(5, 6), np.rad2deg(1.0), 3),
        pair(slice(0, 2), 1.0, 0),
        f"{rms(plane['error'][:, 0, -1, :2]):.0f}",
    ]


def ways_table(latitudes_deg: tuple[float, ...] = LATITUDES_DEG) -> str:
    """The table in Markdown."""
    head = [
        "Latitude",
        "Heading",
        "NEES of 6",
        "Heave, mm/s",
        "Yaw, deg",
        "Horizontal position, m",
        "on a plane, m",
    ]
    return table(head, [row(latitude, heading) for latitude in latitudes_deg for heading in HEADINGS_DEG], 2)


if __name__ == "__main__":
    write_tables(PAGE, {"long-way": ways_table()})
