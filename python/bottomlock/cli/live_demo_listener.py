"""What the listener of `bottomlock live-demo` receives: ODOMETRY messages of MAVLink, as for an autopilot."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.ports.mavlink import dialect

_DIAGONAL = (0, 6, 11)
"""Places of the first three variances in the upper triangle of a 6 by 6 covariance."""


@dataclass(frozen=True)
class Heard:
    """A message: its time, velocity (3,) and 1 sigma (3,) in m/s, platform axes, and the state when it came."""

    time_ns: int
    velocity_mps: NDArray[np.float64]
    sd_mps: NDArray[np.float64]
    state: str


class Listener(asyncio.DatagramProtocol):
    """Parses datagrams and keeps what it has heard.

    Args:
        state: gives the state now.

    Raises:
        ScenarioError: where the MAVLink library is not installed.
    """

    def __init__(self, state: Callable[[], str]) -> None:
        self._link = dialect().MAVLink(None)
        self._state = state
        self.heard: list[Heard] = []

    def datagram_received(self, data: bytes, addr: object) -> None:  # noqa: ARG002 - asyncio's
        """Takes the messages of a datagram."""
        for message in self._link.parse_buffer(data) or ():
            if message.get_type() != "ODOMETRY":
                continue
            velocity = np.array([message.vx, message.vy, message.vz])
            sd = np.array([math.sqrt(message.velocity_covariance[place]) for place in _DIAGONAL])
            self.heard.append(Heard(message.time_usec * 1000, velocity, sd, self._state()))
