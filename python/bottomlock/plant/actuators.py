"""Fin servos and thruster: saturation, rate limit, first-order lag, and a stuck fin."""

from collections.abc import Callable
from dataclasses import dataclass

from bottomlock.plant.equations import Four
from bottomlock.plant.maths import Maths, Number
from bottomlock.plant.vehicle import Vehicle


@dataclass(frozen=True)
class StuckFin:
    """Fin `fin` (1 to 4) stays at `angle_rad` throughout, whatever its command."""

    fin: int
    angle_rad: float


def fin_servo(vehicle: Vehicle, maths: Maths[Number]) -> Callable[[Number, Number], Number]:
    """Build the rate of a fin (rad/s) from its command and its angle (rad).

    The command is clipped, then lagged, then rate-limited.
    """
    servo = vehicle.fin_actuator
    limit, rate, corner = servo.max_deflection, servo.max_rate, 1.0 / servo.time_constant
    clip = maths.clip

    def motion(command: Number, angle: Number) -> Number:
        return clip(corner * (clip(command, -limit, limit) - angle), -rate, rate)

    return motion


def thruster(vehicle: Vehicle, maths: Maths[Number]) -> Callable[[Number, Number], Number]:
    """Build the shaft's acceleration (rev/s²) from the commanded and the actual shaft speed (rev/s)."""
    prop = vehicle.propeller
    limit, rate, corner = prop.max_speed, prop.max_acceleration, 1.0 / prop.time_constant
    clip = maths.clip

    def motion(command: Number, shaft: Number) -> Number:
        return clip(corner * (clip(command, -limit, limit) - shaft), -rate, rate)

    return motion


def actuator_rates(
    vehicle: Vehicle, maths: Maths[Number], stuck: StuckFin | None
) -> Callable[[Four[Number], Four[Number], Number, Number], tuple[list[Number], Number]]:
    """Build the rates of all actuators.

    The function takes the fin commands and fin angles (rad) and the commanded and actual shaft speed (rev/s), and
    returns the fin rates (rad/s) and the shaft's acceleration (rev/s²). A stuck fin is held at its angle by a fast lag.
    """
    servo, motor = fin_servo(vehicle, maths), thruster(vehicle, maths)
    index = stuck.fin - 1 if stuck is not None else -1
    angle_rad = stuck.angle_rad if stuck is not None else 0.0

    def rates(
        commands: Four[Number], angles: Four[Number], shaft_command: Number, shaft: Number
    ) -> tuple[list[Number], Number]:
        fin_rates = [servo(command, angle) for command, angle in zip(commands, angles, strict=True)]
        if index >= 0:
            fin_rates[index] = 50.0 * (angle_rad - angles[index])
        return fin_rates, motor(shaft_command, shaft)

    return rates
