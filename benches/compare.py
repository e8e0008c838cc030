"""Ours against a numba block-structured filter, nalgebra dense, pyins and INSLIB, on the same readings, interleaved.

    cargo build --release --example compare_filters
    python benches/compare.py [--rounds 9] [--seconds 250]

Every round times every candidate, in turn; a figure is the median over the rounds, with the smallest and the largest,
and each ratio is the median of the rounds' own ratios, so that what else the machine does falls on all alike. Times are
those that the thread had on a core. The candidates with 20 states must end with the same covariance, or it fails.

Needs numba, python-ins and inslib beside the package; a candidate that is not installed is left out and named.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
PROGRAM = HERE.parent / "target" / "release" / "examples" / "compare_filters"

DEGREE = np.pi / 180.0
RATE_HZ = 150
BEAM_SD_MPS = 0.042
LATITUDE_RAD = 32.8 * DEGREE
EARTH_RATE_RADPS = 7.292115e-5
# Table 2 of Tal et al. 2017, as `Model::table_2` of the kernel.
INITIAL_SD = np.repeat(
    [2.0, 0.01, 0.02, 0.05, 0.5e-3 * 9.80665, 3.0 * DEGREE / 3600.0, 0.005, 0.007], [3, 2, 1, 3, 3, 3, 4, 1]
)
NOISE_DENSITY = np.array([0.072 / 60.0, 0.34 * DEGREE / 60.0, 1e-5, 2.8e-5 * DEGREE, 5e-5, 5e-5]) ** 2
SAME_COVARIANCE = 1e-9
PYINS_SECONDS = 20
# A candidate of 20 states repeats its work for so long, after once unmeasured: a run takes a few milliseconds.
LEAST_S = 0.03

Matrix = NDArray[np.float64]


def gravity_mps2() -> float:
    """Somigliana's formula (WGS 84)."""
    s2 = np.sin(LATITUDE_RAD) ** 2
    return float(9.780_325_335_9 * (1.0 + 0.001_931_853 * s2) / np.sqrt(1.0 - 0.006_694_379_990_14 * s2))


@dataclass(frozen=True)
class Readings:
    """A weaving vehicle at 2 m/s: inertial readings at 150 Hz with noise, and four beams a second."""

    time_ns: NDArray[np.int64]
    rate: Matrix
    force: Matrix
    ping_ns: NDArray[np.int64]
    beams: Matrix
    directions: Matrix

    @classmethod
    def make(cls, seconds: int) -> Readings:
        """Draw them."""
        count = seconds * RATE_HZ + 1
        time_ns = np.round(np.arange(count) * (1e9 / RATE_HZ)).astype(np.int64)
        t = time_ns * 1e-9
        generator = np.random.default_rng(20170101)
        rate = np.stack([0.02 * np.sin(0.5 * t), 0.03 * np.cos(0.4 * t), 0.05 * np.sin(0.05 * t)], axis=1)
        force = np.stack(
            [0.05 * np.sin(0.3 * t), 0.1 * np.sin(0.05 * t), np.full(count, -gravity_mps2())], axis=1
        )
        rate += generator.normal(scale=1e-3, size=rate.shape)
        force += generator.normal(scale=1e-2, size=force.shape)
        azimuth, tilt = np.deg2rad([45.0, 135.0, 225.0, 315.0]), 20.0 * DEGREE
        directions = np.stack(
            [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(4, np.cos(tilt))], axis=1
        )
        ping_ns = time_ns[RATE_HZ::RATE_HZ]
        beams = directions @ [2.0, 0.0, 0.0] + generator.normal(scale=BEAM_SD_MPS, size=(len(ping_ns), 4))
        return cls(time_ns, rate, force, ping_ns, beams, directions)

    @property
    def steps(self) -> int:
        """Number of inertial steps."""
        return len(self.time_ns) - 1

    def write(self, path: Path) -> None:
        """The file that the Rust candidates read."""
        parts = [
            [self.steps, len(self.ping_ns)],
            np.column_stack([self.time_ns, self.rate, self.force]).ravel(),
            np.column_stack([self.ping_ns, self.beams]).ravel(),
            [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0],
        ]
        np.concatenate(parts).astype("<f8").tofile(path)


@dataclass(frozen=True)
class Timing:
    """What a candidate needed for one run-step, µs, and one run's covariance at the end where it has our 20 states."""

    step_us: float
    covariance: Matrix | None = None


Candidate = Callable[[], Timing]


class Rust:
    """The Rust candidates in a process of their own, one answer a line."""

    def __init__(self, readings: Readings, folder: Path, program: Path = PROGRAM) -> None:
        if not program.exists():
            sys.exit(
                "compare: build the Rust candidates first: cargo build --release --example compare_filters"
            )
        path = folder / "readings.bin"
        readings.write(path)
        self._command = [program, path]
        self._process = self._start()

    def _start(self) -> subprocess.Popen[str]:
        return subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def renew(self) -> None:
        """Another process: where memory happens to lie lasts as long as a process, and may cost a third."""
        self._process.communicate()
        self._process = self._start()

    def ask(self, line: str) -> list[float]:
        """The numbers that answer a line."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        print(line, file=stdin, flush=True)
        return [float(word) for word in stdout.readline().split()]

    def candidate(self, line: str) -> Candidate:
        """A candidate by its line."""

        def run() -> Timing:
            nanoseconds, run_steps, *lower = self.ask(line)
            covariance = np.zeros((20, 20))
            covariance[np.tril_indices(20)] = lower
            return Timing(nanoseconds / run_steps / 1e3, covariance + np.tril(covariance, -1).T)

        return run


def numba_block(readings: Readings) -> Candidate:
    """The block-structured filter compiled by numba."""
    from block_filter import run_filter  # noqa: PLC0415 - an optional candidate

    earth = EARTH_RATE_RADPS * np.array([np.cos(LATITUDE_RAD), 0.0, -np.sin(LATITUDE_RAD)])
    work = (
        readings.time_ns, readings.rate, readings.force, readings.ping_ns, readings.beams, readings.directions,
        np.array([1.0, 0.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]), np.diag(INITIAL_SD**2), NOISE_DENSITY, earth,
        gravity_mps2(), BEAM_SD_MPS,
    )  # fmt: skip
    run_filter(*work)

    def run() -> Timing:
        covariance = run_filter(*work)
        begin, repeats, spent = time.thread_time(), 0, 0.0
        while spent < LEAST_S:
            run_filter(*work)
            repeats, spent = repeats + 1, time.thread_time() - begin
        return Timing(spent / repeats / readings.steps * 1e6, covariance)

    return run


def pyins_defaults(readings: Readings) -> Candidate:
    """Pyins at its defaults: 15 states, covariance every 0.1 s, a velocity in the body frame each second."""
    import pandas as pd  # noqa: PLC0415 - an optional candidate
    from pyins import filters, measurements, strapdown  # noqa: PLC0415

    short = slice(0, PYINS_SECONDS * RATE_HZ + 1)
    t = readings.time_ns[short] * 1e-9
    imu = pd.DataFrame(
        np.column_stack([readings.rate[short], readings.force[short]]),
        index=pd.Index(t, name="time"),
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    increments = strapdown.compute_increments_from_imu(imu, "rate")
    start = pd.Series(
        [32.8, 35.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        index=["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=0.0,
    )
    velocity = np.linalg.lstsq(readings.directions, readings.beams.T, rcond=None)[0].T
    inside = readings.ping_ns * 1e-9 <= t[-1]
    fixes = pd.DataFrame(velocity[inside], index=readings.ping_ns[inside] * 1e-9, columns=["VX", "VY", "VZ"])
    measurement = measurements.BodyVelocity(fixes, BEAM_SD_MPS)

    def run() -> Timing:
        begin = time.thread_time()
        filters.run_feedback_filter(start, 2.0, 0.05, 0.6, 1.1, increments, measurements=[measurement])
        return Timing((time.thread_time() - begin) / len(increments) * 1e6)

    return run


def inslib_ins(readings: Readings) -> Candidate:
    """INSLIB's inertial filter through its own calls, less what the calls from Python cost by themselves."""
    from INSLIB import Ins  # noqa: PLC0415 - an optional candidate

    t_us = (readings.time_ns // 1000).tolist()
    force, rate = readings.force.tolist(), readings.rate.tolist()
    dt_s = 1.0 / RATE_HZ

    def lead(*, update: bool) -> float:
        navigator = Ins()
        begin = time.thread_time()
        for k in range(1, len(t_us)):
            navigator.imu(t_us[k], dt_s, acc=force[k], gyr=rate[k])
            if k % RATE_HZ == 1:
                navigator.gnss_pos_llh((LATITUDE_RAD, 0.6, 0.0), (4.0, 4.0, 4.0))
                navigator.gnss_vel((2.0, 0.0, 0.0), (0.01, 0.01, 0.01))
                navigator.yaw(0.0, 0.02)
            if update:
                navigator.update()
            else:
                navigator.is_ready()
        spent = time.thread_time() - begin
        if update and not navigator.is_ready():
            raise RuntimeError("INSLIB has not begun to navigate on these readings")
        return spent

    def run() -> Timing:
        return Timing((lead(update=True) - lead(update=False)) / readings.steps * 1e6)

    return run


def spread(values: list[float]) -> str:
    """Median, smallest and largest."""
    return f"{np.median(values):10.4g}   [{min(values):.4g}, {max(values):.4g}]"


def disagreement(covariance: Matrix, reference: Matrix) -> float:
    """The largest difference of two covariances, in standard deviations of the second."""
    sd = np.sqrt(np.diag(reference))
    return float(np.max(np.abs(covariance - reference) / np.outer(sd, sd)))


def main() -> int:
    """Time all candidates, print figures and ratios, check the covariances."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=int, default=250)
    options = parser.parse_args()
    readings = Readings.make(options.seconds)
    with tempfile.TemporaryDirectory() as folder:
        rust = Rust(readings, Path(folder))
        candidates: dict[str, Candidate] = {
            "one run": rust.candidate("alone"),
            "one run, 10 Hz": rust.candidate("alone_10hz"),
            "one run, event by event": rust.candidate("one"),
            "event by event, 10 Hz": rust.candidate("one_10hz"),
            "8 methods side by side": rust.candidate("methods 8"),
            "8 methods, 10 Hz": rust.candidate("methods_10hz 8"),
            "8 runs side by side": rust.candidate("many 8"),
            "32 runs side by side": rust.candidate("many 32"),
            "8 runs, 10 Hz": rust.candidate("many_10hz 8"),
            "32 runs, 10 Hz": rust.candidate("many_10hz 32"),
            "nalgebra dense": rust.candidate("dense"),
        }
        for name, make in (("numba block", numba_block), ("pyins", pyins_defaults), ("INSLIB", inslib_ins)):
            try:
                candidates[name] = make(readings)
            except ImportError as error:
                print(f"left out: {name} ({error})")
        timings: dict[str, list[Timing]] = {name: [] for name in candidates}
        peaks: list[float] = []
        for _ in range(options.rounds):
            rust.renew()
            for name, candidate in candidates.items():
                timings[name].append(candidate())
            peaks.append(rust.ask("peak")[0] * 1e-9)
        flops = rust.ask("flops")[0]
    return show(timings, peaks, flops)


RATIOS = [
    ("numba block", "8 methods side by side"),
    ("numba block", "8 runs side by side"),
    ("numba block", "32 runs side by side"),
    ("numba block", "one run"),
    ("numba block", "one run, event by event"),
    ("nalgebra dense", "one run"),
    ("nalgebra dense", "one run, event by event"),
    ("nalgebra dense", "32 runs side by side"),
    ("8 methods side by side", "8 methods, 10 Hz"),
    ("8 runs side by side", "8 runs, 10 Hz"),
    ("32 runs side by side", "32 runs, 10 Hz"),
    ("pyins", "one run"),
    ("pyins", "one run, 10 Hz"),
    ("INSLIB", "one run"),
    ("INSLIB", "32 runs side by side"),
]


def show(timings: dict[str, list[Timing]], peaks: list[float], flops: float) -> int:
    """Print it all; 1 where the covariances disagree."""
    rounds = len(peaks)
    print(f"\nus per run-step: median [smallest, largest] of {rounds} rounds")
    for name, own in timings.items():
        print(f"  {name:24}{spread([timing.step_us for timing in own])}")
    print(f"\n  multiply-adds, GFLOP/s  {spread(peaks)}")
    rates = [flops / timing.step_us * 1e-3 for timing in timings["8 methods side by side"]]
    print(
        f"  8 methods, GFLOP/s         {spread(rates)}   ({flops:.0f} operations a step, updates not counted)"
    )
    print(
        f"  share of the peak       {spread([rate / peak for rate, peak in zip(rates, peaks, strict=True)])}"
    )
    print("\nratios: median [smallest, largest] of the rounds' own")
    for slower, faster in RATIOS:
        if slower in timings and faster in timings:
            pairs = zip(timings[slower], timings[faster], strict=True)
            print(f"  {slower + ' / ' + faster:48}{spread([a.step_us / b.step_us for a, b in pairs])}")
    print("\ncovariance at the end against nalgebra dense, in standard deviations")
    reference, failed = timings["nalgebra dense"][0].covariance, False
    assert reference is not None
    for name, own in timings.items():
        if own[0].covariance is None or "10 Hz" in name:
            continue
        difference = disagreement(own[0].covariance, reference)
        failed |= not difference <= SAME_COVARIANCE
        print(f"  {name:24}{difference:10.2g}")
    if failed:
        print(f"compare: covariances differ by more than {SAME_COVARIANCE:g}", file=sys.stderr)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
