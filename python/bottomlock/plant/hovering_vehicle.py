"""The coefficients of a vehicle that thrusters move in every direction, such as an ROV.

SNAME notation in the platform frame (FRD) with its origin at the centre of buoyancy; all fields are SI floats.
"""

from typing import Self, TypeAlias

import numpy as np
from pydantic import model_validator

from bottomlock.plant import coefficients as coef
from bottomlock.plant.maths import FloatArray
from bottomlock.plant.vehicle import AddedMass, Limits, RigidBody, Table, Vehicle, Water, check_body


class Damping(Table):
    """Drag of each axis by itself: linear and quadratic in its velocity through the water."""

    surge_linear: coef.LinearDrag
    surge_quadratic: coef.QuadraticDrag
    sway_linear: coef.LinearDrag
    sway_quadratic: coef.QuadraticDrag
    heave_linear: coef.LinearDrag
    heave_quadratic: coef.QuadraticDrag
    roll_linear: coef.LinearRotaryDrag
    roll_quadratic: coef.RotaryDrag
    pitch_linear: coef.LinearRotaryDrag
    pitch_quadratic: coef.RotaryDrag
    yaw_linear: coef.LinearRotaryDrag
    yaw_quadratic: coef.RotaryDrag

    def axes(self) -> list[tuple[float, float]]:
        """Linear and quadratic drag of surge, sway, heave, roll, pitch and yaw."""
        values = list(self.model_dump().values())
        return list(zip(values[::2], values[1::2], strict=True))


class Thrusters(Table):
    """Place and direction of each thruster, their greatest thrust and lag; a list has an entry a thruster."""

    position_x: tuple[coef.Length, ...]
    position_y: tuple[coef.Length, ...]
    position_z: tuple[coef.Length, ...]
    azimuth: tuple[coef.Angle, ...]
    elevation: tuple[coef.Angle, ...]
    max_thrust: coef.PositiveForce
    time_constant: coef.PositiveTime

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
    integral: coef.ForcePerDistance
    tracking_time: coef.PositiveTime
    limit: coef.PositiveForce


class AnglePid(Table):
    """A PID controller from an angle error to a moment, with its limit."""

    proportional: coef.MomentPerAngle
    integral: coef.MomentPerAngleSecond
    derivative: coef.MomentPerRate
    tracking_time: coef.PositiveTime
    limit: coef.PositiveMoment


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


class HoveringGuidance(Table):
    """Line-of-sight look-ahead, target approach speed, and the gain from depth error to sink rate."""

    look_ahead: coef.PositiveLength
    approach_speed: coef.PositiveSpeed
    depth_gain: coef.PerTime


class HoveringVehicle(Table):
    """Every coefficient of a vehicle that thrusters move in every direction, SI; see `load_vehicle`."""

    name: str
    description: str
    water: Water
    rigid_body: RigidBody
    damping: Damping
    added_mass: AddedMass
    thrusters: Thrusters
    autopilot: HoveringAutopilot
    guidance: HoveringGuidance
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
