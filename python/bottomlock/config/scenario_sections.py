"""The sections of a scenario file, in human units, each checked as it is read."""

import math
from collections.abc import Iterable
from typing import Annotated, Any, Final, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from bottomlock import units
from bottomlock.config.beam_tilt import BeamTilt, check_tilts
from bottomlock.config.instrument_grades import filled_from_grade, imu_model
from bottomlock.config.own_methods import OwnMethods
from bottomlock.config.path_keys import PathKeys, check_source, others_keys
from bottomlock.kernel import INERTIAL_STATES, METHODS, STATES, Configuration, models
from bottomlock.own_method import known_names
from bottomlock.support.nearest import did_you_mean

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Factor = Annotated[float, Field(ge=1, allow_inf_nan=False)]
Triple = tuple[NonNegative, NonNegative, NonNegative]
Vector = tuple[Finite, Finite, Finite]


class Section(BaseModel):
    """A section: unknown keys are errors, values are kept as read."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class Trajectory(PathKeys, Section):
    """The true motion: of a simulated vehicle, analytic, or along a path of one's own from a file.

    `feedback` is the state that guidance and control of the vehicle use: the truth or the estimate. `pilot` is the
    method whose estimate it is, or "own": each method has its own vehicle.
    """

    kind: Literal["straight", "constant_turn", "figure_eight", "lawn_mower", "waypoints", "file"]
    source: Literal["vehicle", "analytic", "file"] = "vehicle"
    vehicle: str = "tauv"
    feedback: Literal["truth", "estimate"] = "truth"
    pilot: str = "own"
    duration_s: Annotated[float, Field(gt=0, le=86_400)] = 250.0
    speed_mps: Annotated[float, Field(gt=0, le=50)] = 2.0
    heading_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    yaw_rate_deg_per_s: Annotated[float, Field(gt=0, le=90)] = 3.0
    dive_angle_deg: Annotated[float, Field(ge=0, le=60)] = 5.0
    dive_s: NonNegative = 30.0
    leg_s: Positive = 40.0
    turn_s: Positive = 20.0
    sway_gain_m: Annotated[float, Field(ge=-10, le=10)] = 0.6

    @model_validator(mode="after")
    def _of_one_source(self) -> Self:
        check_source(self.source, self.kind, self.model_fields_set)
        if self.pilot != "own":
            check_methods([self.pilot])
        return self

    @model_serializer(mode="wrap")
    def _of_its_source(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leaves out the keys that would mean something else if they were given: what is dumped can be read again."""
        strange = others_keys(self.source)
        # A path through waypoints ends at the last of them, unless it has a duration; so does one from a file.
        strange |= {"duration_s"} if self.kind in {"waypoints", "file"} else set()
        strange |= {"speed_mps"} if self.kind == "file" else set()
        dumped: dict[str, Any] = handler(self)
        return {key: value for key, value in dumped.items() if key not in strange - self.model_fields_set}


class Environment(Section):
    """Position on the Earth, and the date; longitude and decimal year are used for the magnetic field only."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)] = 32.8
    longitude_deg: Annotated[float, Field(ge=-180, le=360)] = 35.0
    year: Annotated[float, Field(ge=1900, le=2100)] = 2026.0
    gravity: Literal["normal"] | Positive = "normal"
    depth_m: Finite = 0.0
    earth_rotation: bool = True
    earth: Literal["ellipsoid", "tangent_plane"] = "ellipsoid"


class ImuErrors(Section):
    """Errors of inertial sensors, 1 sigma; those of a packaged grade where `grade` names one and a key is left out."""

    grade: str | None = None
    accel_bias_mg: NonNegative
    gyro_bias_deg_per_h: NonNegative
    accel_noise_mps_per_rt_h: NonNegative
    gyro_noise_deg_per_rt_h: NonNegative
    accel_bias_walk_mps2_per_rt_s: NonNegative = 0.0
    gyro_bias_walk_deg_per_s_per_rt_s: NonNegative = 0.0

    @model_validator(mode="wrap")
    @classmethod
    def _of_grade(cls, content: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:  # noqa: ANN401
        return filled_from_grade("imu", content, handler)

    def kernel_model(self) -> models.ImuModel:
        """The errors in SI."""
        return imu_model(self.model_dump())


_LIMITS: Final = models.ImuLimits()


class ImuLimits(Section):
    """What readings of a live navigator or a recorded log are checked against; simulated ones are not.

    A reading at or beyond the full scale of the data sheet is rejected, and so is the last of `stuck_after` equal ones
    (0: never). An interval without good readings that is longer than `max_gap_s` is refused or, with `gap` = "inflate",
    bridged; `gap_rate_deg_per_s` and `gap_accel_mps2`, 1 sigma on each axis, are the motion that may happen unseen
    (docs/imu_faults.md).
    """

    max_rate_deg_per_s: Annotated[float, Field(gt=0, le=1e6)] = math.degrees(_LIMITS.max_rate_radps)
    max_force_mps2: Annotated[float, Field(gt=0, le=1e6)] = _LIMITS.max_force_mps2
    stuck_after: Annotated[int, Field(ge=0, le=1_000_000)] = _LIMITS.stuck_after
    max_gap_s: Annotated[float, Field(gt=0, le=1e6)] = _LIMITS.max_gap_s
    gap: Literal["refuse", "inflate"] = _LIMITS.gap
    gap_rate_deg_per_s: NonNegative = math.degrees(_LIMITS.gap_rate_sd_radps)
    gap_accel_mps2: NonNegative = _LIMITS.gap_accel_sd_mps2

    def kernel_limits(self) -> models.ImuLimits:
        """The limits in SI."""
        return models.ImuLimits(
            max_rate_radps=units.rad_or_default(self.max_rate_deg_per_s, _LIMITS.max_rate_radps),
            gap_rate_sd_radps=units.rad_or_default(self.gap_rate_deg_per_s, _LIMITS.gap_rate_sd_radps),
            gap_accel_sd_mps2=self.gap_accel_mps2,
            **self.model_dump(include={"max_force_mps2", "stuck_after", "max_gap_s", "gap"}),
        )


class Imu(ImuErrors):
    """Inertial measurement unit: rate, errors, and the limits of its readings outside a simulation."""

    rate_hz: Annotated[float, Field(ge=1, le=10_000)] = 150.0
    sampling: Literal["instantaneous", "averaged"] = "instantaneous"
    limits: ImuLimits = ImuLimits()


class Outage(Section):
    """Beams that do not return between two times."""

    beams: tuple[Annotated[int, Field(ge=1, le=8)], ...]
    from_s: NonNegative = 0.0
    to_s: Positive = math.inf


class Dropout(Section):
    """Beams that come and go by chance, each by itself: mean times up and down, memoryless in between."""

    beams: tuple[Annotated[int, Field(ge=1, le=8)], ...]
    mean_up_s: Positive
    mean_down_s: Positive


class AltitudeLoss(Section):
    """All beams lost together by chance: mean times up and down."""

    mean_up_s: Positive
    mean_down_s: Positive


class Dvl(Section):
    """Doppler velocity log: geometry, rate, errors (1 sigma), limits over the seabed, and which beams are lost.

    The defaults of bias and scale factor are those of the paper's Table 2, as in a replay. A fraction of the readings
    of each beam are outliers, with `outlier_factor` times the noise; the filter does not model them.

    Every rule of loss must let a beam through: lost throughout, outages, dropouts, altitude loss, the validity of a
    recorded log (`replay_validity`, repeated end to end), and range and incidence where there is a seabed.
    """

    rate_hz: Annotated[float, Field(gt=0, le=100)] = 1.0
    configuration: Configuration = "x"
    tilt_deg: BeamTilt = 20.0
    tilts_deg: tuple[Annotated[float, Field(gt=-90, lt=90)], ...] | None = None
    azimuths_deg: tuple[Annotated[float, Field(ge=-360, le=360)], ...] | None = None
    directions: tuple[Vector, ...] | None = None
    lever_arms_m: tuple[Vector, ...] | None = None
    mounting_roll_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    mounting_pitch_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    mounting_yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    sound_speed_scale: Positive = 1.0
    beam_noise_mps: Positive
    beam_bias_mps: NonNegative = 0.005
    beam_bias_walk_mps_per_rt_s: NonNegative = 5e-5
    scale_factor_percent: NonNegative = 0.7
    scale_factor_walk_percent_per_rt_s: NonNegative = 5e-3
    outlier_fraction: Fraction = 0.0
    outlier_factor: Factor = 10.0
    min_range_m: NonNegative = 0.0
    max_range_m: Annotated[float, Field(gt=0)] = math.inf
    max_incidence_deg: Annotated[float, Field(gt=0, le=90)] = 90.0
    range_noise_m: NonNegative = 0.0
    beams_lost: tuple[Annotated[int, Field(ge=1, le=8)], ...] = ()
    outages: tuple[Outage, ...] = ()
    dropouts: tuple[Dropout, ...] = ()
    altitude_loss: AltitudeLoss | None = None
    replay_validity: str | None = None

    @property
    def beams(self) -> int:
        """Number of beams."""
        if self.configuration == "angles":
            return len(self.azimuths_deg or ())
        if self.configuration == "directions":
            return len(self.directions or ())
        return 4

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.configuration == "angles" and (
            not self.azimuths_deg or not self.tilts_deg or len(self.azimuths_deg) != len(self.tilts_deg)
        ):
            raise ValueError("configuration 'angles' needs azimuths_deg and tilts_deg of the same length")
        if self.configuration == "angles":
            check_tilts(self.tilts_deg or ())
        if self.configuration == "directions" and not self.directions:
            raise ValueError("configuration 'directions' needs directions, one unit vector per beam")
        if self.lever_arms_m is not None and len(self.lever_arms_m) != self.beams:
            raise ValueError(
                f"lever_arms_m has {len(self.lever_arms_m)} entries, expected {self.beams}, one per beam"
            )
        named = [*self.beams_lost, *(beam for outage in self.outages for beam in outage.beams)]
        coming_and_going = [beam for dropout in self.dropouts for beam in dropout.beams]
        for beam in named + coming_and_going:
            if beam > self.beams:
                raise ValueError(f"lost beam {beam} does not exist, expected 1 to {self.beams}")
        for outage in self.outages:
            if outage.to_s <= outage.from_s:
                raise ValueError(
                    f"outage ends at {outage.to_s} s, expected after its start at {outage.from_s} s"
                )
        for beam in coming_and_going:
            if coming_and_going.count(beam) > 1:
                raise ValueError(f"beam {beam} stands in two dropouts, expected one at most")
        if self.min_range_m >= self.max_range_m:
            raise ValueError(
                f"min_range_m is {self.min_range_m}, expected less than max_range_m {self.max_range_m}"
            )
        return self


class Initial(Section):
    """Uncertainty of the initial state, 1 sigma."""

    position_m: Triple = (2.0, 2.0, 2.0)
    velocity_mps: Triple = (0.05, 0.05, 0.05)
    roll_deg: NonNegative = 0.573
    pitch_deg: NonNegative = 0.573
    yaw_deg: NonNegative = 1.146


_WATER: Final = models.Water()


class Water(Section):
    """Prior of the methods sway_current and consistent for the motion through the water, 1 sigma.

    `vehicle` gives the keys left out; without it they are the kernel's, of a torpedo of 3 m at 2 m/s.
    docs/methods/sway_current.md says where each number comes from.
    """

    vehicle: str | None = None
    current_sd_mps: NonNegative = _WATER.current_sd_mps
    current_time_s: Positive = _WATER.current_time_s
    sway_gain_m: Finite = _WATER.sway_gain_m
    sway_gain_sd_m: NonNegative = _WATER.sway_gain_sd_m
    trim_sd_mps: NonNegative = _WATER.trim_sd_mps
    trim_time_s: Positive = _WATER.trim_time_s
    slip_sd_mps: Positive = _WATER.slip_sd_mps
    slip_time_s: Positive = _WATER.slip_time_s
    slip_epochs: Annotated[float, Field(ge=1, allow_inf_nan=False)] = _WATER.slip_epochs

    @model_validator(mode="wrap")
    @classmethod
    def _of_vehicle(cls, content: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:  # noqa: ANN401
        return filled_from_grade("water", content, handler, "vehicle")


_MOTION: Final = models.Motion().as_dict()


class Motion(Section):
    """Prior of the velocity of a vehicle without usable accelerometers, along forward, right and down, 1 sigma.

    A mean, which hardly changes, and a first-order change about it; all zero, the default, is no prior
    (docs/no_imu.md).
    """

    mean_sd_mps: tuple[NonNegative, NonNegative, NonNegative] = _MOTION["mean_sd_mps"]
    mean_time_s: Positive = _MOTION["mean_time_s"]
    change_sd_mps: tuple[NonNegative, NonNegative, NonNegative] = _MOTION["change_sd_mps"]
    change_time_s: tuple[Positive, Positive, Positive] = _MOTION["change_time_s"]


_LAYERS: Final = models.CurrentLayers()


class CurrentLayers(Section):
    """Prior of the current by depth, with water track (docs/methods/without_bottom.md); `sd_mps` 0 is no layers."""

    sd_mps: NonNegative = _LAYERS.sd_mps
    time_s: Positive = _LAYERS.time_s
    way_m: Positive = _LAYERS.way_m
    spacing_m: Positive = _LAYERS.spacing_m
    mean_time_s: Positive = _LAYERS.mean_time_s


_OPTIONS: Final = models.Options()


class Filter(Section):
    """Filter options; the defaults are the kernel's.

    The paper gives neither n_f nor ε. n_f = 1 is its Eq. 28 with nothing added; ε = 1e-3 m²/s² is a sway of 3 cm/s,
    which is close to zero without making the gate reject real beams. Neither is fitted to a result.

    `speed_sd_mps`, 0 for none, bounds each component of the velocity over ground, with one error for `speed_time_s`,
    while the beams leave a direction unobserved beyond the linear range (docs/linear_range.md).
    """

    gate: Literal["joint", "per_row", "off"] = _OPTIONS.gate
    gate_probability: Annotated[float, Field(gt=0, lt=1)] = _OPTIONS.gate_probability
    inflate_after_rejections: Annotated[int, Field(ge=0, le=1_000_000)] = _OPTIONS.inflate_after_rejections
    covariance_rate_hz: NonNegative = 1e9 / _OPTIONS.covariance_period_ns
    estimate_dvl: bool = _OPTIONS.estimate_dvl
    virtual_beam_factor: Positive = _OPTIONS.assumptions.virtual_beam_factor
    nullified_sway_var_m2ps2: Positive = _OPTIONS.assumptions.nullified_sway_var_m2ps2
    weak_sway_var_m2ps2: Positive = _OPTIONS.assumptions.weak_sway_var_m2ps2
    information_port: Literal["axes", "full"] = _OPTIONS.information_port
    speed_sd_mps: NonNegative = _OPTIONS.speed_bound.sd_mps
    speed_time_s: Positive = _OPTIONS.speed_bound.time_s
    water: Water = Water()
    current_layers: CurrentLayers = CurrentLayers()
    motion: Motion = Motion()

    @property
    def states(self) -> int:
        """Number of error states: with the DVL's biases and scale factor, or the inertial states only."""
        return STATES if self.estimate_dvl else INERTIAL_STATES

    def kernel_options(self) -> dict[str, Any]:
        """What the section says of `models.Options`."""
        rate_hz = self.covariance_rate_hz
        period_ns = units.ns_from_s(1.0 / rate_hz) if rate_hz > 0.0 else 0
        same = {"gate", "gate_probability", "inflate_after_rejections", "estimate_dvl", "information_port"}
        content = self.model_dump(
            include={*same, "current_layers", "motion", "water"}, exclude={"water": {"vehicle"}}
        )
        assumptions = set(models.Assumptions.model_fields)
        return content | {
            "covariance_period_ns": period_ns,
            "assumptions": self.model_dump(include=assumptions),
            "speed_bound": {"sd_mps": self.speed_sd_mps, "time_s": self.speed_time_s},
        }


_ROBUST: Final = models.Robust()
Gate = Annotated[float, Field(gt=0, lt=1)] | Literal["off"]


class Robust(Section):
    """Treatment of outliers among the beams before a method uses a ping; the defaults are the kernel's.

    A gate, of closure or of single beams, is the probability with which a good ping or beam passes, or "off"; `tail` is
    the distribution of the noise of the beams that pass.
    """

    enabled: bool = True
    closure_gate: Gate = _ROBUST.closure_gate or "off"
    beam_gate: Gate = _ROBUST.beam_gate or "off"
    tail: Literal["gaussian", "student_t"] = _ROBUST.tail
    student_t_degrees: Positive = _ROBUST.student_t_degrees

    def kernel_options(self) -> models.Robust | None:
        """The treatment as the kernel takes it, None for none."""
        if not self.enabled:
            return None
        content: dict[str, Any] = self.model_dump(exclude={"enabled"})
        content |= {key: None for key, value in content.items() if value == "off"}
        return models.Robust(**content)


def check_methods(methods: Iterable[str]) -> None:
    """Rejects unknown and repeated methods and an empty list.

    Raises:
        ValueError: naming the known methods.
    """
    seen: set[str] = set()
    for method in methods:
        if method not in known_names():
            hint = did_you_mean(method, known_names())
            raise ValueError(
                f"unknown method '{method}'{hint} (known: {', '.join(known_names())}; your own: MODULE:CLASS)"
            )
        if method in seen:
            raise ValueError(f"method '{method}' is named twice")
        seen.add(method)
    if not seen:
        raise ValueError(f"no method is named, expected one or more of {', '.join(METHODS)}")


def known_methods(methods: Any) -> Any:  # noqa: ANN401 - what a file or a call names
    """The methods, if they are a list of texts that `check_methods` accepts."""
    if isinstance(methods, list | tuple) and all(isinstance(method, str) for method in methods):
        check_methods(methods)
    return methods


class Campaign(OwnMethods, Section):
    """How many runs of what; `own_methods` says where methods of one's own are (docs/own_method.md)."""

    runs: Annotated[int, Field(ge=1, le=10_000_000)] = 100
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 2017
    methods: Annotated[tuple[str, ...], BeforeValidator(known_methods)] = METHODS
