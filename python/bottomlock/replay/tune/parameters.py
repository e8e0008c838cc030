"""The settings of a case that can be tuned: their values, their priors, and the case with other values."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from bottomlock import units
from bottomlock.config.section import Section
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.replay.case import Case
from bottomlock.replay.model import imu_model
from bottomlock.replay.streams import Streams

PRIOR_SD = float(np.log(10.0))
"""1 sigma of the logarithm of a setting of a case: it is right within a factor of ten."""
ALLAN_CORNER_S = 100.0
"""Time at which a random walk that the case leaves out overtakes the white noise, for its prior."""
UNKNOWN_NOISE = 0.01
"""Prior of the inertial noise that a case leaves at zero, m/s/√h and deg/√h."""
S = TypeVar("S", bound=Section)
_ACCEL_NOISE, _GYRO_NOISE = "imu.errors.accel_noise_mps_per_rt_h", "imu.errors.gyro_noise_deg_per_rt_h"
_WALKS = {
    "imu.errors.accel_bias_walk_mps2_per_rt_s": _ACCEL_NOISE,
    "imu.errors.gyro_bias_walk_deg_per_s_per_rt_s": _GYRO_NOISE,
}
"""Walks, and the noise that each of them overtakes at the corner."""
INERTIAL_NOISE = (_ACCEL_NOISE, _GYRO_NOISE)
BEAM_NOISE, WATER_NOISE, LAYERS = (
    "dvl.beam_noise_mps",
    "water_track.noise_mps",
    "filter.current_layers.sd_mps",
)
_KEYS: dict[str, str] = {
    _ACCEL_NOISE: "accelerometer noise, m/s/√h",
    _GYRO_NOISE: "gyro noise, deg/√h",
    "imu.errors.accel_bias_walk_mps2_per_rt_s": "accelerometer bias walk, m/s²/√s",
    "imu.errors.gyro_bias_walk_deg_per_s_per_rt_s": "gyro bias walk, deg/s/√s",
    BEAM_NOISE: "beam noise, m/s",
    "dvl.errors.beam_bias_walk_mps_per_rt_s": "beam bias walk, m/s/√s",
    "dvl.errors.scale_factor_walk_percent_per_rt_s": "DVL scale walk, %/√s",
    "attitude.roll_pitch_sd_deg": "roll and pitch noise, deg",
    "attitude.yaw_sd_deg": "yaw noise, deg",
    "attitude.yaw_walk_sd_deg": "yaw walk, deg",
    "depth.sd_m": "depth noise, m",
    WATER_NOISE: "noise of a beam of the water, m/s",
    LAYERS: "own part of a layer of current, m/s",
    "thrust.slip_mps": "slip of the propeller, m/s",
    "thrust.noise_mps": "noise of the propeller's speed, m/s",
    "effort.slip_mps": "slip of the speed by thrusters, m/s",
    "effort.noise_mps": "noise of the speed by thrusters, m/s",
}


@dataclass(frozen=True)
class Parameter:
    """A setting that is tuned; it is searched in its natural logarithm.

    Attributes:
        key: its place in the case, with dots.
        start: its value in the case, or its prior where the case has none.
        is_given: whether `start` is the case's, and not the prior of what the case leaves at zero.
        words: what it is, for tables.
    """

    key: str
    start: float
    is_given: bool
    words: str


def noise_of(case: Case, streams: Streams) -> list[Parameter]:
    """The noise of a case that can be tuned: of the sensors that it uses."""
    found = []
    for key, words in _KEYS.items():
        if not _applies(case, streams, key):
            continue
        value = value_of(case, key)
        value = _measured(case, streams, key) if value is None else value
        # Other settings of zero say that the error is not there, and stay.
        start = _of_zero(case, key) if value == 0.0 else value
        if start is not None:
            found.append(Parameter(key, start, is_given=value != 0.0, words=words))
    return found


def _of_zero(case: Case, key: str) -> float | None:
    """The prior of what a case leaves at zero; a walk per √s overtakes the noise per √h at the Allan corner."""
    if key in _WALKS:
        return (value_of(case, _WALKS[key]) or 0.0) / 60.0 / ALLAN_CORNER_S or None
    return UNKNOWN_NOISE if key in INERTIAL_NOISE else None


def _measured(case: Case, streams: Streams, key: str) -> float | None:
    """What a replay takes for a key that the case leaves out: of the geometry, or of the recording."""
    if key == BEAM_NOISE:
        return float(streams.instrument.beam_sd_mps.mean())
    if key == WATER_NOISE and streams.water is not None:
        return float(streams.water.sd_mps.mean())
    if key == _GYRO_NOISE and isinstance(case.imu, ImuFromAttitude):
        noise = imu_model(case, streams).gyro_noise_rad_rts
        return units.per_rt_h_from_per_rt_s(float(np.rad2deg(noise)))
    return None


def _applies(case: Case, streams: Streams, key: str) -> bool:
    if key == BEAM_NOISE:
        return case.dvl.beam_noise_from != "recording" and streams.instrument.beam_sd_mps_per_m == 0.0
    if key == WATER_NOISE:
        # Noise that the instrument records with each cell comes before that of the case.
        return streams.water is not None and float(np.ptp(streams.water.sd_mps)) == 0.0
    if key == LAYERS:
        return streams.water is not None
    if key.startswith("attitude."):
        # The scatter of a reference whose errors last says nothing of them: its white noise alone would claim too much.
        axis = "yaw" if "yaw" in key else "roll_pitch"
        aids = None if case.attitude is None else case.attitude.aids
        slow = any(value_of(case, f"attitude.{axis}_{kind}_sd_deg") for kind in ("offset", "walk"))
        return slow and (aids == "attitude" or (aids == "heading" and axis == "yaw"))
    if key == _ACCEL_NOISE and isinstance(case.imu, ImuFromAttitude):
        # How the velocity changes is the prior of the motion, measured on the pings; this is what is left beside it.
        return False
    return not key.startswith("dvl.errors.") or case.filter.estimate_dvl


def value_of(case: Case, key: str) -> float | None:
    """The value of a key; None where the case has none."""
    at: Any = case
    for name in key.split("."):
        at = getattr(at, name, None)
    return None if at is None else float(at)


def with_values(case: Case, values: Mapping[str, float]) -> Case:
    """The case with other values."""
    for key, value in values.items():
        case = _replaced(case, key.split("."), value)
    return case


def _replaced(section: S, names: list[str], value: float) -> S:
    own = value if len(names) == 1 else _replaced(getattr(section, names[0]), names[1:], value)
    return section.model_copy(update={names[0]: own})
