"""A start after the first one: what the configuration states was so then, and what is measured is measured again."""

import math
from dataclasses import dataclass

import numpy as np

from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.kernel import Navigator
from bottomlock.kernel.models import InitialModel, InitialState
from bottomlock.live.sections import StartSection
from bottomlock.recordings.rotation import angles
from bottomlock.recordings.streams import Floats

ANY_YAW_SD_RAD = math.pi / math.sqrt(3.0)
"""1 sigma of a yaw that may be any."""


@dataclass(frozen=True, eq=False)
class LeftOff:
    """Where a navigator was that was given up, and which way it pointed.

    Attributes:
        time_ns: of its last estimate.
        position_m, position_sd_m: (3,) north, east, down, and 1 sigma.
        speed_mps: over ground.
        yaw_rad, yaw_sd_rad: of the platform, and 1 sigma.
    """

    time_ns: int
    position_m: Floats
    position_sd_m: Floats
    speed_mps: float
    yaw_rad: float
    yaw_sd_rad: float

    @classmethod
    def of(cls, navigator: Navigator) -> "LeftOff":
        """That of a navigator."""
        state, sd = navigator.state(), np.sqrt(np.diag(navigator.covariance()))
        yaw_rad = float(angles(np.asarray(state["attitude_t_p"]))[2])
        speed_mps = float(np.linalg.norm(state["velocity_p_mps"]))
        position_m = np.asarray(state["position_t_m"])
        return cls(int(state["time_ns"]), position_m, sd[:3], speed_mps, yaw_rad, float(sd[5]))

    def section(self, start: StartSection, attitude: AttitudeReference | None) -> StartSection:
        """The section of the next start: heading of [attitude] or as it was, velocity of the beams."""
        # What was stated is measured now, and a 1 sigma that was stated with it is not that of the measurement.
        of_the_first = (
            (start.heading_deg is not None, ("heading_deg", "heading_sd_deg")),
            ("position_m" in start.model_fields_set, ("position_m", "position_sd_m")),
            (start.velocity == "given", ("velocity", "velocity_mps", "velocity_sd_mps")),
        )
        stated = {key for is_stated, keys in of_the_first if is_stated for key in keys}
        kept = start.model_dump(exclude_unset=True, exclude=stated)
        if attitude is None:
            sd_deg = math.degrees(ANY_YAW_SD_RAD)
            kept |= {"heading_deg": math.degrees(self.yaw_rad), "heading_sd_deg": sd_deg}
        return StartSection.model_validate(kept)

    def state(self, state: InitialState, depth_m: float | None) -> InitialState:
        """The state of the next start: at the place where it was, at the depth now."""
        north, east, down = self.position_m
        return state.replace(position_t_m=(north, east, down if depth_m is None else depth_m))

    def initial(
        self,
        initial: InitialModel,
        state: InitialState,
        attitude: AttitudeReference | None,
        *,
        depth_m: float | None,
        turning_sd_radps: float,
    ) -> InitialModel:
        """The covariance of the next start, grown by what may have happened since.

        Args:
            initial: that of its section.
            state: of the next start.
            attitude: gives the heading; None without.
            depth_m: of the next start; None without a depth sensor.
            turning_sd_radps: turning that may happen unseen.
        """
        away_s = (state.time_ns - self.time_ns) * 1e-9
        gone_m = away_s * max(self.speed_mps, float(np.linalg.norm(state.velocity_p_mps)))
        north, east, down = np.hypot(self.position_sd_m, gone_m).tolist()
        yaw_sd = initial.attitude_sd_rad[2]
        if attitude is None:
            yaw_sd = min(math.hypot(self.yaw_sd_rad, turning_sd_radps * away_s), yaw_sd)
        return initial.replace(
            position_sd_m=(north, east, down if depth_m is None else initial.position_sd_m[2]),
            attitude_sd_rad=(*initial.attitude_sd_rad[:2], yaw_sd),
        )
