"""The sections of a scenario file, in human units, each checked as it is read."""

import math
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from bottomlock import units
from bottomlock.config.beam_layout import BeamLayout, BeamTilt
from bottomlock.config.dvl import DvlErrors
from bottomlock.config.instrument_grades import Graded, one_of
from bottomlock.config.own_methods import OwnMethods, known_methods
from bottomlock.config.section import Earth, Outliers, PackagedOrFile, Section, Triple, shown
from bottomlock.kernel import INERTIAL_STATES, METHODS, STATES, models
from bottomlock.kernel.models import Finite, NonNegative, Positive, Real, Whole


class Environment(Earth):
    """Position on the Earth, and the date; longitude and decimal year are used for the magnetic field only."""

    latitude_deg: Annotated[Real, Field(ge=-90, le=90)] = 32.8
    """latitude, for gravity and the Earth's rate"""
    longitude_deg: Annotated[Real, Field(ge=-180, le=360)] = 35.0
    """longitude, for the magnetic field alone"""
    year: Annotated[Real, Field(ge=1900, le=2100), shown(unit="year")] = 2026.0
    """decimal year, for the magnetic field alone"""
    depth_m: Finite = 0.0
    """depth at which normal gravity is taken; on the ellipsoid it follows from the vehicle's depth"""
    earth_rotation: bool = True
    """whether the Earth turns, for truth and filter alike"""


class Outage(Section):
    """Beams that do not return between two times."""

    beams: Annotated[tuple[Annotated[Whole, Field(ge=1, le=8)], ...], shown(unit="1", example=[3, 4])]
    """beams that do not return, numbered from 1"""
    from_s: NonNegative = 0.0
    """begin, from the start"""
    to_s: Annotated[Positive, shown(example=120.0)] = math.inf
    """end, from the start; without it until the end"""

    @model_validator(mode="after")
    def _ends_later(self) -> Self:
        if self.to_s <= self.from_s:
            raise ValueError(f"outage ends at {self.to_s} s, expected after its start at {self.from_s} s")
        return self


class Dropout(Section):
    """Beams that come and go by chance, each by itself: mean times up and down, memoryless in between."""

    beams: Annotated[tuple[Annotated[Whole, Field(ge=1, le=8)], ...], shown(unit="1", example=[1, 2])]
    """beams that come and go, each by itself, numbered from 1"""
    mean_up_s: Annotated[Positive, shown(example=20.0)]
    """mean time that a beam returns"""
    mean_down_s: Annotated[Positive, shown(example=5.0)]
    """mean time that it does not"""


class AltitudeLoss(Section):
    """All beams lost together by chance: mean times up and down."""

    mean_up_s: Annotated[Positive, shown(example=120.0)]
    """mean time that the bottom is in range"""
    mean_down_s: Annotated[Positive, shown(example=15.0)]
    """mean time that it is not, and no beam returns"""


class Dvl(Outliers, DvlErrors, BeamLayout):
    """Doppler velocity log: geometry, rate, errors (1 sigma), limits over the seabed, and which beams are lost.

    The defaults of bias and scale factor are those of the paper's Table 2, as in a replay. Every rule of loss must let
    a beam through.
    """

    rate_hz: Annotated[Real, Field(gt=0, le=100)] = 1.0
    """rate of the pings"""
    tilt_deg: Annotated[BeamTilt, shown(range="≥ 2.0, < 90.0")] = 20.0
    """tilt of every beam from the vertical, for x and +"""
    beam_noise_mps: Annotated[Positive, shown(example=0.042)]
    beam_noise_mps_per_m: NonNegative = 0.0
    """white noise that grows with the range of a beam, beside `beam_noise_mps`; needs [seabed]"""
    min_range_m: NonNegative = 0.0
    """least range at which a beam returns; needs [seabed]"""
    max_range_m: Annotated[Real, Field(gt=0), shown(example=64.0)] = math.inf
    """greatest range at which a beam returns; needs [seabed]"""
    max_incidence_deg: Annotated[Real, Field(gt=0, le=90)] = 90.0
    """greatest angle between beam and the bottom's normal at which it returns; needs [seabed]"""
    range_noise_m: NonNegative = 0.0
    """white noise of the ranges, which decide what returns; needs [seabed]"""
    beams_lost: Annotated[
        tuple[Annotated[Whole, Field(ge=1, le=8)], ...], shown(unit="1", example=[3, 4])
    ] = ()
    """beams lost throughout, numbered from 1"""
    outages: tuple[Outage, ...] = ()
    dropouts: tuple[Dropout, ...] = ()
    altitude_loss: AltitudeLoss | None = None
    replay_validity: Annotated[Annotated[str, PackagedOrFile] | None, shown(example="dive.parquet")] = None
    """beam table of a recorded log whose validity is repeated end to end, from the scenario's folder"""

    @model_validator(mode="after")
    def _loses_beams_that_exist(self) -> Self:
        named = [*self.beams_lost, *(beam for outage in self.outages for beam in outage.beams)]
        coming_and_going = [beam for dropout in self.dropouts for beam in dropout.beams]
        for beam in named + coming_and_going:
            if beam > self.beams:
                raise ValueError(f"lost beam {beam} does not exist, expected 1 to {self.beams}")
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
    """north, east, down"""
    velocity_mps: Triple = (0.05, 0.05, 0.05)
    """surge, sway, heave"""
    roll_deg: NonNegative = 0.573
    """roll"""
    pitch_deg: NonNegative = 0.573
    """pitch"""
    yaw_deg: NonNegative = 1.146
    """yaw"""


class Water(Graded, models.Water):
    """Prior of the method sway_current for the motion through the water, 1 sigma.

    The defaults are of a torpedo of 3 m at 2 m/s; docs/methods/sway_current.md says where each number comes from.
    """

    of_grade = ("water", "vehicle")
    beside = frozenset({"vehicle"})
    vehicle: Annotated[str | None, shown(range=one_of("water"), example="hovering")] = None
    """kind of vehicle that gives the keys left out here; bottomlock list grades lists them"""


_OPTIONS: Final = models.Options()


class Filter(models.FilterKeys, models.AssumptionKeys, Section):
    """Filter options; the defaults are the kernel's.

    The paper gives neither n_f nor ε. n_f = 1 is its Eq. 28 with nothing added; ε = 1e-3 m²/s² is a sway of 3 cm/s,
    which is close to zero without making the gate reject real beams. Neither is fitted to a result.
    """

    covariance_rate_hz: NonNegative = 1e9 / _OPTIONS.covariance_period_ns
    """rate of the covariance's propagation; 0 at every inertial reading"""
    speed_sd_mps: NonNegative = _OPTIONS.speed_bound.sd_mps
    """bound on each component of the velocity while the beams leave a direction unobserved beyond the linear range;
    0 none"""
    speed_time_s: Positive = _OPTIONS.speed_bound.time_s
    """correlation time of that bound's error"""
    water: Water = Water()
    current_layers: models.CurrentLayers = models.CurrentLayers()
    motion: models.Motion = models.Motion()

    @property
    def states(self) -> int:
        """Number of error states: with the DVL's biases and scale factor, or the inertial states only."""
        return STATES if self.estimate_dvl else INERTIAL_STATES

    def kernel_options(self) -> dict[str, Any]:
        """What the section says of `models.Options`."""
        rate_hz = self.covariance_rate_hz
        period_ns = units.ns_from_s(1.0 / rate_hz) if rate_hz > 0.0 else 0
        same = {*models.FilterKeys.model_fields, "current_layers", "motion", "water"}
        content = self.model_dump(include=same, exclude={"water": {"vehicle"}})
        return content | {
            "covariance_period_ns": period_ns,
            "assumptions": self.model_dump(include=set(models.AssumptionKeys.model_fields)),
            "speed_bound": {"sd_mps": self.speed_sd_mps, "time_s": self.speed_time_s},
        }


_ROBUST: Final = models.Robust()
Gate = Annotated[Real, Field(gt=0, lt=1)] | Literal["off"]


class Robust(Section, kernel=models.Robust):
    """Treatment of outliers among the beams before a method uses a ping; the defaults are the kernel's."""

    enabled: bool = True
    """whether outliers among the beams are treated before a method uses a ping"""
    closure_gate: Annotated[Gate, shown(unit="1")] = _ROBUST.closure_gate or "off"
    """probability with which the closure of a good ping passes, or "off" """
    beam_gate: Annotated[Gate, shown(unit="1")] = _ROBUST.beam_gate or "off"
    """probability with which a good beam passes against the filter's own velocity, or "off" """
    tail: Literal["gaussian", "student_t"] = _ROBUST.tail
    student_t_degrees: Annotated[Positive, shown(unit="1")] = _ROBUST.student_t_degrees

    def kernel_options(self) -> models.Robust | None:
        """The treatment as the kernel takes it, None for none."""
        if not self.enabled:
            return None
        content: dict[str, Any] = self.model_dump(exclude={"enabled"})
        content |= {key: None for key, value in content.items() if value == "off"}
        return models.Robust(**content)


class Campaign(OwnMethods):
    """How many runs of what; `own_methods` says where methods of one's own are (docs/own_method.md)."""

    runs: Annotated[Whole, Field(ge=1, le=10_000_000), shown(unit="1")] = 100
    """number of runs of each trajectory"""
    seed: Annotated[Whole, Field(ge=0, lt=2**63), shown(unit="1")] = 2017
    """seed of every random number"""
    methods: Annotated[
        tuple[str, ...], BeforeValidator(known_methods), shown(example=["tc", "sway_current"])
    ] = METHODS
    """aiding methods, all on the same readings; also dead_reckoning, where [magnetometer] or [heading] is enabled"""
