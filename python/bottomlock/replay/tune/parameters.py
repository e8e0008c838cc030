"""The settings of a case that can be tuned: their values, their priors, and the case with other values."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from bottomlock import units
from bottomlock.config.section import Section
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.recordings.streams import Floats
from bottomlock.replay.case import Case
from bottomlock.replay.model import imu_model
from bottomlock.replay.streams import Streams

PRIOR_SD = float(np.log(10.0))
"""1 sigma of the logarithm of a setting of a case: it is right within a factor of ten."""
STEP = 0.02
"""Step of the derivatives, in the natural logarithm of a parameter."""
ALLAN_CORNER_S = 100.0
"""Time at which a random walk that the case leaves out overtakes the white noise, for its prior."""
S = TypeVar("S", bound=Section)
_ACCEL_NOISE, _GYRO_NOISE = "imu.errors.accel_noise_mps_per_rt_h", "imu.errors.gyro_noise_deg_per_rt_h"
_SLOW = ("roll_pitch", "yaw")
"""Axes of an attitude reference whose errors last."""
BEAM_NOISE = "dvl.beam_noise_mps"
WATER_NOISE, LAYERS = "water_track.noise_mps", "filter.current_layers.sd_mps"


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

    @property
    def is_inertial_noise(self) -> bool:
        """Whether it is the noise of the inertial readings, which a prediction follows."""
        return self.key.startswith("imu.errors.") and "_noise_" in self.key

    @property
    def old(self) -> float:
        """The value in the case, 0 where it has none."""
        return self.start if self.is_given else 0.0


def _walk_of(noise_key: str) -> Callable[[Case], float]:
    """A random walk per √s that overtakes a noise per √h at the corner of the Allan deviation."""
    return lambda case: (value_of(case, noise_key) or 0.0) / 60.0 / ALLAN_CORNER_S


_OF_ZERO: dict[str, Callable[[Case], float]] = {
    _ACCEL_NOISE: lambda _: 0.01,
    _GYRO_NOISE: lambda _: 0.01,
    "imu.errors.accel_bias_walk_mps2_per_rt_s": _walk_of(_ACCEL_NOISE),
    "imu.errors.gyro_bias_walk_deg_per_s_per_rt_s": _walk_of(_GYRO_NOISE),
}
"""Priors of what a case leaves at zero; other settings of zero say that the error is not there, and stay."""

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


def noise_of(case: Case, streams: Streams) -> list[Parameter]:
    """The noise of a case that can be tuned: of the sensors that it uses."""
    found = []
    for key, words in _KEYS.items():
        if not _applies(case, streams, key):
            continue
        value = value_of(case, key)
        if value is None:
            value = _measured(case, streams, key)
        if value is not None and value > 0.0:
            found.append(Parameter(key, value, is_given=True, words=words))
        elif value is not None and key in _OF_ZERO:
            found.append(Parameter(key, _OF_ZERO[key](case), is_given=False, words=words))
    return found


def _measured(case: Case, streams: Streams, key: str) -> float | None:
    """What a replay takes for a key that the case leaves out: of the geometry, or of the recording."""
    if key == BEAM_NOISE:
        return float(streams.instrument.beam_sd_mps.mean())
    if key == WATER_NOISE and streams.water is not None:
        return float(streams.water.sd_mps.mean())
    if isinstance(case.imu, ImuFromAttitude):
        imu = imu_model(case, streams)
        if key == _ACCEL_NOISE:
            return units.per_rt_h_from_per_rt_s(imu.accel_noise_mps_rts)
        if key == _GYRO_NOISE:
            return units.per_rt_h_from_per_rt_s(float(np.rad2deg(imu.gyro_noise_rad_rts)))
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
        aids = case.attitude is not None and case.attitude.aids
        aided = {"attitude": _SLOW, "heading": _SLOW[1:]}.get(str(aids), ())
        kinds = ("offset", "walk")
        slow = [
            axis for axis in aided if any(value_of(case, f"attitude.{axis}_{kind}_sd_deg") for kind in kinds)
        ]
        return any(axis in key for axis in slow)
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


def coordinates_of(parameters: Sequence[Parameter], values: Mapping[str, float] | None = None) -> Floats:
    """(P,) logarithms of values by their keys; of those at the start where there are none."""
    values = values or {}
    return np.log([values.get(one.key, one.start) for one in parameters])
