"""What a late measurement costs, from Python, beside one in order and an inertial reading.

    python benches/late_data.py [--pushes 2000] [--rate 150]

One filter (`tc`) and two (`sway_current`), a ping of four beams at 5 Hz. A late ping is up to 2 s old; its push
goes back, fuses it and replays the inertial readings that follow. A late depth comes after each ping, which is in
order: its push replays ten pings as well. Times are those of whole calls in one run; the ratios count, and the load
of the machine is printed with them.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

import numpy as np

from bottomlock import BeamGeometry, InitialState, Navigator, load_scenario, normal_gravity_mps2

SECOND = 1_000_000_000


def start(method: Any, horizon_ns: int) -> Navigator:  # noqa: ANN401 - a method's name
    """A navigator at rest."""
    scenario, gravity = load_scenario("straight"), normal_gravity_mps2(0.57)
    initial = InitialState(
        time_ns=0, position_t_m=[0, 0, 0], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[0, 0, 0]
    )
    model, options = scenario.kernel_model(gravity), scenario.kernel_options()
    return Navigator(BeamGeometry.janus(0.35), model, options, initial, method=method, horizon_ns=horizon_ns)


def flown(
    method: str, late_ns: int, pushes: int, rate: int, *, depths: bool = False
) -> dict[str, np.ndarray]:
    """Times of the calls, µs: inertial readings, and pings that are late or at the last reading.

    With `depths`, pings are at the last reading, and the times under "ping" are those of depths that are late.
    """
    to = start(method, 2 * SECOND if late_ns >= 0 else 0)
    step_ns, late_ns = SECOND // rate, max(late_ns, 0)
    still = {"omega_p_radps": np.zeros(3), "force_p_mps2": np.array([0.0, 0.0, -normal_gravity_mps2(0.57)])}
    ping = np.zeros(4), np.ones(4, bool)
    noise = np.full(4, 0.042)
    draw = np.random.default_rng(1)
    times: dict[str, list[int]] = {"imu": [], "ping": []}
    every, warm = rate // 5, 3 * rate
    for k in range(warm + pushes * every):
        begin = time.perf_counter_ns()
        to.push_imu(k * step_ns, **still)
        times["imu"].append(time.perf_counter_ns() - begin)
        if k % every == 0 and k * step_ns >= late_ns:
            velocity = ping[0] + 0.04 * draw.normal(size=4)
            begin = time.perf_counter_ns()
            to.push_beams(k * step_ns - (0 if depths else late_ns), velocity, ping[1], sd_mps=noise)
            if depths:
                begin = time.perf_counter_ns()
                to.push_depth(k * step_ns - late_ns, 0.1 * draw.normal(), sd_m=0.1)
            times["ping"].append(time.perf_counter_ns() - begin)
    return {name: np.array(values[len(values) // 10 :]) * 1e-3 for name, values in times.items()}


def main() -> None:
    """Prints p50 and p99, and ratios to pings in order."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--pushes", type=int, default=2000)
    arguments.add_argument("--rate", type=int, default=150)
    asked = arguments.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores, inertial readings at {asked.rate} Hz")
    for method in ("tc", "sway_current"):
        base = None
        for name, late_ns in (
            ("none", -1),
            ("in order", 0),
            ("0.3 s late", 3 * SECOND // 10),
            ("2 s late", 2 * SECOND),
            ("depth, 2 s late", 2 * SECOND),
        ):
            found = flown(method, late_ns, asked.pushes, asked.rate, depths=name.startswith("depth"))
            row = [f"{np.percentile(found[what], q):8.1f}" for what in ("imu", "ping") for q in (50, 99)]
            base = base or np.median(found["ping"])
            ratio = np.median(found["ping"]) / base
            print(
                f"{method:10} {name:15}  imu p50, p99 {row[0]}{row[1]} µs   ping{row[2]}{row[3]} µs   x{ratio:.1f}"
            )


if __name__ == "__main__":
    main()
