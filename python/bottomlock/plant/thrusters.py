"""Damping and thrust of a vehicle that thrusters move in every direction."""

from collections.abc import Callable, Sequence

from bottomlock.plant.hovering_vehicle import HoveringVehicle
from bottomlock.plant.maths import Number


def thruster_wrench(vehicle: HoveringVehicle) -> Callable[..., tuple[Number, ...]]:
    """Build damping and thrust: (u, v, w, p, q, r, thrusts) relative to the water -> (X, Y, Z, K, M, N), N and N m.

    Each axis is damped by itself, linear and quadratic (von Benzon et al. 2022); the thrust is that at rest.
    """
    drag = vehicle.damping.axes()
    rows = vehicle.thrusters.wrenches().tolist()
    count = len(rows[0])

    def wrench(
        u: Number, v: Number, w: Number, p: Number, q: Number, r: Number, actuators: Sequence[Number]
    ) -> tuple[Number, ...]:
        thrusts = actuators[:count]
        return tuple(
            sum(k * thrust for k, thrust in zip(row, thrusts, strict=True))
            - (linear + quadratic * abs(x)) * x
            for row, (linear, quadratic), x in zip(rows, drag, (u, v, w, p, q, r), strict=True)
        )

    return wrench
