"""Model and options of a replay's filter, in SI, as the kernel takes them."""

from bottomlock.config.imu import WEIGHTLESS_MPS2, without_gyrocompass
from bottomlock.io.beams import Instrument
from bottomlock.kernel import normal_gravity_mps2
from bottomlock.kernel.models import Environment, ImuModel, InitialModel, Model, Options
from bottomlock.recordings.sensors import of_kernel
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.replay.case import Case
from bottomlock.replay.streams import Streams, VehicleMotion

BEYOND_PRIOR = 5.0
"""White noise of the accelerations over that of the prior's changes: what both say counts for a twenty-fifth."""


def imu_model(case: Case, streams: Streams | None = None) -> ImuModel:
    """IMU errors that the filter assumes.

    Args:
        case: the case.
        streams: its recording, for a vehicle without inertial readings: they hold its motion.
    """
    if isinstance(case.imu, ImuFromAttitude):
        return _motion_model(case.imu, case, streams)
    return case.imu.errors.kernel_model()


def _motion_model(imu: ImuFromAttitude, case: Case, streams: Streams | None) -> ImuModel:
    """Noise of a motion made from attitudes: of the vehicle's accelerations, and of the reference's changing error."""
    assert case.attitude is not None  # validated in Case
    motion = None if streams is None else streams.vehicle_motion
    accel = 0.0 if motion is None else BEYOND_PRIOR * motion.accel_noise_mps_per_rt_s
    return imu.errors.kernel_model(accel, case.attitude.gyro_noise_rad_rts)


def gravity_mps2(case: Case, streams: Streams) -> float:
    """Gravity: the case's own, or normal gravity at the latitude; on a tangent plane at the recording's mean depth.

    On the ellipsoid the kernel adds what depth and latitude of the vehicle change.
    It is 0 for a vehicle without inertial readings, whose specific forces are made without it (docs/no_imu.md).
    """
    if isinstance(case.imu, ImuFromAttitude):
        return WEIGHTLESS_MPS2
    if case.origin.gravity != "normal":
        return float(case.origin.gravity)
    depth = 0.0
    if case.origin.earth == "ellipsoid":
        return normal_gravity_mps2(streams.latitude_rad, depth)
    if streams.depths is not None:
        depth = float(streams.depths.depth_m.mean())
    elif streams.reference is not None and streams.reference.position_t_m is not None:
        depth = float(streams.reference.position_t_m[:, 2].mean())
    return normal_gravity_mps2(streams.latitude_rad, depth)


def kernel_model(case: Case, streams: Streams, imu: ImuModel, initial: InitialModel, gravity: float) -> Model:
    """Environment, sensor errors and initial standard deviations, as the kernel takes them: `without_gyrocompass`."""
    model = Model(
        environment=Environment(
            latitude_rad=streams.latitude_rad, gravity_mps2=gravity, earth=case.origin.earth
        ),
        imu=imu,
        dvl=case.dvl.errors.kernel_model(
            float(streams.instrument.beam_sd_mps.mean()), streams.instrument.calibration
        ),
        initial=initial,
        **of_kernel(case)[0],
    )
    return without_gyrocompass(model)


def kernel_options(case: Case, instrument: Instrument, motion: VehicleMotion | None = None) -> Options:
    """Filter options, as the kernel takes them; the DVL's file has a part in the prior of its calibration.

    Args:
        case: the case.
        instrument: the DVL.
        motion: the prior of the velocity where the case gives none, as measured.
    """
    options = case.filter.kernel_options()
    if motion is not None and "motion" not in case.filter.model_fields_set:
        options["motion"] = motion.prior
    limits = case.imu.limits.kernel_limits()
    own = {
        "robust": case.robust.kernel_options(),
        "imu_limits": limits.replace(max_gap_s=max(limits.max_gap_s, case.imu.bridge_gaps_s)),
        "imu_sampling": "averaged" if case.imu.averaged else "instantaneous",
        "calibration": case.calibration.prior(instrument.calibration),
    }
    return Options.of(options, own, *of_kernel(case)[1])
