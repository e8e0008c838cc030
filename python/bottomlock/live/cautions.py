"""What the receivers of a configuration will not do, told at the start."""

from bottomlock.live.config import LiveConfig
from bottomlock.live.sections import DVL_FORMATS
from bottomlock.ports.mavlink import MAX_RATE_HZ

PX4_START_S = 0.2
"""PX4's EKF2 begins with external vision where two messages are less than this apart (EV_MAX_INTERVAL)."""


def cautions(config: LiveConfig) -> list[str]:
    """What PX4 and ArduPilot will not do with these ports, a line each: they begin to aid only under conditions."""
    found = []
    for section in config.port:
        if section.port == "odometry" and section.settings.get("receiver", "px4") == "px4":
            dvl_hz = min(one.rate_hz for one in config.source if one.format in DVL_FORMATS)
            slow = 1.0 / dvl_hz
            if config.mode == "navigation":
                slow = 1.0 / (section.rate_hz or MAX_RATE_HZ) + 1.0 / config.navigation.estimate_hz
            if slow >= PX4_START_S:
                found.append(
                    f"port odometry: messages may be {slow:.2g} s apart, "
                    f"and PX4 begins to aid only below {PX4_START_S} s"
                )
        if section.port == "vision_speed_estimate" and not any(
            one.port == "odometry" and one.to == section.to for one in config.port
        ):
            found.append(
                "port vision_speed_estimate: ArduPilot begins external navigation only with positions beside it "
                "(EK3_SRC1_POSXY = 6): port odometry with settings.receiver = 'ardupilot' sends both"
            )
    return found
