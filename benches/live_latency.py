"""Time from the bytes of a DVL report to the bytes at the ports, on one core, and that of an inertial reading.

Usage: python -m benches.live_latency [--seconds 60] [--mode navigation|velocity]

The engine is given what arrives at 15 Hz from the DVL (Water Linked JSON) and, in mode navigation, at 200 Hz from the
IMU, in the order of arrival and as fast as it takes them; each call is timed alone, the garbage collector between them
too. The load of the machine is stated: percentiles beyond the median are those of a machine that does nothing else.
"""

import argparse
import os
import time

import numpy as np

from bottomlock.live.config import parse_config
from bottomlock.live.engine import TICK_NS, Engine
from bottomlock.live.runner import collected_between_readings
from tests.live.world import NAVIGATION_TOML, VELOCITY_TOML, World

LIMIT_99_MS, LIMIT_999_MS = 1.0, 5.0


def durations(mode: str, port: str, seconds: float) -> dict[str, np.ndarray]:
    """Duration of each call, ms, by source; "sent" those of the DVL that gave a message."""
    text = (VELOCITY_TOML if mode == "velocity" else NAVIGATION_TOML).format(
        dvl="tcp:127.0.0.1:9", imu="udpin:127.0.0.1:9", to="udpout:127.0.0.1:9", format="waterlinked-json"
    )
    text = text.replace('port = "probe"', f'port = "{port}"').replace("\nrate_hz = 10\n", "\nrate_hz = 20\n")
    engine = Engine(parse_config(text, place="benchmark"))
    arrivals = list(World(seconds, dvl_hz=15.0, imu_hz=200.0).arrivals(imu=mode == "navigation"))
    found: dict[str, list[float]] = {"dvl": [], "imu": [], "collector": []}
    tick = 0
    with collected_between_readings() as collect:
        for arrival_ns, source, data in arrivals:
            start = time.perf_counter_ns()
            engine.arrive(source, arrival_ns, data)
            found["imu" if source else "dvl"].append((time.perf_counter_ns() - start) * 1e-6)
            if arrival_ns // TICK_NS > tick:
                tick, start = arrival_ns // TICK_NS, time.perf_counter_ns()
                collect()
                found["collector"].append((time.perf_counter_ns() - start) * 1e-6)
    return {name: np.array(values[len(values) // 10 :]) for name, values in found.items() if values}


def main() -> None:
    """Prints the percentiles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--mode", choices=["navigation", "velocity"], default="navigation")
    parser.add_argument("--port", default="sentence")
    chosen = parser.parse_args()
    print(
        f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; mode {chosen.mode}, port {chosen.port}"
    )
    for name, values in durations(chosen.mode, chosen.port, chosen.seconds).items():
        p50, p99, p999 = np.percentile(values, [50, 99, 99.9])
        line = f"{name}: {len(values)} calls, p50 {p50:.3f} ms, p99 {p99:.3f} ms, p99.9 {p999:.3f} ms"
        if name == "dvl":
            held = p99 <= LIMIT_99_MS and p999 <= LIMIT_999_MS
            line += f" (limits {LIMIT_99_MS:g} and {LIMIT_999_MS:g} ms: {'held' if held else 'NOT held'})"
        print(line)


if __name__ == "__main__":
    main()
