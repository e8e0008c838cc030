"""Sections of a case file that map the columns of a log: quantity, unit, axes and clock."""

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.config.imu import ImuErrors, ImuLimits, MotionErrors
from bottomlock.config.section import InFolder, Mounting, Section, Vector, shown
from bottomlock.config.sensors import AcousticPositionErrors, DepthErrors, GpsErrors
from bottomlock.config.through_water import EffortErrors, ThrustErrors
from bottomlock.kernel.models import Finite, NonNegative, Positive, Whole
from bottomlock.recordings.rotation import UNCHANGED_AXES, Axes, check_axes

ColumnTriple = tuple[str, str, str]

ANGLE_UNITS = ("rad", "deg")


class Clock(Section):
    """Times of a table's rows: from a column, from an even rate, or both.

    With `column` alone the stamps are the times. With `rate_hz` alone row k is at `start_s` + k/rate. With both the
    rows are at an even rate, whose offset is the median of the (host's) stamps. A time that repeats or goes back is an
    error, or its row is left out where `unordered` is "drop".
    """

    column: Annotated[str | None, shown(example="time_ns")] = None
    """column of the stamps; none: the rows are at rate_hz"""
    unit: Literal["ns", "us", "ms", "s"] = "s"
    """unit of the stamps"""
    rate_hz: Annotated[Positive | None, shown(example=62.5)] = None
    """even rate of the rows; with a column the stamps give the begin only"""
    start_s: Finite = 0.0
    """time of the first row, without a column"""
    offset_s: Finite = 0.0
    """added to every time, to bring the stream to the clock of the case"""
    gap_s: Annotated[Positive | None, shown(example=0.5)] = None
    """step that counts as a gap; none: three median steps"""
    jump_s: Positive = 60.0
    """step that counts as a jump of the clock"""
    steady_within_s: Positive = 0.05
    """deviation of a stamp from the even rate that is allowed"""
    unordered: Literal["error", "drop"] = "error"
    """what a time that repeats or goes back does: error, or its row is dropped"""

    @model_validator(mode="after")
    def _gives_times(self) -> Self:
        if self.column is None and self.rate_hz is None:
            raise ValueError("a clock needs 'column' (stamps), 'rate_hz' (rows at an even rate) or both")
        if self.column is not None and "start_s" in self.model_fields_set:
            raise ValueError(
                "'start_s' is given beside 'column', which gives the times; use 'offset_s' to shift them"
            )
        return self


class Stream(Section):
    """A table of a case: file and clock; with `every` = n every n-th row is used."""

    file: Annotated[Path, InFolder, shown(example="imu.csv")]
    """table, CSV or Parquet, from the case's folder"""
    clock: Clock
    every: Annotated[Whole, Field(ge=1), shown(unit="1")] = 1
    """every n-th row is used; 1 for the IMU"""


class SensorStream(Stream):
    """A table whose columns, named by the keys `column_keys`, are the readings of a sensor."""

    column_keys: ClassVar[tuple[str, ...]] = ("column",)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        named = [getattr(self, key) for key in self.column_keys]
        return tuple(named[0]) if isinstance(named[0], tuple) else tuple(named)


class Reordered(Section):
    """A sensor with its own axes, reordered by `axes`."""

    axes: Axes = UNCHANGED_AXES
    """axes of the sensor, with sign, that point forward, starboard, down"""

    @model_validator(mode="after")
    def _axes_once(self) -> Self:
        check_axes(self.axes)
        return self


class ReorderedStream(Reordered, Stream):
    """A table of a sensor with its own axes."""


class MountedStream(Mounting, ReorderedStream):
    """A sensor whose axes, reordered, are rotated to platform axes by the mounting angles."""


class ImuStream(MountedStream):
    """Inertial sensors: specific force and angular rate, or their increments over an interval.

    Increments ("m/s", "rad", "deg") are divided by the column `interval` (s), or by 1/`rate_hz` of the clock; the
    result is the mean over the step that ends at the row, and the filter uses it as such. A gap longer than
    `bridge_gaps_s` is an error unless `limits.gap` is "inflate"; a shorter one is bridged by linear interpolation
    between its ends, and reported. `limits` are those of the readings.
    """

    source: Literal["readings"] = "readings"
    """where the readings are from: this table, or the attitude of a vehicle that has none"""
    force: Annotated[ColumnTriple, shown(example=["fx", "fy", "fz"])]
    """columns of the specific force"""
    omega: Annotated[ColumnTriple, shown(example=["wx", "wy", "wz"])]
    """columns of the angular rate"""
    force_unit: Literal["m/s2", "g", "mg", "m/s"] = "m/s2"
    """unit of the specific force; m/s: increments over the interval"""
    omega_unit: Literal["rad/s", "deg/s", "deg/h", "rad", "deg"] = "rad/s"
    """unit of the angular rate; rad, deg: increments over the interval"""
    interval: Annotated[str | None, shown(example="dt")] = None
    """column of the interval of increments, s; none: 1/clock.rate_hz"""
    sampling: Annotated[Literal["instantaneous", "averaged"] | None, shown(example="averaged")] = None
    """whether a reading is of its moment, or the mean over its interval; none: averaged for increments"""
    bridge_gaps_s: NonNegative = 0.0
    """longest gap that is bridged linearly"""
    limits: ImuLimits = ImuLimits()
    errors: ImuErrors

    @property
    def increments(self) -> tuple[bool, bool]:
        """Whether specific force and angular rate are recorded as increments."""
        return self.force_unit == "m/s", self.omega_unit in ANGLE_UNITS

    @property
    def averaged(self) -> bool:
        """Whether a reading is the mean over the step that it ends."""
        return self.sampling == "averaged" if self.sampling is not None else any(self.increments)

    @model_validator(mode="after")
    def _increments_have_an_interval(self) -> Self:
        if any(self.increments) and self.interval is None and self.clock.rate_hz is None:
            raise ValueError(
                f"units '{self.force_unit}' and '{self.omega_unit}' are increments: give 'interval' (a column, s) "
                "or clock.rate_hz"
            )
        if self.interval is not None and not any(self.increments):
            raise ValueError("'interval' is given, but no unit is that of an increment (m/s, rad, deg)")
        if self.every != 1:
            raise ValueError(
                f"'every' is {self.every}, expected 1: the strapdown needs every inertial reading"
            )
        return self


class ImuFromAttitude(Section):
    """With source = "attitude" there are no inertial readings: [attitude] turns the vehicle, and its velocity persists.

    A gap between attitudes of up to `bridge_gaps_s` is bridged by a turn at a constant rate; a longer one is an error.
    The misalignment of the filter is the error of the attitudes (docs/no_imu.md).
    """

    source: Literal["attitude"]
    """the readings are made from [attitude]"""
    bridge_gaps_s: NonNegative = 0.0
    """longest gap of the attitude that is bridged by a turn at a constant rate"""
    limits: ImuLimits = ImuLimits()
    errors: MotionErrors = MotionErrors()

    @property
    def averaged(self) -> bool:
        """Whether a reading is the mean over the step that it ends."""
        return True


def kind_of_imu(section: Any) -> str:  # noqa: ANN401 - what a file holds, or a section
    """Name of the class of a section [imu]."""
    source = section.get("source") if isinstance(section, dict) else getattr(section, "source", None)
    return ImuFromAttitude.__name__ if source == "attitude" else ImuStream.__name__


class DepthStream(DepthErrors, SensorStream):
    """Depth, height (`up` = true) or pressure: its column, density, and errors."""

    column: Annotated[str, shown(example="depth")]
    """column of depth, height or pressure"""
    unit: Literal["m", "cm", "ft", "Pa", "kPa", "mbar", "bar", "dbar"] = "m"
    """unit of the column"""
    up: bool = False
    """whether the column is positive up, a height"""
    offset_m: Finite = 0.0
    """added to the depth"""
    water_density_kg_per_m3: Positive = 1025.0
    """density, for pressures"""


class ThrustStream(ThrustErrors, SensorStream):
    """Revolutions of the propeller, the speed through the water (docs/howto/thrust.md): column, unit, and errors.

    Positive revolutions drive the vehicle forward. What-if cases leave them alone.
    """

    column: Annotated[str, shown(example="rpm")]
    """column of the revolutions, positive where they drive the vehicle forward"""
    unit: Literal["rpm", "Hz", "rad/s"]
    """unit of the column"""


class EffortStream(EffortErrors, SensorStream):
    """Forces of the thrusters, the speed through the water by drag (docs/howto/thrust.md): columns, mass, drag, errors.

    `force` are the columns of the sums along surge, sway and heave, N, positive forward, starboard and down. What-if
    cases leave them alone.
    """

    column_keys: ClassVar = ("force",)
    force: Annotated[ColumnTriple, shown(example=["x", "y", "z"])]
    """columns of the forces along surge, sway and heave, N, positive forward, starboard and down"""


class AttitudeStream(AttitudeReference, SensorStream):
    """Roll, pitch and yaw of a recorded attitude sensor: its columns, mounting and errors."""

    column_keys: ClassVar = ("roll", "pitch", "yaw")
    roll: Annotated[str, shown(example="roll")]
    """column of the roll"""
    pitch: Annotated[str, shown(example="pitch")]
    """column of the pitch"""
    yaw: Annotated[str, shown(example="yaw")]
    """column of the yaw"""
    unit: Literal["rad", "deg"] = "rad"
    """unit of the angles"""


class PositionStream(Stream):
    """Positions as latitude, longitude and height, or north, east and down in m (`height` is positive up)."""

    latitude: Annotated[str | None, shown(example="lat")] = None
    """column of the latitude"""
    longitude: Annotated[str | None, shown(example="lon")] = None
    """column of the longitude"""
    height: Annotated[str | None, shown(example="alt")] = None
    """column of the height, m, positive up"""
    angle_unit: Literal["rad", "deg"] = "deg"
    """unit of latitude and longitude"""
    north: Annotated[str | None, shown(example="north")] = None
    """column of the position north, m"""
    east: Annotated[str | None, shown(example="east")] = None
    """column of the position east, m"""
    down: Annotated[str | None, shown(example="down")] = None
    """column of the position down, m"""

    @property
    def geodetic(self) -> bool:
        """Whether positions are given as latitude and longitude."""
        return self.latitude is not None

    @property
    def has_position(self) -> bool:
        """Whether the stream has positions."""
        return self.latitude is not None or self.north is not None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.latitude is None) != (self.longitude is None):
            raise ValueError("only one of 'latitude' and 'longitude' is given, expected both or neither")
        if (self.north is None) != (self.east is None):
            raise ValueError("only one of 'north' and 'east' is given, expected both or neither")
        if self.latitude is not None and self.north is not None:
            raise ValueError("positions are given twice, as 'latitude' and as 'north': expected one of them")
        if self.height is not None and self.down is not None:
            raise ValueError("'height' (up) and 'down' are both given, expected one of them")
        return self


class PlacedStream(PositionStream):
    """A stream that has positions."""

    @model_validator(mode="after")
    def _has_positions(self) -> Self:
        if not self.has_position:
            raise ValueError("no position: give 'latitude' and 'longitude', or 'north' and 'east'")
        return self


class GpsStream(GpsErrors, PlacedStream):
    """GPS positions of an antenna at `lever_arm_m` from the IMU; with `aids` = false only the alignment uses them."""

    aids: bool = True
    """whether the filter uses it; the alignment may use it in any case"""


class AcousticPositionStream(AcousticPositionErrors, PlacedStream):
    """Acoustic positions (USBL, LBL): columns, and errors; `sd` are the columns of 1 sigma (m; north, east, down)."""

    sd: Annotated[ColumnTriple | None, shown(example=["sn", "se", "sd"])] = None
    """columns of the noise of north, east, down, m, 1 sigma; none: sd_m and sd_percent_of_range"""


class ReferenceStream(PositionStream):
    """Reference position, velocity and attitude, to compute errors against."""

    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the reference point from the IMU, platform axes"""
    velocity_ned: Annotated[ColumnTriple | None, shown(example=["vn", "ve", "vd"])] = None
    """columns of the velocity north, east, down, m/s; needs the attitude"""
    velocity_body: Annotated[ColumnTriple | None, shown(example=["u", "v", "w"])] = None
    """columns of the velocity forward, starboard, down, m/s"""
    roll: Annotated[str | None, shown(example="roll")] = None
    """column of the roll"""
    pitch: Annotated[str | None, shown(example="pitch")] = None
    """column of the pitch"""
    yaw: Annotated[str | None, shown(example="yaw")] = None
    """column of the yaw"""
    attitude_unit: Literal["rad", "deg"] = "rad"
    """unit of the angles"""
    sd_m: NonNegative = 0.0
    """1 sigma of a horizontal position of the reference"""
    note: Annotated[str, shown(example="post-processed with the same IMU")] = ""
    """sentence for the page, for instance on which sensors the reference depends"""

    @property
    def has_attitude(self) -> bool:
        """Whether the reference has attitudes."""
        return self.roll is not None

    @model_validator(mode="after")
    def _parts_agree(self) -> Self:
        angles = (self.roll, self.pitch, self.yaw)
        if any(angle is not None for angle in angles) and None in angles:
            raise ValueError("some of 'roll', 'pitch' and 'yaw' are missing, expected all three or none")
        if self.velocity_ned is not None and self.velocity_body is not None:
            raise ValueError("the velocity is given twice, as 'velocity_ned' and as 'velocity_body'")
        if self.velocity_ned is not None and not self.has_attitude:
            raise ValueError(
                "'velocity_ned' needs 'roll', 'pitch' and 'yaw': velocity errors are computed in the platform frame"
            )
        if any(self.lever_arm_m) and not self.has_attitude:
            raise ValueError(
                "'lever_arm_m' needs 'roll', 'pitch' and 'yaw' to rotate it to the tangent frame"
            )
        if not (self.has_position or self.has_attitude or self.velocity_body is not None):
            raise ValueError("[reference] has no columns, expected position, velocity or attitude")
        return self


class SensorStreams(Section):
    """The sections of the sensors of `recordings.sensors.SENSORS` that have a table of their own."""

    attitude: AttitudeStream | None = None
    depth: DepthStream | None = None
    thrust: ThrustStream | None = None
    effort: EffortStream | None = None
    gps: GpsStream | None = None
    acoustic_position: AcousticPositionStream | None = None
