"""The coefficients of a vehicle that thrusters move in every direction, such as an ROV, and reading of any vehicle.

SNAME notation in the platform frame (FRD) with its origin at the centre of buoyancy; all fields are SI floats.
"""

from pathlib import Path
from typing import Any, Self, TypeAlias

import numpy as np
from pydantic import model_validator

from bottomlock.config.packaged import packaged_names, text_of
from bottomlock.config.toml_file import parse_toml
from bottomlock.config.validation import checked
from bottomlock.plant import coefficients as coef
from bottomlock.plant.maths import FloatArray
from bottomlock.plant.vehicle import AddedMass, Guidance, Limits, RigidBody, Table, Vehicle, Water, check_body


class Damping(Table):
    """Drag of each axis by itself: linear and quadratic in its velocity through the water."""

    surge_linear: coef.LinearDrag
    """drag in surge over speed"""
    surge_quadratic: coef.QuadraticDrag
    """drag in surge over speed squared"""
    sway_linear: coef.LinearDrag
    """drag in sway over speed"""
    sway_quadratic: coef.QuadraticDrag
    """drag in sway over speed squared"""
    heave_linear: coef.LinearDrag
    """drag in heave over speed"""
    heave_quadratic: coef.QuadraticDrag
    """drag in heave over speed squared"""
    roll_linear: coef.LinearRotaryDrag
    """damping of roll over its rate"""
    roll_quadratic: coef.RotaryDrag
    """damping of roll over its rate squared"""
    pitch_linear: coef.LinearRotaryDrag
    """damping of pitch over its rate"""
    pitch_quadratic: coef.RotaryDrag
    """damping of pitch over its rate squared"""
    yaw_linear: coef.LinearRotaryDrag
    """damping of yaw over its rate"""
    yaw_quadratic: coef.RotaryDrag
    """damping of yaw over its rate squared"""

    def axes(self) -> list[tuple[float, float]]:
        """Linear and quadratic drag of surge, sway, heave, roll, pitch and yaw."""
        values = list(self.model_dump().values())
        return list(zip(values[::2], values[1::2], strict=True))


class Thrusters(Table):
    """Place and direction of each thruster, their greatest thrust and lag; a list has an entry a thruster."""

    position_x: tuple[coef.Length, ...]
    """where each thruster stands, forward of the centre of buoyancy; six or more"""
    position_y: tuple[coef.Length, ...]
    """the same, starboard"""
    position_z: tuple[coef.Length, ...]
    """the same, down"""
    azimuth: tuple[coef.Angle, ...]
    """direction in which each one pushes the vehicle, from forward to starboard"""
    elevation: tuple[coef.Angle, ...]
    """the same, above the level"""
    max_thrust: coef.PositiveForce
    """greatest thrust of each, both ways"""
    time_constant: coef.PositiveTime
    """first-order lag of the thrust"""

    def wrenches(self) -> FloatArray:
        """Force (N) and moment (N m) of a newton of each thruster, (6, thrusters)."""
        azimuth, elevation = np.array(self.azimuth), np.array(self.elevation)
        level = np.cos(elevation)
        force = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)])
        place = np.array([self.position_x, self.position_y, self.position_z])
        return np.concatenate([force, np.cross(place, force, axis=0)])


class VelocityPi(Table):
    """A PI controller from a velocity error to a force, with its limit."""

    proportional: coef.ForcePerSpeed
    """force for each m/s of error"""
    integral: coef.ForcePerDistance
    """force for each metre of integrated error"""
    tracking_time: coef.PositiveTime
    """time in which anti-windup unwinds the integral"""
    limit: coef.PositiveForce
    """greatest force that it asks for"""


class AnglePid(Table):
    """A PID controller from an angle error to a moment, with its limit."""

    proportional: coef.MomentPerAngle
    """moment for each rad of error"""
    integral: coef.MomentPerAngleSecond
    """moment for each rad s of integrated error"""
    derivative: coef.MomentPerRate
    """moment for each rad/s of error"""
    tracking_time: coef.PositiveTime
    """time in which anti-windup unwinds the integral"""
    limit: coef.PositiveMoment
    """greatest moment that it asks for"""


class HoveringAutopilot(Table):
    """The six controllers, an axis each."""

    surge: VelocityPi
    sway: VelocityPi
    heave: VelocityPi
    roll: AnglePid
    pitch: AnglePid
    yaw: AnglePid

    def axes(self) -> tuple[VelocityPi | AnglePid, ...]:
        """The controllers of surge, sway, heave, roll, pitch and yaw."""
        return self.surge, self.sway, self.heave, self.roll, self.pitch, self.yaw


class HoveringVehicle(Table):
    """Every coefficient of a vehicle that thrusters move in every direction, SI; see `load_vehicle`."""

    packaged = "bluerov2_heavy"
    name: str
    """name of the vehicle"""
    description: str
    """one sentence for pages"""
    water: Water
    rigid_body: RigidBody
    damping: Damping
    added_mass: AddedMass
    thrusters: Thrusters
    autopilot: HoveringAutopilot
    guidance: Guidance
    limits: Limits

    @model_validator(mode="after")
    def _physical(self) -> Self:
        check_body(self.water, self.rigid_body, self.added_mass, self.limits)
        drives = self.thrusters
        counts = {
            name: len(getattr(drives, name))
            for name in ("position_x", "position_y", "position_z", "azimuth", "elevation")
        }
        if len(set(counts.values())) != 1:
            words = ", ".join(f"{name} {count}" for name, count in counts.items())
            raise ValueError(
                f"thrusters: expected as many entries in each list as there are thrusters; {words}"
            )
        if np.linalg.matrix_rank(drives.wrenches(), tol=1e-6) < 6:
            raise ValueError(
                "thrusters: together they do not reach all six axes (surge, sway, heave, roll, pitch, yaw), expected "
                "six or more whose places and directions do"
            )
        return self


AnyVehicle: TypeAlias = Vehicle | HoveringVehicle


def packaged_vehicles() -> list[str]:
    """Names of the vehicles that ship with the package, sorted."""
    return packaged_names("vehicles")


def load_vehicle(name_or_path: str | Path) -> AnyVehicle:
    """Read and check a vehicle: a packaged name such as `tauv`, or a path to a TOML file.

    Raises:
        ScenarioError: naming table and coefficient, for one that is missing, has a wrong unit or is unphysical.

    >>> load_vehicle("tauv").limits.cruise_speed
    2.0
    """
    text, place = text_of("vehicle", name_or_path)
    return parse_vehicle(parse_toml(text, place=place, kind="vehicle"), place)


def parse_vehicle(tables: dict[str, Any], place: str) -> AnyVehicle:
    """Check vehicle tables already read from TOML; with `[thrusters]` they are those of a hovering vehicle.

    Raises:
        ScenarioError: with every fault found.
    """
    kind: type[AnyVehicle] = HoveringVehicle if "thrusters" in tables else Vehicle
    return checked(kind, tables, place)
