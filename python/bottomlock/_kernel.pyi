"""Typed contract of the compiled kernel.

SI units, radians, int64 nanoseconds; tangent NED, platform FRD, quaternions scalar first.

Settings are objects of `bottomlock.kernel.models`; dicts with the same keys are taken, too. Of every dict, each key
that is given must be one that is read: an unknown one is an error that names the nearest.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Event
from typing import Any, Final, Literal, NotRequired, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.arguments import AnyGeometry
from bottomlock.io.beams import Instrument
from bottomlock.kernel import FixMethod, JanusConfiguration, Method
from bottomlock.kernel.models import Environment, ImuModel, InitialState, Model, Options
from bottomlock.live.started import StartedNavigator
from bottomlock.own_method import AnyMethod

__all__ = [
    "DEFAULT_OPTIONS",
    "EARTH_RATE_RADPS",
    "FIX_STATUS",
    "INERTIAL_STATES",
    "METHODS",
    "RECOMMENDED_METHOD",
    "SENSORS",
    "STATES",
    "BeamGeometry",
    "ClosedLoop",
    "Navigator",
    "Report",
    "__version__",
    "check_settings",
    "covariance_history",
    "error_model",
    "integrate_segments",
    "local_earth",
    "normal_gravity_mps2",
    "observe",
    "register_method",
    "rejected_imu",
    "replay_log",
    "run_batch",
    "simulate_sensors",
    "solve_velocity",
]
__version__: Final[str]
DEFAULT_OPTIONS: Final[dict[str, Any]]
EARTH_RATE_RADPS: Final[float]
INERTIAL_STATES: Final[int]
STATES: Final[int]
METHODS: Final[tuple[Method, ...]]
RECOMMENDED_METHOD: Final[Method]
SENSORS: Final[tuple[str, ...]]
FIX_STATUS: Final[tuple[str, ...]]

@type_check_only
class LocalEarthDict(TypedDict):
    gravity_t_mps2: NDArray[np.float64]
    rotation_t_n: NDArray[np.float64]
    depth_m: NDArray[np.float64]

@type_check_only
class SegmentsDict(TypedDict):
    rotation: NDArray[np.float64]
    force_integral_mps: NDArray[np.float64]
    rotation_integral_s: NDArray[np.float64]
    bias_integral: NDArray[np.float64]

@type_check_only
class ScheduleDict(TypedDict):
    dvl_time_ns: NDArray[np.int64]
    beam_valid: NDArray[np.bool_]
    beam_range_m: NotRequired[NDArray[np.float64]]
    depth_time_ns: NDArray[np.int64]
    depth_offset_m: NotRequired[NDArray[np.float64]]
    magnetometer_time_ns: NDArray[np.int64]
    yaw_offset_rad: NotRequired[NDArray[np.float64]]
    heading_time_ns: NotRequired[NDArray[np.int64]]
    gps_time_ns: NDArray[np.int64]
    gps_received: NotRequired[NDArray[np.bool_]]
    acoustic_position_time_ns: NotRequired[NDArray[np.int64]]
    acoustic_position_received: NotRequired[NDArray[np.bool_]]
    thrust_time_ns: NotRequired[NDArray[np.int64]]
    thrust_current_mps: NotRequired[NDArray[np.float64]]
    water_track_time_ns: NotRequired[NDArray[np.int64]]
    water_track_valid: NotRequired[NDArray[np.bool_]]
    water_current_n_mps: NotRequired[NDArray[np.float64]]
    water_shear_n_ps: NotRequired[NDArray[np.float64]]
    sample_time_ns: NDArray[np.int64]

@type_check_only
class TruthDict(TypedDict):
    time_ns: NDArray[np.int64]
    position_t_m: NDArray[np.float64]
    attitude_t_p: NDArray[np.float64]
    velocity_p_mps: NDArray[np.float64]
    omega_p_radps: NDArray[np.float64]
    force_p_mps2: NDArray[np.float64]

@type_check_only
class StartDict(TypedDict):
    time_ns: int
    position_t_m: NDArray[np.float64]
    attitude_t_p: NDArray[np.float64]
    velocity_p_mps: NDArray[np.float64]

@type_check_only
class EstimateDict(TypedDict):
    position_t_m: NDArray[np.float64]
    attitude_t_p: NDArray[np.float64]
    velocity_p_mps: NDArray[np.float64]

@type_check_only
class StateDict(TypedDict):
    time_ns: int
    position_t_m: NDArray[np.float64]
    attitude_t_p: NDArray[np.float64]
    velocity_p_mps: NDArray[np.float64]
    accel_bias_p_mps2: NDArray[np.float64]
    gyro_bias_p_radps: NDArray[np.float64]
    dvl_bias_mps: NDArray[np.float64]
    dvl_scale_factor: float

@type_check_only
class CalibrationDict(TypedDict):
    mounting_sd_rad: list[float]
    clock_sd_s: float

@type_check_only
class SlowErrorDict(TypedDict):
    error_rad: NDArray[np.float64]
    sd_rad: NDArray[np.float64]

@type_check_only
class CalibrationStateDict(TypedDict):
    mounting_rad: NDArray[np.float64]
    clock_s: float
    covariance: NDArray[np.float64]

@type_check_only
class LayersStateDict(TypedDict):
    depth_m: NDArray[np.float64]
    current_t_mps: NDArray[np.float64]
    current_covariance: NDArray[np.float64]
    age_s: NDArray[np.float64]

@type_check_only
class WaterStateDict(TypedDict):
    current_t_mps: NDArray[np.float64]
    current_covariance: NDArray[np.float64]
    sway_gain_m: float
    trim_heave_mps: float
    sway_slip_mps: float
    heave_slip_mps: float
    sway_slip_sd_mps: float
    heave_slip_sd_mps: float
    sway_slip_time_s: float
    heave_slip_time_s: float
    restarts: int
    alarms: int
    covariance: NDArray[np.float64]
    layers: LayersStateDict

@type_check_only
class ThrustStateDict(TypedDict):
    scale: NDArray[np.float64]
    slip_mps: NDArray[np.float64]
    covariance: NDArray[np.float64]

@type_check_only
class ImuFaultsDict(TypedDict):
    out_of_range: int
    clipped: int
    stuck: int
    jumped: int
    inflated_gaps: int

@type_check_only
class RejectedImuDict(TypedDict):
    row: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    reason: list[str]

@type_check_only
class InflatedImuDict(TypedDict):
    time_ns: NDArray[np.int64]
    gap_s: NDArray[np.float64]

@type_check_only
class SolutionDict(TypedDict):
    velocity_p_mps: NDArray[np.float64]
    cov_m2ps2: NDArray[np.float64]
    observed_velocity_p_mps: NDArray[np.float64]
    information_s2pm2: NDArray[np.float64]
    component: NDArray[np.uint8]
    status: NDArray[np.uint8]
    beams_used: NDArray[np.bool_]
    rank: NDArray[np.uint8]
    source: NDArray[np.uint8]

@type_check_only
class BatchDict(TypedDict):
    error: NDArray[np.float64]
    sd: NDArray[np.float64]
    nees: NDArray[np.float64]
    nees_velocity_attitude: NDArray[np.float64]
    nis_mean: NDArray[np.float64]
    fixes_accepted: NDArray[np.int64]
    fixes_rejected: NDArray[np.int64]
    fixes_beyond_linear_range: NDArray[np.int64]
    final_bias_error: NDArray[np.float64]
    final_bias_sd: NDArray[np.float64]
    choice: NDArray[np.uint8]

@type_check_only
class AidingDict(TypedDict):
    velocity: bool
    beams: NDArray[np.bool_]
    depth: bool
    attitude: bool
    heading: bool
    gps_position: bool
    gps_velocity: bool
    acoustic_position: NotRequired[bool]
    thrust_surge: NotRequired[bool]
    thrust_sway: NotRequired[bool]
    thrust_heave: NotRequired[bool]
    levers: NotRequired[Mapping[str, ArrayLike]]

@type_check_only
class AidingScheduleDict(TypedDict):
    time_ns: NDArray[np.int64]
    beams: NDArray[np.bool_]
    velocity: NDArray[np.bool_]
    depth: NDArray[np.bool_]
    attitude: NDArray[np.bool_]
    heading: NDArray[np.bool_]
    gps_position: NDArray[np.bool_]
    gps_velocity: NDArray[np.bool_]
    acoustic_position: NotRequired[NDArray[np.bool_]]
    thrust_surge: NotRequired[NDArray[np.bool_]]
    thrust_sway: NotRequired[NDArray[np.bool_]]
    thrust_heave: NotRequired[NDArray[np.bool_]]

@type_check_only
class ObservabilityDict(TypedDict):
    states: list[str]
    rank: int
    decided: bool
    gap: float
    widest_step: float
    singular_values: NDArray[np.float64]
    noise_floor: float
    basis: NDArray[np.float64]
    pivots: NDArray[np.int64]
    unobservable_fraction: NDArray[np.float64]
    scales: NDArray[np.float64]
    gramian: NDArray[np.float64]
    rows: NDArray[np.float64]
    epoch_time_ns: NDArray[np.int64]
    epoch_rank: NotRequired[NDArray[np.int64]]
    epoch_gap: NotRequired[NDArray[np.float64]]
    epoch_decided: NotRequired[NDArray[np.bool_]]

@type_check_only
class CovarianceDict(TypedDict):
    states: list[str]
    time_ns: NDArray[np.int64]
    covariance: NDArray[np.float64]

@type_check_only
class LogDict(TypedDict):
    imu_time_ns: NDArray[np.int64]
    force_p_mps2: ArrayLike
    omega_p_radps: ArrayLike
    dvl_time_ns: NDArray[np.int64]
    beam_velocity_mps: ArrayLike
    beam_valid: NDArray[np.bool_]
    beam_sd_mps: NotRequired[ArrayLike]
    depth_time_ns: NotRequired[NDArray[np.int64]]
    depth_m: NotRequired[ArrayLike]
    heading_time_ns: NotRequired[NDArray[np.int64]]
    heading_rad: NotRequired[ArrayLike]
    attitude_time_ns: NotRequired[NDArray[np.int64]]
    attitude_t_p: NotRequired[ArrayLike]
    gps_time_ns: NotRequired[NDArray[np.int64]]
    gps_position_t_m: NotRequired[ArrayLike]
    acoustic_position_time_ns: NotRequired[NDArray[np.int64]]
    acoustic_position_t_m: NotRequired[ArrayLike]
    acoustic_position_sd_m: NotRequired[ArrayLike]
    thrust_time_ns: NotRequired[NDArray[np.int64]]
    thrust_speed_p_mps: NotRequired[ArrayLike]
    water_track_time_ns: NotRequired[NDArray[np.int64]]
    water_track_velocity_mps: NotRequired[ArrayLike]
    water_track_valid: NotRequired[NDArray[np.bool_]]
    water_track_sd_mps: NotRequired[ArrayLike]
    water_track_range_m: NotRequired[ArrayLike]
    dvl_withheld: NotRequired[NDArray[np.bool_]]
    velocity_withheld: NotRequired[NDArray[np.bool_]]
    depth_withheld: NotRequired[NDArray[np.bool_]]
    attitude_withheld: NotRequired[NDArray[np.bool_]]
    heading_withheld: NotRequired[NDArray[np.bool_]]
    gps_withheld: NotRequired[NDArray[np.bool_]]
    acoustic_position_withheld: NotRequired[NDArray[np.bool_]]
    thrust_withheld: NotRequired[NDArray[np.bool_]]
    water_track_withheld: NotRequired[NDArray[np.bool_]]

@type_check_only
class InnovationsDict(TypedDict):
    time_ns: NDArray[np.int64]
    withheld: NDArray[np.bool_]
    rows: NDArray[np.uint8]
    residual: NDArray[np.float64]
    covariance: NDArray[np.float64]

@type_check_only
class SensorDict(TypedDict):
    measured: int
    rejected: int
    left_out: int
    inflated: int
    nis: float
    degrees: int

@type_check_only
class ReplayDict(TypedDict):
    sample_time_ns: NDArray[np.int64]
    position_t_m: NDArray[np.float64]
    attitude_t_p: NDArray[np.float64]
    velocity_p_mps: NDArray[np.float64]
    accel_bias_p_mps2: NDArray[np.float64]
    gyro_bias_p_radps: NDArray[np.float64]
    dvl_bias_mps: NDArray[np.float64]
    dvl_scale: NDArray[np.float64]
    sd: NDArray[np.float64]
    nis: NDArray[np.float64]
    nis_dof: NDArray[np.uint8]
    fix_status: NDArray[np.uint8]
    innovation_mps: NDArray[np.float64]
    innovation_sd_mps: NDArray[np.float64]
    beam_weight: NDArray[np.float64]
    choice: NDArray[np.uint8]
    unused: dict[Literal["before_start", "after_end", "rejected"], dict[str, int]]
    imu_faults: ImuFaultsDict
    rejected_imu: RejectedImuDict
    inflated_imu: InflatedImuDict
    sensors: list[dict[str, SensorDict]]
    slow_errors: list[dict[str, float]]
    innovations: NotRequired[list[dict[str, InnovationsDict]]]
    covariance: NotRequired[NDArray[np.float64]]
    smoothed_position_t_m: NotRequired[NDArray[np.float64]]
    smoothed_attitude_t_p: NotRequired[NDArray[np.float64]]
    smoothed_velocity_p_mps: NotRequired[NDArray[np.float64]]
    smoothed_accel_bias_mps2: NotRequired[NDArray[np.float64]]
    smoothed_gyro_bias_radps: NotRequired[NDArray[np.float64]]
    smoothed_dvl_bias_mps: NotRequired[NDArray[np.float64]]
    smoothed_dvl_scale: NotRequired[NDArray[np.float64]]
    smoothed_sd: NotRequired[NDArray[np.float64]]
    smoothed_covariance: NotRequired[NDArray[np.float64]]
    current_t_mps: NotRequired[NDArray[np.float64]]
    current_covariance: NotRequired[NDArray[np.float64]]
    attitude_error: NotRequired[NDArray[np.float64]]
    attitude_error_sd: NotRequired[NDArray[np.float64]]
    calibration: NotRequired[NDArray[np.float64]]
    calibration_sd: NotRequired[NDArray[np.float64]]
    calibration_covariance: NotRequired[NDArray[np.float64]]
    smoother_bytes: NotRequired[NDArray[np.int64]]

@final
class BeamGeometry:
    """Directions and lever arms of the beams of a DVL."""

    def __new__(
        cls,
        directions_d: ArrayLike,
        *,
        lever_arms_p_m: ArrayLike | None = None,
        mounting_rpy_rad: ArrayLike | None = None,
        sound_speed_scale: float = 1.0,
    ) -> BeamGeometry: ...
    @staticmethod
    def janus(
        tilt_rad: float,
        *,
        configuration: JanusConfiguration = "x",
        lever_arms_p_m: ArrayLike | None = None,
        mounting_rpy_rad: ArrayLike | None = None,
        sound_speed_scale: float = 1.0,
    ) -> BeamGeometry: ...
    @staticmethod
    def from_angles(
        tilt_rad: ArrayLike,
        azimuth_rad: ArrayLike,
        *,
        lever_arms_p_m: ArrayLike | None = None,
        mounting_rpy_rad: ArrayLike | None = None,
        sound_speed_scale: float = 1.0,
    ) -> BeamGeometry: ...
    @property
    def directions_p(self) -> NDArray[np.float64]: ...
    @property
    def lever_arms_p_m(self) -> NDArray[np.float64]: ...
    @property
    def beams(self) -> int: ...
    @property
    def rank(self) -> int: ...
    @property
    def sound_speed_scale(self) -> float: ...
    def beam_velocities(
        self,
        velocity_p_mps: ArrayLike,
        *,
        omega_tp_p_radps: ArrayLike | None = None,
        beam_bias_mps: ArrayLike | None = None,
        scale_factor: float = 0.0,
    ) -> NDArray[np.float64]: ...
    def save(self) -> bytes: ...
    @classmethod
    def load(cls, data: bytes) -> BeamGeometry: ...
    def __copy__(self) -> BeamGeometry: ...
    def __deepcopy__(self, _memo: dict[int, Any]) -> BeamGeometry: ...

@final
class Report:
    """What became of a measurement, or of an inertial reading that was rejected."""

    @property
    def sensor(self) -> str: ...
    @property
    def time_ns(self) -> int: ...
    @property
    def residual(self) -> NDArray[np.float64]: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @property
    def degrees(self) -> int: ...
    @property
    def nis(self) -> float: ...
    @property
    def threshold(self) -> float: ...
    @property
    def verdict(
        self,
    ) -> Literal["accepted", "accepted_in_part", "rejected", "no_information", "withheld"]: ...
    @property
    def revised(self) -> bool: ...
    @property
    def reason(self) -> str | None: ...
    @property
    def inflation(self) -> float | None: ...
    @property
    def charged_to_sensor(self) -> float: ...
    @property
    def beyond_linear_range(self) -> bool: ...
    @property
    def rejected_rows(self) -> NDArray[np.bool_]: ...
    @property
    def beam_weight(self) -> NDArray[np.float64] | None: ...
    @property
    def choice(self) -> dict[str, Any] | None: ...

@final
class Navigator:
    """An aided inertial navigator, fed a sample at a time."""

    def __new__(
        cls,
        geometry: AnyGeometry,
        model: Model,
        options: Options,
        initial: InitialState | StateDict,
        *,
        method: AnyMethod | None = None,
        covariance: ArrayLike | None = None,
        horizon_ns: int | None = None,
    ) -> Navigator: ...
    @staticmethod
    def start(
        *,
        dvl: str | Path | Mapping[str, Any] | Instrument,
        imu: str | Mapping[str, Any] | ImuModel,
        latitude_deg: float,
        heading_deg: float | None = None,
        heading_sd_deg: float | None = None,
        method: AnyMethod | None = None,
        **sections: Mapping[str, Any] | None,
    ) -> StartedNavigator: ...
    def push_imu(
        self, time_ns: int, *, omega_p_radps: ArrayLike, force_p_mps2: ArrayLike
    ) -> list[Report]: ...
    def push_imu_block(
        self, time_ns: ArrayLike, *, omega_p_radps: ArrayLike, force_p_mps2: ArrayLike
    ) -> list[Report]: ...
    def push_beams(
        self, time_ns: int, velocity_mps: ArrayLike, valid: ArrayLike, *, sd_mps: ArrayLike
    ) -> list[Report]: ...
    def push_water_track(
        self,
        time_ns: int,
        velocity_mps: ArrayLike,
        valid: ArrayLike,
        *,
        sd_mps: ArrayLike,
        range_m: float = 0.0,
    ) -> list[Report]: ...
    def push_velocity(
        self, time_ns: int, velocity_p_mps: ArrayLike, *, cov_m2ps2: ArrayLike
    ) -> list[Report]: ...
    def push_thrust(self, time_ns: int, speed_p_mps: ArrayLike, *, sd_mps: float) -> list[Report]: ...
    def push_depth(self, time_ns: int, depth_m: float, *, sd_m: float) -> list[Report]: ...
    def push_attitude(
        self, time_ns: int, attitude_t_p: ArrayLike, *, roll_pitch_sd_rad: float, yaw_sd_rad: float
    ) -> list[Report]: ...
    def push_heading(self, time_ns: int, yaw_rad: float, *, sd_rad: float) -> list[Report]: ...
    def push_gps(
        self,
        time_ns: int,
        position_t_m: ArrayLike,
        velocity_t_mps: ArrayLike,
        *,
        position_sd_m: ArrayLike,
        velocity_sd_mps: ArrayLike,
    ) -> list[Report]: ...
    def push_position(
        self, time_ns: int, position_t_m: ArrayLike, *, position_sd_m: ArrayLike
    ) -> list[Report]: ...
    def push_acoustic_position(
        self, *, time_ns: int, position_t_m: ArrayLike, sd_m: ArrayLike | None = None
    ) -> list[Report]: ...
    def late_events(self) -> dict[str, int]: ...
    def imu_faults(self) -> ImuFaultsDict: ...
    def discard_waiting(self) -> int: ...
    def state(self) -> StateDict: ...
    def covariance(self) -> NDArray[np.float64]: ...
    def water(self) -> WaterStateDict | None: ...
    def thrust(self) -> ThrustStateDict | None: ...
    def attitude_error(self) -> SlowErrorDict | None: ...
    def heading_error(self) -> SlowErrorDict | None: ...
    def calibration(self) -> CalibrationStateDict | None: ...
    def save(self) -> bytes: ...
    @classmethod
    def load(cls, data: bytes) -> Navigator: ...
    def __copy__(self) -> Navigator: ...
    def __deepcopy__(self, _memo: dict[int, Any]) -> Navigator: ...

@final
class ClosedLoop:
    """Vehicles side by side whose truth depends on their own estimates."""

    def __new__(
        cls,
        geometry: AnyGeometry,
        simulated: Model,
        assumed: Model,
        options: Options,
        methods: Sequence[AnyMethod],
        start: StartDict,
        *,
        vehicle_per_method: bool,
        seed: int,
        trajectory_key: int,
        first_run: int,
        threads: int,
    ) -> ClosedLoop: ...
    def advance(self, truth: TruthDict, schedule: ScheduleDict) -> None: ...
    def estimate(self, method: int = 0) -> EstimateDict: ...
    def results(self) -> BatchDict: ...

def solve_velocity(
    geometry: AnyGeometry,
    velocity_mps: ArrayLike,
    valid: ArrayLike,
    *,
    method: FixMethod,
    beam_sd_mps: ArrayLike,
    prior_velocity_p_mps: ArrayLike | None = None,
    prior_cov_m2ps2: ArrayLike | None = None,
    omega_tp_p_radps: ArrayLike | None = None,
    virtual_beam_factor: float,
    nullified_sway_var_m2ps2: float,
    weak_sway_var_m2ps2: float,
) -> SolutionDict: ...
def simulate_sensors(
    geometry: AnyGeometry,
    truth: TruthDict,
    model: Model,
    schedule: ScheduleDict,
    *,
    seed: int,
    trajectory_key: int,
    run: int,
    imu_sampling: Literal["instantaneous", "averaged"] = "instantaneous",
    options: Options | None = None,
) -> dict[str, Any]: ...
def replay_log(
    geometry: AnyGeometry,
    model: Model,
    options: Options,
    methods: Sequence[AnyMethod],
    log: LogDict,
    start: InitialState | StateDict,
    *,
    sample_time_ns: ArrayLike,
    covariance: ArrayLike | None = None,
    smooth: bool = False,
    covariances: bool = False,
    innovations: bool = False,
    threads: int = 1,
) -> ReplayDict: ...
def run_batch(
    geometry: AnyGeometry,
    truth: TruthDict,
    simulated: Model,
    assumed: Model,
    options: Options,
    schedule: ScheduleDict,
    methods: Sequence[AnyMethod],
    *,
    seed: int,
    trajectory_key: int,
    first_run: int,
    runs: int,
    threads: int,
    stop: Event | None = None,
) -> BatchDict: ...
def check_settings(place: str, values: dict[str, Any]) -> None: ...
def error_model(
    model: Model,
    *,
    attitude_t_p: ArrayLike,
    velocity_p_mps: ArrayLike,
    omega_p_radps: ArrayLike,
    force_p_mps2: ArrayLike,
) -> dict[str, NDArray[np.float64]]: ...
def register_method(
    name: str, label: str, call: Callable[[dict[str, Any]], tuple[ArrayLike, ...] | None]
) -> None: ...
def integrate_segments(
    time_ns: ArrayLike, force_p_mps2: ArrayLike, omega_p_radps: ArrayLike, readings: int
) -> SegmentsDict: ...
def local_earth(environment: Environment, position_t_m: ArrayLike) -> LocalEarthDict: ...
def normal_gravity_mps2(latitude_rad: float, depth_m: float = 0.0) -> float: ...
def observe(
    geometry: AnyGeometry,
    truth: TruthDict | dict[str, Any],
    model: Model,
    aidings: list[AidingDict] | list[dict[str, Any]],
    *,
    kind: Literal["full", "inertial", "paper", "paper_printed"] = "full",
    period_ns: int = ...,
    schedule: AidingScheduleDict | dict[str, Any] | None = None,
    scale: ArrayLike | None = None,
    per_epoch: bool = False,
) -> list[ObservabilityDict]: ...
def rejected_imu(
    imu: ImuModel,
    options: Options,
    time_ns: ArrayLike,
    omega_p_radps: ArrayLike,
    force_p_mps2: ArrayLike,
) -> RejectedImuDict: ...
def covariance_history(
    geometry: AnyGeometry,
    truth: TruthDict | dict[str, Any],
    model: Model,
    aiding: AidingDict | dict[str, Any],
    *,
    kind: Literal["full", "inertial", "paper", "paper_printed"] = "full",
    period_ns: int = ...,
    schedule: AidingScheduleDict | dict[str, Any] | None = None,
) -> CovarianceDict: ...
