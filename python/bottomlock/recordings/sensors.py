"""The sensors beside IMU and DVL, each declared once for a case, a live configuration and a program's readings.

A sensor is a section with its errors (`kernel_models`, `kernel_options`), a reading and an entry of `SENSORS`. Beside
it, only the models of the files name the sensors one by one; the readings of a simulation are in `config.sensors`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bottomlock import units
from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.config.sensors import AcousticPositionErrors, DepthErrors, GpsErrors, WaterCells
from bottomlock.config.through_water import DriveErrors, EffortErrors, ThrustErrors
from bottomlock.geodesy import Place, geodetic_from_tangent, tangent_from_geodetic
from bottomlock.kernel import Navigator, Report
from bottomlock.recordings.drives import SpeedByForces, speed_by_revolutions
from bottomlock.recordings.readings import (
    AcousticPositionReading,
    AttitudeReading,
    DepthReading,
    EffortReading,
    GpsReading,
    ImuReading,
    SpeedReading,
    ThrustReading,
    WaterReading,
)
from bottomlock.recordings.rotation import angles, quaternion

MOST_LATITUDE_DEG, MOST_LONGITUDE_DEG = 90.0, 360.0
FILLER = 1e12
"""The kernel takes no such number, in SI: it stands for a missing value."""
Reports = Sequence[Report]
Arrays = dict[str, np.ndarray]
Logged = Mapping[str, Arrays]
"""Arrays of the kernel's log, by the name of their times."""
Maker = Callable[[int, int], Any]
"""The reading of a time and the row of its stream."""


@dataclass(frozen=True)
class Numbers:
    """A field of a reading: its name, how many numbers it has (0 for one by itself), of what; None where `optional`."""

    name: str
    count: int
    unit: str
    optional: bool = False


@dataclass(frozen=True, eq=False)
class Instrument:
    """How readings of a kind come one at a time.

    Attributes:
        name: section of a case and of a live configuration.
        reading: their class.
        numbers: its fields after the time.
        line: live format of lines of numbers; "" where there is none.
        columns: of such a line after its time, SI; those in `more` may be left out.
        more: see `columns`.
        make: reading of a time and the numbers of a line, None for numbers that cannot be; its fields in a row unless
            it is given.
        messages: live formats of ROS 2, and the type of the message of each.
        mavlink: whether a source of MAVLink has such readings.
    """

    name: str
    reading: type
    numbers: tuple[Numbers, ...] = ()
    line: str = ""
    columns: tuple[str, ...] = ()
    more: tuple[str, ...] = ()
    make: Callable[[int, list[float]], Any] | None = None
    messages: Mapping[str, str] = field(default_factory=dict)
    mavlink: bool = False

    def of_line(self, time_ns: int, values: list[float]) -> Any:  # noqa: ANN401 - of its class
        """The reading of a line's time and numbers; None for numbers that cannot be."""
        if max(map(abs, values), default=0.0) >= FILLER:
            return None
        if self.make is not None:
            return self.make(time_ns, values)
        rest = iter(values)
        return self.reading(
            time_ns,
            *(tuple(next(rest) for _ in range(of.count)) if of.count else next(rest) for of in self.numbers),
        )

    @property
    def formats(self) -> tuple[str, ...]:
        """Live formats that have such readings alone."""
        return (*([self.line] if self.line else []), *self.messages)

    @property
    def header(self) -> str:
        """The columns of a line as one writes them."""
        more = f"[,{','.join(self.more)}]" if self.more else ""
        return ",".join(("time_ns", *self.columns)) + more


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensor(Instrument):
    """An instrument that aids.

    Attributes:
        settings: class of its section in every settings file, or the base of it.
        updates: the kernel's names of its measurements in reports.
        made: of a section, what makes of each reading and the angular rate at it (3,), rad/s, in the order of their
            times, the `SpeedReading` that is pushed in its place.
        push: gives a reading to a navigator, with its section and the origin of the tangent frame, where it is known;
            an attitude is that of the platform.
        arrays: the kernel's log arrays, by the fields of a recorded stream (`recordings.streams`), which are those of a
            reading.
        log: the arrays of a stream and its section, by the name of their times; as `arrays` says unless it is given.
        rows: readings of a stream and the origin; of its fields unless it is given.
    """

    settings: type
    updates: tuple[str, ...]
    push: Callable[[Navigator, Any, Any, Place | None], Reports]
    made: Callable[[Any], Callable[[Any, np.ndarray], SpeedReading]] | None = None
    arrays: Mapping[str, str] = field(default_factory=dict)
    log: Callable[[Any, Any], Logged] | None = None
    rows: Callable[[Any, Place | None], Maker] | None = None

    def logged(self, stream: Any, section: Any, rows: slice, omega_p_radps: np.ndarray) -> Logged:  # noqa: ANN401
        """The kernel's log arrays of rows of a recorded stream, by the name of their times; with their rates (n, 3)."""
        if self.made is not None:
            made, reading = self.made(section), self.readings(stream, None)
            taken = zip(
                range(len(stream.time_ns))[rows], stream.time_ns[rows].tolist(), omega_p_radps, strict=True
            )
            speeds = [made(reading(at_ns, k), omega).speed_p_mps for k, at_ns, omega in taken]
            return {"thrust": {"thrust_speed_p_mps": np.array(speeds).reshape(-1, 3)}}
        if self.log is not None:
            found = self.log(stream, section)
        else:
            fields = {key: getattr(stream, name) for name, key in self.arrays.items()}
            found = {self.name: {key: values for key, values in fields.items() if values is not None}}
        return {name: {key: values[rows] for key, values in arrays.items()} for name, arrays in found.items()}

    def readings(self, stream: Any, home: Place | None) -> Maker:  # noqa: ANN401 - of any sensor
        """The reading of a time and a row of a recorded stream."""
        if self.rows is not None:
            return self.rows(stream, home)
        columns = [None if (of := getattr(stream, name)) is None else of.tolist() for name in self.arrays]
        return lambda time_ns, k: self.reading(
            time_ns,
            *(None if of is None else tuple(of[k]) if isinstance(of[k], list) else of[k] for of in columns),
        )


def is_on_earth(latitude_deg: float, longitude_deg: float) -> bool:
    """Whether these can be a latitude and a longitude."""
    return abs(latitude_deg) <= MOST_LATITUDE_DEG and abs(longitude_deg) <= MOST_LONGITUDE_DEG


def _attitude_line(time_ns: int, values: list[float]) -> AttitudeReading:
    roll, pitch, yaw = values
    return AttitudeReading(time_ns, quaternion(roll, pitch, yaw))


def _gps_line(time_ns: int, values: list[float]) -> GpsReading | None:
    latitude, longitude, height = values
    return GpsReading(time_ns, latitude, longitude, height) if is_on_earth(latitude, longitude) else None


def _acoustic_line(time_ns: int, values: list[float]) -> AcousticPositionReading | None:
    north, east, down, *stated = values
    if stated and min(stated) <= 0.0:
        return None
    sd_m = (stated[0], stated[1], stated[2]) if stated else None
    return AcousticPositionReading(time_ns, (north, east, down), sd_m)


def _push_attitude(
    navigator: Navigator, reading: AttitudeReading, section: AttitudeReference, _: Place | None
) -> Reports:
    """The whole attitude, or its heading alone."""
    yaw_sd_rad = units.rad_from_deg(section.yaw_sd_deg)
    if section.aids == "heading":
        yaw = angles(reading.attitude_t_s)[2]
        return navigator.push_heading(reading.time_ns, yaw, sd_rad=yaw_sd_rad)
    if section.aids == "nothing":
        return ()
    return navigator.push_attitude(
        reading.time_ns,
        reading.attitude_t_s,
        roll_pitch_sd_rad=units.rad_from_deg(section.roll_pitch_sd_deg),
        yaw_sd_rad=yaw_sd_rad,
    )


def _attitude_log(stream: Any, section: AttitudeReference) -> Logged:  # noqa: ANN401
    if section.aids == "heading":
        return {"heading": {"heading_rad": stream.rpy_rad[:, 2].copy()}}
    if section.aids == "nothing":
        return {}
    return {"attitude": {"attitude_t_p": stream.attitude.as_quat(scalar_first=True)}}


def _attitude_rows(stream: Any, _: Place | None) -> Maker:  # noqa: ANN401
    rows = stream.attitude.as_quat(scalar_first=True).tolist()
    return lambda time_ns, k: AttitudeReading(time_ns, tuple(rows[k]))


def _push_gps(navigator: Navigator, reading: GpsReading, section: GpsErrors, home: Place | None) -> Reports:
    assert home is not None  # validated
    latitude, longitude = units.rad_from_deg(reading.latitude_deg), units.rad_from_deg(reading.longitude_deg)
    position_t_m = tangent_from_geodetic(latitude, longitude, reading.height_m, home)
    return navigator.push_position(reading.time_ns, position_t_m, position_sd_m=section.position_sd_m)


def _gps_rows(stream: Any, home: Place | None) -> Maker:  # noqa: ANN401
    geodetic = stream.geodetic
    if geodetic is None:
        assert home is not None  # asked for by the caller
        latitude, longitude, height = geodetic_from_tangent(stream.position_t_m, home)
        geodetic = np.column_stack([np.rad2deg(latitude), np.rad2deg(longitude), height])
    places = geodetic.tolist()
    return lambda time_ns, k: GpsReading(time_ns, *places[k])


IMU = Instrument(
    "imu",
    ImuReading,
    (Numbers("omega_radps", 3, "rad/s"), Numbers("force_mps2", 3, "m/s²")),
    "imu-csv",
    ("wx", "wy", "wz", "fx", "fy", "fz"),
    messages={"ros-imu": "sensor_msgs/msg/Imu"},
    mavlink=True,
)
DEPTH = Sensor(
    "depth",
    DepthReading,
    (Numbers("depth_m", 0, "m"),),
    "depth-csv",
    ("depth_m",),
    messages={"ros-pressure": "sensor_msgs/msg/FluidPressure", "ros-depth": "std_msgs/msg/Float64"},
    mavlink=True,
    settings=DepthErrors,
    updates=("depth",),
    push=lambda navigator, reading, section, _: navigator.push_depth(
        reading.time_ns, reading.depth_m, sd_m=section.sd_m
    ),
    arrays={"depth_m": "depth_m"},
)
ATTITUDE = Sensor(
    "attitude",
    AttitudeReading,
    (Numbers("attitude_t_s", 4, "a quaternion, scalar first"),),
    "attitude-csv",
    ("roll", "pitch", "yaw"),
    make=_attitude_line,
    messages={"ros-attitude": "sensor_msgs/msg/Imu"},
    mavlink=True,
    settings=AttitudeReference,
    updates=("attitude", "heading"),
    push=_push_attitude,
    log=_attitude_log,
    rows=_attitude_rows,
)
GPS = Sensor(
    "gps",
    GpsReading,
    (Numbers("latitude_deg", 0, "deg"), Numbers("longitude_deg", 0, "deg"), Numbers("height_m", 0, "m")),
    "gps-csv",
    ("latitude_deg", "longitude_deg", "height_m"),
    make=_gps_line,
    messages={"ros-navsat": "sensor_msgs/msg/NavSatFix"},
    mavlink=True,
    settings=GpsErrors,
    updates=("gps_position",),
    push=_push_gps,
    log=lambda stream, section: {"gps": {"gps_position_t_m": stream.position_t_m}} if section.aids else {},
    rows=_gps_rows,
)
ACOUSTIC_POSITION = Sensor(
    "acoustic_position",
    AcousticPositionReading,
    (
        Numbers("position_t_m", 3, "m north, east, down"),
        Numbers("sd_m", 3, "m of each axis, or None", optional=True),
    ),
    "acoustic-csv",
    ("north_m", "east_m", "down_m"),
    ("sd_n", "sd_e", "sd_d"),
    make=_acoustic_line,
    messages={"ros-pose": "geometry_msgs/msg/PoseWithCovarianceStamped"},
    settings=AcousticPositionErrors,
    updates=("acoustic_position",),
    push=lambda navigator, reading, _section, _: navigator.push_acoustic_position(
        time_ns=reading.time_ns, position_t_m=reading.position_t_m, sd_m=reading.sd_m
    ),
    arrays={"position_t_m": "acoustic_position_t_m", "sd_m": "acoustic_position_sd_m"},
)


def _push_speed(
    navigator: Navigator, reading: SpeedReading, section: DriveErrors, _: Place | None
) -> Reports:
    return navigator.push_thrust(reading.time_ns, reading.speed_p_mps, sd_mps=section.noise_mps)


_BY_DRIVES = ("thrust_surge", "thrust_sway", "thrust_heave")
THRUST = Sensor(
    "thrust",
    ThrustReading,
    (Numbers("revolutions_hz", 0, "1/s"),),
    "thrust-csv",
    ("revolutions_hz",),
    settings=ThrustErrors,
    updates=_BY_DRIVES,
    made=speed_by_revolutions,
    push=_push_speed,
    rows=lambda stream, _: lambda time_ns, k: ThrustReading(time_ns, float(stream.revolutions_hz[k])),
)
EFFORT = Sensor(
    "effort",
    EffortReading,
    (Numbers("force_p_n", 3, "N"),),
    "effort-csv",
    ("surge_n", "sway_n", "heave_n"),
    settings=EffortErrors,
    updates=_BY_DRIVES,
    made=SpeedByForces,
    push=_push_speed,
    rows=lambda stream, _: lambda time_ns, k: EffortReading(time_ns, tuple(stream.force_p_n[k].tolist())),
)
WATER_TRACK = Sensor(
    "water_track",
    WaterReading,
    settings=WaterCells,
    updates=("water_track",),
    push=lambda navigator, reading, _section, _: navigator.push_water_track(
        reading.time_ns, reading.velocity_mps, reading.valid, sd_mps=reading.sd_mps, range_m=reading.range_m
    ),
    arrays={key: f"water_track_{key}" for key in ("velocity_mps", "valid", "sd_mps", "range_m")},
    rows=lambda stream, _: (
        lambda time_ns, k: WaterReading(
            time_ns, stream.velocity_mps[k], stream.valid[k], stream.sd_mps[k], float(stream.range_m[k])
        )
    ),
)

SENSORS: tuple[Sensor, ...] = (DEPTH, ATTITUDE, GPS, ACOUSTIC_POSITION, THRUST, EFFORT, WATER_TRACK)
"""In the order in which readings of the same time are taken, after inertial readings and pings."""
INSTRUMENTS: tuple[Instrument, ...] = (IMU, *SENSORS)
SENSOR_OF: dict[type, Sensor] = {sensor.reading: sensor for sensor in SENSORS}


def of_kernel(config: Any) -> tuple[dict[str, Any], list[dict[str, Any]]]:  # noqa: ANN401 - a case or a live one
    """What the sensors' sections of a configuration are to the kernel: models by their names there, and options."""
    sections = [one for sensor in SENSORS if (one := getattr(config, sensor.name)) is not None]
    named = [item for one in sections for item in one.kernel_models().items()]
    return dict(named), [one.kernel_options() for one in sections]
