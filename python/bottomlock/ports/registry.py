"""Registry of the ports by name.

A new port is a file with a class and a line in `PORTS` below.
"""

import inspect
from collections.abc import Callable
from typing import Any

from bottomlock.errors import ScenarioError
from bottomlock.kernel import BeamGeometry
from bottomlock.ports.distance_sensor import DistanceSensor
from bottomlock.ports.mip import MicroStrain
from bottomlock.ports.odometry import Odometry
from bottomlock.ports.port import Port
from bottomlock.ports.restored import Pd0, WaterLinkedJson
from bottomlock.ports.ros_dvl import RosDvl
from bottomlock.ports.ros_odometry import RosOdometry, RosTransform
from bottomlock.ports.ros_velocity import RosTwist, RosVelocity
from bottomlock.ports.sentence import Sentence
from bottomlock.ports.vision_position_delta import VisionPositionDelta
from bottomlock.ports.vision_speed_estimate import VisionSpeedEstimate
from bottomlock.support.nearest import did_you_mean

_CLASSES: tuple[type[Port], ...] = (
    VisionPositionDelta,
    VisionSpeedEstimate,
    Odometry,
    DistanceSensor,
    MicroStrain,
    RosVelocity,
    RosTwist,
    RosDvl,
    RosOdometry,
    RosTransform,
    WaterLinkedJson,
    Pd0,
    Sentence,
)
PORTS: dict[str, Callable[..., Port]] = {one.name: one for one in _CLASSES}


def port(name: str, **settings: Any) -> Port:  # noqa: ANN401 - the settings of each port have their types there
    """The port of a name with its settings.

    Raises:
        ScenarioError: for an unknown name or key, which names the nearest, or a value out of range.
    """
    make = PORTS.get(name)
    if make is None:
        raise ScenarioError(f"unknown name '{name}'{_nearest(name, list(PORTS))}", place="port")
    parameters = inspect.signature(make).parameters
    for key in settings:
        if key not in parameters:
            raise ScenarioError(f"unknown key '{key}'{_nearest(key, list(parameters))}", place=f"port {name}")
    for key, parameter in parameters.items():
        if parameter.default is parameter.empty and key not in settings:
            raise ScenarioError("is missing", place=f"port {name}", key=f"'{key}'")
    geometry = settings.get("geometry")
    if "geometry" in settings and not isinstance(geometry, BeamGeometry):
        raise ScenarioError(
            f"geometry is of type {type(geometry).__name__}", place=f"port {name}", expected="a BeamGeometry"
        )
    return make(**settings)


def _nearest(word: str, known: list[str]) -> str:
    return did_you_mean(word, known, f" (known: {', '.join(known) or 'none'})")
