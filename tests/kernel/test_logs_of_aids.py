"""A log of an IMU and one further sensor gives the bits of a navigator that is fed in order of time."""

from typing import Any

import numpy as np
import pytest

from bottomlock.kernel import Method, Navigator, replay_log
from bottomlock.kernel.models import AcousticPositionModel, CurrentLayers, ThrustModel
from tests.kernel import documented_navigator as example
from tests.kernel import test_thrust, test_water_track

RANDOM = np.random.default_rng(3)
IMU_NS = np.arange(0, 4_000_000_000, 10_000_000)
FORCE = [0.0, 0.0, -example.gravity] + 0.01 * RANDOM.normal(size=(len(IMU_NS), 3))
OMEGA = 0.01 * RANDOM.normal(size=FORCE.shape)
AID_NS = IMU_NS[25::50] + 3_000_000
BEAMS = RANDOM.normal(size=(len(AID_NS), 4))
COLUMNS: dict[str, dict[str, Any]] = {
    "thrust": {"speed_p_mps": np.array([1.6, 0.0, 0.1]) + 0.1 * RANDOM.normal(size=(len(AID_NS), 3))},
    "water_track": {
        "velocity_mps": BEAMS, "valid": RANDOM.random(BEAMS.shape) < 0.8, "range_m": 40.0 * RANDOM.random(len(AID_NS)),
    },
    "acoustic_position": {"t_m": RANDOM.normal(size=(len(AID_NS), 3))},
    "acoustic_position with": {
        "t_m": RANDOM.normal(size=(len(AID_NS), 3)), "sd_m": RANDOM.uniform(0.5, 3.0, (len(AID_NS), 3)),
    },
}  # fmt: skip
"""Of each sensor, and of fixes with deviations of their own."""
DRIVES = ThrustModel(scale_sd=[0.1] * 3, slip_sd_mps=[0.02] * 3)
AXES = ("thrust_surge", "thrust_sway", "thrust_heave")
LAYERED = test_thrust.ON.replace(current_layers=CurrentLayers())
TRANSCEIVER = example.model.replace(
    acoustic_position=AcousticPositionModel(sd_m=0.5, sd_per_range=0.02, transceiver_t_m=[40.0, -30.0, 5.0])
)
SETTINGS: dict[str, tuple[Any, Any, tuple[str, ...], tuple[Method, ...]]] = {
    "thrust": (test_thrust.MODEL.replace(thrust=DRIVES), LAYERED, AXES, ("ins", "tc", "sway_current")),
    "water_track": (example.model, test_water_track.LAYERED, ("water_track",), ("tc", "sway_current")),
    "acoustic_position": (TRANSCEIVER, example.options, ("acoustic_position",), ("tc", "sway_current")),
}
"""Model, options, sensors of the records, methods."""


def push(flown: Navigator, columns: str, row: int) -> None:
    """A row with the noise that a replay of it takes."""
    time_ns, values = int(AID_NS[row]), {key: column[row] for key, column in COLUMNS[columns].items()}
    sensor = columns.removesuffix(" with")
    if sensor == "thrust":
        flown.push_thrust(time_ns, **values, sd_mps=DRIVES.noise_sd_mps)
    elif sensor == "acoustic_position":
        flown.push_acoustic_position(time_ns=time_ns, position_t_m=values["t_m"], sd_m=values.get("sd_m"))
    else:
        dvl: Any = example.model.dvl
        beams = (values["velocity_mps"], values["valid"])
        sd_mps = np.full(4, dvl.beam_noise_sd_mps)
        flown.push_water_track(time_ns, *beams, sd_mps=sd_mps, range_m=values["range_m"])


@pytest.mark.parametrize("columns", COLUMNS)
def test_a_log_gives_the_bits_of_the_navigator(columns: str) -> None:
    """State, current and the times of its records; and what was saved has the same estimates."""
    sensor = columns.removesuffix(" with")
    log: Any = {
        "imu_time_ns": IMU_NS, "force_p_mps2": FORCE, "omega_p_radps": OMEGA, "dvl_time_ns": np.empty(0, np.int64),
        "beam_velocity_mps": np.empty((0, 4)), "beam_valid": np.empty((0, 4), dtype=bool), f"{sensor}_time_ns": AID_NS,
        **{f"{sensor}_{key}": column for key, column in COLUMNS[columns].items()},
    }  # fmt: skip
    model, options, records, methods = SETTINGS[sensor]
    taken = AID_NS[COLUMNS[sensor]["valid"].any(axis=1)] if sensor == "water_track" else AID_NS
    for method in methods:
        out: Any = replay_log(
            example.janus, model, options, [method], log, example.initial, sample_time_ns=IMU_NS[-1:], innovations=True
        )  # fmt: skip
        for name in records:
            np.testing.assert_array_equal(out["innovations"][0][name]["time_ns"], taken)
        flown = Navigator(example.janus, model, options, example.initial, method=method)
        waiting = list(range(len(AID_NS)))
        for k, time_ns in enumerate(IMU_NS.tolist()):
            while waiting and AID_NS[waiting[0]] <= time_ns:
                push(flown, columns, waiting.pop(0))
            flown.push_imu(time_ns, omega_p_radps=OMEGA[k], force_p_mps2=FORCE[k])
        assert out["velocity_p_mps"][0, 0].tolist() == list(flown.state()["velocity_p_mps"])
        water: Any = flown.water()
        if sensor == "water_track":
            for name in ("current_t_mps", "current_covariance"):
                np.testing.assert_array_equal(out[name][0, 0], water[name])
        loaded = Navigator.load(flown.save())
        for name in ("thrust", "water"):
            np.testing.assert_equal(getattr(loaded, name)(), getattr(flown, name)())
