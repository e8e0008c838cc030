"""The coefficients of a vehicle that thrusters move in every direction, such as an ROV.

SNAME notation in the platform frame (FRD) with its origin at the centre of buoyancy; all fields are SI floats.
"""

from typing import Annotated, Self, TypeAlias

import numpy as np
from pydantic import model_validator

from bottomlock.config.meaning import shown
from bottomlock.plant import coefficients as coef
from bottomlock.plant.maths import FloatArray
from bottomlock.plant.vehicle import AddedMass, Limits, RigidBody, Table, Vehicle, Water, check_body


class Damping(Table):
    """Drag of each axis by itself: linear and quadratic in its velocity through the water."""

    surge_linear: Annotated[
        coef.LinearDrag, shown(example={"value": 13.7, "unit": "N s/m", "source": "basin"})
    ]
    """drag in surge over speed"""
    surge_quadratic: Annotated[
        coef.QuadraticDrag, shown(example={"value": 141.0, "unit": "kg/m", "source": "basin"})
    ]
    """drag in surge over speed squared"""
    sway_linear: Annotated[coef.LinearDrag, shown(example={"value": 0.0, "unit": "N s/m", "source": "basin"})]
    """drag in sway over speed"""
    sway_quadratic: Annotated[
        coef.QuadraticDrag, shown(example={"value": 217.0, "unit": "kg/m", "source": "basin"})
    ]
    """drag in sway over speed squared"""
    heave_linear: Annotated[
        coef.LinearDrag, shown(example={"value": 33.0, "unit": "N s/m", "source": "basin"})
    ]
    """drag in heave over speed"""
    heave_quadratic: Annotated[
        coef.QuadraticDrag, shown(example={"value": 190.0, "unit": "kg/m", "source": "basin"})
    ]
    """drag in heave over speed squared"""
    roll_linear: Annotated[
        coef.LinearRotaryDrag, shown(example={"value": 0.0, "unit": "N m s/rad", "source": "basin"})
    ]
    """damping of roll over its rate"""
    roll_quadratic: Annotated[
        coef.RotaryDrag, shown(example={"value": 1.19, "unit": "kg m2", "source": "basin"})
    ]
    """damping of roll over its rate squared"""
    pitch_linear: Annotated[
        coef.LinearRotaryDrag, shown(example={"value": 0.8, "unit": "N m s/rad", "source": "basin"})
    ]
    """damping of pitch over its rate"""
    pitch_quadratic: Annotated[
        coef.RotaryDrag, shown(example={"value": 0.47, "unit": "kg m2", "source": "basin"})
    ]
    """damping of pitch over its rate squared"""
    yaw_linear: Annotated[
        coef.LinearRotaryDrag, shown(example={"value": 0.0, "unit": "N m s/rad", "source": "basin"})
    ]
    """damping of yaw over its rate"""
    yaw_quadratic: Annotated[
        coef.RotaryDrag, shown(example={"value": 1.5, "unit": "kg m2", "source": "basin"})
    ]
    """damping of yaw over its rate squared"""

    def axes(self) -> list[tuple[float, float]]:
        """Linear and quadratic drag of surge, sway, heave, roll, pitch and yaw."""
        values = list(self.model_dump().values())
        return list(zip(values[::2], values[1::2], strict=True))


class Thrusters(Table):
    """Place and direction of each thruster, their greatest thrust and lag; a list has an entry a thruster."""

    position_x: Annotated[
        tuple[coef.Length, ...], shown(example=[{"value": 0.156, "unit": "m", "source": "drawing"}])
    ]
    """where each thruster stands, forward of the centre of buoyancy; six or more"""
    position_y: Annotated[
        tuple[coef.Length, ...], shown(example=[{"value": 0.111, "unit": "m", "source": "drawing"}])
    ]
    """the same, starboard"""
    position_z: Annotated[
        tuple[coef.Length, ...], shown(example=[{"value": 0.0, "unit": "m", "source": "drawing"}])
    ]
    """the same, down"""
    azimuth: Annotated[
        tuple[coef.Angle, ...], shown(example=[{"value": -45.0, "unit": "deg", "source": "drawing"}])
    ]
    """direction in which each one pushes the vehicle, from forward to starboard"""
    elevation: Annotated[
        tuple[coef.Angle, ...], shown(example=[{"value": 0.0, "unit": "deg", "source": "drawing"}])
    ]
    """the same, above the level"""
    max_thrust: Annotated[
        coef.PositiveForce, shown(example={"value": 40.0, "unit": "N", "source": "data sheet"})
    ]
    """greatest thrust of each, both ways"""
    time_constant: Annotated[
        coef.PositiveTime, shown(example={"value": 0.15, "unit": "s", "source": "assumed"})
    ]
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

    proportional: Annotated[
        coef.ForcePerSpeed, shown(example={"value": 60.0, "unit": "N s/m", "source": "design"})
    ]
    """force for each m/s of error"""
    integral: Annotated[
        coef.ForcePerDistance, shown(example={"value": 60.0, "unit": "N/m", "source": "design"})
    ]
    """force for each metre of integrated error"""
    tracking_time: Annotated[
        coef.PositiveTime, shown(example={"value": 1.0, "unit": "s", "source": "design"})
    ]
    """time in which anti-windup unwinds the integral"""
    limit: Annotated[coef.PositiveForce, shown(example={"value": 80.0, "unit": "N", "source": "design"})]
    """greatest force that it asks for"""


class AnglePid(Table):
    """A PID controller from an angle error to a moment, with its limit."""

    proportional: Annotated[
        coef.MomentPerAngle, shown(example={"value": 4.0, "unit": "N m/rad", "source": "design"})
    ]
    """moment for each rad of error"""
    integral: Annotated[
        coef.MomentPerAngleSecond, shown(example={"value": 1.0, "unit": "N m/(rad s)", "source": "design"})
    ]
    """moment for each rad s of integrated error"""
    derivative: Annotated[
        coef.MomentPerRate, shown(example={"value": 3.0, "unit": "N m s/rad", "source": "design"})
    ]
    """moment for each rad/s of error"""
    tracking_time: Annotated[
        coef.PositiveTime, shown(example={"value": 3.0, "unit": "s", "source": "design"})
    ]
    """time in which anti-windup unwinds the integral"""
    limit: Annotated[coef.PositiveMoment, shown(example={"value": 10.0, "unit": "N m", "source": "design"})]
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


class HoveringGuidance(Table):
    """Line-of-sight look-ahead, target approach speed, and the gain from depth error to sink rate."""

    look_ahead: Annotated[coef.PositiveLength, shown(example={"value": 2.0, "unit": "m", "source": "design"})]
    """look-ahead of line-of-sight guidance"""
    approach_speed: Annotated[
        coef.PositiveSpeed, shown(example={"value": 0.2, "unit": "m/s", "source": "design"})
    ]
    """greatest approach speed of constant-bearing guidance"""
    depth_gain: Annotated[coef.PerTime, shown(example={"value": 0.5, "unit": "1/s", "source": "design"})]
    """sink rate for each metre of depth error"""


class HoveringVehicle(Table):
    """Every coefficient of a vehicle that thrusters move in every direction, SI; see `load_vehicle`."""

    name: Annotated[str, shown(example="bluerov2_heavy")]
    """name of the vehicle"""
    description: Annotated[str, shown(example="ROV with eight thrusters")]
    """one sentence for pages"""
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
