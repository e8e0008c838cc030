"""Model and options of a replay's filter, in SI, as the kernel takes them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bottomlock import units
from bottomlock.config.scenario_sections import ImuErrors
from bottomlock.kernel import EARTH_RATE_RADPS, normal_gravity_mps2
from bottomlock.replay.case import Case
from bottomlock.replay.sensors import SENSORS
from bottomlock.replay.streams import Floats, Streams


@dataclass(frozen=True)
class ImuModel:
    """Errors of the inertial sensors that the filter assumes, 1 sigma, SI."""

    accel_noise_mps_rts: float
    gyro_noise_rad_rts: float
    accel_bias_sd_mps2: float
    gyro_bias_sd_radps: float
    accel_bias_walk_mps2_rts: float
    gyro_bias_walk_radps_rts: float

    @classmethod
    def of(cls, errors: ImuErrors) -> "ImuModel":
        """The errors of a case's section, converted to SI."""
        return cls(
            accel_noise_mps_rts=units.per_rt_s_from_per_rt_h(errors.accel_noise_mps_per_rt_h),
            gyro_noise_rad_rts=units.rad_from_deg(
                units.per_rt_s_from_per_rt_h(errors.gyro_noise_deg_per_rt_h)
            ),
            accel_bias_sd_mps2=units.mps2_from_mg(errors.accel_bias_mg),
            gyro_bias_sd_radps=units.radps_from_deg_per_h(errors.gyro_bias_deg_per_h),
            accel_bias_walk_mps2_rts=errors.accel_bias_walk_mps2_per_rt_s,
            gyro_bias_walk_radps_rts=units.rad_from_deg(errors.gyro_bias_walk_deg_per_s_per_rt_s),
        )


def imu_model(case: Case) -> ImuModel:
    """IMU errors that the filter assumes; with `degrade`, the root sum of squares of both sets of errors."""
    own = ImuModel.of(case.imu.errors)
    if case.imu.degrade is None:
        return own
    added = ImuModel.of(case.imu.degrade)
    names = list(ImuModel.__dataclass_fields__)
    return ImuModel(**{name: float(np.hypot(getattr(own, name), getattr(added, name))) for name in names})


def gravity_mps2(case: Case, streams: Streams) -> float:
    """Gravity: the case's own, or normal gravity at the latitude and mean depth of the recording."""
    if case.origin.gravity != "normal":
        return float(case.origin.gravity)
    depth = 0.0
    if streams.depths is not None:
        depth = float(streams.depths.depth_m.mean())
    elif streams.reference is not None and streams.reference.position_t_m is not None:
        depth = float(streams.reference.position_t_m[:, 2].mean())
    return normal_gravity_mps2(streams.latitude_rad, depth)


def kernel_model(
    case: Case, streams: Streams, imu: ImuModel, initial: dict[str, Floats], gravity: float
) -> dict[str, Any]:
    """Environment, sensor errors and initial standard deviations, as the kernel takes them."""
    dvl = case.dvl.errors
    model: dict[str, Any] = {
        "environment": {
            "latitude_rad": streams.latitude_rad,
            "gravity_mps2": gravity,
            "earth_rate_radps": EARTH_RATE_RADPS,
        },
        "imu": dict(vars(imu)),
        "dvl": {
            "beam_noise_sd_mps": float(streams.instrument.beam_sd_mps.mean()),
            "beam_bias_sd_mps": dvl.beam_bias_mps,
            "beam_bias_walk_mps_rts": dvl.beam_bias_walk_mps_per_rt_s,
            "scale_factor_sd": units.fraction_from_percent(dvl.scale_factor_percent),
            "scale_factor_walk_rts": units.fraction_from_percent(dvl.scale_factor_walk_percent_per_rt_s),
        },
        "initial": {name: values.tolist() for name, values in initial.items()},
    }
    for sensor in SENSORS:
        model |= sensor.model(getattr(case, sensor.section))
    return model


def kernel_options(case: Case) -> dict[str, Any]:
    """Filter options, as the kernel takes them."""
    rate_hz = case.filter.covariance_rate_hz
    options = (
        case.filter.model_dump(exclude={"covariance_rate_hz"})
        | case.robust.kernel_options()
        | case.imu.limits.kernel_options()
        | {
            "covariance_period_ns": units.ns_from_s(1.0 / rate_hz) if rate_hz > 0.0 else 0,
            "imu_sampling": "averaged" if case.imu.averaged else "instantaneous",
            "max_imu_gap_s": max(case.imu.limits.max_gap_s, case.imu.bridge_gaps_s),
        }
    )
    for sensor in SENSORS:
        stream = getattr(case, sensor.section)
        options |= {} if stream is None else sensor.options(stream)
    return options
