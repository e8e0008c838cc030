"""Sections of a live configuration, in human units, each checked as it is read."""

from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.config.imu import Imu, ImuLimits, MotionErrors
from bottomlock.config.section import Earth, InFolder, Mounting, Section, Vector, shown
from bottomlock.config.sensors import AidingSections, DepthErrors
from bottomlock.io.formats import LIVE
from bottomlock.kernel import RECOMMENDED_METHOD, Method
from bottomlock.kernel.models import Finite, NonNegative, Positive, Real, Whole
from bottomlock.ports.address import checked_by, checked_host, sink_address, source_address
from bottomlock.ports.estimate import VelocityMethod
from bottomlock.ports.port import RateHz
from bottomlock.recordings.sensors import INSTRUMENTS
from bottomlock.recordings.stream_sections import Reordered

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_\-]{1,40}$")]
Angle = Annotated[Real, Field(ge=-360, le=360)]

SourceAddress = Annotated[str, checked_by(source_address)]
SinkAddress = Annotated[str, checked_by(sink_address)]
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
        (*DVL_FORMATS, *(one for formats in FORMATS.values() for one in formats), "mavlink")
    ]


class ImuSection(Mounting, Reordered, Imu):
    """Inertial sensors: rate, errors and limits as in a scenario, and their axes and mounting.

    The sensor's axes, reordered by `axes`, are rotated to the platform's (forward, starboard, down) by the mounting.
    A gap of the readings is always bridged with its uncertainty (docs/imu_faults.md): what is too uncertain is not
    sent.
    """

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
    """the attitudes of [attitude] take the place of inertial readings"""
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
    """MAVLink message of the attitude"""


class DepthSection(DepthErrors):
    """Depth sensor: noise and bias (1 sigma), lever arm; density and surface pressure turn a pressure into a depth.

    `message` is the MAVLink message of the water's pressure: on ArduSub it is SCALED_PRESSURE2.
    """

    sd_m: Positive = 0.05
    water_density_kg_per_m3: Positive = 1025.0
    """density, for pressures"""
    surface_pressure_pa: Positive = 101_325.0
    """pressure at the surface"""
    message: Literal["SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3"] = "SCALED_PRESSURE"
    """MAVLink message of the water's pressure; on ArduSub SCALED_PRESSURE2"""

    def depth_m(self, pressure_pa: float, gravity_mps2: float) -> float:
        """Depth below the surface, m, of the water's absolute pressure."""
        return (pressure_pa - self.surface_pressure_pa) / (self.water_density_kg_per_m3 * gravity_mps2)


class LiveSections(AidingSections):
    """The sensors that aid; of two of them live needs more than a filter does."""

    attitude: AttitudeSection | None = None
    depth: DepthSection | None = None


class OriginSection(Earth):
    """Where the vehicle is: latitude, for gravity and the Earth's rate; all three for GPS positions.

    `height_m` is the origin's as the receiver counts: above the ellipsoid, or above the sea.
    """

    latitude_deg: Annotated[Real, Field(ge=-90, le=90), shown(example=42.3)]
    """latitude, for gravity and the Earth's rate"""
    longitude_deg: Annotated[Annotated[Real, Field(ge=-360, le=360)] | None, shown(example=9.1)] = None
    """longitude; needed by [gps] alone"""
    height_m: Finite = 0.0
    """height of the origin, as the GPS receiver counts it"""


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

    window_s: Annotated[Real, Field(gt=0, le=3600)] = 5.0
    """time that levelling averages over"""
    level: Annotated[Literal["levelling", "attitude"] | None, shown(example="attitude")] = None
    """source of roll and pitch: the accelerometers, or [attitude]; none: the accelerometers where there are
    inertial readings"""
    level_sd_deg: Annotated[Positive | None, shown(example=1.0)] = None
    """1 sigma of roll and pitch, the vehicle's own acceleration included; none: 1 by levelling, that of [attitude]
    otherwise"""
    largest_tilt_deg: Annotated[Real, Field(gt=0, le=180)] = 60.0
    """tilt that the accelerometers may measure at the start"""
    heading_deg: Annotated[Angle | None, shown(example=90.0)] = None
    """heading of the platform when the program starts; none: that of [attitude]"""
    heading_sd_deg: Annotated[Positive | None, Field(validate_default=True), shown(example=5.0)] = None
    """1 sigma of that heading; none: that of [attitude], which only then can be left out"""
    position_m: Vector = (0.0, 0.0, 0.0)
    """north, east, down at the start"""
    position_sd_m: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 1.0)
    """1 sigma of that position"""
    velocity: Literal["beams", "given"] = "beams"
    """source of the velocity: the first ping of rank 3, or given"""
    velocity_mps: Vector = (0.0, 0.0, 0.0)
    """surge, sway, heave, for velocity given"""
    velocity_sd_mps: tuple[Positive, Positive, Positive] = (0.1, 0.1, 0.1)
    """1 sigma of surge, sway, heave"""

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

    method: Method = RECOMMENDED_METHOD
    """aiding method"""
    horizon_s: Annotated[Real, Field(gt=0, le=10)] = 2.0
    """how late a measurement may be and still be put in its place"""
    estimate_hz: Annotated[RateHz, Field(le=1000), shown(unit="Hz")] = 20.0
    """estimates a second beside one after each ping"""


class StatesSection(Section):
    """Where the conditions of the states begin (docs/live.md).

    `rejected_pings` is less than `filter.inflate_after_rejections`, with which the gate opens again.
    """

    silent_periods: Annotated[Real, Field(ge=1, le=1000), shown(unit="1")] = 3.0
    """periods of a source without a message after which it is silent"""
    silent_least_s: Annotated[Real, Field(ge=0, le=3600)] = 0.1
    """least time of that"""
    settle_s: Annotated[Real, Field(ge=0, le=3600)] = 1.0
    """time without a worse condition before a state improves"""
    velocity_sd_mps: Positive = 0.5
    """1 sigma of a velocity axis above which the state is UNSAFE"""
    rejected_pings: Annotated[Whole, Field(ge=1, le=10_000), shown(unit="1")] = 4
    """pings rejected in a row after which the state is UNSAFE"""
    agree_s: Annotated[Real, Field(ge=0, le=3600)] = 10.0
    """time UNSAFE after such pings: the estimate may have followed beams that were false"""
    closure_ratio: Annotated[Real, Field(ge=1.0, le=1000.0), shown(unit="1")] = 3.0
    """scatter of the beams' closure over the claimed one, over 20 complete pings, above which the state is UNSAFE"""


_LINES = tuple(one.line for one in INSTRUMENTS if one.line)
_KEYS_OF = {
    **dict.fromkeys(("request_hz", "system", "component"), ("MAVLink", ("mavlink",))),
    **dict.fromkeys(("negate_beams", "keep_stale"), ("a DVL", DVL_FORMATS)),
    "checksum": (f"lines of numbers ({', '.join(_LINES)})", _LINES),
}
"""Keys of a source that not every format has: whose they are, and the formats."""


class SourceSection(Section):
    """A stream of bytes: where it comes from, its format, and its clock."""

    name: Annotated[Name, shown(example="dvl")]
    """name of the source"""
    address: Annotated[
        SourceAddress,
        shown(
            range="tcp:, tcpin:, udpin:, udpout:, serial:, file:, stdin, ros: (docs/live.md)",
            example="tcp:192.168.194.95:16171",
        ),
    ]
    """where the bytes come from"""
    format: Annotated[SourceFormat, shown(example="waterlinked-json")]
    """format of the bytes"""
    rate_hz: Annotated[RateHz, Field(le=10_000), shown(example=4.0)]
    """least rate that is expected"""
    clock: Literal["instrument", "host", "arrival"] = "instrument"
    """instrument: its stamps, mapped to the host's clock; host: its stamps as they are; arrival: the time of arrival"""
    latency_s: Annotated[Real, Field(ge=-10, le=10)] = 0.0
    """subtracted from the times"""
    step_s: Annotated[Real, Field(gt=0, le=60)] = 0.1
    """distance of a stamp from where the clock should be, beyond which it is not used"""
    negate_beams: bool = False
    """whether the velocities of the beams are positive away from the bottom; of a DVL"""
    keep_stale: bool = False
    """whether beams that repeat the previous record stay valid; of a DVL"""
    checksum: bool = False
    """whether every line needs a checksum, or those after the first that has one; imu-csv, attitude-csv and
    depth-csv"""
    request_hz: Annotated[Annotated[RateHz, Field(le=1000)] | None, shown(example=50.0)] = None
    """rate at which the autopilot is asked for what is read of it (SET_MESSAGE_INTERVAL); none: not asked; of
    mavlink"""

    system: Annotated[Annotated[Whole, Field(ge=1, le=255)] | None, shown(example=1, unit="1")] = None
    """system that is read, of mavlink; none: that of the first reading, and no other"""
    component: Annotated[Annotated[Whole, Field(ge=1, le=255)] | None, shown(example=1, unit="1")] = None
    """component that is read, of mavlink; none: that of the first reading, and no other"""

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
    def _keys_of_its_format(self) -> Self:
        for key, (of, formats) in _KEYS_OF.items():
            if key in self.model_fields_set and self.format not in formats:
                raise ValueError(
                    f"'{key}' belongs to {of}, and source '{self.name}' has format '{self.format}'"
                )
        return self


class PortSection(Section):
    """A target: the kind of port, where it goes, its greatest rate (by default the port's own), its other settings."""

    port: Annotated[str, shown(range="a name of docs/ports.md", example="vision_speed_estimate")]
    """kind of port (docs/ports.md)"""
    to: Annotated[
        SinkAddress,
        shown(
            range="tcp:, tcpin:, udpout:, serial:, file:, ros:, stdout (docs/live.md)",
            example="udpout:127.0.0.1:14550",
        ),
    ]
    """where the messages go"""
    rate_hz: Annotated[Annotated[RateHz, Field(le=1000)] | None, shown(example=10.0)] = None
    """greatest rate; none: the port's own"""
    settings: Annotated[dict[str, Any], shown(range="keys of the port", example={"system": 1})] = Field(
        default_factory=dict
    )
    """other settings of the port (docs/ports.md)"""


class LogSection(Section):
    """The raw log: every byte with its time of arrival, as MCAP, a new file at each start."""

    folder: Annotated[str, InFolder, shown(example="logs")]
    """folder of the raw logs, from the configuration's"""
    flush_s: Annotated[Real, Field(ge=0, le=60)] = 0.5
    """time after which bytes are on the disk"""


class CheckpointSection(Section):
    """The navigator saved to a file every `every_s`; a start continues from it if it is not older than `max_age_s`."""

    file: Annotated[str, InFolder, shown(example="rov.checkpoint")]
    """file of the saved navigator, from the configuration's folder"""
    every_s: Annotated[Real, Field(ge=0.1, le=60)] = 1.0
    """interval between two savings"""
    max_age_s: Annotated[Real, Field(gt=0, le=60)] = 5.0
    """age up to which a start goes on from it"""


class HealthSection(Section):
    """The health page: address and TCP port."""

    host: Annotated[str, AfterValidator(checked_host)] = "127.0.0.1"
    """address that the page listens on"""
    port: Annotated[Whole, Field(ge=0, le=65_535), shown(unit="1")] = 8770
    """TCP port of the page; 0 any free one"""
    names: Annotated[tuple[str, ...], shown(example=["rov.local"])] = ()
    """host names under which the page may be asked, beside addresses, localhost and host"""


class DiagnosticsSection(Section):
    """Diagnostics of ROS 2, `diagnostic_msgs/DiagnosticArray`: where to, and how often."""

    to: Annotated[SinkAddress, shown(range="as port.to")] = "ros:/diagnostics"
    """where the diagnostics go"""
    every_s: Annotated[Real, Field(ge=0.1, le=60)] = 1.0
    """interval between two of them"""


class VelocitySection(Section):
    """Mode velocity: how a ping is solved, and what no vehicle does from one ping to the next."""

    method: VelocityMethod = "info"
    """how a ping is solved: observable axes, platform components, or the whole velocity alone"""
    acceleration_mps2: Annotated[Real, Field(gt=0, le=100)] = 1.0
    """largest acceleration along a beam; a beam that changes faster is an outlier and not used"""
