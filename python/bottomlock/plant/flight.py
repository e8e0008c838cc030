"""From a mission to the truth from which the sensors are simulated, and to a table of the flight."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import polars as pl

from bottomlock.config.scenario import EARTH_RATE_RADPS
from bottomlock.plant.equations import to_platform
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import FloatArray
from bottomlock.plant.mission import Mission
from bottomlock.plant.path import cross_track_m
from bottomlock.plant.swim import StateHistory, swim
from bottomlock.plant.vehicle import Vehicle
from bottomlock.truth import Truth


def inertial_measurements(
    state: FloatArray,
    acceleration: FloatArray,
    *,
    latitude_rad: float,
    gravity_mps2: float,
    earth_rate_radps: float,
) -> tuple[FloatArray, FloatArray]:
    """Inertial rate w_ip (rad/s) and specific force (m/s²), both (N, 3), platform frame.

    The mechanisation v' = f + R' g - (w_ip + R' w_ie) x v solved for f, with v' of the equations of motion;
    w_ip = w_tp + R' w_ie.
    """
    q0, q1, q2, q3 = state[:, 3:7].T
    north = np.full_like(q0, earth_rate_radps * np.cos(latitude_rad))
    down = np.full_like(q0, -earth_rate_radps * np.sin(latitude_rad))
    level = np.zeros_like(q0)
    earth_p = np.stack(to_platform(q0, q1, q2, q3, north, level, down), axis=1)
    gravity_p = np.stack(to_platform(q0, q1, q2, q3, level, level, level + gravity_mps2), axis=1)
    omega = state[:, 10:13] + earth_p
    force = acceleration[:, :3] - gravity_p + np.cross(omega + earth_p, state[:, 7:10])
    return omega, force


@dataclass(frozen=True)
class Flight:
    """A simulated mission: the truth for the sensors, and the vehicle's whole state history."""

    vehicle: AnyVehicle
    mission: Mission
    history: StateHistory
    truth: Truth


def fly(
    vehicle: AnyVehicle,
    mission: Mission,
    *,
    latitude_rad: float,
    gravity_mps2: float,
    earth_rate_radps: float = EARTH_RATE_RADPS,
    imu_rate_hz: float = 150.0,
) -> Flight:
    """Check the vehicle, integrate the mission controlled on the truth, and return the truth at the IMU's rate.

    Latitude in rad, gravity in m/s² (the kernel's normal gravity). The same arguments give the same bits.

    Raises:
        ScenarioError: for a vehicle without a stable trim, or a mission outside its limits.

    >>> from bottomlock.plant import load_vehicle, straight
    >>> mission = straight(duration_s=1.0)
    >>> flight = fly(load_vehicle("tauv"), mission, latitude_rad=0.57, gravity_mps2=9.795)
    >>> len(flight.truth.time_ns)
    151
    """
    history = _history(vehicle, mission, gravity_mps2, imu_rate_hz)
    omega, force = inertial_measurements(
        history.state,
        history.acceleration,
        latitude_rad=latitude_rad,
        gravity_mps2=gravity_mps2,
        earth_rate_radps=earth_rate_radps,
    )
    truth = Truth(
        time_ns=history.time_ns,
        position_t_m=history.state[:, 0:3].copy(),
        attitude_t_p=history.state[:, 3:7].copy(),
        velocity_p_mps=history.state[:, 7:10].copy(),
        omega_p_radps=omega,
        force_p_mps2=force,
        latitude_rad=latitude_rad,
        gravity_mps2=gravity_mps2,
    )
    return Flight(vehicle, mission, history, truth)


@lru_cache(maxsize=4)
def _history(vehicle: AnyVehicle, mission: Mission, gravity_mps2: float, imu_rate_hz: float) -> StateHistory:
    """The state history; a sweep asks for that of the same few missions for every value."""
    return swim(vehicle, mission, gravity_mps2=gravity_mps2, imu_rate_hz=imu_rate_hz)


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
    offset, nearest = cross_track_m(mission.segments, state[:, :2])
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
