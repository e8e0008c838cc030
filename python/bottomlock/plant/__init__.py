"""A vehicle in six degrees of freedom that swims missions over a seabed, and the truth that results.

Frames: tangent NED fixed to the Earth, platform FRD at the centre of buoyancy. SI and radians throughout; SNAME
notation for coefficients. From file to truth: `load_vehicle` -> a `Mission` -> `fly` -> `Flight.truth`.
"""

from bottomlock.plant.control import StuckFin
from bottomlock.plant.flight import Flight, fly, telemetry
from bottomlock.plant.hovering_vehicle import AnyVehicle, HoveringVehicle, load_vehicle, packaged_vehicles
from bottomlock.plant.mission import (
    Current,
    DepthProfile,
    Mission,
    figure_eight,
    lawn_mower,
    straight,
    waypoint_mission,
)
from bottomlock.plant.swim import StateHistory, swim
from bottomlock.plant.vehicle import Vehicle

__all__ = [
    "AnyVehicle", "Current", "DepthProfile", "Flight", "HoveringVehicle", "Mission", "StateHistory",
    "StuckFin", "Vehicle", "figure_eight", "fly", "lawn_mower", "load_vehicle", "packaged_vehicles",
    "straight", "swim", "telemetry", "waypoint_mission",
]  # fmt: skip
