"""Objects that keep a state, under attack: a Navigator through random pushes, a ClosedLoop through its segments."""

import math
from random import Random
from typing import Any

import numpy as np

from bottomlock import kernel
from tests.attack.trial import Trial, same
from tests.attack.values import Arguments, spoilt_arguments
from tests.attack.worlds import NONE, drawn_geometry, model, motion, options, some_methods
from tests.kernel.report_bits import FIELDS

STEP_NS = 50_000_000
SPOILT = 0.3
"""Share of spoilt calls: fewer than elsewhere, so that a navigator lives on after most of them."""


def _drawn(rng: Random, arguments: dict[str, Any]) -> Arguments:
    return spoilt_arguments(arguments, rng) if rng.random() < SPOILT else Arguments(arguments)


def navigator(rng: Random, trial: Trial) -> None:
    """A navigator and some twenty pushes, valid and spoilt; after each, state and covariance must be sound."""
    made = drawn_geometry(rng)
    at_rest = {
        "time_ns": 0,
        "position_t_m": np.zeros(3),
        "attitude_t_p": np.array([1.0, 0.0, 0.0, 0.0]),
        "velocity_p_mps": np.array([1.0, 0.0, 0.0]),
        "accel_bias_p_mps2": np.zeros(3),
        "gyro_bias_p_radps": np.zeros(3),
        "dvl_bias_mps": np.zeros(4),
        "dvl_scale_factor": 0.0,
    }
    arguments: dict[str, Any] = {
        "geometry": made, "model": model(), "options": options(rng), "initial": at_rest,
        "method": rng.choice(kernel.METHODS),
    }  # fmt: skip
    if rng.random() < 0.3:
        arguments["covariance"] = np.diag(np.full(kernel.STATES, 0.01))
    flown = trial.call("Navigator", kernel.Navigator, _drawn(rng, arguments))
    if flown is None:
        return
    known = _judge_navigator(trial, "Navigator", flown)
    time_ns = known[0]["time_ns"]
    for _ in range(rng.randint(5, 30)):
        time_ns += rng.choice((0, STEP_NS // 2, STEP_NS, STEP_NS, STEP_NS))
        name = rng.choice(_PUSHES)
        push = _drawn(rng, _push(name, time_ns, made.beams, rng))
        reports = trial.call(name, getattr(flown, name), push)
        found = _judge_navigator(trial, name, flown)
        if reports is None and name != "push_imu_block" and not all(map(same, known, found)):
            trial.fault(name, "a refused push changed the state or the covariance")
        for report in reports or ():
            # A beam that did not return has no weight.
            trial.finite(
                f"report of {name}",
                {one: getattr(report, one) for one in FIELDS},
                may_lack=("threshold", "beam_weight"),
            )
        if trial.faults:
            return
        known = found
    trial.call("late_events", flown.late_events, Arguments({}))
    thrust = trial.call("thrust", flown.thrust, Arguments({}))
    if thrust is not None:
        trial.finite("thrust", thrust)
        trial.covariance("thrust", thrust["covariance"])
    water = trial.call("water", flown.water, Arguments({}))
    if water is not None:
        # A layer that was never measured is infinitely old.
        trial.finite("water", water, may_lack=("age_s",))
        for covariance in (water["covariance"], water["layers"]["current_covariance"]):
            trial.covariance("water", covariance)


_PUSHES = (
    *["push_imu"] * 10, *["push_beams"] * 4, *["push_water_track"] * 2, "push_imu_block", "push_velocity", "push_depth",
    "push_attitude", "push_heading", "push_gps", "push_position", "push_acoustic_position", "push_thrust",
)  # fmt: skip


def _push(name: str, time_ns: int, beams: int, rng: Random) -> dict[str, Any]:
    """Valid arguments of a push."""
    three = np.array([rng.gauss(0.0, 1.0) for _ in range(3)])
    yaw = rng.uniform(-math.pi, math.pi)
    force = np.array([0.0, 0.0, -9.8])
    block = time_ns + STEP_NS * np.arange(1, 4)
    of_push: dict[str, dict[str, Any]] = {
        "push_imu": {"omega_p_radps": 0.1 * three, "force_p_mps2": force + 0.1 * three},
        "push_imu_block": {
            "omega_p_radps": np.tile(0.1 * three, (3, 1)),
            "force_p_mps2": np.tile(force, (3, 1)),
        },
        "push_beams": {
            "velocity_mps": np.array([rng.gauss(0.0, 0.5) for _ in range(beams)]),
            "valid": np.array([rng.random() < 0.7 for _ in range(beams)]),
            "sd_mps": np.full(beams, 0.042),
        },
        "push_water_track": {
            "velocity_mps": np.array([rng.gauss(0.0, 0.5) for _ in range(beams)]),
            "valid": np.array([rng.random() < 0.7 for _ in range(beams)]),
            "sd_mps": np.full(beams, 0.06),
        },
        "push_velocity": {"velocity_p_mps": 0.5 * three, "cov_m2ps2": np.diag([0.01, 0.01, 0.02])},
        "push_depth": {"depth_m": rng.gauss(0.0, 1.0), "sd_m": 0.1},
        "push_attitude": {
            "attitude_t_p": np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]),
            "roll_pitch_sd_rad": 0.02,
            "yaw_sd_rad": 0.1,
        },
        "push_heading": {"yaw_rad": yaw, "sd_rad": 0.1},
        "push_gps": {
            "position_t_m": three,
            "velocity_t_mps": 0.1 * three,
            "position_sd_m": np.full(3, 2.0),
            "velocity_sd_mps": np.full(3, 0.1),
        },
        "push_thrust": {"speed_p_mps": rng.choice((0.0, 0.1, 2.0)) * three, "sd_mps": 0.02},
        "push_position": {"position_t_m": three, "position_sd_m": np.full(3, 2.0)},
        "push_acoustic_position": {"position_t_m": three} | ({"sd_m": np.full(3, 1.0)} if yaw > 0 else {}),
    }
    return {"time_ns": block if name == "push_imu_block" else time_ns} | of_push[name]


def _judge_navigator(
    trial: Trial, name: str, flown: kernel.Navigator
) -> tuple[dict[str, Any], dict[str, Any]]:
    state: Any = flown.state()
    cov = flown.covariance()
    trial.finite(f"state after {name}", state)
    if abs(float(np.linalg.norm(state["attitude_t_p"])) - 1.0) > 1e-9:
        trial.fault(f"state after {name}", "a quaternion that is not of norm 1")
    trial.covariance(f"covariance after {name}", cov)
    return state, {"covariance": cov}


def closed_loop(rng: Random, trial: Trial) -> None:
    """Vehicles side by side over a few segments of the motion."""
    made, per_method = drawn_geometry(rng), rng.random() < 0.5
    methods = some_methods(rng)
    vehicles = len(methods) * rng.randint(1, 2)
    whole = motion()
    start = {"time_ns": int(whole["time_ns"][0])} | {
        key: np.tile(whole[key][0], (vehicles, 1))
        for key in ("position_t_m", "attitude_t_p", "velocity_p_mps")
    }
    arguments: dict[str, Any] = {
        "geometry": made, "simulated": model(), "assumed": model(), "options": options(rng), "methods": methods,
        "start": start, "vehicle_per_method": per_method, "seed": 1, "trajectory_key": 2, "first_run": 0, "threads": 1,
    }  # fmt: skip
    loop = trial.call("ClosedLoop", kernel.ClosedLoop, _drawn(rng, arguments))
    if loop is None:
        return
    for first in (0, 5, 10, 15):
        trial.call("advance", loop.advance, _drawn(rng, _segment(whole, first, vehicles, made.beams)))
        estimate = trial.call("estimate", loop.estimate, _drawn(rng, {"method": 0}))
        if estimate is not None:
            trial.finite("estimate", estimate)
        if rng.random() < 0.5:
            results = trial.call("results", loop.results, Arguments({}))
            if results is not None:
                trial.finite("results", results, may_lack=("nis_mean", "final_bias_error", "final_bias_sd"))


def _segment(whole: dict[str, np.ndarray[Any, Any]], first: int, vehicles: int, beams: int) -> dict[str, Any]:
    """Five steps of the motion for every vehicle, with a ping and a depth within them."""
    part = {key: values[first : first + 6] for key, values in whole.items()}
    times = part.pop("time_ns")
    truth = {"time_ns": times} | {key: np.tile(values, (vehicles, 1, 1)) for key, values in part.items()}
    plan = {
        "dvl_time_ns": times[3:4], "beam_valid": np.ones((1, beams), dtype=bool), "depth_time_ns": times[2:3],
        "magnetometer_time_ns": NONE, "gps_time_ns": NONE, "sample_time_ns": times[5:6],
    }  # fmt: skip
    return {"truth": truth, "schedule": plan}
