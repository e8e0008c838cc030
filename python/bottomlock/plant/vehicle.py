"""The coefficients of a vehicle with fins and a propeller, validated, and what it shares with every other vehicle.

SNAME notation in the platform frame (FRD) with its origin at the centre of buoyancy; all fields are SI floats.
"""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from bottomlock.config.meaning import shown
from bottomlock.plant import coefficients as coef


class Table(BaseModel):
    """A table of a vehicle file."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Water(Table):
    """The water for which the coefficients hold."""

    density: Annotated[
        coef.PositiveDensity, shown(example={"value": 1026.0, "unit": "kg/m3", "source": "sea water"})
    ]
    """density of the water for which the coefficients hold"""


class RigidBody(Table):
    """Mass, displaced volume, centre of gravity and inertia about the origin (centre of buoyancy)."""

    mass: Annotated[coef.PositiveMass, shown(example={"value": 185.0, "unit": "kg", "source": "weighed"})]
    """mass; buoyancy within 10 % of the weight"""
    displaced_volume: Annotated[
        coef.PositiveVolume, shown(example={"value": 0.1809, "unit": "m3", "source": "drawing"})
    ]
    """displaced volume"""
    centre_of_gravity_x: Annotated[
        coef.Length, shown(example={"value": 0.0, "unit": "m", "source": "trimmed"})
    ]
    """centre of gravity from the centre of buoyancy, forward"""
    centre_of_gravity_y: Annotated[
        coef.Length, shown(example={"value": 0.0, "unit": "m", "source": "trimmed"})
    ]
    """centre of gravity from the centre of buoyancy, starboard"""
    centre_of_gravity_z: Annotated[
        coef.Length, shown(example={"value": 0.02, "unit": "m", "source": "inclining test"})
    ]
    """centre of gravity from the centre of buoyancy, down; above 0, or the vehicle capsizes"""
    inertia_xx: Annotated[
        coef.PositiveInertia, shown(example={"value": 1.97, "unit": "kg m2", "source": "drawing"})
    ]
    """inertia in roll about the centre of buoyancy"""
    inertia_yy: Annotated[
        coef.PositiveInertia, shown(example={"value": 105.0, "unit": "kg m2", "source": "drawing"})
    ]
    """inertia in pitch about the centre of buoyancy"""
    inertia_zz: Annotated[
        coef.PositiveInertia, shown(example={"value": 105.0, "unit": "kg m2", "source": "drawing"})
    ]
    """inertia in yaw about the centre of buoyancy"""


class Hull(Table):
    """Shape (Myring nose and tail), drag and lift of the bare hull."""

    length: Annotated[coef.PositiveLength, shown(example={"value": 3.0, "unit": "m", "source": "measured"})]
    """length of the hull"""
    diameter: Annotated[
        coef.PositiveLength, shown(example={"value": 300.0, "unit": "mm", "source": "measured"})
    ]
    """diameter of the hull"""
    nose_length: Annotated[
        coef.PositiveLength, shown(example={"value": 0.35, "unit": "m", "source": "drawing"})
    ]
    """length of the nose"""
    tail_length: Annotated[
        coef.PositiveLength, shown(example={"value": 0.75, "unit": "m", "source": "drawing"})
    ]
    """length of the tail"""
    nose_exponent: Annotated[
        coef.PositiveNumber, shown(example={"value": 2.0, "unit": "1", "source": "drawing"})
    ]
    """exponent of the Myring nose"""
    tail_angle: Annotated[
        coef.PositiveAngle, shown(example={"value": 25.0, "unit": "deg", "source": "drawing"})
    ]
    """angle of the Myring tail"""
    centre_of_buoyancy_from_nose: Annotated[
        coef.PositiveLength, shown(example={"value": 1.4, "unit": "m", "source": "drawing"})
    ]
    """centre of buoyancy behind the nose"""
    axial_drag: Annotated[
        coef.QuadraticDrag, shown(example={"value": 6.1, "unit": "kg/m", "source": "ITTC-57"})
    ]
    """drag along the hull over speed squared"""
    lift: Annotated[coef.QuadraticDrag, shown(example={"value": 79.4, "unit": "kg/m", "source": "Hoerner"})]
    """lift of the bare hull over speed squared, for each rad"""
    centre_of_pressure_x: Annotated[
        coef.Length, shown(example={"value": -0.55, "unit": "m", "source": "Hoerner"})
    ]
    """where that lift acts, forward of the centre of buoyancy"""
    cross_flow_drag: Annotated[
        coef.NotNegativeNumber, shown(example={"value": 1.1, "unit": "1", "source": "circular cylinder"})
    ]
    """drag coefficient of the cross flow"""
    roll_drag: Annotated[
        coef.RotaryDrag, shown(example={"value": 0.024, "unit": "kg m2", "source": "friction"})
    ]
    """moment over roll rate squared"""
    pitch_drag: Annotated[
        coef.RotaryDrag, shown(example={"value": 0.0, "unit": "kg m2", "source": "cross-flow strips have it"})
    ]
    """moment over pitch rate squared beside the cross flow"""
    yaw_drag: Annotated[
        coef.RotaryDrag, shown(example={"value": 0.0, "unit": "kg m2", "source": "cross-flow strips have it"})
    ]
    """moment over yaw rate squared beside the cross flow"""


class AddedMass(Table):
    """Added-mass derivatives, SNAME signs; y_rdot = n_vdot and z_qdot = m_wdot by symmetry."""

    x_udot: Annotated[coef.Mass, shown(example={"value": -3.83, "unit": "kg", "source": "Lamb"})]
    """added mass in surge; not positive"""
    y_vdot: Annotated[coef.Mass, shown(example={"value": -200.0, "unit": "kg", "source": "strips"})]
    """added mass in sway; not positive"""
    z_wdot: Annotated[coef.Mass, shown(example={"value": -200.0, "unit": "kg", "source": "strips"})]
    """added mass in heave; not positive"""
    k_pdot: Annotated[coef.Inertia, shown(example={"value": -0.214, "unit": "kg m2", "source": "strips"})]
    """added inertia in roll; not positive"""
    m_qdot: Annotated[coef.Inertia, shown(example={"value": -129.0, "unit": "kg m2", "source": "strips"})]
    """added inertia in pitch; not positive"""
    n_rdot: Annotated[coef.Inertia, shown(example={"value": -129.0, "unit": "kg m2", "source": "strips"})]
    """added inertia in yaw; not positive"""
    y_rdot: Annotated[
        coef.AddedMassMoment, shown(example={"value": 18.6, "unit": "kg m", "source": "strips"})
    ]
    """coupling of sway and yaw"""
    z_qdot: Annotated[
        coef.AddedMassMoment, shown(example={"value": -18.6, "unit": "kg m", "source": "strips"})
    ]
    """coupling of heave and pitch"""


class Fins(Table):
    """Equal all-moving fins round the tail; azimuth from starboard (+y) towards down (+z)."""

    azimuth: Annotated[
        tuple[coef.Angle, ...],
        Field(min_length=4, max_length=4),
        shown(
            example=[
                {"value": 45.0, "unit": "deg", "source": "drawing"},
                {"value": 135.0, "unit": "deg", "source": "drawing"},
                {"value": 225.0, "unit": "deg", "source": "drawing"},
                {"value": 315.0, "unit": "deg", "source": "drawing"},
            ]
        ),
    ]
    """azimuth of each of the four fins, from starboard towards down"""
    position_x: Annotated[coef.Length, shown(example={"value": -1.32, "unit": "m", "source": "drawing"})]
    """quarter chord of the fins, forward of the centre of buoyancy"""
    centre_radius: Annotated[
        coef.PositiveLength, shown(example={"value": 0.16, "unit": "m", "source": "drawing"})
    ]
    """distance of a fin's mid-span from the axis"""
    area: Annotated[coef.PositiveArea, shown(example={"value": 171.0, "unit": "cm2", "source": "drawing"})]
    """area of a fin"""
    aspect_ratio: Annotated[
        coef.PositiveNumber, shown(example={"value": 1.74, "unit": "1", "source": "drawing"})
    ]
    """effective aspect ratio"""
    lift_slope: Annotated[
        coef.PositiveSlope, shown(example={"value": 2.78, "unit": "1/rad", "source": "Hoerner"})
    ]
    """lift coefficient over angle of attack"""
    zero_lift_drag: Annotated[
        coef.NotNegativeNumber, shown(example={"value": 0.015, "unit": "1", "source": "NACA 0012"})
    ]
    """drag coefficient without lift"""
    oswald_efficiency: Annotated[
        coef.PositiveNumber, shown(example={"value": 0.9, "unit": "1", "source": "Hoerner"})
    ]
    """efficiency of the induced drag"""
    stall_angle: Annotated[
        coef.PositiveAngle, shown(example={"value": 20.0, "unit": "deg", "source": "NACA 0012"})
    ]
    """angle of attack at which a fin stalls"""
    stall_width: Annotated[
        coef.PositiveAngle, shown(example={"value": 3.0, "unit": "deg", "source": "NACA 0012"})
    ]
    """range of angles over which it does"""


class FinActuator(Table):
    """Limits and first-order lag of each fin's servo."""

    max_deflection: Annotated[
        coef.PositiveAngle, shown(example={"value": 25.0, "unit": "deg", "source": "data sheet"})
    ]
    """greatest angle of a fin"""
    max_rate: Annotated[
        coef.PositiveAngularRate, shown(example={"value": 60.0, "unit": "deg/s", "source": "data sheet"})
    ]
    """greatest rate of a fin"""
    time_constant: Annotated[
        coef.PositiveTime, shown(example={"value": 0.1, "unit": "s", "source": "data sheet"})
    ]
    """lag of the servo"""


class Propeller(Table):
    """Open-water line K = K0 + K1 J, hull interaction, limits; rotation +1 is clockwise from aft."""

    diameter: Annotated[coef.PositiveLength, shown(example={"value": 0.2, "unit": "m", "source": "measured"})]
    """diameter of the propeller"""
    thrust_at_rest: Annotated[
        coef.PositiveNumber, shown(example={"value": 0.45, "unit": "1", "source": "series"})
    ]
    """thrust coefficient at rest, K_T0"""
    thrust_slope: Annotated[coef.Number, shown(example={"value": -0.4, "unit": "1", "source": "series"})]
    """slope of the thrust coefficient over the advance ratio"""
    torque_at_rest: Annotated[
        coef.NotNegativeNumber, shown(example={"value": 0.06, "unit": "1", "source": "series"})
    ]
    """torque coefficient at rest, K_Q0"""
    torque_slope: Annotated[coef.Number, shown(example={"value": -0.04, "unit": "1", "source": "series"})]
    """slope of the torque coefficient over the advance ratio"""
    wake_fraction: Annotated[coef.Fraction, shown(example={"value": 0.15, "unit": "1", "source": "assumed"})]
    """part of the speed that the hull's wake takes"""
    thrust_deduction: Annotated[
        coef.Fraction, shown(example={"value": 0.1, "unit": "1", "source": "assumed"})
    ]
    """part of the thrust that the hull takes"""
    rotation: Annotated[
        coef.Number, shown(range="1 or -1", example={"value": 1.0, "unit": "1", "source": "seen"})
    ]
    """sense of rotation: 1 clockwise seen from aft, -1 the other"""
    max_speed: Annotated[
        coef.PositiveShaftSpeed, shown(example={"value": 1200.0, "unit": "rpm", "source": "data sheet"})
    ]
    """greatest shaft speed"""
    max_acceleration: Annotated[
        coef.PositiveShaftAcceleration,
        shown(example={"value": 20.0, "unit": "rev/s2", "source": "data sheet"}),
    ]
    """greatest rate of the shaft speed"""
    time_constant: Annotated[
        coef.PositiveTime, shown(example={"value": 0.3, "unit": "s", "source": "data sheet"})
    ]
    """lag of the motor"""


class AttitudePid(Table):
    """A PID from an angle error to an equivalent fin angle at cruise speed."""

    proportional: Annotated[coef.FinPerAngle, shown(example={"value": 1.0, "unit": "1", "source": "design"})]
    """fin angle for each angle of error, at cruise speed"""
    integral: Annotated[
        coef.FinPerAngleSecond, shown(example={"value": 0.1, "unit": "1/s", "source": "design"})
    ]
    """fin angle for each angle and second of error"""
    derivative: Annotated[coef.FinPerRate, shown(example={"value": 1.0, "unit": "s", "source": "design"})]
    """fin angle for each rate of error"""
    derivative_filter: Annotated[
        coef.PositiveTime, shown(example={"value": 0.1, "unit": "s", "source": "design"})
    ]
    """time constant of the filter of the rate"""
    tracking_time: Annotated[
        coef.PositiveTime, shown(example={"value": 1.0, "unit": "s", "source": "design"})
    ]
    """time constant of anti-windup"""
    limit: Annotated[coef.PositiveAngle, shown(example={"value": 20.0, "unit": "deg", "source": "design"})]
    """greatest fin angle that is asked for"""


class SpeedPid(Table):
    """A PID from a speed error to a shaft speed, about a feed-forward proportional to the wanted speed."""

    proportional: Annotated[
        coef.ShaftPerSpeed, shown(example={"value": 2.0, "unit": "rev/m", "source": "design"})
    ]
    """shaft speed for each error of speed"""
    integral: Annotated[
        coef.ShaftPerDistance, shown(example={"value": 0.5, "unit": "rev/(m s)", "source": "design"})
    ]
    """shaft speed for each error of distance"""
    derivative: Annotated[
        coef.ShaftPerAcceleration, shown(example={"value": 0.0, "unit": "rev s/m", "source": "design"})
    ]
    """shaft speed for each acceleration"""
    derivative_filter: Annotated[
        coef.PositiveTime, shown(example={"value": 0.5, "unit": "s", "source": "design"})
    ]
    """time constant of the filter of the acceleration"""
    tracking_time: Annotated[
        coef.PositiveTime, shown(example={"value": 2.0, "unit": "s", "source": "design"})
    ]
    """time constant of anti-windup"""
    feed_forward: Annotated[
        coef.ShaftPerSpeed, shown(example={"value": 5.0, "unit": "rev/m", "source": "trim"})
    ]
    """shaft speed for each wanted speed"""


class Autopilot(Table):
    """The four controllers; fin gains are scaled with (cruise speed / speed)²."""

    roll: AttitudePid
    pitch: AttitudePid
    yaw: AttitudePid
    speed: SpeedPid


class GuidanceGains(Table):
    """Line-of-sight look-ahead, target approach speed, depth loop and crab-angle filter."""

    look_ahead: Annotated[
        coef.PositiveLength, shown(example={"value": 12.0, "unit": "m", "source": "design"})
    ]
    """distance ahead on the path that is steered for"""
    approach_speed: Annotated[
        coef.PositiveSpeed, shown(example={"value": 0.5, "unit": "m/s", "source": "design"})
    ]
    """speed at which a moving target is closed with"""
    depth_gain: Annotated[coef.PerTime, shown(example={"value": 0.2, "unit": "1/s", "source": "design"})]
    """sink rate for each error of depth"""
    depth_integral: Annotated[
        coef.PerTimeSquared, shown(example={"value": 0.01, "unit": "1/s2", "source": "design"})
    ]
    """sink rate for each error of depth and second"""
    max_pitch: Annotated[
        coef.PositiveAngle, shown(example={"value": 20.0, "unit": "deg", "source": "design"})
    ]
    """greatest pitch that is asked for"""
    crab_time_constant: Annotated[
        coef.PositiveTime, shown(example={"value": 5.0, "unit": "s", "source": "design"})
    ]
    """time constant of the filter of the crab angle"""


class Limits(Table):
    """Cruise speed, the range of speeds the autopilot serves, and the greatest depth."""

    cruise_speed: Annotated[
        coef.PositiveSpeed, shown(example={"value": 2.0, "unit": "m/s", "source": "design"})
    ]
    """speed at which the gains hold"""
    min_speed: Annotated[coef.PositiveSpeed, shown(example={"value": 1.0, "unit": "m/s", "source": "design"})]
    """least speed that the autopilot serves"""
    max_speed: Annotated[coef.PositiveSpeed, shown(example={"value": 3.0, "unit": "m/s", "source": "design"})]
    """greatest speed that the autopilot serves"""
    max_depth: Annotated[
        coef.PositiveLength, shown(example={"value": 200.0, "unit": "m", "source": "design"})
    ]
    """greatest depth"""


class Vehicle(Table):
    """Every coefficient of a vehicle with fins and a propeller, SI; see `load_vehicle`."""

    name: Annotated[str, shown(example="tauv")]
    """name of the vehicle"""
    description: Annotated[str, shown(example="Torpedo of 3 m, four fins in an x")]
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
