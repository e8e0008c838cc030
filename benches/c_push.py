"""What a push into the C library takes, and the part of a core that navigation takes: 200 Hz IMU, 20 Hz estimates.

Usage: python -m benches.c_push [--seconds 300]

The packaged `survey_table2` with inertial readings at 200 Hz, a DVL at 5 Hz, depth and attitude. Every push is timed
alone; state and covariance are read 20 times a second, which counts for the core. The load of the machine is stated:
percentiles beyond the median are those of a machine that does nothing else.
"""

import argparse
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import Navigator, simulate_sensors
from bottomlock.kernel.models import InitialState
from bottomlock.simulation.build import build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tests.c.dive_files import write_files
from tests.drawn_log import drawn_log
from tools.install_c import install

METHODS = ("tc", "sway_current")
PROGRAM = Path(__file__).parents[1] / "crates" / "bottomlock-c" / "tests" / "dive.c"


def flown(method: Any, seconds: float, folder: Path) -> tuple[Path, Path]:  # noqa: ANN401 - a name
    """The files of a navigator at the start of the scenario, and of its readings."""
    content = load_scenario("survey_table2").model_dump(exclude_unset=True)
    content["imu"] |= {"rate_hz": 200.0}
    content["dvl"] |= {"rate_hz": 5.0}
    content["trajectory"] |= {"duration_s": seconds}
    simulation = build_simulation(Scenario.model_validate(content))
    truth, scenario = simulation.truth(), simulation.scenario
    model, options = scenario.kernel_model(simulation.gravity_mps2), scenario.kernel_options()
    key = trajectory_key("c_push")
    plan: Any = measurement_schedule(simulation, truth, trajectory_key=key)
    arrays: Any = truth.kernel_arrays()
    drawn = simulate_sensors(
        simulation.geometry, arrays, model, plan, imu_sampling=scenario.imu.sampling, options=options,
        seed=1, trajectory_key=key, run=0,
    )  # fmt: skip
    start = InitialState(
        time_ns=int(truth.time_ns[0]),
        position_t_m=truth.position_t_m[0],
        attitude_t_p=truth.attitude_t_p[0],
        velocity_p_mps=truth.velocity_p_mps[0],
    )
    log = drawn_log(drawn) | {
        "beam_sd_mps": np.full(drawn["dvl_velocity_mps"].shape, model.dvl.beam_noise_sd_mps),
        "attitude_time_ns": drawn["magnetometer_time_ns"],
        "attitude_t_p": drawn["magnetometer_attitude_t_p"],
    }
    return write_files(
        folder, Navigator(simulation.geometry, model, options, start, method=method), model, log
    )


def main() -> None:
    """Prints a row a method."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=300.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        install(folder / "prefix")
        library = folder / "prefix" / "lib" / "libbottomlock.a"
        include = f"-I{folder / 'prefix' / 'include'}"
        program = folder / "dive"
        words = ["cc", "-O2", "-std=c99", str(PROGRAM), include, str(library), "-lm", "-lpthread", "-ldl"]
        subprocess.run([*words, "-o", str(program)], check=True)
        print(f"load {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores")
        for method in METHODS:
            files = flown(method, seconds, folder)
            times = subprocess.run([program, *files, "time"], check=True, capture_output=True, text=True)
            print(f"{method:<14}{times.stdout.strip()}")


if __name__ == "__main__":
    main()
