"""The coefficients of a vehicle with fins and a propeller, validated, and what it shares with every other vehicle.

SNAME notation in the platform frame (FRD) with its origin at the centre of buoyancy; all fields are SI floats.
"""

import tomllib
from functools import cache
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from bottomlock.config.packaged import packaged_text
from bottomlock.config.section import shown
from bottomlock.plant import coefficients as coef


def _with_examples(schema: dict[str, Any], model: type["Table"]) -> None:
    """Adds the examples to a JSON schema."""
    for name, described in schema["properties"].items():
        if "$ref" not in described:
            described["examples"] = [model.example_of(name)]


class Table(BaseModel):
    """A table of a vehicle file.

    Attributes:
        packaged: of a whole file, the packaged vehicle whose values are the examples of its keys.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, use_attribute_docstrings=True, json_schema_extra=_with_examples
    )
    packaged: ClassVar[str] = ""

    @classmethod
    def example_of(cls, name: str) -> Any:  # noqa: ANN401 - of any key
        """The value of a key in the packaged vehicle."""
        return _packaged()[cls][name]


@cache
def _packaged() -> dict[type[Table], dict[str, Any]]:
    """Every table with its content in a packaged vehicle, the first that has it."""
    found: dict[type[Table], dict[str, Any]] = {}

    def add(table: type[Table], content: dict[str, Any]) -> None:
        found.setdefault(table, content)
        for name, field in table.model_fields.items():
            if isinstance(field.annotation, type) and issubclass(field.annotation, Table):
                add(field.annotation, content[name])

    for kind in Table.__subclasses__():
        if kind.packaged:
            add(kind, tomllib.loads(packaged_text("vehicles", kind.packaged)))
    return found


class Water(Table):
    """The water for which the coefficients hold."""

    density: coef.PositiveDensity
    """density of the water for which the coefficients hold"""


class RigidBody(Table):
    """Mass, displaced volume, centre of gravity and inertia about the origin (centre of buoyancy)."""

    mass: coef.PositiveMass
    """mass; buoyancy within 10 % of the weight"""
    displaced_volume: coef.PositiveVolume
    """displaced volume"""
    centre_of_gravity_x: coef.Length
    """centre of gravity from the centre of buoyancy, forward"""
    centre_of_gravity_y: coef.Length
    """centre of gravity from the centre of buoyancy, starboard"""
    centre_of_gravity_z: coef.Length
    """centre of gravity from the centre of buoyancy, down; above 0, or the vehicle capsizes"""
    inertia_xx: coef.PositiveInertia
    """inertia in roll about the centre of buoyancy"""
    inertia_yy: coef.PositiveInertia
    """inertia in pitch about the centre of buoyancy"""
    inertia_zz: coef.PositiveInertia
    """inertia in yaw about the centre of buoyancy"""


class Hull(Table):
    """Shape (Myring nose and tail), drag and lift of the bare hull."""

    length: coef.PositiveLength
    """length of the hull"""
    diameter: coef.PositiveLength
    """diameter of the hull"""
    nose_length: coef.PositiveLength
    """length of the nose"""
    tail_length: coef.PositiveLength
    """length of the tail"""
    nose_exponent: coef.PositiveNumber
    """exponent of the Myring nose"""
    tail_angle: coef.PositiveAngle
    """angle of the Myring tail"""
    centre_of_buoyancy_from_nose: coef.PositiveLength
    """centre of buoyancy behind the nose"""
    axial_drag: coef.QuadraticDrag
    """drag along the hull over speed squared"""
    lift: coef.QuadraticDrag
    """lift of the bare hull over speed squared, for each rad"""
    centre_of_pressure_x: coef.Length
    """where that lift acts, forward of the centre of buoyancy"""
    cross_flow_drag: coef.NotNegativeNumber
    """drag coefficient of the cross flow"""
    roll_drag: coef.RotaryDrag
    """moment over roll rate squared"""
    pitch_drag: coef.RotaryDrag
    """moment over pitch rate squared beside the cross flow"""
    yaw_drag: coef.RotaryDrag
    """moment over yaw rate squared beside the cross flow"""


class AddedMass(Table):
    """Added-mass derivatives, SNAME signs; y_rdot = n_vdot and z_qdot = m_wdot by symmetry."""

    x_udot: coef.Mass
    """added mass in surge; not positive"""
    y_vdot: coef.Mass
    """added mass in sway; not positive"""
    z_wdot: coef.Mass
    """added mass in heave; not positive"""
    k_pdot: coef.Inertia
    """added inertia in roll; not positive"""
    m_qdot: coef.Inertia
    """added inertia in pitch; not positive"""
    n_rdot: coef.Inertia
    """added inertia in yaw; not positive"""
    y_rdot: coef.AddedMassMoment
    """coupling of sway and yaw"""
    z_qdot: coef.AddedMassMoment
    """coupling of heave and pitch"""


class Fins(Table):
    """Equal all-moving fins round the tail; azimuth from starboard (+y) towards down (+z)."""

    azimuth: Annotated[tuple[coef.Angle, ...], Field(min_length=4, max_length=4)]
    """azimuth of each of the four fins, from starboard towards down"""
    position_x: coef.Length
    """quarter chord of the fins, forward of the centre of buoyancy"""
    centre_radius: coef.PositiveLength
    """distance of a fin's mid-span from the axis"""
    area: coef.PositiveArea
    """area of a fin"""
    aspect_ratio: coef.PositiveNumber
    """effective aspect ratio"""
    lift_slope: coef.PositiveSlope
    """lift coefficient over angle of attack"""
    zero_lift_drag: coef.NotNegativeNumber
    """drag coefficient without lift"""
    oswald_efficiency: coef.PositiveNumber
    """efficiency of the induced drag"""
    stall_angle: coef.PositiveAngle
    """angle of attack at which a fin stalls"""
    stall_width: coef.PositiveAngle
    """range of angles over which it does"""


class FinActuator(Table):
    """Limits and first-order lag of each fin's servo."""

    max_deflection: coef.PositiveAngle
    """greatest angle of a fin"""
    max_rate: coef.PositiveAngularRate
    """greatest rate of a fin"""
    time_constant: coef.PositiveTime
    """lag of the servo"""


class Propeller(Table):
    """Open-water line K = K0 + K1 J, hull interaction, limits; rotation +1 is clockwise from aft."""

    diameter: coef.PositiveLength
    """diameter of the propeller"""
    thrust_at_rest: coef.PositiveNumber
    """thrust coefficient at rest, K_T0"""
    thrust_slope: coef.Number
    """slope of the thrust coefficient over the advance ratio"""
    torque_at_rest: coef.NotNegativeNumber
    """torque coefficient at rest, K_Q0"""
    torque_slope: coef.Number
    """slope of the torque coefficient over the advance ratio"""
    wake_fraction: coef.Fraction
    """part of the speed that the hull's wake takes"""
    thrust_deduction: coef.Fraction
    """part of the thrust that the hull takes"""
    rotation: Annotated[coef.Number, shown(range="1 or -1")]
    """sense of rotation: 1 clockwise seen from aft, -1 the other"""
    max_speed: coef.PositiveShaftSpeed
    """greatest shaft speed"""
    max_acceleration: coef.PositiveShaftAcceleration
    """greatest rate of the shaft speed"""
    time_constant: coef.PositiveTime
    """lag of the motor"""


class AttitudePid(Table):
    """A PID from an angle error to an equivalent fin angle at cruise speed."""

    proportional: coef.PositiveNumber
    """fin angle for each angle of error, at cruise speed"""
    integral: coef.PerTime
    """fin angle for each angle and second of error"""
    derivative: coef.FinPerRate
    """fin angle for each rate of error"""
    derivative_filter: coef.PositiveTime
    """time constant of the filter of the rate"""
    tracking_time: coef.PositiveTime
    """time constant of anti-windup"""
    limit: coef.PositiveAngle
    """greatest fin angle that is asked for"""


class SpeedPid(Table):
    """A PID from a speed error to a shaft speed, about a feed-forward proportional to the wanted speed."""

    proportional: coef.ShaftPerSpeed
    """shaft speed for each error of speed"""
    integral: coef.ShaftPerDistance
    """shaft speed for each error of distance"""
    derivative: coef.ShaftPerAcceleration
    """shaft speed for each acceleration"""
    derivative_filter: coef.PositiveTime
    """time constant of the filter of the acceleration"""
    tracking_time: coef.PositiveTime
    """time constant of anti-windup"""
    feed_forward: coef.ShaftPerSpeed
    """shaft speed for each wanted speed"""


class Autopilot(Table):
    """The four controllers; fin gains are scaled with (cruise speed / speed)²."""

    roll: AttitudePid
    pitch: AttitudePid
    yaw: AttitudePid
    speed: SpeedPid


class Guidance(Table):
    """Line-of-sight look-ahead, target approach speed, and the gain from depth error to sink rate."""

    look_ahead: coef.PositiveLength
    """distance ahead on the path that is steered for"""
    approach_speed: coef.PositiveSpeed
    """greatest speed at which a moving target is closed with"""
    depth_gain: coef.PerTime
    """sink rate for each error of depth"""


class GuidanceGains(Guidance):
    """Guidance of a vehicle that dives by pitch: depth loop and crab-angle filter as well."""

    depth_integral: coef.PerTimeSquared
    """sink rate for each error of depth and second"""
    max_pitch: coef.PositiveAngle
    """greatest pitch that is asked for"""
    crab_time_constant: coef.PositiveTime
    """time constant of the filter of the crab angle"""


class Limits(Table):
    """Cruise speed, the range of speeds the autopilot serves, and the greatest depth."""

    cruise_speed: coef.PositiveSpeed
    """speed at which the gains hold"""
    min_speed: coef.PositiveSpeed
    """least speed that the autopilot serves"""
    max_speed: coef.PositiveSpeed
    """greatest speed that the autopilot serves"""
    max_depth: coef.PositiveLength
    """greatest depth"""


class Vehicle(Table):
    """Every coefficient of a vehicle with fins and a propeller, SI; see `load_vehicle`."""

    packaged = "tauv"
    name: str
    """name of the vehicle"""
    description: str
    """one sentence for pages"""
    water: Water
    rigid_body: RigidBody
    hull: Hull
    added_mass: AddedMass
    fins: Fins
    fin_actuator: FinActuator
    propeller: Propeller
    autopilot: Autopilot
    guidance: GuidanceGains
    limits: Limits

    @model_validator(mode="after")
    def _physical(self) -> Self:
        check_body(self.water, self.rigid_body, self.added_mass, self.limits)
        if self.hull.nose_length + self.hull.tail_length > self.hull.length:
            raise ValueError("hull: nose and tail together are longer than the hull")
        if abs(self.propeller.rotation) != 1.0:
            raise ValueError("propeller.rotation: expected 1 (clockwise seen from aft) or -1")
        return self


def check_body(water: Water, body: RigidBody, added: AddedMass, limits: Limits) -> None:
    """Check that mass, inertia, added mass, buoyancy and limits are those of a body.

    Raises:
        ValueError: naming table and coefficient.
    """
    inertias = sorted((body.inertia_xx, body.inertia_yy, body.inertia_zz))
    if inertias[2] > inertias[0] + inertias[1]:
        raise ValueError(
            "rigid_body: the largest inertia exceeds the sum of the other two, which no rigid body can have"
        )
    for name in ("x_udot", "y_vdot", "z_wdot", "k_pdot", "m_qdot", "n_rdot"):
        if getattr(added, name) > 0.0:
            raise ValueError(
                f"added_mass.{name}: must not be positive (SNAME: the water resists acceleration)"
            )
    for axis, second, coupling in (("y_vdot", "n_rdot", "y_rdot"), ("z_wdot", "m_qdot", "z_qdot")):
        if getattr(added, coupling) ** 2 > getattr(added, axis) * getattr(added, second):
            raise ValueError(f"added_mass.{coupling}: the added-mass matrix has a negative eigenvalue")
    if body.centre_of_gravity_z <= 0.0:
        raise ValueError(
            "rigid_body.centre_of_gravity_z: expected above 0 (below the centre of buoyancy, z is down), or the "
            "vehicle capsizes"
        )
    ratio = water.density * body.displaced_volume / body.mass
    if not 0.9 < ratio < 1.1:
        raise ValueError(f"rigid_body: buoyancy is {ratio:.3f} of the weight; expected 0.9 to 1.1")
    if not limits.min_speed <= limits.cruise_speed <= limits.max_speed:
        raise ValueError("limits: expected min_speed <= cruise_speed <= max_speed")
