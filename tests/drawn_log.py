"""Simulated readings as the arrays of a log that `replay_log` takes."""

from typing import Any

COLUMNS = {
    "depth": ("depth_m",), "heading": ("heading_rad",), "gps": ("gps_position_t_m",),
    "acoustic_position": ("acoustic_position_t_m", "acoustic_position_sd_m"),
}  # fmt: skip


def drawn_log(drawn: Any, *sensors: str, **changed: Any) -> Any:  # noqa: ANN401 - the kernel's dicts
    """Inertial readings, pings and depths of `simulate_sensors`, further sensors, and what a test changes."""
    log = {
        "imu_time_ns": drawn["imu_time_ns"], "omega_p_radps": drawn["imu_omega_p_radps"],
        "force_p_mps2": drawn["imu_force_p_mps2"], "dvl_time_ns": drawn["dvl_time_ns"],
        "beam_velocity_mps": drawn["dvl_velocity_mps"], "beam_valid": drawn["dvl_valid"],
    }  # fmt: skip
    for sensor in ("depth", *sensors):
        log |= {name: drawn[name] for name in (f"{sensor}_time_ns", *COLUMNS[sensor])}
    return log | changed
