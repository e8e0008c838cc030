"""The sensors beside IMU and DVL: the section of each and its declaration for campaign, tables and studies.

A sensor is a section and a line of `SENSORS`; nothing else in the package names the sensors of a simulation one by one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from bottomlock import units
from bottomlock.config.meaning import shown
from bottomlock.config.scenario_sections import Factor, Fraction, Section, Vector
from bottomlock.config.thrust import Thrust
from bottomlock.kernel import models
from bottomlock.kernel.models import Finite, NonNegative, Positive

AXES = ("north", "east", "down")


DEPTH_BIAS_M: float = 0.3
DEPTH_BIAS_TIME_S: float = 21_600.0
"""A sensor of 0.1 % of 200 m in waters with a tide; half a semidiurnal tide."""


class Depth(Section):
    """Depth sensor: noise, bias, and what density, tide and barometer add to its reading.

    A run draws the bias as a process; what density, tide and barometer add is not drawn.
    """

    enabled: bool = True
    """whether there is a depth sensor; a section that is there is on unless it says otherwise"""
    rate_hz: Positive = 0.25
    """rate of the readings"""
    noise_pa: Positive = 194.0
    """white noise of the pressure"""
    bias_m: NonNegative = DEPTH_BIAS_M
    """offset, tide, density and barometer together, which the filter estimates and a run draws; 0 says that there
    are none"""
    bias_time_s: Positive = DEPTH_BIAS_TIME_S
    """correlation time of the bias"""
    water_density_kg_per_m3: Positive = 1025.0
    """density with which the sensor takes its pressure for depth"""
    true_density_kg_per_m3: Annotated[Positive | None, shown(example=1027.0)] = None
    """density of the water itself; none: the sensor's"""
    tide_m: Finite = 0.0
    """what the tide adds to the reading; not drawn"""
    barometric_offset_pa: Finite = 0.0
    """what the barometer adds to the pressure; not drawn"""
    wave_m: NonNegative = 0.0
    """what waves add to the reading, drawn for each run; a state of the filter unless 0"""
    wave_period_s: Positive = models.WAVE_PERIOD_S
    """mean period of the waves"""


class Magnetometer(Section):
    """Magnetometer and tilt sensor as an attitude sensor: noise, and what declination and iron add to its yaw."""

    enabled: bool = True
    """whether there is a magnetometer with tilt sensor"""
    rate_hz: Positive = 0.5
    """rate of the readings"""
    yaw_noise_deg: Positive = 5.72
    """white noise of the yaw"""
    roll_pitch_noise_deg: Positive = 1.15
    """white noise of roll and pitch"""
    yaw_offset_sd_deg: NonNegative = 0.0
    """constant offset of the yaw, drawn for each run; a state of the filter unless 0"""
    roll_pitch_offset_sd_deg: NonNegative = 0.0
    """constant offset of roll and of pitch, likewise"""
    yaw_walk_sd_deg: NonNegative = 0.0
    """first-order walk of the yaw, likewise"""
    roll_pitch_walk_sd_deg: NonNegative = 0.0
    """first-order walk of roll and of pitch, likewise"""
    walk_time_s: Positive = models.WALK_TIME_S
    """correlation time of the walks"""
    yaw_semicircular_sd_deg: NonNegative = 0.0
    """deviation of the yaw by its cosine and by its sine, each, drawn for each run; states of the filter unless 0"""
    yaw_quadrantal_sd_deg: NonNegative = 0.0
    """deviation by cosine and by sine of twice the yaw, likewise"""
    declination_deg: Annotated[
        Annotated[float, Field(ge=-180, le=180)] | Literal["wmm"], shown(range='≥ -180.0, ≤ 180.0, or "wmm"')
    ] = 0.0
    """declination of the field; "wmm" takes the field from the World Magnetic Model"""
    inclination_deg: Annotated[float, Field(gt=-90, lt=90)] = 49.0
    """inclination of the field, down"""
    field_nt: Annotated[Positive, shown(unit="nT")] = 45_000.0
    """strength of the field"""
    assumed_declination_deg: Annotated[
        Annotated[float, Field(ge=-180, le=180)] | None, shown(example=4.5)
    ] = None
    """declination that the compass corrects for; none: the true one"""
    hard_iron_nt: Annotated[Vector, shown(unit="nT")] = (0.0, 0.0, 0.0)
    """field of the vehicle's own, platform axes"""
    soft_iron: Annotated[tuple[Vector, Vector, Vector], shown(unit="1")] = (
        (1.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0),
    )
    """matrix that distorts the field, rows in platform axes"""


class Heading(Section):
    """Heading sensor, such as a gyrocompass: yaw alone; its slow errors as of the magnetometer."""

    enabled: bool = True
    """whether there is a heading sensor, such as a gyrocompass"""
    rate_hz: Positive = 1.0
    """rate of the readings"""
    noise_deg: Positive = 0.5
    """white noise of the heading"""
    offset_sd_deg: NonNegative = 0.0
    """constant offset, drawn for each run; a state of the filter unless 0"""
    walk_sd_deg: NonNegative = 0.0
    """first-order walk, likewise"""
    walk_time_s: Positive = models.WALK_TIME_S
    """correlation time of the walk"""
    semicircular_sd_deg: NonNegative = 0.0
    """deviation of a magnetic compass by the cosine and by the sine of the heading, each, likewise"""
    quadrantal_sd_deg: NonNegative = 0.0
    """deviation by cosine and by sine of twice the heading, likewise"""


class Gps(Section):
    """GPS receiver: fixes at the surface only, from `acquire_s` after the antenna has come up."""

    enabled: bool = True
    """whether there is a GPS receiver"""
    rate_hz: Positive = 1.0
    """rate of the fixes, at the surface"""
    position_noise_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    """white noise of north, east, down"""
    velocity_noise_mps: tuple[Positive, Positive, Positive] = (0.1, 0.1, 0.2)
    """white noise of the velocity north, east, down"""
    antenna_depth_m: Finite = 0.3
    """depth of the platform above which the antenna is out of the water"""
    acquire_s: NonNegative = 5.0
    """time from surfacing to the first fix"""


class AcousticPosition(Section):
    """Acoustic position (USBL, LBL): fixes whose noise grows with the slant range from the transceiver.

    The standard deviation of each axis is the root of noise_m² + (noise_percent_of_range/100 · slant range)².
    """

    enabled: bool = True
    """whether there are acoustic positions (USBL, LBL)"""
    rate_hz: Positive = 0.2
    """rate of the fixes"""
    noise_m: Positive = 0.5
    """part of the noise that does not depend on range, each axis"""
    noise_percent_of_range: NonNegative = 1.0
    """part of the noise that grows with the slant range, each axis"""
    transceiver_m: Vector = (0.0, 0.0, 0.0)
    """position of the transceiver: north, east, down"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the transponder from the IMU, platform axes"""
    outlier_fraction: Annotated[Fraction, shown(unit="1")] = 0.0
    """part of the fixes that are outliers; the filter does not model them"""
    outlier_factor: Annotated[Factor, shown(unit="1")] = 10.0
    """noise of an outlier over that of a good fix"""


@dataclass(frozen=True)
class Sensor:
    """Declaration of a sensor of a scenario.

    Attributes:
        name: its section in a scenario and in the kernel's model, and its name in a schedule.
        section: the class of the section, which has `enabled` and `rate_hz`.
        updates: its updates, as the kernel's `SENSORS` names them.
        table: its table of simulated readings.
        columns: columns of that table, by the kernel's array that holds them.
        model: the kernel's model in SI, of a section and gravity (m/s²).
        options: what the section adds to the filter's options, for instance a lever arm.
    """

    name: str
    section: type[Section]
    updates: tuple[str, ...]
    table: str
    columns: Mapping[str, tuple[str, ...]]
    model: Callable[[Any, float], models.Settings]
    options: Callable[[Any], dict[str, Any]] = lambda _: {}


DEPTH = Sensor(
    name="depth",
    section=Depth,
    updates=("depth",),
    table="depth",
    columns={"depth_m": ("depth_m",)},
    model=lambda depth, gravity_mps2: models.DepthModel(
        sd_m=depth.noise_pa / (depth.water_density_kg_per_m3 * gravity_mps2),
        bias_sd_m=depth.bias_m,
        bias_time_s=depth.bias_time_s,
        wave_sd_m=depth.wave_m,
        wave_period_s=depth.wave_period_s,
    ),
)
MAGNETOMETER = Sensor(
    name="magnetometer",
    section=Magnetometer,
    updates=("attitude",),
    table="attitude",
    columns={"magnetometer_attitude_t_p": tuple(f"attitude_{part}" for part in "wxyz")},
    model=lambda compass, _: models.MagnetometerModel(
        yaw_sd_rad=units.rad_from_deg(compass.yaw_noise_deg),
        roll_pitch_sd_rad=units.rad_from_deg(compass.roll_pitch_noise_deg),
        yaw_offset_sd_rad=units.rad_from_deg(compass.yaw_offset_sd_deg),
        roll_pitch_offset_sd_rad=units.rad_from_deg(compass.roll_pitch_offset_sd_deg),
        yaw_walk_sd_rad=units.rad_from_deg(compass.yaw_walk_sd_deg),
        roll_pitch_walk_sd_rad=units.rad_from_deg(compass.roll_pitch_walk_sd_deg),
        walk_time_s=compass.walk_time_s,
        yaw_semicircular_sd_rad=units.rad_from_deg(compass.yaw_semicircular_sd_deg),
        yaw_quadrantal_sd_rad=units.rad_from_deg(compass.yaw_quadrantal_sd_deg),
    ),
)
HEADING = Sensor(
    name="heading",
    section=Heading,
    updates=("heading",),
    table="heading",
    columns={"heading_rad": ("heading_rad",)},
    model=lambda gyrocompass, _: models.HeadingModel(
        sd_rad=units.rad_from_deg(gyrocompass.noise_deg),
        offset_sd_rad=units.rad_from_deg(gyrocompass.offset_sd_deg),
        walk_sd_rad=units.rad_from_deg(gyrocompass.walk_sd_deg),
        walk_time_s=gyrocompass.walk_time_s,
        semicircular_sd_rad=units.rad_from_deg(gyrocompass.semicircular_sd_deg),
        quadrantal_sd_rad=units.rad_from_deg(gyrocompass.quadrantal_sd_deg),
    ),
)
GPS = Sensor(
    name="gps",
    section=Gps,
    updates=("gps_position", "gps_velocity"),
    table="gps",
    columns={
        "gps_position_t_m": tuple(f"position_{axis}_m" for axis in AXES),
        "gps_velocity_t_mps": tuple(f"velocity_{axis}_mps" for axis in AXES),
    },
    model=lambda gps, _: models.GpsModel(
        position_sd_m=gps.position_noise_m, velocity_sd_mps=gps.velocity_noise_mps
    ),
)

ACOUSTIC_POSITION = Sensor(
    name="acoustic_position",
    section=AcousticPosition,
    updates=("acoustic_position",),
    table="acoustic_position",
    columns={
        "acoustic_position_t_m": tuple(f"position_{axis}_m" for axis in AXES),
        "acoustic_position_sd_m": tuple(f"sd_{axis}_m" for axis in AXES),
    },
    model=lambda fixes, _: models.AcousticPositionModel(
        sd_m=fixes.noise_m,
        sd_per_range=units.fraction_from_percent(fixes.noise_percent_of_range),
        transceiver_t_m=fixes.transceiver_m,
        outlier_fraction=fixes.outlier_fraction,
        outlier_factor=fixes.outlier_factor,
    ),
    options=lambda fixes: {"levers": {"acoustic_position_p_m": fixes.lever_arm_m}},
)

THRUST = Sensor(
    name="thrust",
    section=Thrust,
    updates=("thrust",),
    table="thrust",
    columns={"thrust_revolutions_hz": ("revolutions_hz",)},
    model=lambda thrust, _: thrust.kernel_model(),
    options=Thrust.kernel_options,
)

SENSORS = (DEPTH, MAGNETOMETER, HEADING, GPS, ACOUSTIC_POSITION, THRUST)
"""In the order in which the kernel takes measurements of the same time, after the DVL's."""


class SensorSections(Section):
    """The sections of `SENSORS` in a scenario."""

    depth: Depth = Depth(enabled=False)
    magnetometer: Magnetometer = Magnetometer(enabled=False)
    heading: Heading = Heading(enabled=False)
    gps: Gps = Gps(enabled=False)
    acoustic_position: AcousticPosition = AcousticPosition(enabled=False)
    thrust: Thrust = Thrust(enabled=False)
