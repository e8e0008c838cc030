"""A vehicle's coefficients, read from TOML and checked before anything swims.

SNAME notation in the platform frame (FRD) with its origin at the centre of buoyancy; all fields are SI
floats.
"""

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from bottomlock.errors import ScenarioError
from bottomlock.plant import quantity as qty


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Water(_Table):
    """The water the coefficients hold for."""

    density: qty.PositiveDensity


class RigidBody(_Table):
    """Mass, displaced volume, centre of gravity and inertia about the origin (centre of buoyancy)."""

    mass: qty.PositiveMass
    displaced_volume: qty.PositiveVolume
    centre_of_gravity_x: qty.Length
    centre_of_gravity_y: qty.Length
    centre_of_gravity_z: qty.Length
    inertia_xx: qty.PositiveInertia
    inertia_yy: qty.PositiveInertia
    inertia_zz: qty.PositiveInertia


class Hull(_Table):
    """Shape (Myring nose and tail), drag and lift of the bare hull."""

    length: qty.PositiveLength
    diameter: qty.PositiveLength
    nose_length: qty.PositiveLength
    tail_length: qty.PositiveLength
    nose_exponent: qty.PositiveNumber
    tail_angle: qty.PositiveAngle
    centre_of_buoyancy_from_nose: qty.PositiveLength
    axial_drag: qty.QuadraticDrag
    lift: qty.QuadraticDrag
    centre_of_pressure_x: qty.Length
    cross_flow_drag: qty.NotNegativeNumber
    roll_drag: qty.RotaryDrag
    pitch_drag: qty.RotaryDrag
    yaw_drag: qty.RotaryDrag


class AddedMass(_Table):
    """Added-mass derivatives, SNAME signs; y_rdot = n_vdot and z_qdot = m_wdot by symmetry."""

    x_udot: qty.Mass
    y_vdot: qty.Mass
    z_wdot: qty.Mass
    k_pdot: qty.Inertia
    m_qdot: qty.Inertia
    n_rdot: qty.Inertia
    y_rdot: qty.AddedMassMoment
    z_qdot: qty.AddedMassMoment


class Fins(_Table):
    """Equal all-moving fins round the tail; azimuth from starboard (+y) towards down (+z)."""

    azimuth: Annotated[tuple[qty.Angle, ...], Field(min_length=4, max_length=4)]
    position_x: qty.Length
    centre_radius: qty.PositiveLength
    area: qty.PositiveArea
    aspect_ratio: qty.PositiveNumber
    lift_slope: qty.PositiveSlope
    zero_lift_drag: qty.NotNegativeNumber
    oswald_efficiency: qty.PositiveNumber
    stall_angle: qty.PositiveAngle
    stall_width: qty.PositiveAngle


class FinActuator(_Table):
    """Limits and first-order lag of each fin's servo."""

    max_deflection: qty.PositiveAngle
    max_rate: qty.PositiveAngularRate
    time_constant: qty.PositiveTime


class Propeller(_Table):
    """Open-water line K = K0 + K1 J, hull interaction, limits; rotation +1 is clockwise from aft."""

    diameter: qty.PositiveLength
    thrust_at_rest: qty.PositiveNumber
    thrust_slope: qty.Number
    torque_at_rest: qty.NotNegativeNumber
    torque_slope: qty.Number
    wake_fraction: qty.Fraction
    thrust_deduction: qty.Fraction
    rotation: qty.Number
    max_speed: qty.PositiveShaftSpeed
    max_acceleration: qty.PositiveShaftAcceleration
    time_constant: qty.PositiveTime


class AttitudePid(_Table):
    """A PID from an angle error to an equivalent fin angle at cruise speed."""

    proportional: qty.FinPerAngle
    integral: qty.FinPerAngleSecond
    derivative: qty.FinPerRate
    derivative_filter: qty.PositiveTime
    tracking_time: qty.PositiveTime
    limit: qty.PositiveAngle


class SpeedPid(_Table):
    """A PID from a speed error to a shaft speed, about a feed-forward proportional to the wanted speed."""

    proportional: qty.ShaftPerSpeed
    integral: qty.ShaftPerDistance
    derivative: qty.ShaftPerAcceleration
    derivative_filter: qty.PositiveTime
    tracking_time: qty.PositiveTime
    feed_forward: qty.ShaftPerSpeed


class Autopilot(_Table):
    """The four controllers; fin gains are scaled with (cruise speed / speed)²."""

    roll: AttitudePid
    pitch: AttitudePid
    yaw: AttitudePid
    speed: SpeedPid


class GuidanceGains(_Table):
    """Line-of-sight look-ahead, target approach speed, depth loop and crab-angle filter."""

    look_ahead: qty.PositiveLength
    approach_speed: qty.PositiveSpeed
    depth_gain: qty.PerTime
    depth_integral: qty.PerTimeSquared
    max_pitch: qty.PositiveAngle
    crab_time_constant: qty.PositiveTime


class Limits(_Table):
    """Cruise speed, the range of speeds the autopilot serves, and the greatest depth."""

    cruise_speed: qty.PositiveSpeed
    min_speed: qty.PositiveSpeed
    max_speed: qty.PositiveSpeed
    max_depth: qty.PositiveLength


class Vehicle(_Table):
    """Every coefficient of one vehicle, SI; see `load_vehicle`."""

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
        body, added = self.rigid_body, self.added_mass
        inertias = sorted((body.inertia_xx, body.inertia_yy, body.inertia_zz))
        if inertias[2] > inertias[0] + inertias[1]:
            raise ValueError(
                "rigid_body: the largest inertia exceeds the sum of the other two; no body has that"
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
                "rigid_body.centre_of_gravity_z: must lie below the centre of buoyancy, else it capsizes"
            )
        ratio = self.water.density * body.displaced_volume / body.mass
        if not 0.9 < ratio < 1.1:
            raise ValueError(f"rigid_body: buoyancy is {ratio:.3f} of the weight; expected 0.9 to 1.1")
        if self.hull.nose_length + self.hull.tail_length > self.hull.length:
            raise ValueError("hull: nose and tail together are longer than the hull")
        if abs(self.propeller.rotation) != 1.0:
            raise ValueError("propeller.rotation: expected 1 (clockwise seen from aft) or -1")
        if not self.limits.min_speed <= self.limits.cruise_speed <= self.limits.max_speed:
            raise ValueError("limits: expected min_speed <= cruise_speed <= max_speed")
        return self


def packaged_vehicles() -> list[str]:
    """Names of the vehicles that ship with the package, sorted."""
    folder = resources.files("bottomlock.config") / "vehicles"
    return sorted(
        entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")
    )


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """Read and check a vehicle: a packaged name such as `tauv`, or a path to a TOML file.

    Raises `ScenarioError` naming the table and the coefficient when one is missing, has a wrong unit or is
    unphysical.

    >>> load_vehicle("tauv").limits.cruise_speed
    2.0
    """
    text, label = _read(name_or_path)
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"vehicle {label}: not valid TOML: {error}") from error
    return parse_vehicle(tables, label)


def parse_vehicle(tables: dict[str, Any], label: str) -> Vehicle:
    """Check vehicle tables already read from TOML; raises `ScenarioError` with every fault found."""
    try:
        return Vehicle.model_validate(tables)
    except ValidationError as error:
        faults = "; ".join(_fault(item["loc"], item["msg"]) for item in error.errors())
        raise ScenarioError(f"vehicle {label}: {faults}") from error


def _fault(location: tuple[int | str, ...], message: str) -> str:
    path = ".".join(str(part) for part in location)
    text = message.removeprefix("Value error, ")
    text = "this coefficient is missing" if text == "Field required" else text
    return f"{path}: {text}" if path else text


def _read(name_or_path: str | Path) -> tuple[str, str]:
    if isinstance(name_or_path, str) and name_or_path in packaged_vehicles():
        entry = resources.files("bottomlock.config") / "vehicles" / f"{name_or_path}.toml"
        return entry.read_text(encoding="utf-8"), name_or_path
    path = Path(name_or_path)
    if not path.is_file():
        known = ", ".join(packaged_vehicles())
        raise ScenarioError(f"vehicle '{name_or_path}': neither a packaged vehicle ({known}) nor a file")
    return path.read_text(encoding="utf-8"), str(path)
