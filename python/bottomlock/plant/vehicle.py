"""The coefficients of a vehicle with fins and a propeller, validated, and what it shares with every other vehicle.

SNAME notation in the platform frame (FRD) with its origin at the centre of buoyancy; all fields are SI floats.
"""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from bottomlock.plant import coefficients as coef


class Table(BaseModel):
    """A table of a vehicle file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Water(Table):
    """The water for which the coefficients hold."""

    density: coef.PositiveDensity


class RigidBody(Table):
    """Mass, displaced volume, centre of gravity and inertia about the origin (centre of buoyancy)."""

    mass: coef.PositiveMass
    displaced_volume: coef.PositiveVolume
    centre_of_gravity_x: coef.Length
    centre_of_gravity_y: coef.Length
    centre_of_gravity_z: coef.Length
    inertia_xx: coef.PositiveInertia
    inertia_yy: coef.PositiveInertia
    inertia_zz: coef.PositiveInertia


class Hull(Table):
    """Shape (Myring nose and tail), drag and lift of the bare hull."""

    length: coef.PositiveLength
    diameter: coef.PositiveLength
    nose_length: coef.PositiveLength
    tail_length: coef.PositiveLength
    nose_exponent: coef.PositiveNumber
    tail_angle: coef.PositiveAngle
    centre_of_buoyancy_from_nose: coef.PositiveLength
    axial_drag: coef.QuadraticDrag
    lift: coef.QuadraticDrag
    centre_of_pressure_x: coef.Length
    cross_flow_drag: coef.NotNegativeNumber
    roll_drag: coef.RotaryDrag
    pitch_drag: coef.RotaryDrag
    yaw_drag: coef.RotaryDrag


class AddedMass(Table):
    """Added-mass derivatives, SNAME signs; y_rdot = n_vdot and z_qdot = m_wdot by symmetry."""

    x_udot: coef.Mass
    y_vdot: coef.Mass
    z_wdot: coef.Mass
    k_pdot: coef.Inertia
    m_qdot: coef.Inertia
    n_rdot: coef.Inertia
    y_rdot: coef.AddedMassMoment
    z_qdot: coef.AddedMassMoment


class Fins(Table):
    """Equal all-moving fins round the tail; azimuth from starboard (+y) towards down (+z)."""

    azimuth: Annotated[tuple[coef.Angle, ...], Field(min_length=4, max_length=4)]
    position_x: coef.Length
    centre_radius: coef.PositiveLength
    area: coef.PositiveArea
    aspect_ratio: coef.PositiveNumber
    lift_slope: coef.PositiveSlope
    zero_lift_drag: coef.NotNegativeNumber
    oswald_efficiency: coef.PositiveNumber
    stall_angle: coef.PositiveAngle
    stall_width: coef.PositiveAngle


class FinActuator(Table):
    """Limits and first-order lag of each fin's servo."""

    max_deflection: coef.PositiveAngle
    max_rate: coef.PositiveAngularRate
    time_constant: coef.PositiveTime


class Propeller(Table):
    """Open-water line K = K0 + K1 J, hull interaction, limits; rotation +1 is clockwise from aft."""

    diameter: coef.PositiveLength
    thrust_at_rest: coef.PositiveNumber
    thrust_slope: coef.Number
    torque_at_rest: coef.NotNegativeNumber
    torque_slope: coef.Number
    wake_fraction: coef.Fraction
    thrust_deduction: coef.Fraction
    rotation: coef.Number
    max_speed: coef.PositiveShaftSpeed
    max_acceleration: coef.PositiveShaftAcceleration
    time_constant: coef.PositiveTime


class AttitudePid(Table):
    """A PID from an angle error to an equivalent fin angle at cruise speed."""

    proportional: coef.FinPerAngle
    integral: coef.FinPerAngleSecond
    derivative: coef.FinPerRate
    derivative_filter: coef.PositiveTime
    tracking_time: coef.PositiveTime
    limit: coef.PositiveAngle


class SpeedPid(Table):
    """A PID from a speed error to a shaft speed, about a feed-forward proportional to the wanted speed."""

    proportional: coef.ShaftPerSpeed
    integral: coef.ShaftPerDistance
    derivative: coef.ShaftPerAcceleration
    derivative_filter: coef.PositiveTime
    tracking_time: coef.PositiveTime
    feed_forward: coef.ShaftPerSpeed


class Autopilot(Table):
    """The four controllers; fin gains are scaled with (cruise speed / speed)²."""

    roll: AttitudePid
    pitch: AttitudePid
    yaw: AttitudePid
    speed: SpeedPid


class GuidanceGains(Table):
    """Line-of-sight look-ahead, target approach speed, depth loop and crab-angle filter."""

    look_ahead: coef.PositiveLength
    approach_speed: coef.PositiveSpeed
    depth_gain: coef.PerTime
    depth_integral: coef.PerTimeSquared
    max_pitch: coef.PositiveAngle
    crab_time_constant: coef.PositiveTime


class Limits(Table):
    """Cruise speed, the range of speeds the autopilot serves, and the greatest depth."""

    cruise_speed: coef.PositiveSpeed
    min_speed: coef.PositiveSpeed
    max_speed: coef.PositiveSpeed
    max_depth: coef.PositiveLength


class Vehicle(Table):
    """Every coefficient of a vehicle with fins and a propeller, SI; see `load_vehicle`."""

    name: str
    description: str
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
