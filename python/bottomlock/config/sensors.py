"""The sensors beside IMU and DVL: the section of each and its declaration for campaign, tables and studies.

A sensor is a section and a line of `SENSORS`; nothing else in the package names the sensors of a simulation one by one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from bottomlock import units
from bottomlock.config.scenario_sections import (
    Factor,
    Finite,
    Fraction,
    NonNegative,
    Positive,
    Section,
    Vector,
)
from bottomlock.config.thrust import Thrust
from bottomlock.kernel import models

AXES = ("north", "east", "down")


DEPTH_BIAS_M: float = 0.3
DEPTH_BIAS_TIME_S: float = 21_600.0
"""A sensor of 0.1 % of 200 m in waters with a tide; half a semidiurnal tide."""


class Depth(Section):
    """Depth sensor: noise, bias, and what density, tide and barometer add to its reading.

    `bias_m`, 1 sigma, is what the filter expects of offset, tide, density and barometer together, and estimates; a
    run draws it as a process with the correlation time `bias_time_s`. The sensor takes its pressure for depth with
    `water_density_kg_per_m3`; the water itself has `true_density_kg_per_m3`, by default the same. What density,
    tide and barometer add is not drawn.
    """

    enabled: bool = True
    rate_hz: Positive = 0.25
    noise_pa: Positive = 194.0
    bias_m: NonNegative = DEPTH_BIAS_M
    bias_time_s: Positive = DEPTH_BIAS_TIME_S
    water_density_kg_per_m3: Positive = 1025.0
    true_density_kg_per_m3: Positive | None = None
    tide_m: Finite = 0.0
    barometric_offset_pa: Finite = 0.0


class Magnetometer(Section):
    """Magnetometer and tilt sensor as an attitude sensor: noise, and what declination and iron add to its yaw.

    `declination_deg` is the field's own, with inclination and strength; "wmm" takes all three from the World Magnetic
    Model. `assumed_declination_deg` is what the compass corrects for, by default the true one. Its slow errors, a
    constant offset and a first-order walk drawn for each run, are states of the filter where they are not 0.
    """

    enabled: bool = True
    rate_hz: Positive = 0.5
    yaw_noise_deg: Positive = 5.72
    roll_pitch_noise_deg: Positive = 1.15
    yaw_offset_sd_deg: NonNegative = 0.0
    roll_pitch_offset_sd_deg: NonNegative = 0.0
    yaw_walk_sd_deg: NonNegative = 0.0
    roll_pitch_walk_sd_deg: NonNegative = 0.0
    walk_time_s: Positive = models.WALK_TIME_S
    declination_deg: Annotated[float, Field(ge=-180, le=180)] | Literal["wmm"] = 0.0
    inclination_deg: Annotated[float, Field(gt=-90, lt=90)] = 49.0
    field_nt: Positive = 45_000.0
    assumed_declination_deg: Annotated[float, Field(ge=-180, le=180)] | None = None
    hard_iron_nt: Vector = (0.0, 0.0, 0.0)
    soft_iron: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Heading(Section):
    """Heading sensor, such as a gyrocompass: yaw alone; its slow errors as of the magnetometer."""

    enabled: bool = True
    rate_hz: Positive = 1.0
    noise_deg: Positive = 0.5
    offset_sd_deg: NonNegative = 0.0
    walk_sd_deg: NonNegative = 0.0
    walk_time_s: Positive = models.WALK_TIME_S


class Gps(Section):
    """GPS receiver: fixes at the surface only, from `acquire_s` after the antenna has come up."""

    enabled: bool = True
    rate_hz: Positive = 1.0
    position_noise_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    velocity_noise_mps: tuple[Positive, Positive, Positive] = (0.1, 0.1, 0.2)
    antenna_depth_m: Finite = 0.3
    acquire_s: NonNegative = 5.0


class AcousticPosition(Section):
    """Acoustic position (USBL, LBL): fixes whose noise grows with the slant range from the transceiver.

    The standard deviation of each axis is the root of noise_m² + (noise_percent_of_range/100 · slant range)². The
    transceiver, on a ship or on the seabed, is at `transceiver_m` in the tangent frame (north, east, down); the
    transponder at `lever_arm_m` in the platform frame. A fraction of the fixes are outliers, with `outlier_factor`
    times the noise; the filter does not model them.
    """

    enabled: bool = True
    rate_hz: Positive = 0.2
    noise_m: Positive = 0.5
    noise_percent_of_range: NonNegative = 1.0
    transceiver_m: Vector = (0.0, 0.0, 0.0)
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    outlier_fraction: Fraction = 0.0
    outlier_factor: Factor = 10.0


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
