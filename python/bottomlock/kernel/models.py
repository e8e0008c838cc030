"""What the kernel assumes: errors of the sensors, options of the filters, and the state at the start.

Each is frozen and keyword-only, in SI. A value is checked when an object is made, by the kernel's own rules; an unknown
key is an error that names the nearest. Defaults are the kernel's. Vectors are kept as tuples.

Examples:
    >>> ImuModel(
    ...     accel_noise_mps_rts=1e-3, gyro_noise_rad_rts=1e-4, accel_bias_sd_mps2=5e-3, gyro_bias_sd_radps=1e-5,
    ...     accel_bias_walk_mps2_rts=1e-5, gyro_bias_walk_radps_rts=5e-7,
    ... ).replace(gyro_bias_sd_radps=2e-5).gyro_bias_sd_radps
    2e-05
    >>> Options(gate="off", depth_lever_p_m=[0.5, 0.0, 0.0])
    Options(gate='off', depth_lever_p_m=(0.5, 0.0, 0.0))
    >>> Options(gaate="off")  # doctest: +IGNORE_EXCEPTION_DETAIL
    Traceback (most recent call last):
    KernelError: options has no key 'gaate' (did you mean 'gate'?)
"""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Any, ClassVar, Literal, Self, TypeVar, dataclass_transform, get_args

import numpy as np
from numpy.typing import NDArray

from bottomlock.kernel import (
    DEFAULT_OPTIONS,
    EARTH_RATE_RADPS,
    KernelError,
    check_settings,
    normal_gravity_mps2,
)
from bottomlock.support.nearest import nearest

WALK_TIME_S = 300.0
"""Correlation time of the slow error of an attitude reference where none is given, s: minutes, as of manoeuvres."""
Vector = Sequence[float] | NDArray[np.float64]
"""Numbers of a fixed length; kept as a tuple."""


class Settings:
    """Base of all settings: checked keys and values, `replace`, `as_dict` and a short `repr`."""

    place: ClassVar[str]
    """The name of the settings in messages, and of the kernel's rules for them."""

    def __new__(cls, **given: Any) -> Self:  # noqa: ANN401 - the fields of the settings have their types
        """Rejects unknown and missing keys.

        Raises:
            KernelError: naming the key, and the nearest known one.
        """
        known = [field.name for field in fields(cls)]  # type: ignore[arg-type] # every subclass is a dataclass
        for key in given:
            if key not in known:
                close = nearest(key, known)
                hint = f"did you mean '{close}'?" if close else f"known: {', '.join(known)}"
                raise KernelError(f"{cls.place} has no key '{key}' ({hint})")
        required = [field.name for field in fields(cls) if field.default is MISSING]  # type: ignore[arg-type]
        missing = [key for key in required if key not in given]
        # A copy and an unpickled object are made without keys, and filled afterwards.
        if given and missing:
            raise KernelError(f"{cls.place} lacks the key '{missing[0]}'")
        return super().__new__(cls)

    def __post_init__(self) -> None:
        """Brings every value to the type of its field, and checks it by the kernel's rules.

        Raises:
            KernelError: naming the key, the value and what was expected.
        """
        for field in fields(self):  # type: ignore[arg-type]
            object.__setattr__(self, field.name, _as_typed(field.type, getattr(self, field.name)))
        check_settings(self.place, self.as_dict())

    def replace(self, **changes: Any) -> Self:  # noqa: ANN401 - the fields of the settings have their types
        """The same settings with other values.

        Raises:
            KernelError: for an unknown key or a value that is not valid.
        """
        own = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return type(self)(**own | changes)

    def as_dict(self) -> dict[str, Any]:
        """Keys and values, settings among them as dicts too: what JSON can hold, and what makes the same object."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {key: value.as_dict() if isinstance(value, Settings) else value for key, value in own.items()}

    def __repr__(self) -> str:
        """The values that are not the defaults; a line each where settings are among them."""
        own = [(field, getattr(self, field.name)) for field in fields(self)]  # type: ignore[arg-type]
        shown = [(field.name, value) for field, value in own if value != field.default]
        parts = [f"{name}={value!r}" for name, value in shown]
        if any(isinstance(value, Settings) for _, value in shown):
            lines = ",\n".join(parts).replace("\n", "\n    ")
            return f"{type(self).__name__}(\n    {lines},\n)"
        return f"{type(self).__name__}({', '.join(parts)})"


def _as_typed(kind: Any, value: Any) -> Any:  # noqa: ANN401 - values come as users give them
    """A value in the type of its field; what does not fit stays as it is, for the kernel to reject."""
    kinds = (kind, *get_args(kind))
    section = next((one for one in kinds if isinstance(one, type) and issubclass(one, Settings)), None)
    if section is not None and isinstance(value, Mapping):
        return section(**value)
    if isinstance(value, np.ndarray | list):
        return tuple(np.asarray(value).tolist())
    if isinstance(value, np.generic):
        return value.item()
    if float in kinds and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value


_T = TypeVar("_T")
_Errors = TypeVar("_Errors", bound=Settings)


@dataclass_transform(frozen_default=True, kw_only_default=True)
def _settings(cls: type[_T]) -> type[_T]:
    return dataclass(frozen=True, kw_only=True, repr=False)(cls)


@_settings
class Environment(Settings):
    """Latitude (rad), gravity (m/s²) at the origin and Earth rate (rad/s), 0 for an Earth at rest.

    Gravity that is left out, or None, is normal gravity at that latitude (`normal_gravity_mps2`).
    With `earth` = "ellipsoid" gravity, depth, level and heading are those of the place (docs/ellipsoid.md); with
    "tangent_plane" they are those of the origin everywhere, as in the 2017 paper.
    """

    place: ClassVar[str] = "environment"
    latitude_rad: float
    gravity_mps2: float = None  # type: ignore[assignment] # a number in every object
    earth_rate_radps: float = EARTH_RATE_RADPS
    earth: Literal["ellipsoid", "tangent_plane"] = "ellipsoid"

    def __post_init__(self) -> None:
        """Fills in the gravity, and checks as every section does."""
        if vars(self)["gravity_mps2"] is None:
            # The latitude is checked first: an error about gravity would name the wrong key.
            check_settings(self.place, self.as_dict() | {"gravity_mps2": 0.0})
            object.__setattr__(self, "gravity_mps2", normal_gravity_mps2(self.latitude_rad))
        super().__post_init__()


@_settings
class ImuModel(Settings):
    """Errors of the inertial sensors, 1 sigma per axis: noise, biases at the start, and their random walks."""

    place: ClassVar[str] = "imu"
    accel_noise_mps_rts: float
    gyro_noise_rad_rts: float
    accel_bias_sd_mps2: float
    gyro_bias_sd_radps: float
    accel_bias_walk_mps2_rts: float
    gyro_bias_walk_radps_rts: float


@_settings
class DvlModel(Settings):
    """Errors of the DVL, 1 sigma: noise of a beam, bias and scale factor at the start, and their random walks."""

    place: ClassVar[str] = "dvl"
    beam_noise_sd_mps: float
    beam_bias_sd_mps: float
    beam_bias_walk_mps_rts: float
    scale_factor_sd: float
    scale_factor_walk_rts: float


@_settings
class DvlOutlierModel(Settings):
    """Outliers among simulated beams: their fraction, and their noise over that of a good reading."""

    place: ClassVar[str] = "dvl_outliers"
    outlier_fraction: float
    outlier_factor: float


@_settings
class InitialModel(Settings):
    """Uncertainty of the state at the start, 1 sigma, (3,) each.

    Position and misalignment in the tangent frame, velocity in the platform frame.
    """

    place: ClassVar[str] = "initial"
    position_sd_m: Vector
    attitude_sd_rad: Vector
    velocity_sd_mps: Vector


@_settings
class DepthModel(Settings):
    """Errors of the depth sensor, 1 sigma: noise, and a bias (0 for none) with its correlation time."""

    place: ClassVar[str] = "depth"
    sd_m: float
    bias_sd_m: float
    bias_time_s: float


@_settings
class MagnetometerModel(Settings):
    """Errors of an attitude reference (AHRS, magnetometer and tilt sensor), 1 sigma.

    White noise of a reading; and the slow errors that the filter then estimates, 0 for none: a constant offset, and a
    first-order walk with its correlation time.
    """

    place: ClassVar[str] = "magnetometer"
    yaw_sd_rad: float
    roll_pitch_sd_rad: float
    yaw_offset_sd_rad: float = 0.0
    roll_pitch_offset_sd_rad: float = 0.0
    yaw_walk_sd_rad: float = 0.0
    roll_pitch_walk_sd_rad: float = 0.0
    walk_time_s: float = WALK_TIME_S


@_settings
class HeadingModel(Settings):
    """Error of a heading sensor, 1 sigma: white noise, and the slow errors as of `MagnetometerModel`."""

    place: ClassVar[str] = "heading"
    sd_rad: float
    offset_sd_rad: float = 0.0
    walk_sd_rad: float = 0.0
    walk_time_s: float = WALK_TIME_S


@_settings
class GpsModel(Settings):
    """Errors of the GPS receiver, 1 sigma per axis of the tangent frame, (3,) each."""

    place: ClassVar[str] = "gps"
    position_sd_m: Vector
    velocity_sd_mps: Vector


@_settings
class AcousticPositionModel(Settings):
    """Errors of acoustic position fixes (USBL, LBL), 1 sigma per axis, and outliers among simulated ones.

    The noise is that at zero range and that per slant range from the transceiver at `transceiver_t_m` (3,); 0, the
    default, for the same at every range.
    """

    place: ClassVar[str] = "acoustic_position"
    sd_m: float
    sd_per_range: float = 0.0
    transceiver_t_m: Vector = (0.0, 0.0, 0.0)
    outlier_fraction: float = 0.0
    outlier_factor: float = 1.0


@_settings
class WaterTrackModel(Settings):
    """Errors of simulated beams that the water returned; bias and scale factor are those of `DvlModel`.

    White noise of a beam, 1 sigma; distance along the beam to the middle of the cell, m; fractions of the readings that
    are outliers (with their noise over that of a good reading) and lost; and `wake`, 0 to 1, the part of the vehicle's
    velocity relative to the water with which the water in the cell follows it.
    """

    place: ClassVar[str] = "water_track"
    beam_noise_sd_mps: float
    range_m: float = 0.0
    outlier_fraction: float = 0.0
    outlier_factor: float = 1.0
    lost_fraction: float = 0.0
    wake: float = 0.0


@_settings
class ThrustModel(Settings):
    """Speed through the water by the propeller's revolutions, 1 sigma.

    Advance per revolution with its uncertainty, m, and the mean of simulated vehicles, 0 for the same; slip with its
    correlation time; and white noise of a reading, as a speed.
    """

    place: ClassVar[str] = "thrust"
    advance_m: float
    advance_sd_m: float
    true_advance_m: float = 0.0
    slip_sd_mps: float = 0.02
    slip_time_s: float = 5.0
    noise_sd_mps: float = 0.01


@_settings
class EffortModel(Settings):
    """Speed through the water by the forces of thrusters, 1 sigma; surge, sway and heave each.

    An axis without drag is not used. Mass and added mass, kg; linear and quadratic drag, N s/m and N s²/m²; buoyancy
    less weight, N; relative uncertainty of the speed at a force (half of that of a quadratic drag) and of mass and
    added mass, with correlation times; slip with its correlation time; and white noise of a force, N.
    """

    place: ClassVar[str] = "effort"
    mass_kg: Vector
    linear_drag_kgps: Vector
    quadratic_drag_kgpm: Vector
    buoyancy_n: float = 0.0
    speed_scale_sd: float = 0.1
    speed_scale_time_s: float = 86_400.0
    inertia_sd: float = 0.2
    inertia_time_s: float = 86_400.0
    slip_sd_mps: float = 0.02
    slip_time_s: float = 5.0
    noise_sd_n: float = 1.0


@_settings
class Model(Settings):
    """Environment, and errors of the sensors: what `Scenario.kernel_model` returns.

    A sensor that aids is None, which is the default, where there is none.
    """

    place: ClassVar[str] = "model"
    environment: Environment
    imu: ImuModel
    initial: InitialModel
    dvl: DvlModel | None = None
    depth: DepthModel | None = None
    magnetometer: MagnetometerModel | None = None
    gps: GpsModel | None = None
    dvl_outliers: DvlOutlierModel | None = None
    heading: HeadingModel | None = None
    acoustic_position: AcousticPositionModel | None = None
    water_track: WaterTrackModel | None = None
    thrust: ThrustModel | None = None
    effort: EffortModel | None = None

    def of(self, kind: type[_Errors]) -> _Errors:
        """The errors of a sensor that has to be there.

        Raises:
            KernelError: naming the sensor where there is none.
        """
        found = getattr(self, kind.place)
        if not isinstance(found, kind):
            raise KernelError("is None", key=f"model.{kind.place}", expected=f"a {kind.__name__}")
        return found


@_settings
class Water(Settings):
    """Prior of the motion through the water for the method `sway_current` (docs/methods/sway_current.md), 1 sigma."""

    place: ClassVar[str] = "options.water"
    current_sd_mps: float = DEFAULT_OPTIONS["water"]["current_sd_mps"]
    current_time_s: float = DEFAULT_OPTIONS["water"]["current_time_s"]
    sway_gain_m: float = DEFAULT_OPTIONS["water"]["sway_gain_m"]
    sway_gain_sd_m: float = DEFAULT_OPTIONS["water"]["sway_gain_sd_m"]
    trim_sd_mps: float = DEFAULT_OPTIONS["water"]["trim_sd_mps"]
    trim_time_s: float = DEFAULT_OPTIONS["water"]["trim_time_s"]
    slip_sd_mps: float = DEFAULT_OPTIONS["water"]["slip_sd_mps"]
    slip_time_s: float = DEFAULT_OPTIONS["water"]["slip_time_s"]
    slip_epochs: float = DEFAULT_OPTIONS["water"]["slip_epochs"]


@_settings
class CurrentLayers(Settings):
    """Prior of the current by depth, with `Options.water_track` or `thrust` (docs/methods/without_bottom.md).

    `sd_mps` is 1 sigma of a layer's own part, 0 for no layers, which is forgotten in `time_s` and on `way_m` over
    ground; layers are `spacing_m` apart; `mean_time_s` is the correlation time of what all depths have in common.
    """

    place: ClassVar[str] = "options.current_layers"
    sd_mps: float = DEFAULT_OPTIONS["current_layers"]["sd_mps"]
    time_s: float = DEFAULT_OPTIONS["current_layers"]["time_s"]
    way_m: float = DEFAULT_OPTIONS["current_layers"]["way_m"]
    spacing_m: float = DEFAULT_OPTIONS["current_layers"]["spacing_m"]
    mean_time_s: float = DEFAULT_OPTIONS["current_layers"]["mean_time_s"]


@_settings
class Calibration(Settings):
    """Prior of the DVL's mounting and clock as states of the filter, 1 sigma; zero is certain, all zero is off.

    `mounting_sd_rad` (3,) is about the platform's forward, right and down axes (docs/calibration.md).
    """

    place: ClassVar[str] = "options.calibration"
    mounting_sd_rad: Vector = tuple(DEFAULT_OPTIONS["calibration"]["mounting_sd_rad"])
    clock_sd_s: float = DEFAULT_OPTIONS["calibration"]["clock_sd_s"]


@_settings
class Motion(Settings):
    """Prior of the velocity of a vehicle without usable accelerometers, 1 sigma; all zero is off (docs/no_imu.md).

    Along forward, right and down of the platform, (3,) each: a mean, which hardly changes, and a first-order change
    about it. An axis of which both are zero is free.
    """

    place: ClassVar[str] = "options.motion"
    mean_sd_mps: Vector = tuple(DEFAULT_OPTIONS["motion"]["mean_sd_mps"])
    mean_time_s: float = DEFAULT_OPTIONS["motion"]["mean_time_s"]
    change_sd_mps: Vector = tuple(DEFAULT_OPTIONS["motion"]["change_sd_mps"])
    change_time_s: Vector = tuple(DEFAULT_OPTIONS["motion"]["change_time_s"])


@_settings
class Robust(Settings):
    """Treatment of outliers among the beams (docs/robust.md).

    A gate is the probability with which a good ping (closure) or a good beam passes, None for no gate; `tail` is the
    distribution of the noise of the beams that pass.
    """

    place: ClassVar[str] = "options.robust"
    closure_gate: float | None = DEFAULT_OPTIONS["robust"]["closure_gate"]
    beam_gate: float | None = DEFAULT_OPTIONS["robust"]["beam_gate"]
    tail: Literal["gaussian", "student_t"] = DEFAULT_OPTIONS["robust"]["tail"]
    student_t_degrees: float = DEFAULT_OPTIONS["robust"]["student_t_degrees"]


@_settings
class Options(Settings):
    """Options of the filters (`Scenario.kernel_options` makes them); docs/event_loop.md explains each.

    `robust` None is no treatment of outliers; `thrust` is what the propeller's revolutions correct; a lever arm (3,) is
    the place of a sensor in the platform frame, m.
    """

    place: ClassVar[str] = "options"
    gate: Literal["joint", "per_row", "off"] = DEFAULT_OPTIONS["gate"]
    gate_probability: float = DEFAULT_OPTIONS["gate_probability"]
    inflate_after_rejections: int = DEFAULT_OPTIONS["inflate_after_rejections"]
    covariance_period_ns: int = DEFAULT_OPTIONS["covariance_period_ns"]
    imu_sampling: Literal["instantaneous", "averaged"] = DEFAULT_OPTIONS["imu_sampling"]
    estimate_dvl: bool = DEFAULT_OPTIONS["estimate_dvl"]
    virtual_beam_factor: float = DEFAULT_OPTIONS["virtual_beam_factor"]
    nullified_sway_var_m2ps2: float = DEFAULT_OPTIONS["nullified_sway_var_m2ps2"]
    weak_sway_var_m2ps2: float = DEFAULT_OPTIONS["weak_sway_var_m2ps2"]
    information_port: Literal["axes", "full"] = DEFAULT_OPTIONS["information_port"]
    water_track: bool = DEFAULT_OPTIONS["water_track"]
    thrust: Literal["off", "velocity", "all"] = DEFAULT_OPTIONS["thrust"]
    speed_sd_mps: float = DEFAULT_OPTIONS["speed_sd_mps"]
    speed_time_s: float = DEFAULT_OPTIONS["speed_time_s"]
    max_imu_rate_radps: float = DEFAULT_OPTIONS["max_imu_rate_radps"]
    max_imu_force_mps2: float = DEFAULT_OPTIONS["max_imu_force_mps2"]
    imu_stuck_after: int = DEFAULT_OPTIONS["imu_stuck_after"]
    max_imu_gap_s: float = DEFAULT_OPTIONS["max_imu_gap_s"]
    imu_gap: Literal["refuse", "inflate"] = DEFAULT_OPTIONS["imu_gap"]
    imu_gap_rate_sd_radps: float = DEFAULT_OPTIONS["imu_gap_rate_sd_radps"]
    imu_gap_accel_sd_mps2: float = DEFAULT_OPTIONS["imu_gap_accel_sd_mps2"]
    depth_lever_p_m: Vector = tuple(DEFAULT_OPTIONS["depth_lever_p_m"])
    gps_lever_p_m: Vector = tuple(DEFAULT_OPTIONS["gps_lever_p_m"])
    acoustic_position_lever_p_m: Vector = tuple(DEFAULT_OPTIONS["acoustic_position_lever_p_m"])
    effort_lever_p_m: Vector = tuple(DEFAULT_OPTIONS["effort_lever_p_m"])
    water: Water = Water()
    current_layers: CurrentLayers = CurrentLayers()
    calibration: Calibration = Calibration()
    motion: Motion = Motion()
    robust: Robust | None = Robust()


@_settings
class InitialState(Settings):
    """State at the start of a navigator or a replay: what `Navigator.state` returns makes one, too.

    Position (3,), tangent frame, by default its origin; attitude (4,), scalar first, platform to tangent; velocity
    (3,), platform frame; biases of accelerometers and gyros (3,), of four beams (4,), and the DVL's scale factor.
    """

    place: ClassVar[str] = "initial_state"
    time_ns: int
    position_t_m: Vector = (0.0, 0.0, 0.0)
    attitude_t_p: Vector
    velocity_p_mps: Vector
    accel_bias_p_mps2: Vector = (0.0, 0.0, 0.0)
    gyro_bias_p_radps: Vector = (0.0, 0.0, 0.0)
    dvl_bias_mps: Vector = (0.0, 0.0, 0.0, 0.0)
    dvl_scale_factor: float = 0.0
