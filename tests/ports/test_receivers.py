"""A receiver fed through a port is consistent wherever one with the whole covariance is.

Monte Carlo over beam masks and both modes, by the bytes of each port. Errors are judged by NEES of all six states and
along every principal axis of what is sent: the mean NEES alone does not see that a diagonal is too small, because the
trace of diag(P)^-1 P is 3 whatever the correlations are.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock.kernel import solve_velocity
from bottomlock.ports import mip as mip_port
from bottomlock.ports import odometry as odometry_port
from bottomlock.ports import vision_position_delta as delta_port
from bottomlock.ports.estimate import Estimate
from bottomlock.ports.over_bound import diagonal_bound
from bottomlock.ports.registry import port
from bottomlock.statistics.chi_squared import each_probability, mean_band
from tests.ports import cases
from tests.ports.cases import BEAM_SD, JANUS, SECOND, START, TRUTH, fused, navigated
from tests.ports.receivers import (
    ACCEL_NOISE,
    BIAS_SD,
    BIAS_WALK,
    PORTS,
    PROCESS,
    STEP_S,
    TRANSITION,
    VELOCITY_SD,
    Px4,
    Receiver,
)

Floats = NDArray[np.float64]

MASKS = cases.MASKS | {"no beam": (0, 0, 0, 0)}
STEPS = 8
FULL = "ros_twist"
FALSE_ALARM = 1e-3
"""Of the whole table: two modes, six masks, five ports, NEES and up to three axes."""
TESTS = 2 * len(MASKS) * len(PORTS) * 4


def directions(mask: tuple[int, ...]) -> Floats:
    found: Floats = JANUS.directions_p[np.array(mask, dtype=bool)]
    return found


class Source:
    """Estimates of one mask and mode, whose errors are drawn by their own covariance, anew at every message."""

    def __init__(self, mode: str, mask: tuple[int, ...], rng: np.random.Generator) -> None:
        self.mode, self.mask, self.rng = mode, np.array(mask, dtype=bool), rng
        self.information = directions(mask).T @ directions(mask) / BEAM_SD**2
        self.covariance = fused(mask)

    def axes(self) -> Floats:
        """Principal axes of what is known, in units of each component's σ: there diag(P) is short the most."""
        if self.mode == "navigation":
            sd = np.sqrt(np.diag(self.covariance))
            found: Floats = np.linalg.eigh(self.covariance / np.outer(sd, sd))[1].T / sd
            return found
        values, vectors = np.linalg.eigh(self.information)
        axes: Floats = vectors.T[values > 1e-6 * values[-1]]
        return axes

    def estimate(self, step: int) -> Estimate:
        """The estimate at a step, with its error."""
        time_ns = START + round(step * STEP_S * SECOND)
        if self.mode == "navigation":
            joint = np.zeros((9, 9))
            joint[:6, :6] = 1e-12 * np.eye(6)
            joint[6:, 6:] = self.covariance
            error = np.linalg.cholesky(self.covariance) @ self.rng.standard_normal(3)
            return navigated(
                time_ns,
                velocity_p_mps=TRUTH - error,
                covariance_m2ps2=self.covariance,
                navigation_covariance=joint,
                attitude_t_p=[1.0, 0.0, 0.0, 0.0],
            )
        readings = JANUS.beam_velocities([TRUTH])[0] + BEAM_SD * self.rng.standard_normal(4)
        fixes = solve_velocity(JANUS, [readings], [self.mask], method="info", beam_sd_mps=BEAM_SD)
        return Estimate.from_fix(time_ns, fixes)


Means = dict[str, dict[str, float]]


def statistics(names: list[str], mode: str, mask: tuple[int, ...], runs: int, seed: int) -> Means:
    """Means over runs at the last step, by port, 1 for a consistent receiver.

    "nees" is that of all states over its degrees, "axis k" the error along an axis squared over its variance. All ports
    get the same estimates, and all receivers the same readings of their own.
    """
    found: dict[tuple[str, str], list[float]] = {}
    for run in range(runs):
        rng = np.random.default_rng((seed, run))
        source = Source(mode, mask, rng)
        bias = BIAS_SD * rng.standard_normal(3)
        start = TRUTH - VELOCITY_SD * rng.standard_normal(3)
        receivers = {name: Receiver(start) for name in names}
        ports = {name: port(name, **PORTS[name][0]) for name in names}
        for step in range(STEPS):
            accel = bias + ACCEL_NOISE * rng.standard_normal(3)
            bias = bias + BIAS_WALK * rng.standard_normal(3)
            estimate = source.estimate(step)
            for name, receiver in receivers.items():
                receiver.predict(accel)
                data = ports[name].encode(estimate)
                if data is not None:
                    receiver.update(PORTS[name][1](data))
        for name, receiver in receivers.items():
            error = np.concatenate((TRUTH - receiver.velocity, bias - receiver.bias))
            nees = float(error @ np.linalg.solve(receiver.covariance, error)) / 6.0
            found.setdefault((name, "nees"), []).append(nees)
            for k, axis in enumerate(source.axes()):
                variance = float(axis @ receiver.covariance[:3, :3] @ axis)
                ratio = float(axis @ error[:3]) ** 2 / variance
                found.setdefault((name, f"axis {k + 1}"), []).append(ratio)
    means: Means = {name: {} for name in names}
    for (name, key), values in found.items():
        means[name][key] = float(np.mean(values))
    return means


def limits(key: str, runs: int) -> tuple[float, float]:
    """Band of a mean over runs, in units of its expectation, so that the whole table has the false-alarm rate."""
    degrees = 6 if key == "nees" else 1
    low, high = mean_band(degrees, runs, each_probability(FALSE_ALARM, TESTS))
    return low / degrees, high / degrees


@pytest.mark.statistical
@pytest.mark.first_cases(4)
@pytest.mark.parametrize("mode", ["velocity", "navigation"])
@pytest.mark.parametrize("mask", list(MASKS))
def test_a_receiver_is_consistent_through_every_port(mode: str, mask: str) -> None:
    runs = 40
    for name, means in statistics(list(PORTS), mode, MASKS[mask], runs, seed=17).items():
        for key, value in means.items():
            low, high = limits(key, runs)
            assert value < high, (name, key)
            if name == FULL:
                assert low < value, (name, key)


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("name", "module", "bound", "mode", "mask"),
    [
        ("odometry", odometry_port, "diagonal_bound", "navigation", "no beam"),
        ("microstrain", mip_port, "diagonal_bound", "navigation", "no beam"),
        ("vision_position_delta", delta_port, "scalar_bound", "velocity", "3 beams"),
    ],
)
def test_without_the_over_bound_it_is_not(
    monkeypatch: pytest.MonkeyPatch, name: str, module: ModuleType, bound: str, mode: str, mask: str
) -> None:
    """P's own diagonal, or its mean for one σ: the error along a principal axis leaves the same band."""

    def own_diagonal(covariance: Floats) -> Any:  # noqa: ANN401 - an array or a number
        diagonal = np.diag(covariance).copy()
        return diagonal if bound == "diagonal_bound" else float(diagonal.mean())

    monkeypatch.setattr(module, bound, own_diagonal)
    found = statistics([name], mode, MASKS[mask], 60, seed=17)[name]
    assert max(value / limits(key, 60)[1] for key, value in found.items()) > 1.0, found


@pytest.mark.statistical
def test_px4_resets_to_what_is_sent_and_is_consistent_afterwards() -> None:
    """A receiver that is wrong by 3 m/s rejects for 1 s, is reset, and is then wrong by no more than it claims.

    One beam returns, so two axes are inertial: a port that sent zeros for them would have reset the receiver to those.
    """
    runs, nees = 60, []
    for run in range(runs):
        rng = np.random.default_rng((18, run))
        source = Source("navigation", MASKS["1 beam"], rng)
        receiver = Px4(Receiver(TRUTH + 3.0), active=True, passed_s=0.0)
        one = port("odometry", variance_factor=1.0, max_rate_hz=1.0 / STEP_S)
        bias = BIAS_SD * rng.standard_normal(3)
        for step in range(10):
            receiver.filter.predict(bias + ACCEL_NOISE * rng.standard_normal(3))
            bias = bias + BIAS_WALK * rng.standard_normal(3)
            receiver.message(one.encode(source.estimate(step)), step * STEP_S)
        assert receiver.resets == 1
        error = TRUTH - receiver.filter.velocity
        nees.append(float(error @ np.linalg.solve(receiver.filter.covariance[:3, :3], error)))
    _, high = mean_band(3, runs, 0.999)
    assert np.mean(nees) < high


@pytest.mark.parametrize("time_s", [0.1, 0.5, 3.0])
def test_the_variance_factor_makes_up_for_errors_that_last(time_s: float) -> None:
    """Errors with a correlation time, taken as white: (1 + a) / (1 - a), a = exp(-T / τ), bounds them.

    It is the ratio of their spectral density at zero frequency to that of white noise of the same variance. Exact
    covariances, with the error as a further state of the truth; without the factor the receiver is overconfident.
    """
    true = Source("navigation", MASKS["2 neighbours"], np.random.default_rng(0)).covariance
    decay = np.exp(-STEP_S / time_s)
    for factor, expected in (((1.0 + decay) / (1.0 - decay), True), (1.0, False)):
        sent = np.diag(diagonal_bound(true)) * factor
        claimed = np.diag([VELOCITY_SD**2] * 3 + [BIAS_SD**2] * 3)
        joint = np.zeros((9, 9))
        joint[:6, :6], joint[6:, 6:] = claimed, true
        step = np.zeros((9, 9))
        step[:6, :6], step[6:, 6:] = TRANSITION, decay * np.eye(3)
        noise = np.zeros((9, 9))
        noise[:6, :6], noise[6:, 6:] = PROCESS, (1.0 - decay**2) * true
        rows = np.eye(6)[:3]
        for _ in range(200):
            claimed = TRANSITION @ claimed @ TRANSITION.T + PROCESS
            joint = step @ joint @ step.T + noise
            gain = claimed @ rows.T @ np.linalg.inv(claimed[:3, :3] + sent)
            keep = np.eye(6) - gain @ rows
            claimed = keep @ claimed @ keep.T + gain @ sent @ gain.T
            whole = np.eye(9)
            whole[:6, :6], whole[:6, 6:] = keep, -gain
            joint = whole @ joint @ whole.T
        assert (np.linalg.eigvalsh(claimed - joint[:6, :6])[0] > -1e-9) == expected
