"""Sections of a live configuration, in human units, each checked as it is read."""

from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from bottomlock.config.aiding_errors import AcousticPositionErrors, DepthErrors, GpsErrors
from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.config.effort import EffortErrors
from bottomlock.config.motion_errors import MotionErrors
from bottomlock.config.scenario_sections import Finite, Imu, ImuLimits, NonNegative, Positive, Section, Vector
from bottomlock.config.thrust import ThrustErrors
from bottomlock.config.water_cells import WaterCells
from bottomlock.io.formats import LIVE
from bottomlock.kernel import Method
from bottomlock.live.address import SinkAddress, SourceAddress
from bottomlock.recordings.rotation import UNCHANGED_AXES, Axes, check_axes
from bottomlock.recordings.sensors import INSTRUMENTS

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_\-]{1,40}$")]
Angle = Annotated[float, Field(ge=-360, le=360)]

DVL_FORMATS = tuple(LIVE)
"""Streams and messages with beams."""
FORMATS = {one.name: one.formats for one in INSTRUMENTS if one.formats}
"""Formats of the other readings, by the section that takes them; "mavlink" has several of them."""
ROS_TYPES = {
    "ros-dvl": "marine_acoustic_msgs/msg/Dvl",
    "ros-dvl-msgs": "dvl_msgs/msg/DVL",
    **{name: kind for one in INSTRUMENTS for name, kind in one.messages.items()},
}
"""Type of the messages of each format of ROS 2."""

if TYPE_CHECKING:
    SourceFormat = str
else:
    SourceFormat = Literal[
        (
            *DVL_FORMATS,
            *(one for formats in FORMATS.values() for one in formats),
            "mavlink",
        )
    ]


class ImuSection(Imu):
    """Inertial sensors: rate, errors and limits as in a scenario, and their axes and mounting.

    The sensor's axes, reordered by `axes`, are rotated to the platform's (forward, starboard, down) by the mounting.
    A gap of the readings is always bridged with its uncertainty (docs/imu_faults.md): what is too uncertain is not
    sent.
    """

    axes: Axes = UNCHANGED_AXES
    mounting_roll_deg: Angle = 0.0
    mounting_pitch_deg: Angle = 0.0
    mounting_yaw_deg: Angle = 0.0

    @model_validator(mode="after")
    def _axes_once(self) -> Self:
        check_axes(self.axes)
        return self

    @model_validator(mode="after")
    def _bridges_gaps(self) -> Self:
        if "gap" in self.limits.model_fields_set and self.limits.gap == "refuse":
            raise ValueError('limits.gap is "refuse", expected "inflate": live use bridges every gap')
        return self


class ImuFromAttitude(MotionErrors):
    """With source = "attitude" there are no inertial readings: [attitude] turns the vehicle, its velocity persists.

    The noise of the vehicle's accelerations is what a replay of its log says (docs/no_imu.md).
    """

    source: Literal["attitude"]
    limits: ImuLimits = ImuLimits()

    @model_validator(mode="after")
    def _states_accelerations(self) -> Self:
        if self.accel_noise_mps_per_rt_h is None:
            raise ValueError(
                "'accel_noise_mps_per_rt_h' is missing, expected number in m/s/√h, > 0: white noise of the vehicle's "
                "own accelerations, which `bottomlock replay` measures on a log"
            )
        return self


def kind_of_imu(section: Any) -> str:  # noqa: ANN401 - what a file holds, or a section
    """Name of the class of a section [imu]."""
    source = section.get("source") if isinstance(section, dict) else getattr(section, "source", None)
    return (ImuSection if source is None else ImuFromAttitude).__name__


AttitudeMessage = Literal["ATTITUDE", "ATTITUDE_QUATERNION"]
"""MAVLink messages of an attitude."""


class AttitudeSection(AttitudeReference):
    """Attitude or heading reference: its mounting, its errors and what the filter uses of it, as in a replay case.

    `message` is the MAVLink message of a source `mavlink`, whose frames are always NED and FRD.
    """

    message: AttitudeMessage = "ATTITUDE"


class DepthSection(DepthErrors):
    """Depth sensor: noise and bias (1 sigma), lever arm; density and surface pressure turn a pressure into a depth.

    `message` is the MAVLink message of the water's pressure: on ArduSub it is SCALED_PRESSURE2.
    """

    sd_m: Positive = 0.05
    water_density_kg_per_m3: Positive = 1025.0
    surface_pressure_pa: Positive = 101_325.0
    message: Literal["SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3"] = "SCALED_PRESSURE"

    def depth_m(self, pressure_pa: float, gravity_mps2: float) -> float:
        """Depth below the surface, m, of the water's absolute pressure."""
        return (pressure_pa - self.surface_pressure_pa) / (self.water_density_kg_per_m3 * gravity_mps2)


class AidingSections(Section):
    """The sections of the sensors of `recordings.sensors.SENSORS`."""

    attitude: AttitudeSection | None = None
    depth: DepthSection | None = None
    gps: GpsErrors | None = None
    acoustic_position: AcousticPositionErrors | None = None
    water_track: WaterCells | None = None
    thrust: ThrustErrors | None = None
    effort: EffortErrors | None = None


class OriginSection(Section):
    """Where the vehicle is: latitude, for gravity and the Earth's rate; all three for GPS positions.

    `height_m` is the origin's as the receiver counts: above the ellipsoid, or above the sea.
    """

    latitude_deg: Annotated[float, Field(ge=-90, le=90)]
    longitude_deg: Annotated[float, Field(ge=-360, le=360)] | None = None
    height_m: Finite = 0.0
    gravity: Literal["normal"] | Positive = "normal"
    earth: Literal["ellipsoid", "tangent_plane"] = "ellipsoid"


HEADING_SD_DEG = 2.0
"""1 sigma of a heading that is given without one: dynamic accuracy of a magnetic AHRS (config/grades/attitude.toml)."""
LEVELLING_SD_DEG = 1.0
"""1 sigma of levelling in a moving vehicle, where the file states none."""


class StartSection(Section):
    """Initial alignment: level by the accelerometers over `window_s`, heading given, velocity by the beams or given.

    `heading_deg` is that of the platform when the program starts; left out, it is the yaw of [attitude]. With `level` =
    "attitude", as always without inertial readings, [attitude] gives roll and pitch, too, and there is no window.
    Without `position_m` the vehicle begins at the origin, at the depth of [depth] where one has come.
    `level_sd_deg` is 1 sigma of roll and pitch; the vehicle's own acceleration during the window belongs to it. What
    [attitude] gives has the 1 sigma of that section, unless it is stated here. There is no start where the
    accelerometers measure a tilt above `largest_tilt_deg`, or gravity elsewhere than below that attitude.
    """

    window_s: Positive = 5.0
    level: Literal["levelling", "attitude"] | None = None
    level_sd_deg: Positive | None = None
    largest_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 60.0
    heading_deg: Angle | None = None
    heading_sd_deg: Annotated[Positive | None, Field(validate_default=True)] = None
    position_m: Vector = (0.0, 0.0, 0.0)
    position_sd_m: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 1.0)
    velocity: Literal["beams", "given"] = "beams"
    velocity_mps: Vector = (0.0, 0.0, 0.0)
    velocity_sd_mps: tuple[Positive, Positive, Positive] = (0.1, 0.1, 0.1)

    @field_validator("heading_sd_deg", mode="after")
    @classmethod
    def _given_with_its_heading(cls, sd_deg: float | None, info: ValidationInfo) -> float | None:
        if sd_deg is None and info.data.get("heading_deg") is not None:
            raise PydanticCustomError("missing", "Field required")
        return sd_deg


class NavigationSection(Section):
    """Mode navigation: the aiding method, and how late a measurement may be.

    A ping is of the time when it was reflected, and arrives some hundredths to tenths of a second after it. Up to
    `horizon_s` it is put in its place (docs/late_data.md). The ports are given an estimate `estimate_hz` times a
    second, and one after each ping.
    """

    method: Method = "tc"
    horizon_s: Annotated[float, Field(gt=0, le=10)] = 2.0
    estimate_hz: Annotated[float, Field(gt=0, le=1000)] = 20.0


class StatesSection(Section):
    """Where the conditions of the states begin (docs/live.md).

    `rejected_pings` is less than `filter.inflate_after_rejections`, with which the gate opens again.
    """

    silent_periods: Annotated[float, Field(ge=1, le=1000)] = 3.0
    silent_least_s: NonNegative = 0.1
    settle_s: NonNegative = 1.0
    velocity_sd_mps: Positive = 0.5
    rejected_pings: Annotated[int, Field(ge=1, le=10_000)] = 4
    closure_ratio: Annotated[float, Field(ge=1.0, le=1000.0)] = 3.0


class SourceSection(Section):
    """A stream of bytes: where it comes from, its format, and its clock.

    `rate_hz` is the least rate that is expected of it: it is silent after `states.silent_periods` of that. `clock`:
    "instrument" maps its own stamps to the host's clock; "host" takes them as they are; "arrival" takes the time of
    arrival. `latency_s` is subtracted from the times. A stamp that is further than `step_s` from where the clock
    should be is not used. `checksum` demands one of every line of numbers; without it they are demanded from the first
    line that has one. `request_hz` is the rate at which an autopilot is asked for what is read of it, 10 Hz at most of
    what does not move the vehicle.
    """

    name: Name
    address: SourceAddress
    format: SourceFormat
    rate_hz: Annotated[float, Field(gt=0, le=10_000)]
    clock: Literal["instrument", "host", "arrival"] = "instrument"
    latency_s: Annotated[float, Field(ge=-10, le=10)] = 0.0
    step_s: Annotated[float, Field(gt=0, le=60)] = 0.1
    negate_beams: bool = False
    keep_stale: bool = False
    checksum: bool = False
    request_hz: Annotated[float, Field(gt=0, le=1000)] | None = None

    @model_validator(mode="after")
    def _messages_stay_whole(self) -> Self:
        if self.address.startswith("ros:") and self.format not in ROS_TYPES:
            raise ValueError(
                f"source '{self.name}' is a topic of ROS 2 with format '{self.format}', expected one of "
                f"{', '.join(ROS_TYPES)}"
            )
        if self.format in ROS_TYPES and not self.address.startswith("ros:"):
            raise ValueError(
                f"source '{self.name}' has format '{self.format}', which are messages, and address "
                f"'{self.address}', expected ros:/TOPIC"
            )
        if self.format == "ros-depth" and self.clock != "arrival":
            raise ValueError(
                f'source \'{self.name}\' has clock = "{self.clock}", expected "arrival": '
                f"{ROS_TYPES[self.format]} has no stamp"
            )
        return self

    @model_validator(mode="after")
    def _flags_of_a_format(self) -> Self:
        if self.request_hz is not None and self.format != "mavlink":
            raise ValueError(
                f"'request_hz' belongs to MAVLink, and source '{self.name}' has format '{self.format}'"
            )
        if "checksum" in self.model_fields_set and not self.format.endswith("-csv"):
            raise ValueError(
                f"'checksum' belongs to lines of numbers ({', '.join(one.line for one in INSTRUMENTS if one.line)}), "
                f"and source '{self.name}' has format '{self.format}', whose records have their own"
            )
        for key in ("negate_beams", "keep_stale"):
            if key in self.model_fields_set and self.format not in DVL_FORMATS:
                raise ValueError(
                    f"'{key}' belongs to a DVL, and source '{self.name}' has format '{self.format}'"
                )
        return self


class PortSection(Section):
    """A target: the kind of port, where it goes, its greatest rate (by default the port's own), its other settings."""

    port: str
    to: SinkAddress
    rate_hz: Annotated[float, Field(gt=0, le=1000)] | None = None
    settings: dict[str, Any] = Field(default_factory=dict)


class LogSection(Section):
    """The raw log: every byte with its time of arrival, as MCAP, a new file at each start."""

    folder: str
    flush_s: Annotated[float, Field(ge=0, le=60)] = 0.5


class CheckpointSection(Section):
    """The navigator saved to a file every `every_s`; a start continues from it if it is not older than `max_age_s`."""

    file: str
    every_s: Annotated[float, Field(ge=0.1, le=60)] = 1.0
    max_age_s: Annotated[float, Field(gt=0, le=60)] = 5.0


class HealthSection(Section):
    """The health page: address and TCP port."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65_535)] = 8770
    names: tuple[str, ...] = ()


class DiagnosticsSection(Section):
    """Diagnostics of ROS 2, `diagnostic_msgs/DiagnosticArray`: where to, and how often."""

    to: SinkAddress = "ros:/diagnostics"
    every_s: Annotated[float, Field(ge=0.1, le=60)] = 1.0


VelocityMethod = Literal["info", "plcf", "lc"]
"""Methods that hold no assumption: what the beams do not see is absent."""


class VelocitySection(Section):
    """Mode velocity: how a ping is solved, and what no vehicle does from one ping to the next."""

    method: VelocityMethod = "info"
    acceleration_mps2: Annotated[float, Field(gt=0, le=100)] = 1.0
