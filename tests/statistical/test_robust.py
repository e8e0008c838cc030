"""What a heavy-tailed update wins where beams have heavy tails, and whether NEES stays near 6.

TC in a figure-eight over 60 runs, beams with Student's t noise of three degrees at Table 2's scale. The RMS limits lie
a little off what was seen (the seed is fixed: they are not chances); the NEES check has a 95 % band from the spread
between runs, so a right filter fails each of the two in 5 % of ensembles. Seed and number of runs were fixed before
the first run.
"""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel.models import DvlModel, Robust
from tests.analytic import analytic_simulation
from tests.drawn_log import drawn_log
from tests.oracle import chi_squared
from tests.oracle.rotations import Array, log_rotation, matrix_from_quaternion
from tests.statistical.ensembles import SEED

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

RUNS = 60
DEGREES = 3.0
WAYS: dict[str, dict[str, Any]] = {
    "gaussian": {"gate": "off"},
    "matched": {"gate": "off", "scale": np.sqrt(DEGREES / (DEGREES - 2))},
    "student": {
        "gate": "off",
        "robust": Robust(closure_gate=None, beam_gate=None, student_t_degrees=DEGREES),
    },
}
"""Filter options by name; `scale` multiplies the noise that the filter assumes."""


@lru_cache(maxsize=8)
def streams(lost: tuple[int, ...]) -> tuple[Any, ...]:
    """World, model, samples, truth at the samples, and a (log, start) for every run."""
    simulation = analytic_simulation("figure_eight", imu_hz=50.0)
    truth = simulation.truth()
    plan: Any = bottomlock.measurement_schedule(simulation, truth)
    model = simulation.scenario.kernel_model(simulation.gravity_mps2)
    scale = model.of(DvlModel).beam_noise_sd_mps
    silent = model.replace(dvl=model.of(DvlModel).replace(beam_noise_sd_mps=0.0))
    arrays: Any = truth.kernel_arrays()
    sample_ns = plan["sample_time_ns"][4::5]
    runs = []
    for run in range(RUNS):
        drawn = bottomlock.simulate_sensors(
            simulation.geometry, arrays, silent, plan, seed=SEED, trajectory_key=17, run=run
        )
        rng = np.random.default_rng([SEED, run])
        shape = drawn["dvl_velocity_mps"].shape
        noise = rng.standard_t(DEGREES, shape)
        valid = np.ones(shape, dtype=bool)
        valid[:, [beam - 1 for beam in lost]] = False
        log = drawn_log(drawn, beam_velocity_mps=drawn["dvl_velocity_mps"] + scale * noise, beam_valid=valid)
        runs.append((log, drawn["initial"]))
    at = np.searchsorted(arrays["time_ns"], sample_ns)
    return (
        simulation,
        model,
        sample_ns,
        {key: arrays[key][at] for key in ("attitude_t_p", "velocity_p_mps")},
        runs,
    )


@lru_cache(maxsize=16)
def run_tc(name: str, lost: tuple[int, ...]) -> tuple[Array, Array]:
    """Squared velocity error (runs, T) and NEES of attitude and velocity (runs, T) of TC run in one of `WAYS`."""
    way = WAYS[name]
    simulation, model, sample_ns, true, runs = streams(lost)
    options = simulation.scenario.kernel_options().replace(**{key: way[key] for key in way if key != "scale"})
    assumed = model.of(DvlModel).beam_noise_sd_mps * way.get("scale", 1.0)
    square, nees = [], []
    for log, start in runs:
        out: Any = bottomlock.replay_log(
            simulation.geometry,
            model.replace(dvl=model.of(DvlModel).replace(beam_noise_sd_mps=assumed)),
            options,
            ["tc"],
            log,
            start,
            sample_time_ns=sample_ns,
            covariances=True,
        )
        error = np.empty((len(sample_ns), 6))
        for k, quaternion in enumerate(out["attitude_t_p"][0]):
            turn = matrix_from_quaternion(true["attitude_t_p"][k]) @ matrix_from_quaternion(quaternion).T
            error[k, :3] = log_rotation(turn)
        error[:, 3:] = true["velocity_p_mps"] - out["velocity_p_mps"][0]
        P = out["covariance"][0, :, 3:9, 3:9]
        square.append((error[:, 3:] ** 2).sum(axis=1))
        nees.append(np.einsum("ti,ti->t", error, np.linalg.solve(P, error[..., None])[..., 0]))
    return np.array(square), np.array(nees)


def rms(way: str, lost: tuple[int, ...]) -> float:
    return float(np.sqrt(run_tc(way, lost)[0].mean()))


@pytest.mark.parametrize(("lost", "limit"), [((), 0.82), pytest.param((3, 4), 0.88, marks=pytest.mark.long)])
def test_heavy_tails_are_worth_an_update_that_knows_them(lost: tuple[int, ...], limit: float) -> None:
    """Velocity RMS against the Gaussian update; seen: 0.80 at full lock, 0.86 with two beams.

    A Gaussian update with the true variance, three times larger, gains 3 and 6 % only.
    """
    plain = rms("gaussian", lost)
    assert rms("student", lost) < limit * plain
    assert rms("matched", lost) > 0.92 * plain


@pytest.mark.parametrize("lost", [(), pytest.param((3, 4), marks=pytest.mark.long)])
def test_student_t_claims_what_it_achieves(lost: tuple[int, ...]) -> None:
    """NEES of attitude and velocity, 6 degrees; 6.2 and 6.1 seen, where the Gaussian update has 10.0 and 9.2.

    In eight ensembles with other seeds 6.1 to 6.8, in the mean 6.4: three of them lie above the band of a right filter.
    """
    nees = run_tc("student", lost)[1]
    low, high = chi_squared.mean_band(nees.mean(axis=1), 6.0)
    assert low < nees.mean() < high
    assert run_tc("gaussian", lost)[1].mean() > 8.5
