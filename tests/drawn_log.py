"""Simulated readings as the arrays of a log that `replay_log` takes."""

from typing import Any


def drawn_log(drawn: Any) -> dict[str, Any]:  # noqa: ANN401 - the kernel's dict
    """Inertial readings, pings and depths of `simulate_sensors`."""
    return {
        "imu_time_ns": drawn["imu_time_ns"],
        "omega_p_radps": drawn["imu_omega_p_radps"],
        "force_p_mps2": drawn["imu_force_p_mps2"],
        "dvl_time_ns": drawn["dvl_time_ns"],
        "beam_velocity_mps": drawn["dvl_velocity_mps"],
        "beam_valid": drawn["dvl_valid"],
        "depth_time_ns": drawn["depth_time_ns"],
        "depth_m": drawn["depth_m"],
    }
