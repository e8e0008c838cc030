"""Thrust and torque of the propeller against shaft speed, with hull interaction."""

from collections.abc import Callable

from bottomlock.plant.maths import Number
from bottomlock.plant.vehicle import Vehicle


def propeller_wrench(
    vehicle: Vehicle,
) -> Callable[[Number, Number], tuple[Number, Number]]:
    """Build net thrust X (N) and roll moment K (N m) from speed u (m/s) and shaft n (rev/s).

    T = rho D⁴ (K_T0 n|n| + K_T1 |n| V_a / D), V_a = (1 - w) u, and the hull gets (1 - t) T. The torque has the same
    form with D⁵, opposite to the rotation (linear in the advance number, as MSS remus100.m). A stopped shaft gives
    neither.
    """
    prop = vehicle.propeller
    density, diameter = vehicle.water.density, prop.diameter
    advance = (1.0 - prop.wake_fraction) / diameter
    thrust = density * diameter**4 * (1.0 - prop.thrust_deduction)
    thrust_0, thrust_1 = thrust * prop.thrust_at_rest, thrust * prop.thrust_slope * advance
    torque = -prop.rotation * density * diameter**5
    torque_0, torque_1 = torque * prop.torque_at_rest, torque * prop.torque_slope * advance

    def wrench(u: Number, shaft: Number) -> tuple[Number, Number]:
        size = abs(shaft)
        return size * (thrust_0 * shaft + thrust_1 * u), size * (torque_0 * shaft + torque_1 * u)

    return wrench
