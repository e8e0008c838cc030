"""Fin servos and thruster: saturation, rate limit, first-order lag, and a fin that sticks."""

from collections.abc import Callable
from dataclasses import dataclass

from bottomlock.plant.lanes import Lane, Maths
from bottomlock.plant.vehicle import Vehicle


@dataclass(frozen=True)
class StuckFin:
    """Fin `fin` (1 to 4) obeys no command and stands at `angle_rad` throughout."""

    fin: int
    angle_rad: float


def fin_servo(vehicle: Vehicle, maths: Maths[Lane]) -> Callable[[Lane, Lane], Lane]:
    """Build the rate of a fin (rad/s) from its command and its angle (rad).

    The command is clipped, then comes the lag, then the rate limit.
    """
    servo = vehicle.fin_actuator
    limit, rate, corner = servo.max_deflection, servo.max_rate, 1.0 / servo.time_constant
    clip = maths.clip

    def motion(command: Lane, angle: Lane) -> Lane:
        return clip(corner * (clip(command, -limit, limit) - angle), -rate, rate)

    return motion


def thruster(vehicle: Vehicle, maths: Maths[Lane]) -> Callable[[Lane, Lane], Lane]:
    """Build the shaft's acceleration (rev/s²) from the commanded and the actual shaft speed (rev/s)."""
    prop = vehicle.propeller
    limit, rate, corner = prop.max_speed, prop.max_acceleration, 1.0 / prop.time_constant
    clip = maths.clip

    def motion(command: Lane, shaft: Lane) -> Lane:
        return clip(corner * (clip(command, -limit, limit) - shaft), -rate, rate)

    return motion
