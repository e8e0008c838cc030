"""What the MAVLink 2 messages share, by pymavlink (extra `mavlink`).

The dialect module of version 2 is used whatever `MAVLINK20` says: ODOMETRY and the covariance of VISION_SPEED_ESTIMATE
exist in version 2 only. Numbers are 32-bit floats; a variance is rounded up to one.

Sources: message definitions of MAVLink (common.xml, ardupilotmega.xml). What the receivers do: AP_VisualOdom,
NavEKF3_core::writeBodyFrameOdom, and PX4's ekf2 (docs/ports.md).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import ScenarioError
from bottomlock.ports.base import PortBase
from bottomlock.ports.estimate import Estimate

Floats = NDArray[np.float64]

VISUAL_INERTIAL_ODOMETRY = 197
"""MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY."""


def dialect() -> Any:  # noqa: ANN401 - the library is not typed
    """The library's module of the dialect "ardupilotmega", version 2.

    Raises:
        ScenarioError: where the library is not installed.
    """
    try:
        from pymavlink.dialects.v20 import ardupilotmega  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ScenarioError(
            "MAVLink needs the library pymavlink: python -m pip install 'bottomlock[mavlink]'"
        ) from error
    return ardupilotmega


class MavlinkPort(PortBase):
    """Base of the MAVLink ports.

    Args:
        max_rate_hz: most messages a second in mode navigation, where the autopilot estimates from the same inertial
            sensors: consecutive errors of ours are alike, and each message counts as a new one. In mode velocity
            every ping is a new measurement, and none is held back.
        variance_factor: factor on the covariance in mode navigation, for the same reason.
        system_id: of the sender.
        component_id: of the sender.
    """

    def __init__(
        self, *, max_rate_hz: float, variance_factor: float, system_id: int, component_id: int
    ) -> None:
        super().__init__(max_rate_hz=max_rate_hz)
        self._factor = self._positive("variance_factor", variance_factor)
        if self._factor < 1.0:
            raise ScenarioError(f"port {self.name}: variance_factor is {variance_factor}, expected >= 1")
        self._dialect = dialect()
        self._link = self._dialect.MAVLink(
            None,
            srcSystem=self._whole("system_id", system_id, 1, 255),
            srcComponent=self._whole("component_id", component_id, 1, 255),
        )

    def _waits(self, estimate: Estimate) -> str | None:
        return super()._waits(estimate) if estimate.mode == "navigation" else None

    def _covariance(self, estimate: Estimate) -> Floats:
        """(3, 3) of the velocity, with the factor of mode navigation."""
        factor = self._factor if estimate.mode == "navigation" else 1.0
        return estimate.covariance_m2ps2 * factor

    def _above(self, sd_mps: float, noise_mps: float | None) -> str | None:
        """Why a receiver with a σ of its own, `noise_mps`, gets no estimate; None for one without, or where it may."""
        if noise_mps is None or sd_mps <= noise_mps:
            return None
        return f"σ is {sd_mps:.3f} m/s, above receiver_noise_mps, {noise_mps}, which the receiver would use"

    def _pack(self, message: Any) -> bytes:  # noqa: ANN401 - the library is not typed
        data = bytes(message.pack(self._link))
        self._link.seq = (self._link.seq + 1) % 256
        return data
