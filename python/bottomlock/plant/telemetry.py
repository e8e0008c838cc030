"""A flight as a table: position, velocity, angles and actuators at a low rate."""

import numpy as np
import polars as pl

from bottomlock.plant.maths import FloatArray
from bottomlock.plant.path import cross_track_m
from bottomlock.plant.truth import Flight
from bottomlock.plant.vehicle import Vehicle


def euler_rad(attitude_t_p: FloatArray) -> FloatArray:
    """Roll, pitch, yaw (z-y-x) of quaternions, scalar first: (n, 4) -> (n, 3), rad."""
    w, x, y, z = attitude_t_p.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - x * z), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=1)


def telemetry(flight: Flight, *, every: int = 15) -> pl.DataFrame:
    """Every n-th sample of a flight (10 Hz by default) as a data frame, SI and rad.

    Columns: trajectory, time_ns, north_m, east_m, depth_m, depth_wanted_m, cross_track_m, leg (True on
    straight segments), speed_mps (over ground), surge_mps, sway_mps, heave_mps, sideslip_rad and
    angle_of_attack_rad (through the water), roll_rad, pitch_rad, yaw_rad, and fin_1_rad to fin_4_rad and shaft_rps, or
    thrust_1_n and so on.
    """
    history, mission = flight.history, flight.mission
    pick = slice(None, None, every)
    state, water = history.state[pick], history.velocity_through_water_p_mps[pick]
    time_ns = history.time_ns[pick]
    offset, nearest = cross_track_m(list(mission.segments), state[:, :2])
    straight = np.array([segment.curvature_pm == 0.0 for segment in mission.segments])[nearest]
    wanted, _ = mission.depth.at(np.asarray(time_ns * 1e-9, dtype=np.float64))
    roll, pitch, yaw = euler_rad(state[:, 3:7]).T
    through = np.linalg.norm(water, axis=1)
    columns: dict[str, FloatArray] = {
        "north_m": state[:, 0],
        "east_m": state[:, 1],
        "depth_m": state[:, 2],
        "depth_wanted_m": wanted,
        "cross_track_m": offset,
    }
    motion: dict[str, FloatArray] = {
        "speed_mps": np.linalg.norm(state[:, 7:10], axis=1),
        "surge_mps": state[:, 7],
        "sway_mps": state[:, 8],
        "heave_mps": state[:, 9],
        "sideslip_rad": np.arcsin(water[:, 1] / through),
        "angle_of_attack_rad": np.arctan2(water[:, 2], water[:, 0]),
        "roll_rad": roll,
        "pitch_rad": pitch,
        "yaw_rad": yaw,
    }
    if isinstance(flight.vehicle, Vehicle):
        drives = {f"fin_{index + 1}_rad": state[:, 13 + index] for index in range(4)} | {
            "shaft_rps": state[:, 17]
        }
    else:
        count = len(flight.vehicle.thrusters.azimuth)
        drives = {f"thrust_{index + 1}_n": state[:, 13 + index] for index in range(count)}
    return pl.DataFrame(
        {
            "trajectory": [mission.name] * len(state),
            "time_ns": time_ns,
            **columns,
            "leg": straight,
            **motion,
            **drives,
        }
    )
