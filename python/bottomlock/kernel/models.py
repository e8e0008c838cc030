"""What the kernel assumes: errors of the sensors, options of the filters, and the state at the start.

Each is frozen and keyword-only, in SI. A value is checked when an object is made, by the kernel's own rules; an unknown
key is an error that names the nearest. Defaults are the kernel's. Vectors are kept as tuples.

Examples:
    >>> ImuModel(
    ...     accel_noise_mps_rts=1e-3, gyro_noise_rad_rts=1e-4, accel_bias_sd_mps2=5e-3, gyro_bias_sd_radps=1e-5,
    ...     accel_bias_walk_mps2_rts=1e-5, gyro_bias_walk_radps_rts=5e-7,
    ... ).replace(gyro_bias_sd_radps=2e-5).gyro_bias_sd_radps
    2e-05
    >>> Options(gate="off", levers=Levers(depth_p_m=[0.5, 0.0, 0.0]))
    Options(
        gate='off',
        levers=Levers(depth_p_m=(0.5, 0.0, 0.0)),
    )
    >>> Options(gaate="off")  # doctest: +IGNORE_EXCEPTION_DETAIL
    Traceback (most recent call last):
    KernelError: options.gaate is unknown; did you mean 'gate'?
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, Strict

from bottomlock.kernel import EARTH_RATE_RADPS, KernelError, check_settings, normal_gravity_mps2

WALK_TIME_S = 300.0
"""Correlation time of the slow error of an attitude reference where none is given, s: minutes, as of manoeuvres."""
WAVE_PERIOD_S = 8.0
"""Mean period of waves where none is given, s: a wind sea of some metres."""


def _tuple(value: Any) -> tuple[float, ...]:  # noqa: ANN401 - the kernel has checked it
    return tuple(np.asarray(value).tolist())


Vector = Annotated[Sequence[float] | NDArray[np.float64], PlainValidator(_tuple)]
"""Numbers of a fixed length; kept as a tuple."""
Real = Annotated[float, Strict()]
"""A number: true is none, nor is a text."""
Whole = Annotated[int, Strict()]
"""The same of whole ones."""
Positive = Annotated[Real, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[Real, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[Real, Field(allow_inf_nan=False)]
_ONE = Field(json_schema_extra={"unit": "1"})
Triple = tuple[NonNegative, NonNegative, NonNegative]


class Settings(BaseModel):
    """Base of all settings: checked by the kernel's rules, with `replace`, `as_dict` and a short `repr`."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)
    place: ClassVar[str]
    """The name of the settings in messages, and of the kernel's rules for them."""
    beside: ClassVar[frozenset[str]] = frozenset()
    """Keys that the kernel does not know."""

    def __init_subclass__(cls, place: str = "", **others: Any) -> None:  # noqa: ANN401 - of pydantic
        """Settings state their name; those derived from others have theirs."""
        super().__init_subclass__(**others)
        cls.place = place or cls.place

    def __init__(self, **given: Any) -> None:  # noqa: ANN401 - the fields of the settings have their types
        """Checks keys and values.

        Raises:
            KernelError: naming the key, what was expected, and of an unknown key the nearest known one.
        """
        given = self.completed({key: _plain(value) for key, value in given.items()})
        fields = type(self).model_fields.items()
        defaults = {key: field.default for key, field in fields if not field.is_required()}
        checked = (defaults | given).items()
        check_settings(self.place, {key: value for key, value in checked if key not in self.beside})
        super().__init__(**given)

    # Within a section of a file pydantic checks the keys, as it does those beside them.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """The given values with those that follow from them."""
        return given

    def replace(self, **changes: Any) -> Self:  # noqa: ANN401 - the fields of the settings have their types
        """The same settings with other values.

        Raises:
            KernelError: for an unknown key or a value that is not valid.
        """
        return type(self)(**dict(self) | changes)

    def as_dict(self) -> dict[str, Any]:
        """Keys and values, settings among them as dicts too: what JSON can hold, and what makes the same object."""
        return self.model_dump()

    def __repr__(self) -> str:
        """The values that are not the defaults; a line each where settings are among them."""
        fields = type(self).model_fields
        shown = {key: value for key, value in self if value != fields[key].default}
        parts = [f"{key}={value!r}" for key, value in shown.items()]
        if any(isinstance(value, Settings) for value in shown.values()):
            lines = ",\n".join(parts).replace("\n", "\n    ")
            return f"{type(self).__name__}(\n    {lines},\n)"
        return f"{type(self).__name__}({', '.join(parts)})"

    __str__ = __repr__


def _plain(value: Any) -> Any:  # noqa: ANN401 - values come as users give them
    """A value without arrays and numpy's numbers."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


_Errors = TypeVar("_Errors", bound=Settings)


class Environment(Settings, place="environment"):
    """Latitude, gravity and Earth rate; what is left out of gravity is normal gravity (`normal_gravity_mps2`)."""

    latitude_rad: float
    """geodetic latitude"""
    gravity_mps2: float = None  # type: ignore[assignment] # a number in every object
    """gravity at the origin; None for normal gravity at the latitude"""
    earth_rate_radps: float = EARTH_RATE_RADPS
    """rate of rotation, 0 for an Earth at rest"""
    earth: Literal["ellipsoid", "tangent_plane"] = "ellipsoid"
    """whether gravity, level and heading are those of the place (docs/ellipsoid.md) or of the origin everywhere"""

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """Fills in the gravity."""
        if given.get("gravity_mps2") is not None:
            return given
        # The latitude is checked first: an error about gravity would name the wrong key.
        rest = {"earth_rate_radps": EARTH_RATE_RADPS, "earth": "ellipsoid"}
        check_settings(cls.place, rest | given | {"gravity_mps2": 0.0})
        return given | {"gravity_mps2": normal_gravity_mps2(given["latitude_rad"])}


class ImuModel(Settings, place="imu"):
    """Errors of the inertial sensors, 1 sigma per axis."""

    accel_noise_mps_rts: float
    """velocity random walk, each axis"""
    gyro_noise_rad_rts: float
    """angle random walk, each axis"""
    accel_bias_sd_mps2: float
    """accelerometer bias that is constant in a run, each axis"""
    gyro_bias_sd_radps: float
    """gyro bias that is constant in a run, each axis"""
    accel_bias_walk_mps2_rts: float
    """random walk of the accelerometer bias"""
    gyro_bias_walk_radps_rts: float
    """random walk of the gyro bias"""
    gyro_scale_sd: float = 0.0
    """scale factor of a gyro, constant; the filter considers it and does not estimate it"""
    gyro_misalignment_sd_rad: float = 0.0
    """what a gyro sees of turns about each of the other axes, constant; likewise"""
    gyro_g_sensitivity_sd_radps_per_mps2: float = 0.0
    """what a gyro sees of the specific force along each axis, constant; likewise"""
    accel_scale_sd: float = 0.0
    """scale factor of an accelerometer, constant; likewise"""
    accel_warm_up_sd_mps2: float = 0.0
    """how far the accelerometer biases move while the sensors warm up from the start on, each axis"""
    gyro_warm_up_sd_radps: float = 0.0
    """how far the gyro biases do, each axis"""
    warm_up_time_s: float = WALK_TIME_S
    """time constant of the warm-up"""


class DvlModel(Settings, place="dvl"):
    """Errors of the DVL, 1 sigma."""

    beam_noise_sd_mps: float
    """white noise of a beam"""
    beam_noise_sd_mps_per_m: float = 0.0
    """white noise beside it that grows with the range along the beam, of each m"""
    beam_bias_sd_mps: float
    """bias of a beam that is constant in a run or dive"""
    beam_bias_walk_mps_rts: float
    """random walk of a beam's bias"""
    scale_factor_sd: float
    """scale factor common to the beams, constant in a run or dive"""
    scale_factor_walk_rts: float
    """random walk of the scale factor"""


class DvlOutlierModel(Settings, place="dvl_outliers"):
    """Outliers among simulated beams."""

    outlier_fraction: float
    """fraction of the readings"""
    outlier_factor: float
    """their noise over that of a good reading"""


class InitialModel(Settings, place="initial"):
    """Uncertainty of the state at the start, 1 sigma, (3,) each."""

    position_sd_m: Vector
    """position, tangent frame"""
    attitude_sd_rad: Vector
    """misalignment about north, east, down"""
    velocity_sd_mps: Vector
    """velocity, platform frame"""


class DepthModel(Settings, place="depth"):
    """Errors of the depth sensor, 1 sigma."""

    sd_m: float
    """noise"""
    bias_sd_m: float
    """offset, tide, density and barometer together, 1 sigma, which the filter estimates; 0 says that there are none"""
    bias_time_s: float
    """correlation time of the bias"""
    wave_sd_m: float = 0.0
    """what waves add to the reading near the surface, 1 sigma; a state of the filter unless 0"""
    wave_period_s: float = WAVE_PERIOD_S
    """mean period of the waves"""


class MagnetometerModel(Settings, place="magnetometer"):
    """Errors of an attitude reference (AHRS, magnetometer and tilt sensor), 1 sigma.

    White noise of a reading; and the slow errors that the filter then estimates, 0 for none: a constant offset, a
    first-order walk with its correlation time, and the deviation that the vehicle's iron gives a magnetic compass.
    """

    yaw_sd_rad: float
    """white noise of the yaw"""
    roll_pitch_sd_rad: float
    """white noise of roll and pitch"""
    yaw_offset_sd_rad: float = 0.0
    """constant offset of the yaw; a state of the filter unless 0"""
    roll_pitch_offset_sd_rad: float = 0.0
    """constant offset of roll and of pitch; a state of the filter unless 0"""
    yaw_walk_sd_rad: float = 0.0
    """first-order walk of the yaw; a state of the filter unless 0"""
    roll_pitch_walk_sd_rad: float = 0.0
    """first-order walk of roll and of pitch; a state of the filter unless 0"""
    walk_time_s: float = WALK_TIME_S
    """correlation time of the walks"""
    yaw_semicircular_sd_rad: float = 0.0
    """deviation of a magnetic compass by cosine and by sine of the heading, each; states of the filter unless 0"""
    yaw_quadrantal_sd_rad: float = 0.0
    """deviation by cosine and by sine of twice the heading, each; states of the filter unless 0"""


class HeadingModel(Settings, place="heading"):
    """Error of a heading sensor, 1 sigma: white noise, and the slow errors as of `MagnetometerModel`."""

    sd_rad: float
    """white noise of the heading"""
    offset_sd_rad: float = 0.0
    """constant offset; a state of the filter unless 0"""
    walk_sd_rad: float = 0.0
    """first-order walk; a state of the filter unless 0"""
    walk_time_s: float = WALK_TIME_S
    """correlation time of the walk"""
    semicircular_sd_rad: float = 0.0
    """deviation of a magnetic compass by cosine and by sine of the heading, each; states of the filter unless 0"""
    quadrantal_sd_rad: float = 0.0
    """deviation by cosine and by sine of twice the heading, each; states of the filter unless 0"""


class GpsModel(Settings, place="gps"):
    """Errors of the GPS receiver, 1 sigma per axis of the tangent frame, (3,) each."""

    position_sd_m: Vector
    """white noise of north, east, down"""
    velocity_sd_mps: Vector
    """white noise of the velocity north, east, down"""


class AcousticPositionModel(Settings, place="acoustic_position"):
    """Errors of acoustic position fixes (USBL, LBL), 1 sigma per axis, and outliers among simulated ones.

    The transceiver's place (3,) is one of the tangent frame.
    """

    sd_m: float
    """part of the noise that does not depend on range, each axis"""
    sd_per_range: float = 0.0
    """part of the noise that grows with the slant range, each axis"""
    transceiver_t_m: Vector = (0.0, 0.0, 0.0)
    """position of the transceiver: north, east, down"""
    outlier_fraction: float = 0.0
    """fraction of outliers"""
    outlier_factor: float = 1.0
    """their noise over that of a good fix"""


class WaterTrackModel(Settings, place="water_track"):
    """Errors of simulated beams that the water returned; bias and scale factor are those of `DvlModel`."""

    beam_noise_sd_mps: float
    """white noise of a beam, 1 sigma"""
    range_m: float = 0.0
    """distance along the beam from the transducer to the middle of the cell"""
    outlier_fraction: float = 0.0
    """fraction of outliers"""
    outlier_factor: float = 1.0
    """their noise over that of a good reading"""
    lost_fraction: float = 0.0
    """fraction of lost readings"""
    wake: float = 0.0
    """part of the vehicle's velocity through the water with which the water in the cell follows it; the filter does not
    model it"""


class ThrustModel(Settings, place="thrust"):
    """Speed through the water that the vehicle's drives say, along surge, sway and heave, (3,), 1 sigma.

    An axis without slip is not used.
    """

    scale_sd: Vector
    """relative uncertainty of the speed"""
    true_scale_error: float = 0.0
    """how many times the speed simulated vehicles make of it on average, less 1; the filter does not model it"""
    slip_sd_mps: Vector
    """slip, 1 sigma: what waves, turns, a tether and changes of speed make of the speed at a reading"""
    slip_time_s: float = 5.0
    """correlation time of the slip"""
    noise_sd_mps: float = 0.01
    """white noise of a speed"""


class Model(Settings, place="model"):
    """Environment, and errors of the sensors: what `Scenario.kernel_model` returns.

    A sensor that aids is None, which is the default, where there is none.
    """

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

    def of(self, kind: type[_Errors]) -> _Errors:
        """The errors of a sensor that has to be there.

        Raises:
            KernelError: naming the sensor where there is none.
        """
        found = getattr(self, kind.place)
        if not isinstance(found, kind):
            raise KernelError("is None", key=f"model.{kind.place}", expected=f"a {kind.__name__}")
        return found


class Water(Settings, place="options.water"):
    """Prior of the motion through the water for the method `sway_current` (docs/methods/sway_current.md), 1 sigma."""

    current_sd_mps: NonNegative = 0.3
    """current along north and along east"""
    current_time_s: Positive = 1800.0
    """correlation time of the current"""
    sway_gain_m: Finite = 0.6
    """sway per rate of turn: distance of the pivot ahead of the origin"""
    sway_gain_sd_m: NonNegative = 0.3
    """its uncertainty"""
    trim_sd_mps: NonNegative = 0.03
    """heave through the water that balances weight and buoyancy"""
    trim_time_s: Positive = 3600.0
    """correlation time of the trim"""
    slip_sd_mps: Positive = 0.02
    """sway and heave through the water beside these"""
    slip_time_s: Positive = 5.0
    """correlation time of the slip"""


class CurrentLayers(Settings, place="options.current_layers"):
    """Prior of the current by depth, with `Options.water_track` or `thrust` (docs/methods/without_bottom.md)."""

    sd_mps: NonNegative = 0.04
    """a layer's own part, 1 sigma; 0 for no layers"""
    time_s: Positive = 1800.0
    """time in which it is forgotten"""
    way_m: Positive = 5000.0
    """distance over ground on which it is forgotten"""
    spacing_m: Positive = 10.0
    """distance between layers"""
    mean_time_s: Positive = 259_200.0
    """correlation time of what all depths have in common"""


class Calibration(Settings, place="options.calibration"):
    """Prior of the DVL's mounting and clock as states (docs/calibration.md), 1 sigma; 0 is certain, all 0 is off."""

    mounting_sd_rad: Vector = (0.0, 0.0, 0.0)
    """mounting about the platform's forward, right and down axes (3,)"""
    clock_sd_s: float = 0.0
    """time to add to the stamps"""


class Motion(Settings, place="options.motion"):
    """Prior of the velocity of a vehicle without usable accelerometers, 1 sigma; all zero is off (docs/no_imu.md).

    Along forward, right and down of the platform, (3,) each. An axis of which both are zero is free.
    """

    mean_sd_mps: Triple = (0.0, 0.0, 0.0)
    """mean, which hardly changes"""
    mean_time_s: Positive = 10_000.0
    """correlation time of the mean"""
    change_sd_mps: Triple = (0.0, 0.0, 0.0)
    """first-order change about the mean"""
    change_time_s: tuple[Positive, Positive, Positive] = (40.0, 40.0, 40.0)
    """correlation times of the change"""


class Robust(Settings, place="options.robust"):
    """Treatment of outliers among the beams (docs/robust.md)."""

    closure_gate: float | None = 0.9973
    """probability with which the closure of a good ping passes; None for no gate"""
    beam_gate: float | None = 0.9973
    """probability with which a good beam passes against the filter's own velocity; None for no gate"""
    tail: Literal["gaussian", "student_t"] = "student_t"
    """distribution of the noise of the beams that pass"""
    student_t_degrees: float = 4.0
    """degrees of freedom, for student_t"""


class AssumptionKeys(BaseModel):
    """What the partial-beam methods assume, as a settings file says it too."""

    model_config: ClassVar[ConfigDict] = ConfigDict(use_attribute_docstrings=True)
    virtual_beam_factor: Annotated[Positive, _ONE] = 1.0
    """n_f of Eq. 28: inflation of a virtual beam (vb)"""
    exact_virtual_beams: bool = False
    """keep the correlation of a virtual beam with the filter (vb): then identical to tc, and the factor is 1"""
    nullified_sway_var_m2ps2: Positive = 1e-3
    """ε of Eq. 36: variance of the sway that is taken for zero (nsv)"""
    weak_sway_var_m2ps2: Positive = 2.0
    """variance of sway times its correlation time, once a second (weak_sway)"""


class Assumptions(AssumptionKeys, Settings, place="options.assumptions"):
    """Parameters of the partial-beam methods."""


class ImuLimits(Settings, place="options.imu_limits"):
    """What inertial readings from outside are checked against (docs/imu_faults.md)."""

    max_rate_radps: float = 10.0
    """full scale of the gyros: a reading at or beyond it is rejected"""
    max_force_mps2: float = 100.0
    """full scale of the accelerometers: a reading at or beyond it is rejected"""
    stuck_after: int = 0
    """equal readings in a row after which a sensor counts as stuck; 0 never"""
    max_gap_s: float = 1.0
    """longest interval without good readings that is bridged as it is"""
    gap: Literal["refuse", "inflate"] = "refuse"
    """what a longer one does: refuse ends with an error, inflate bridges it with its uncertainty"""
    gap_rate_sd_radps: float = 0.1
    """angular rate that may happen unseen in a gap, 1 sigma of each axis"""
    gap_accel_sd_mps2: float = 0.5
    """acceleration that may happen unseen in a gap, 1 sigma of each axis"""


class SpeedBound(Settings, place="options.speed_bound"):
    """Bound on each component of the velocity where the beams leave a direction unobserved (docs/linear_range.md)."""

    sd_mps: float = 0.0
    """1 sigma; 0 for no bound"""
    time_s: float = 60.0
    """correlation time of the bound's error"""


class Levers(Settings, place="options.levers"):
    """Place of each sensor (3,), platform frame."""

    depth_p_m: Vector = (0.0, 0.0, 0.0)
    gps_p_m: Vector = (0.0, 0.0, 0.0)
    acoustic_position_p_m: Vector = (0.0, 0.0, 0.0)
    thrust_p_m: Vector = (0.0, 0.0, 0.0)


class FilterKeys(BaseModel):
    """Options of the filters, as a settings file says them too."""

    model_config: ClassVar[ConfigDict] = ConfigDict(use_attribute_docstrings=True)
    gate: Literal["joint", "per_row", "off"] = "joint"
    """test of a measurement: joint for all its rows, per_row for each, off for none"""
    gate_probability: Annotated[float, Field(gt=0, lt=1), _ONE] = 0.9973
    """probability with which a good measurement passes"""
    inflate_after_rejections: Annotated[int, Field(ge=0, le=1_000_000), _ONE] = 5
    """rejections of a sensor in a row before the covariance is inflated; 0 never, nor by the mean of pings"""
    estimate_dvl: bool = True
    """whether beam biases and scale factor are states (20), or frozen (15)"""
    information_port: Literal["axes", "full"] = "axes"
    """what info hands over: the observable axes, or the full vector with a large variance"""


class Options(FilterKeys, Settings, place="options"):
    """Options of the filters; the page of a method explains each."""

    covariance_period_ns: int = 100_000_000
    """interval of the covariance propagation; 0 for every inertial step"""
    imu_limits: ImuLimits = ImuLimits()
    imu_sampling: Literal["instantaneous", "averaged"] = "instantaneous"
    """whether an inertial reading is instantaneous or the average over the interval before it"""
    assumptions: Assumptions = Assumptions()
    water: Water = Water()
    water_track: bool = False
    """whether beams that the water returns are used"""
    thrust: Literal["off", "velocity", "all"] = "off"
    """what speeds by the vehicle's drives correct"""
    current_layers: CurrentLayers = CurrentLayers()
    calibration: Calibration = Calibration()
    speed_bound: SpeedBound = SpeedBound()
    motion: Motion = Motion()
    robust: Robust | None = Robust()
    """treatment of outliers among the beams; None for none"""
    levers: Levers = Levers()

    @classmethod
    def of(cls, *parts: Mapping[str, Any]) -> Self:
        """Options of several sections, later ones before earlier ones; each section's lever arms are kept."""
        levers = {key: value for part in parts for key, value in part.get("levers", {}).items()}
        return cls(**{key: value for part in parts for key, value in part.items()} | {"levers": levers})


class InitialState(Settings, place="initial_state"):
    """State at the start of a navigator or a replay: what `Navigator.state` returns makes one, too."""

    time_ns: int
    position_t_m: Vector = (0.0, 0.0, 0.0)
    """position (3,), tangent frame, by default its origin"""
    attitude_t_p: Vector
    """attitude (4,), scalar first, platform to tangent"""
    velocity_p_mps: Vector
    """velocity (3,), platform frame"""
    accel_bias_p_mps2: Vector = (0.0, 0.0, 0.0)
    """bias of the accelerometers (3,)"""
    gyro_bias_p_radps: Vector = (0.0, 0.0, 0.0)
    """bias of the gyros (3,)"""
    dvl_bias_mps: Vector = (0.0, 0.0, 0.0, 0.0)
    """bias of four beams (4,)"""
    dvl_scale_factor: float = 0.0
    """scale factor of the DVL"""
