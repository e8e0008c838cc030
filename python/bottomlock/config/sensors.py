"""The sensors beside IMU and DVL: the section of each in a scenario, and its errors in a case and live.

A sensor of a simulation is a section in `SensorSections`, one that aids in a case or live a section in
`AidingSections`; what a filter assumes of both stands once where it is the same.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from bottomlock import units
from bottomlock.config.attitude_reference import AttitudeReference, SlowAttitudeErrors
from bottomlock.config.mission_sections import CurrentTable
from bottomlock.config.section import Fraction, Outliers, Section, SensorErrors, Vector, in_si, shown
from bottomlock.config.through_water import DriveErrors, EffortErrors, ThrustErrors
from bottomlock.kernel import models
from bottomlock.kernel.models import Finite, NonNegative, Positive, Real, Whole


def _axes(words: str) -> tuple[str, ...]:
    """Names of columns, one for each axis."""
    return tuple(words.format(axis) for axis in ("north", "east", "down"))


class Switched(SensorErrors):
    """A sensor of a simulation, which is on or off."""

    enabled: bool = True
    """whether there is such a sensor; a section that is there is on unless it says otherwise"""


class Simulated(Switched):
    """A sensor of a simulation with a rate of its own.

    `name` is its section in a scenario and in the kernel's model, and its name in a schedule; `updates` are its updates
    as the kernel's `SENSORS` names them; `columns` are those of its `table` of readings, by the kernel's array of them.
    """

    name: ClassVar[str]
    updates: ClassVar[tuple[str, ...]]
    table: ClassVar[str]
    columns: ClassVar[Mapping[str, tuple[str, ...]]]
    rate_hz: Positive = 1.0
    """rate of the readings"""

    def __init_subclass__(cls, **others: Any) -> None:  # noqa: ANN401
        """Table and updates have the sensor's name where it says nothing else."""
        super().__init_subclass__(**others)
        cls.name = cls.kernel.place
        cls.table, cls.updates = cls.__dict__.get("table", cls.name), cls.__dict__.get("updates", (cls.name,))


class SlowDepthErrors(SensorErrors, kernel=models.DepthModel):
    """What a depth is off for longer than a reading: by the defaults 0.1 % of 200 m, in waters with a tide.

    The time is that of half a semidiurnal tide.
    """

    bias_m: NonNegative = 0.3
    bias_time_s: Positive = 21_600.0
    wave_m: NonNegative = 0.0
    wave_period_s: Positive = models.WAVE_PERIOD_S


class DepthErrors(SlowDepthErrors):
    """Noise and bias, 1 sigma, of a depth measured at `lever_arm_m` from the IMU."""

    sd_m: Annotated[Positive, shown(example=0.02)]
    """white noise, 1 sigma"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the sensor from the IMU, platform axes"""


class Depth(SlowDepthErrors, Simulated):
    """Depth sensor: noise, bias and waves that each run draws, and what density, tide and barometer add, not drawn."""

    columns: ClassVar = {"depth_m": ("depth_m",)}
    rate_hz: Positive = 0.25
    noise_pa: Positive = 194.0
    """white noise of the pressure"""
    water_density_kg_per_m3: Positive = 1025.0
    """density with which the sensor takes its pressure for depth"""
    true_density_kg_per_m3: Annotated[Positive | None, shown(example=1027.0)] = None
    """density of the water itself; none: the sensor's"""
    tide_m: Finite = 0.0
    """what the tide adds to the reading; not drawn"""
    barometric_offset_pa: Finite = 0.0
    """what the barometer adds to the pressure; not drawn"""

    def kernel_models(self, gravity_mps2: float = math.nan) -> dict[str, models.Settings]:
        """Section of the kernel's model, SI; gravity makes a depth of a pressure."""
        sd_m = self.noise_pa / (self.water_density_kg_per_m3 * gravity_mps2)
        return {self.name: in_si(dict(self), self.kernel, sd_m=sd_m)}


class Magnetometer(SlowAttitudeErrors, Simulated):
    """Magnetometer and tilt sensor: noise, slow errors that a run draws, and what declination and iron add to yaw."""

    updates, table = ("attitude",), "attitude"
    columns: ClassVar = {"magnetometer_attitude_t_p": tuple(f"attitude_{part}" for part in "wxyz")}
    rate_hz: Positive = 0.5
    yaw_noise_deg: Positive = 5.72
    roll_pitch_noise_deg: Positive = 1.15
    declination_deg: Annotated[
        Annotated[Real, Field(ge=-180, le=180)] | Literal["wmm"],
        shown(range='≥ -180.0, ≤ 180.0, or "wmm"'),
    ] = 0.0
    """declination of the field; "wmm" takes the field from the World Magnetic Model"""
    inclination_deg: Annotated[Real, Field(gt=-90, lt=90)] = 49.0
    """inclination of the field, down"""
    field_nt: Annotated[Positive, shown(unit="nT")] = 45_000.0
    """strength of the field"""
    assumed_declination_deg: Annotated[Annotated[Real, Field(ge=-180, le=180)] | None, shown(example=4.5)] = (
        None
    )
    """declination that the compass corrects for; none: the true one"""
    hard_iron_nt: Annotated[Vector, shown(unit="nT")] = (0.0, 0.0, 0.0)
    """field of the vehicle's own, platform axes"""
    soft_iron: Annotated[tuple[Vector, Vector, Vector], shown(unit="1")] = (
        (1.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0),
    )
    """matrix that distorts the field, rows in platform axes"""


class Heading(Simulated, kernel=models.HeadingModel):
    """Heading sensor, such as a gyrocompass: yaw alone; its slow errors as of the magnetometer."""

    columns: ClassVar = {"heading_rad": ("heading_rad",)}
    noise_deg: Positive = 0.5
    offset_sd_deg: NonNegative = 0.0
    walk_sd_deg: NonNegative = 0.0
    walk_time_s: Positive = models.WALK_TIME_S
    semicircular_sd_deg: NonNegative = 0.0
    quadrantal_sd_deg: NonNegative = 0.0


class GpsErrors(SensorErrors, kernel=models.GpsModel):
    """Noise of GPS positions along north, east, down, 1 sigma, of an antenna at `lever_arm_m` from the IMU."""

    position_sd_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    """noise of north, east, down, 1 sigma"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the antenna from the IMU, platform axes"""

    def si(self) -> dict[str, Any]:
        """The velocities of the receiver, which are not used."""
        return {"velocity_sd_mps": (0.1, 0.1, 0.2)}


class Gps(Simulated, kernel=models.GpsModel):
    """GPS receiver: fixes at the surface only, from `acquire_s` after the antenna has come up."""

    updates = ("gps_position", "gps_velocity")
    columns: ClassVar = {
        "gps_position_t_m": _axes("position_{}_m"),
        "gps_velocity_t_mps": _axes("velocity_{}_mps"),
    }
    position_noise_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    velocity_noise_mps: tuple[Positive, Positive, Positive] = (0.1, 0.1, 0.2)
    antenna_depth_m: Finite = 0.3
    """depth of the platform above which the antenna is out of the water"""
    acquire_s: NonNegative = 5.0
    """time from surfacing to the first fix"""


class Transponder(SensorErrors, kernel=models.AcousticPositionModel):
    """Where the two ends of an acoustic position (USBL, LBL) are."""

    transceiver_m: Vector = (0.0, 0.0, 0.0)
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the transponder from the IMU, platform axes"""


class AcousticPositionErrors(Transponder):
    """Noise of acoustic positions (USBL, LBL) of a transponder at `lever_arm_m` from the IMU (platform frame).

    1 sigma of each axis is the root of sd_m² + (sd_percent_of_range/100 · slant range)², the slant range from
    `transceiver_m` in the tangent frame, unless the readings state it.
    """

    sd_m: Positive = 0.5
    sd_percent_of_range: NonNegative = 1.0


class AcousticPosition(Outliers, Transponder, Simulated):
    """Acoustic position (USBL, LBL): fixes whose noise grows with the slant range from the transceiver.

    The standard deviation of each axis is the root of noise_m² + (noise_percent_of_range/100 · slant range)².
    """

    columns: ClassVar = {
        "acoustic_position_t_m": _axes("position_{}_m"),
        "acoustic_position_sd_m": _axes("sd_{}_m"),
    }
    rate_hz: Positive = 0.2
    noise_m: Positive = 0.5
    noise_percent_of_range: NonNegative = 1.0


class Thrust(DriveErrors, Simulated):
    """The speed through the water along the vehicle's axis that its propeller says, with scale and slip.

    With the section every method has the current as states. A run draws its own scale about `error_percent` more. The
    water moves as for `[water_track]`.
    """

    updates = ("thrust_surge",)
    columns: ClassVar = {
        "thrust_speed_p_mps": tuple(f"speed_{axis}_mps" for axis in ("surge", "sway", "heave"))
    }
    error_percent: Annotated[Real, Field(gt=-100, allow_inf_nan=False)] = 0.0
    """by how much vehicles are faster on average; the filter does not model it"""

    def si(self) -> dict[str, Any]:
        """What is no key of the same name."""
        return super().si() | {"true_scale_error": units.fraction_from_percent(self.error_percent)}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return super().kernel_options() if self.enabled else {"thrust": "off"}


Cell = Annotated[Whole, Field(ge=1, le=255)]


class WaterCells(SensorErrors):
    """Velocity through the water by beams that the water returned, with the current as states of the filter.

    Of each beam the mean over the chosen cells is used. What leaves a cell out is in docs/howto/water_track.md. A noise
    that the instrument records with each cell comes before `noise_mps`.
    """

    cells: Annotated[tuple[Cell, ...], Field(min_length=1), shown(unit="1")] = (1, 2)
    """numbers of the cells whose mean is used, 1 the nearest; leave out those in the vehicle's own wake"""
    min_correlation: Annotated[Real, Field(ge=0, le=255), shown(unit="1", example=64.0)] = 0.0
    """least correlation of a beam in a cell, 0 to 255"""
    max_closure_mps: Annotated[Positive | None, shown(example=0.05)] = None
    """largest closure of the beams of a cell, beyond which none of them is used; none: three times what their noise
    leads to"""
    noise_mps: Annotated[Positive | None, shown(example=0.04)] = None
    """noise of a beam, 1 sigma, where the instrument records none; none: that of the bottom's beams"""

    @model_validator(mode="after")
    def _cells_once(self) -> Self:
        for cell in self.cells:
            if self.cells.count(cell) > 1:
                raise ValueError(f"cell {cell} is named twice in 'cells', expected each cell once")
        return self

    def kernel_models(self, gravity_mps2: float = math.nan) -> dict[str, models.Settings]:  # noqa: ARG002
        """Nothing: the noise is that of the cells."""
        return {}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"water_track": True}


class WaterTrack(Outliers, Switched, kernel=models.WaterTrackModel):
    """Water track: pings of the DVL return the velocity relative to the water in a cell, on every beam.

    Beam biases, scale factor, mounting and clock are those of the bottom's beams; losses, noise and outliers are the
    water's own. The current is that of the depth of each beam's cell. With the section every method but `ins` has the
    current as states. `current` is for a truth without a vehicle, whose motion over ground stays as it is; that of a
    vehicle stands in `[mission]`.
    """

    pings: Literal["all", "without_bottom"] = "all"
    """which pings return the water: all of them, or those of which no beam returns from the bottom"""
    range_m: NonNegative = 10.0
    noise_mps: Positive = 0.05
    """white noise of each beam"""
    lost_fraction: Annotated[Fraction, shown(unit="1")] = 0.0
    """part of the readings of each beam that are lost"""
    wake: Annotated[Fraction, shown(unit="1")] = 0.0
    current: CurrentTable = CurrentTable()

    def si(self) -> dict[str, Any]:
        """What is no key of the same name."""
        return {"beam_noise_sd_mps": self.noise_mps}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"water_track": True}


class SensorSections(Section):
    """The sections of `SENSORS` in a scenario."""

    depth: Depth = Depth(enabled=False)
    magnetometer: Magnetometer = Magnetometer(enabled=False)
    heading: Heading = Heading(enabled=False)
    gps: Gps = Gps(enabled=False)
    acoustic_position: AcousticPosition = AcousticPosition(enabled=False)
    thrust: Thrust = Thrust(enabled=False)


class AidingSections(Section):
    """The sections of `recordings.sensors.SENSORS` as a filter takes them, in a live configuration."""

    attitude: AttitudeReference | None = None
    depth: DepthErrors | None = None
    gps: GpsErrors | None = None
    acoustic_position: AcousticPositionErrors | None = None
    water_track: WaterCells | None = None
    thrust: ThrustErrors | None = None
    effort: EffortErrors | None = None


SENSORS: tuple[type[Simulated], ...] = tuple(
    type(field.default) for field in SensorSections.model_fields.values()
)
"""In the order in which the kernel takes measurements of the same time, after the DVL's."""
