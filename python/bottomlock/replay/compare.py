"""Tables of a replay: estimates, errors against the reference, innovations, beams, currents, fit of readings."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.files.replay_tables import (
    CURRENTS,
    FORWARD,
    IMU_FAULTS,
    PATH,
    REPLAY_SAMPLES,
    SMOOTHED,
    innovations_schema,
    pings_schema,
)
from bottomlock.geodesy import geodetic_from_tangent
from bottomlock.kernel import FIX_STATUS
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.axes import from_quaternions, to_angles
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.case import Case
from bottomlock.replay.rerun import PreparedRun, Rerun
from bottomlock.replay.streams import Streams
from bottomlock.replay.vehicle_motion import level_axes

_NED, _AXES, _ANGLES = ("north", "east", "down"), ("surge", "sway", "heave"), ("roll", "pitch", "yaw")


def filter_passes(case: Case, rerun: Rerun) -> Iterator[tuple[str, str, dict[str, Floats]]]:
    """Pass, method and states of every forward and every smoothed pass, with the same names; dead reckoning too."""
    names = ("position_t_m", "attitude_t_p", "velocity_p_mps", "sd")
    for index, method in enumerate(case.replay.filters):
        yield FORWARD, method, {name: np.asarray(rerun.result[name][index]) for name in names}
    if rerun.reckoned is not None:
        yield FORWARD, DEAD_RECKONING, dict(rerun.reckoned)
    for index, method in enumerate(rerun.smoothed_methods):
        states = {name: np.asarray(rerun.smoothed[f"smoothed_{name}"][index]) for name in names}
        yield SMOOTHED, method, states


def samples_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per method, pass and time (`files.replay_tables.REPLAY_SAMPLES`)."""
    parts = []
    prepared = rerun.prepared
    for name, method, states in filter_passes(case, rerun):
        columns: dict[str, Any] = {"method": method, "pass": name, "time_ns": prepared.sample_time_ns}
        columns |= _estimate(states, prepared) | _errors(states, prepared)
        parts.append(_table(case, what_if, columns, REPLAY_SAMPLES))
    return pl.concat(parts)


def _table(case: Case, what_if: str, columns: Mapping[str, Any], schema: Mapping[str, Any]) -> pl.DataFrame:
    """Columns (n,) as a table, those of the case before them; what is no number is empty."""
    count = max(len(values) for values in columns.values() if not isinstance(values, str))
    every = {"case": [case.name] * count, "what_if": what_if} | dict(columns)
    frame = pl.DataFrame({key: every[key] for key in schema}, schema=dict(schema))
    return frame.with_columns(pl.col(pl.Float64).fill_nan(None))


def _estimate(states: Mapping[str, Floats], prepared: PreparedRun) -> dict[str, Floats]:
    """Position in the tangent frame and in geodetic coordinates; angles against level and true north at the place."""
    position, streams = states["position_t_m"], prepared.streams
    level = level_axes(prepared.model.environment, position)
    angles = np.rad2deg(to_angles(level.inv() * from_quaternions(states["attitude_t_p"])))
    columns = {f"{axis}_m": position[:, k] for k, axis in enumerate(_NED)}
    columns |= {f"{axis}_deg": angles[:, k] for k, axis in enumerate(_ANGLES)}
    columns |= {f"{axis}_mps": states["velocity_p_mps"][:, k] for k, axis in enumerate(_AXES)}
    latitude = longitude = height = np.full(len(position), np.nan)
    if streams.origin is not None:
        latitude, longitude, height = geodetic_from_tangent(position, streams.origin)
    return columns | {
        "latitude_deg": np.rad2deg(latitude),
        "longitude_deg": np.rad2deg(longitude),
        "height_m": height,
    }


def _errors(states: Mapping[str, Floats], prepared: PreparedRun) -> dict[str, Floats]:
    """Errors (reference minus estimate) and the filter's standard deviations; NaN without a reference."""
    position, velocity, attitude = errors_of(states, prepared)
    sd = states["sd"]
    columns: dict[str, Floats] = {}
    for k, axis in enumerate(_NED):
        columns |= {f"err_position_{axis}_m": position[:, k], f"sd_position_{axis}_m": sd[:, k]}
        columns |= {
            f"err_misalignment_{axis}_rad": attitude[:, k],
            f"sd_misalignment_{axis}_rad": sd[:, 3 + k],
        }
    for k, axis in enumerate(_AXES):
        columns |= {f"err_velocity_{axis}_mps": velocity[:, k], f"sd_velocity_{axis}_mps": sd[:, 6 + k]}
    return columns


def errors_of(states: Mapping[str, Floats], prepared: PreparedRun) -> tuple[Floats, Floats, Floats]:
    """Errors of position (tangent frame), velocity (platform) and attitude (ρ, tangent), (T, 3) each, m, m/s, rad.

    Without a height of the reference the error down is NaN, and where it has no row every error.

    The estimates are at the times of inertial readings, the reference up to one reading earlier. The estimate is
    propagated back over that interval with its own velocity and the gyro's rate.
    """
    count = len(prepared.sample_time_ns)
    absent = np.full((count, 3), np.nan)
    reference = prepared.streams.reference
    if reference is None:
        return absent, absent, absent
    rows = prepared.rows
    back_s = (prepared.sample_time_ns - reference.time_ns[rows])[:, None] * 1e-9
    inertial = prepared.streams.inertial
    omega = inertial.omega_p_radps[np.searchsorted(inertial.time_ns, prepared.sample_time_ns)]
    attitude = from_quaternions(states["attitude_t_p"])
    attitude_then = attitude * Rotation.from_rotvec(-omega * back_s)
    position = velocity = misalignment = absent
    if reference.position_t_m is not None:
        position_then = states["position_t_m"] - attitude.apply(states["velocity_p_mps"]) * back_s
        position = reference.position_t_m[rows] - position_then
        if not reference.has_down:
            position[:, 2] = np.nan
    if reference.velocity_p_mps is not None:
        velocity = reference.velocity_p_mps[rows] - states["velocity_p_mps"]
    if reference.attitude is not None:
        # Recorded angles are those against level and north at the vehicle.
        level = level_axes(prepared.model.environment, states["position_t_m"])
        misalignment = (level * reference.attitude[rows] * attitude_then.inv()).as_rotvec()
    position, velocity, misalignment = (
        np.where(rows[:, None] < 0, np.nan, one) for one in (position, velocity, misalignment)
    )
    return position, velocity, misalignment


def innovations_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per method and ping (`files.replay_tables.innovations_schema`)."""
    prepared, result = rerun.prepared, rerun.result
    times = prepared.streams.beams.time_ns[prepared.pings]
    beams = rerun.valid.shape[1]
    schema = innovations_schema(beams)
    parts = []
    for index, method in enumerate(case.replay.filters):
        columns = {
            "method": method,
            "time_ns": times,
            "status": [FIX_STATUS[code] for code in result["fix_status"][index]],
            "nis": result["nis"][index],
            "degrees": result["nis_dof"][index].astype(np.int64),
        }
        for k in range(beams):
            columns[f"beam{k + 1}_innovation_mps"] = result["innovation_mps"][index][:, k]
            columns[f"beam{k + 1}_innovation_sd_mps"] = result["innovation_sd_mps"][index][:, k]
        parts.append(_table(case, what_if, columns, schema))
    return pl.concat(parts)


def pings_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per ping (`files.replay_tables.pings_schema`)."""
    prepared = rerun.prepared
    beams = prepared.streams.beams
    times, velocity = beams.time_ns[prepared.pings], beams.velocity_mps[prepared.pings]
    columns: dict[str, Any] = {"time_ns": times}
    for k in range(velocity.shape[1]):
        columns[f"beam{k + 1}_mps"] = velocity[:, k]
        columns[f"beam{k + 1}_valid"] = rerun.valid[:, k]
    return _table(case, what_if, columns, pings_schema(velocity.shape[1]))


def imu_faults_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """One row: inertial readings rejected, and gaps between them inflated (`files.replay_tables.IMU_FAULTS`)."""
    counts = rerun.result["imu_faults"]
    inflated = counts["inflated_gaps"]
    columns = {"imu_rejected": [sum(counts.values()) - inflated], "imu_gaps_inflated": [inflated]}
    return _table(case, what_if, columns, IMU_FAULTS)


def path_table(streams: Streams) -> pl.DataFrame | None:
    """Positions of the reference (`files.replay_tables.PATH`), or None without positions."""
    reference = streams.reference
    if reference is None or reference.position_t_m is None:
        return None
    position = reference.position_t_m
    latitude = longitude = np.full(len(position), np.nan)
    if streams.origin is not None:
        latitude, longitude, _ = geodetic_from_tangent(position, streams.origin)
    columns: dict[str, Floats | Times] = {"time_ns": reference.time_ns}
    columns |= {f"{axis}_m": position[:, k] for k, axis in enumerate(_NED)}
    columns |= {"latitude_deg": np.rad2deg(latitude), "longitude_deg": np.rad2deg(longitude)}
    return pl.DataFrame(columns, schema=dict(PATH)).with_columns(pl.col(pl.Float64).fill_nan(None))


def currents_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per method that uses the water and time (`replay_tables.CURRENTS`); empty where nothing measures it."""
    parts, sections = [pl.DataFrame(schema=dict(CURRENTS))], rerun.prepared.streams.through_water
    for index, method in enumerate(case.replay.filters):
        if not any(sensor.startswith(sections) for sensor in rerun.result["sensors"][index] if sections):
            continue
        current = rerun.result["current_t_mps"][index]
        sd = np.sqrt(np.diagonal(rerun.result["current_covariance"][index], axis1=1, axis2=2))
        columns = {"method": method, "time_ns": rerun.prepared.sample_time_ns}
        columns |= {"north_mps": current[:, 0], "east_mps": current[:, 1]}
        columns |= {"sd_north_mps": sd[:, 0], "sd_east_mps": sd[:, 1]}
        parts.append(_table(case, what_if, columns, CURRENTS))
    return pl.concat(parts)
