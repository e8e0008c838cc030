"""A long voyage through the kernel: `python tools/soak.py --hours 24 --out out/soak.json`, or `make soak`.

A vehicle on figures of eight, with an IMU of 150 Hz, pings whose beams come and go, outages of the DVL, depth, heading,
attitude, acoustic positions and seldom GPS, fed to a Navigator of each of several methods as fast as the machine goes.
Once a simulated minute every navigator is judged: covariance symmetric and, scaled to correlations, of a Cholesky
factor; quaternion of norm 1; errors within bounds that a diverging filter leaves. The memory of the process must not
grow. The result is written as JSON; a fault ends the command with exit code 1.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from tests.oracle import truth

METHODS: tuple[kernel.Method, ...] = ("tc", "sway_current", "weak_sway", "elc")
RATE_HZ = 150
SECOND_NS = 1_000_000_000
PERIOD_S = 125
"""Of the figure of eight, and so of everything but the position."""

JUDGED_EVERY_S = 60
NORM_BOUND = 1e-12
SYMMETRY_BOUND = 1e-12
"""Of correlations."""

ERROR_BOUNDS = {"position_m": 100.0, "velocity_mps": 2.0, "misalignment_rad": 0.3}
"""A filter that diverges leaves them within minutes: a ping comes every second, an acoustic position every ten."""

GROWTH_BOUND_MB = 8.0
"""Of the resident memory after the first tenth: an hour's reports of one method alone would be more."""

Vectors = NDArray[np.float64]


def _pitch(t: Vectors) -> tuple[Vectors, Vectors]:
    """3° up and down twice an eight."""
    w = 4.0 * math.pi / PERIOD_S
    return np.deg2rad(3.0) * np.sin(w * t), np.deg2rad(3.0) * w * np.cos(w * t)


class Voyage:
    """The true motion, whatever the time, and what the sensors make of it.

    Attributes:
        model: environment and errors of the sensors, SI.
        options: of the filters.
        geometry: the beams.
    """

    def __init__(self, seed: int) -> None:
        scenario = load_scenario("survey_table2")
        latitude_rad = math.radians(scenario.environment.latitude_deg)
        gravity = kernel.normal_gravity_mps2(latitude_rad)
        self.model = scenario.kernel_model(gravity)
        self.options = scenario.kernel_options().replace(imu_sampling="instantaneous")
        self.geometry = kernel.BeamGeometry.janus(math.radians(30.0))
        eight = truth.make(
            truth.figure_eight_yaw,
            _pitch,
            seconds=float(PERIOD_S),
            rate_hz=float(RATE_HZ),
            gravity=gravity,
            latitude_rad=latitude_rad,
        )
        self._eight = eight
        self._imu = np.hstack([eight["omega_p_radps"], eight["force_p_mps2"]])
        self._beams = self.geometry.beam_velocities(eight["velocity_p_mps"][:1])[0]
        self.rng = np.random.default_rng(seed)
        imu, per_sample = self.model.imu, math.sqrt(RATE_HZ)
        sd = [imu.gyro_noise_rad_rts * per_sample] * 3 + [imu.accel_noise_mps_rts * per_sample] * 3
        self._imu_sd = np.array(sd)
        bias_sd = [imu.gyro_bias_sd_radps] * 3 + [imu.accel_bias_sd_mps2] * 3
        self._imu_bias = np.array(bias_sd) * self.rng.standard_normal(6)

    def at(self, second: int) -> dict[str, Vectors]:
        """Position, attitude and velocity at a whole second."""
        turns, place = divmod(second, PERIOD_S)
        k = place * RATE_HZ
        position = self._eight["position_t_m"]
        # An eight is closed but for some centimetres.
        return {
            "position_t_m": turns * (position[-1] - position[0]) + position[k],
            "attitude_t_p": self._eight["attitude_t_p"][k],
            "velocity_p_mps": self._eight["velocity_p_mps"][k],
        }

    def imu(self, second: int) -> tuple[NDArray[np.int64], Vectors, Vectors]:
        """The readings after a whole second, up to the next."""
        first = (second % PERIOD_S) * RATE_HZ + 1
        steps = np.arange(1, RATE_HZ + 1, dtype=np.int64)
        noise = self._imu_sd * self.rng.standard_normal((RATE_HZ, 6))
        readings = self._imu[first : first + RATE_HZ] + self._imu_bias + noise
        return second * SECOND_NS + (steps * SECOND_NS) // RATE_HZ, readings[:, :3], readings[:, 3:]

    def pushes(self, second: int) -> list[tuple[str, dict[str, Any]]]:
        """What the sensors give at a whole second, some of it seldom, some of it lost."""
        now, rng, time_ns = self.at(second), self.rng, second * SECOND_NS
        normal = rng.standard_normal
        found: list[tuple[str, dict[str, Any]]] = []
        # Five minutes of every hour are without bottom lock; else a beam returns four times of five.
        if second % 3600 >= 300:
            valid = rng.random(4) < 0.8
            noise = np.where(rng.random(4) < 0.02, 0.24, 0.02)
            beams = self._beams + noise * normal(4)
            found.append(("push_beams", {"velocity_mps": beams, "valid": valid, "sd_mps": np.full(4, 0.02)}))
        found.append(("push_depth", {"depth_m": now["position_t_m"][2] + 0.02 * normal(), "sd_m": 0.02}))
        yaw = _yaw(now["attitude_t_p"])
        if second % 4 == 0:
            found.append(("push_heading", {"yaw_rad": yaw + 0.1 * normal(), "sd_rad": 0.1}))
        if second % 4 == 2:
            attitude = {"attitude_t_p": now["attitude_t_p"], "roll_pitch_sd_rad": 0.02, "yaw_sd_rad": 0.1}
            found.append(("push_attitude", attitude))
        if second % 10 == 5 and rng.random() < 0.7:
            position = now["position_t_m"] + normal(3)
            found.append(("push_acoustic_position", {"position_t_m": position, "sd_m": np.full(3, 1.0)}))
        if second % 100 == 50:
            velocity = now["velocity_p_mps"] + 0.05 * normal(3)
            found.append(("push_velocity", {"velocity_p_mps": velocity, "cov_m2ps2": np.diag([0.0025] * 3)}))
        if second % 7200 < 30:
            position = now["position_t_m"] + np.array([2.0, 2.0, 4.0]) * normal(3)
            found.append(("push_position", {"position_t_m": position, "position_sd_m": [2.0, 2.0, 4.0]}))
        return [(name, {"time_ns": time_ns} | values) for name, values in found]


def _yaw(q: Vectors) -> float:
    w, x, y, z = q
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def judge(navigator: kernel.Navigator, true: dict[str, Vectors]) -> tuple[dict[str, float], list[str]]:
    """Figures of a navigator and what is wrong with it."""
    state, p = navigator.state(), navigator.covariance()
    faults = []
    diagonal = np.diagonal(p)
    figures = {"quaternion_norm_error": abs(float(np.linalg.norm(state["attitude_t_p"])) - 1.0)}
    if not (np.isfinite(p).all() and (diagonal > 0.0).all()):
        return figures, [
            f"variances from {diagonal.min():.3g} to {diagonal.max():.3g}, expected positive numbers"
        ]
    scale = 1.0 / np.sqrt(diagonal)
    correlation = p * scale[:, None] * scale
    figures["asymmetry"] = float(np.abs(correlation - correlation.T).max())
    figures["least_eigenvalue"] = float(np.linalg.eigvalsh(correlation)[0])
    try:
        np.linalg.cholesky(correlation)
    except np.linalg.LinAlgError:
        faults.append(f"covariance not positive definite, least eigenvalue {figures['least_eigenvalue']:.3g}")
    turn = abs(float(np.dot(state["attitude_t_p"], true["attitude_t_p"])))
    figures["position_m"] = float(np.linalg.norm(state["position_t_m"] - true["position_t_m"]))
    figures["velocity_mps"] = float(np.linalg.norm(state["velocity_p_mps"] - true["velocity_p_mps"]))
    figures["misalignment_rad"] = 2.0 * math.acos(min(1.0, turn))
    bounds = ERROR_BOUNDS | {"quaternion_norm_error": NORM_BOUND, "asymmetry": SYMMETRY_BOUND}
    faults += [f"{key} is {figures[key]:.3g}, expected at most {most:g}" for key, most in bounds.items()
               if not figures[key] <= most]  # fmt: skip
    return figures, faults


def resident_mb() -> float:
    """Resident memory of this process; 0 where the system does not tell."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * 4096 / 2**20 if statm.exists() else 0.0


def soak(
    hours: float, *, seed: int = 1, methods: tuple[kernel.Method, ...] = METHODS, tell: bool = False
) -> dict[str, Any]:
    """Sails so many hours; the figures and the faults."""
    voyage = Voyage(seed)
    start: Any = {"time_ns": 0, **voyage.at(0)}
    navigators = {
        name: kernel.Navigator(voyage.geometry, voyage.model, voyage.options, start, method=name)
        for name in methods
    }
    worst: dict[str, dict[str, float]] = {name: {} for name in methods}
    verdicts = {name: Counter[str]() for name in methods}
    faults: list[str] = []
    memory: list[float] = []
    began = told = time.monotonic()
    seconds = round(hours * 3600)
    for second in range(seconds):
        block, pushes = voyage.imu(second), voyage.pushes(second + 1)
        for name, navigator in navigators.items():
            time_ns, rate, force = block
            reports = navigator.push_imu_block(time_ns, omega_p_radps=rate, force_p_mps2=force)
            for push, values in pushes:
                reports += getattr(navigator, push)(**values)
            verdicts[name].update(f"{report.sensor} {report.verdict}" for report in reports)
        if (second + 1) % JUDGED_EVERY_S:
            continue
        true = voyage.at(second + 1)
        for name, navigator in navigators.items():
            figures, found = judge(navigator, true)
            faults += [f"{name} at {second + 1} s: {words}" for words in found]
            for key, value in figures.items():
                pick = min if key == "least_eigenvalue" else max
                worst[name][key] = pick(worst[name].get(key, value), value)
        memory.append(resident_mb())
        if tell and time.monotonic() - told > 5.0:
            told = time.monotonic()
            _tell(second + 1, seconds, told - began)
    grown_mb = memory[-1] - memory[len(memory) // 10] if memory else 0.0
    if grown_mb > GROWTH_BOUND_MB:
        faults.append(f"memory grew by {grown_mb:.1f} MB, expected at most {GROWTH_BOUND_MB:g}")
    taken_s = time.monotonic() - began
    return {
        "hours": hours, "seed": seed, "steps": seconds * RATE_HZ, "seconds": round(taken_s, 1),
        "steps_per_second_and_method": round(seconds * RATE_HZ * len(methods) / taken_s),
        "worst": worst, "verdicts": {name: dict(sorted(counts.items())) for name, counts in verdicts.items()},
        "memory_mb": {"first": memory[0], "last": memory[-1], "grown": grown_mb} if memory else {},
        "faults": faults,
    }  # fmt: skip


def _tell(done_s: int, seconds: int, taken_s: float) -> None:
    rate = done_s / taken_s
    print(f"soak: {done_s / 3600:.2f} of {seconds / 3600:g} h, {rate:,.0f} times as fast as time,"
          f" {(seconds - done_s) / rate:,.0f} s left", file=sys.stderr, flush=True)  # fmt: skip


def main() -> int:
    """The command line; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/soak.json"))
    chosen = parser.parse_args()
    result = soak(chosen.hours, seed=chosen.seed, tell=True)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    print(
        json.dumps(
            {key: result[key] for key in ("steps", "seconds", "worst", "memory_mb", "faults")}, indent=2
        )
    )
    return 1 if result["faults"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
