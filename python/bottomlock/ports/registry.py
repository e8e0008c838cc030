"""Registry of the ports by name.

A new port is a file with a class and a line in `PORTS` below.
"""

from typing import Any

from pydantic import ValidationError

from bottomlock.config.validation import refusal
from bottomlock.errors import ScenarioError
from bottomlock.ports.distance_sensor import DistanceSensor
from bottomlock.ports.mip import MicroStrain
from bottomlock.ports.odometry import Odometry
from bottomlock.ports.port import Port
from bottomlock.ports.restored import Pd0, WaterLinkedJson
from bottomlock.ports.ros_dvl import RosDvl
from bottomlock.ports.ros_velocity import RosOdometry, RosTransform, RosTwist, RosVelocity
from bottomlock.ports.sentence import Sentence
from bottomlock.ports.vision_position_delta import VisionPositionDelta
from bottomlock.ports.vision_speed_estimate import VisionSpeedEstimate
from bottomlock.text import did_you_mean

_CLASSES: tuple[type[Port], ...] = (
    VisionPositionDelta, VisionSpeedEstimate, Odometry, DistanceSensor, MicroStrain, RosVelocity, RosTwist, RosDvl,
    RosOdometry, RosTransform, WaterLinkedJson, Pd0, Sentence,
)  # fmt: skip
PORTS: dict[str, type[Port]] = {one.name: one for one in _CLASSES}


def port(name: str, **settings: Any) -> Port:  # noqa: ANN401 - the settings of each port have their types there
    """The port of a name with its settings.

    Raises:
        ScenarioError: for an unknown name or key, which names the nearest, or a value out of range.
    """
    make = PORTS.get(name)
    if make is None:
        hint = did_you_mean(name, PORTS, f" (known: {', '.join(PORTS)})")
        raise ScenarioError(f"unknown name '{name}'{hint}", place="port")
    try:
        return make(**settings)
    except ValidationError as error:
        raise refusal(error, f"port {name}", make) from error
