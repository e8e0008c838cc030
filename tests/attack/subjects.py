"""The kernel's functions under attack: valid arguments of each, drawn, then spoilt; and what its result must be."""

import functools
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

from bottomlock import kernel
from tests.attack.flight import closed_loop, navigator
from tests.attack.trial import Trial
from tests.attack.values import Arguments, spoilt_arguments
from tests.attack.worlds import drawn_geometry, log_and_start, model, motion, options, schedule, some_methods

SPOILT = 0.85
"""Share of the calls with a spoilt argument; the others show that the valid ones are accepted."""


def _call(
    rng: Random,
    trial: Trial,
    name: str,
    function: Callable[..., Any],
    arguments: dict[str, Any],
    ignored: str = "-",
) -> Any:  # noqa: ANN401 - what the function returns
    """A call with valid arguments or spoilt ones; of those under the name `ignored` the values do not count."""
    if rng.random() >= SPOILT:
        return trial.call(name, function, Arguments(arguments), valid=True)
    spoilt = spoilt_arguments(arguments, rng)
    wrong = tuple(word for word in spoilt.wrong if not word.startswith(ignored) or word.endswith("key"))
    return trial.call(name, function, spoilt._replace(wrong=wrong))


def geometry(rng: Random, trial: Trial) -> None:
    """Beams by each constructor, and what they read."""
    common: dict[str, Any] = {
        "lever_arms_p_m": np.tile([0.5, 0.0, 0.1], (4, 1)),
        "mounting_rpy_rad": np.array([0.01, -0.02, 0.7]),
        "sound_speed_scale": 1.01,
    }
    tilt = rng.uniform(0.1, 0.8)
    kind = rng.randrange(3)
    azimuths = np.array([0.1, 1.6, 3.2, 4.7])
    subject: tuple[str, Callable[..., Any], dict[str, Any]]
    if kind == 0:
        subject = "janus", kernel.BeamGeometry.janus, {"tilt_rad": tilt, "configuration": rng.choice("x+")}
    elif kind == 1:
        of_angles = {"tilt_rad": np.full(4, tilt), "azimuth_rad": azimuths}
        subject = "from_angles", kernel.BeamGeometry.from_angles, of_angles
    else:
        directions = kernel.BeamGeometry.janus(tilt).directions_p
        subject = "BeamGeometry", kernel.BeamGeometry, {"directions_d": directions}
    name, function, arguments = subject
    made = _call(rng, trial, name, function, arguments | common)
    if made is None:
        return
    directions = made.directions_p
    if not (np.abs(np.linalg.norm(directions, axis=1) - 1.0) < 1e-6).all():
        trial.fault(name, "directions that are not unit vectors")
    trial.finite(name, {"lever_arms_p_m": made.lever_arms_p_m, "scale": made.sound_speed_scale})
    if not (1 <= made.beams <= 8 and 1 <= made.rank <= 3):
        trial.fault(name, f"{made.beams} beams of rank {made.rank}")
    _beam_velocities(rng, trial, made)


def _beam_velocities(rng: Random, trial: Trial, made: kernel.BeamGeometry) -> None:
    arguments = {
        "velocity_p_mps": np.array([[rng.uniform(-3, 3), 0.1, 0.0]]),
        "omega_tp_p_radps": np.array([[0.0, 0.01, 0.1]]),
        "beam_bias_mps": np.full(made.beams, 0.005),
        "scale_factor": 0.003,
    }
    read = _call(rng, trial, "beam_velocities", made.beam_velocities, arguments)
    if read is not None:
        trial.finite("beam_velocities", {"beam velocities": read})


def solve_velocity(rng: Random, trial: Trial) -> None:
    """Pings solved by any method."""
    made, pings = drawn_geometry(rng), rng.randint(1, 4)
    velocity = np.array([[rng.uniform(-2, 2), rng.uniform(-0.5, 0.5), 0.0] for _ in range(pings)])
    arguments: dict[str, Any] = {
        "geometry": made,
        "velocity_mps": made.beam_velocities(velocity),
        "valid": np.array([[rng.random() < 0.7 for _ in range(made.beams)] for _ in range(pings)]),
        "method": rng.choice(list(kernel.FIX_METHODS)),
        "beam_sd_mps": np.full(made.beams, 0.042),
        "prior_velocity_p_mps": velocity + 0.1,
        "prior_cov_m2ps2": np.tile(np.diag([0.01, 0.02, 0.01]), (pings, 1, 1)),
        "omega_tp_p_radps": np.zeros((pings, 3)),
        "virtual_beam_factor": 1.0,
        "nullified_sway_var_m2ps2": 1e-3,
        "weak_sway_var_m2ps2": 2.0,
    }
    fixes = _call(rng, trial, "solve_velocity", kernel.solve_velocity, arguments)
    if fixes is None:
        return
    solved = fixes.component == kernel.COMPONENT_STATUS.index("solved")
    if not np.isfinite(fixes.velocity_p_mps[solved]).all():
        trial.fault("solve_velocity", "a solved velocity that is not finite")
    variance = np.diagonal(fixes.cov_m2ps2, axis1=1, axis2=2)
    if not (np.isfinite(variance[solved]).all() and (variance[solved] > 0).all()):
        trial.fault("solve_velocity", "a solved velocity without a positive variance")
    trial.finite(
        "solve_velocity", {"observed": fixes.observed_velocity_p_mps, "information": fixes.information_s2pm2}
    )
    trial.call("to_frame", fixes.to_frame, Arguments({}))


def batch(rng: Random, trial: Trial) -> None:
    """Runs of methods."""
    made = drawn_geometry(rng)
    arguments = {
        "geometry": made, "truth": motion(), "simulated": model(), "assumed": model(),
        "options": options(rng), "schedule": schedule(made.beams), "methods": some_methods(rng), "seed": 1,
        "trajectory_key": 2, "first_run": 0, "runs": rng.randint(0, 2), "threads": rng.randint(1, 2),
    }  # fmt: skip
    result = _call(rng, trial, "run_batch", kernel.run_batch, arguments)
    if result is not None:
        lacking = ("nis_mean", "final_bias_error", "final_bias_sd")
        trial.finite("run_batch", result, may_lack=lacking)


def sensors(rng: Random, trial: Trial) -> None:
    """The streams of one run."""
    made = drawn_geometry(rng)
    arguments = {
        "geometry": made, "truth": motion(), "model": model(), "schedule": schedule(made.beams), "seed": 1,
        "trajectory_key": 2, "run": 3, "imu_sampling": rng.choice(("instantaneous", "averaged")),
        "options": options(rng),
    }  # fmt: skip
    result = _call(rng, trial, "simulate_sensors", kernel.simulate_sensors, arguments, ignored="options.")
    if result is not None:
        lost = {"dvl_velocity_mps": result["dvl_velocity_mps"][result["dvl_valid"]]}
        trial.finite("simulate_sensors", result | lost)


def replay(rng: Random, trial: Trial) -> None:
    """A log through several methods."""
    made = drawn_geometry(rng)
    log, start = log_and_start(made.beams)
    methods = some_methods(rng)
    arguments = {
        "geometry": made, "model": model(), "options": options(rng), "methods": methods, "log": log,
        "start": start, "sample_time_ns": np.array([500_000_000, 1_000_000_000]), "smooth": rng.random() < 0.4,
        "covariances": rng.random() < 0.4, "threads": 1, "covariance": np.diag(np.full(20, 0.01)),
    }  # fmt: skip
    result = _call(rng, trial, "replay_log", kernel.replay_log, arguments)
    if result is not None:
        # Of a ping without a fix, of beams that did not return, and of a method that estimates no current.
        lacking = (
            "nis", "innovation_mps", "innovation_sd_mps", "beam_weight", "current_t_mps", "current_covariance",
        )  # fmt: skip
        trial.finite("replay_log", result, may_lack=lacking)


SUBJECTS: tuple[tuple[Callable[[Random, Trial], None], int], ...] = (
    (navigator, 40), (solve_velocity, 14), (geometry, 10), (batch, 8), (replay, 8), (sensors, 6), (closed_loop, 5),
)  # fmt: skip
"""What a case attacks, with its weight."""


@functools.cache
def _shares() -> tuple[list[Callable[[Random, Trial], None]], list[int]]:
    subjects, weights = zip(*SUBJECTS, strict=True)
    return list(subjects), list(weights)


def run_case(seed: int, case: int, trial: Trial) -> None:
    """One case, drawn from seed and number alone."""
    rng = Random(seed * 2**40 + case)
    subjects, weights = _shares()
    rng.choices(subjects, weights)[0](rng, trial)
