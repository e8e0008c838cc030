"""Sections of a case file that say which columns of a log mean what, in which units, axes and clocks."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from bottomlock.config.scenario_sections import Finite, NonNegative, Positive, Section, Vector

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Axes = tuple[Axis, Axis, Axis]
Names = tuple[str, str, str]

ANGLE_UNITS = ("rad", "deg")
AS_THEY_ARE: Axes = ("x", "y", "z")


def check_axes(axes: Axes) -> None:
    """Refuses axes that name one sensor axis twice.

    Raises:
        ValueError: with what was expected.
    """
    if len({axis.removeprefix("-") for axis in axes}) != 3:
        raise ValueError(f"axes is {list(axes)}, expected each of x, y, z once, with or without a minus")


class Clock(Section):
    """When the rows of a table are valid: by a column, by their number at an even rate, or both.

    With `column` alone its stamps count. With `rate_hz` alone row k stands at `start_s` + k/rate. With both the rows
    are taken at an even rate and the stamps, a host's, say only where the first of them stands; the stamps may then
    stray from it by `steady_within_s`. `offset_s` is added: it takes the stream's clock to the case's. A step of
    more than `gap_s` is a gap (by default three median steps), of more than `jump_s` a jump of the clock. Rows that
    repeat a time or go back are refused, or left out where `unordered` says "drop".
    """

    column: str | None = None
    unit: Literal["ns", "us", "ms", "s"] = "s"
    rate_hz: Positive | None = None
    start_s: Finite = 0.0
    offset_s: Finite = 0.0
    gap_s: Positive | None = None
    jump_s: Positive = 60.0
    steady_within_s: Positive = 0.05
    unordered: Literal["refuse", "drop"] = "refuse"

    @model_validator(mode="after")
    def _stands_somewhere(self) -> Self:
        if self.column is None and self.rate_hz is None:
            raise ValueError("a clock needs 'column' (stamps), 'rate_hz' (rows at an even rate) or both")
        if self.column is not None and "start_s" in self.model_fields_set:
            raise ValueError("'start_s' is given beside 'column': the column says when, 'offset_s' moves it")
        return self


class Stream(Section):
    """A table of a case: its file and its clock; every n-th row is taken with `every` = n."""

    file: Path
    clock: Clock
    every: Annotated[int, Field(ge=1)] = 1


class Mounted(Stream):
    """A sensor with axes of its own: first flipped and swapped (`axes`), then turned by the mounting angles."""

    axes: Axes = AS_THEY_ARE
    mounting_roll_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    mounting_pitch_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    mounting_yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0

    @model_validator(mode="after")
    def _axes_once(self) -> Self:
        check_axes(self.axes)
        return self


class ImuErrors(Section):
    """Errors of inertial sensors, 1 sigma, with the keys of a scenario's [imu]."""

    accel_bias_mg: NonNegative
    gyro_bias_deg_per_h: NonNegative
    accel_noise_mps_per_rt_h: NonNegative
    gyro_noise_deg_per_rt_h: NonNegative
    accel_bias_walk_mps2_per_rt_s: NonNegative = 0.0
    gyro_bias_walk_deg_per_s_per_rt_s: NonNegative = 0.0


class ImuStream(Mounted):
    """Inertial sensors: specific force and angular rate, or their increments over an interval.

    Increments ("m/s", "rad", "deg") are divided by the column `interval` (s), or by 1/`rate_hz` of the clock; they are
    means over the step that they end, and the filter takes them so. A gap is refused unless it is at most
    `bridge_gaps_s` long: the strapdown then crosses it on a straight line between its ends, and the report says so.
    `degrade` adds errors of a poorer instrument, drawn from the case's seed.
    """

    force: Names
    rate: Names
    force_unit: Literal["m/s2", "g", "mg", "m/s"] = "m/s2"
    rate_unit: Literal["rad/s", "deg/s", "deg/h", "rad", "deg"] = "rad/s"
    interval: str | None = None
    sampling: Literal["instantaneous", "averaged"] | None = None
    bridge_gaps_s: NonNegative = 0.0
    errors: ImuErrors
    degrade: ImuErrors | None = None

    @property
    def increments(self) -> tuple[bool, bool]:
        """Whether force and rate come as increments."""
        return self.force_unit == "m/s", self.rate_unit in ANGLE_UNITS

    @property
    def averaged(self) -> bool:
        """Whether a reading is the mean over the step that it ends."""
        return self.sampling == "averaged" if self.sampling is not None else any(self.increments)

    @model_validator(mode="after")
    def _increments_have_an_interval(self) -> Self:
        if any(self.increments) and self.interval is None and self.clock.rate_hz is None:
            raise ValueError(
                f"units '{self.force_unit}' and '{self.rate_unit}' are increments: give 'interval' (a column, s) "
                "or clock.rate_hz"
            )
        if self.interval is not None and not any(self.increments):
            raise ValueError("'interval' is given, but no unit is that of an increment (m/s, rad, deg)")
        if self.every != 1:
            raise ValueError(f"'every' is {self.every}, expected 1: inertial readings are not left out")
        return self


class DepthStream(Stream):
    """Depth below the surface, altitude above it (`up`), or pressure, of a sensor at `lever_arm_m` from the IMU."""

    column: str
    unit: Literal["m", "cm", "Pa", "kPa", "bar", "dbar"] = "m"
    up: bool = False
    offset_m: Finite = 0.0
    water_density_kg_per_m3: Positive = 1025.0
    sd_m: Positive
    lever_arm_m: Vector = (0.0, 0.0, 0.0)


class AttitudeStream(Stream):
    """Roll, pitch and yaw of a recorded attitude sensor; `frame` "enu_flu" is turned to north–east–down.

    `aids` says what of it the filter hears: the whole attitude, the heading alone, or nothing (it may still serve the
    alignment). The mounting angles turn the sensor's axes to the platform's; `yaw_offset_deg` (a declination) is added.
    """

    roll: str
    pitch: str
    yaw: str
    unit: Literal["rad", "deg"] = "rad"
    frame: Literal["ned_frd", "enu_flu"] = "ned_frd"
    mounting_roll_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    mounting_pitch_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    mounting_yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    yaw_offset_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    aids: Literal["attitude", "heading", "nothing"] = "nothing"
    roll_pitch_sd_deg: Positive = 1.0
    yaw_sd_deg: Positive = 5.0


class MagnetometerStream(Mounted):
    """Magnetic field in sensor axes, for the heading of the alignment; any unit, the same for all three.

    `hard_iron` is taken off the readings (their unit, sensor axes) before they are turned.
    """

    field: Names
    declination_deg: Annotated[float, Field(ge=-180, le=180)]
    hard_iron: Vector = (0.0, 0.0, 0.0)
    heading_sd_deg: Positive


class Positioned(Stream):
    """Positions as latitude, longitude and height, or as metres north, east and down (`height` is up)."""

    latitude: str | None = None
    longitude: str | None = None
    height: str | None = None
    angle_unit: Literal["rad", "deg"] = "deg"
    north: str | None = None
    east: str | None = None
    down: str | None = None
    lever_arm_m: Vector = (0.0, 0.0, 0.0)

    @property
    def geodetic(self) -> bool:
        """Whether positions are latitude and longitude."""
        return self.latitude is not None

    @property
    def placed(self) -> bool:
        """Whether there are positions at all."""
        return self.latitude is not None or self.north is not None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.latitude is None) != (self.longitude is None):
            raise ValueError("'latitude' and 'longitude' come together")
        if (self.north is None) != (self.east is None):
            raise ValueError("'north' and 'east' come together")
        if self.latitude is not None and self.north is not None:
            raise ValueError("positions are given twice, as 'latitude' and as 'north': expected one of them")
        if self.height is not None and self.down is not None:
            raise ValueError("'height' (up) and 'down' are both given, expected one of them")
        return self


class GpsStream(Positioned):
    """GPS positions of an antenna at `lever_arm_m` from the IMU; `aids` = false keeps them for the alignment alone."""

    position_sd_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    aids: bool = True

    @model_validator(mode="after")
    def _has_positions(self) -> Self:
        if not self.placed:
            raise ValueError("no position: give 'latitude' and 'longitude', or 'north' and 'east'")
        return self


class Reference(Positioned):
    """What errors are measured against: position, velocity, attitude, of a point at `lever_arm_m` from the IMU.

    `note` stands in the report, for instance that the reference is made from the same sensors.
    """

    velocity_ned: Names | None = None
    velocity_body: Names | None = None
    roll: str | None = None
    pitch: str | None = None
    yaw: str | None = None
    attitude_unit: Literal["rad", "deg"] = "rad"
    note: str = ""

    @property
    def turned(self) -> bool:
        """Whether there are attitudes."""
        return self.roll is not None

    @model_validator(mode="after")
    def _parts_agree(self) -> Self:
        angles = (self.roll, self.pitch, self.yaw)
        if any(angle is not None for angle in angles) and None in angles:
            raise ValueError("'roll', 'pitch' and 'yaw' come together")
        if self.velocity_ned is not None and self.velocity_body is not None:
            raise ValueError("the velocity is given twice, as 'velocity_ned' and as 'velocity_body'")
        if self.velocity_ned is not None and not self.turned:
            raise ValueError(
                "'velocity_ned' needs 'roll', 'pitch' and 'yaw': errors are counted in platform axes"
            )
        if any(self.lever_arm_m) and not self.turned:
            raise ValueError("'lever_arm_m' needs 'roll', 'pitch' and 'yaw' to turn it")
        if not (self.placed or self.turned or self.velocity_body is not None):
            raise ValueError("the reference has neither position nor velocity nor attitude")
        return self
