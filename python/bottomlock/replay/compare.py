"""Tables of a replay: estimates, errors against the reference, innovations, beams, currents, fit of readings."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.kernel import FIX_STATUS
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.axes import from_quaternions, to_angles
from bottomlock.recordings.geodesy import geodetic_from_tangent
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.case import Case
from bottomlock.replay.rerun import PreparedRun, Rerun
from bottomlock.replay.streams import Streams
from bottomlock.replay.vehicle_motion import level_axes
from bottomlock.tables.replay import (
    CURRENTS,
    FORWARD,
    IMU_FAULTS,
    PATH,
    REPLAY_SAMPLES,
    SMOOTHED,
    innovations_schema,
    pings_schema,
)

_NED, _AXES, _ANGLES = ("north", "east", "down"), ("surge", "sway", "heave"), ("roll", "pitch", "yaw")


def filter_passes(case: Case, rerun: Rerun) -> Iterator[tuple[str, str, dict[str, Floats]]]:
    """Pass, method and states of every forward and every smoothed pass, with the same names; dead reckoning too."""
    names = ("position_t_m", "attitude_t_p", "velocity_p_mps", "sd")
    for index, method in enumerate(case.replay.filters):
        yield FORWARD, method, {name: np.asarray(rerun.result[name][index]) for name in names}
    if rerun.reckoned is not None:
        yield FORWARD, DEAD_RECKONING, dict(rerun.reckoned)
    for index, method in enumerate(rerun.smoothed_methods):
        yield (
            SMOOTHED,
            method,
            {name: np.asarray(rerun.smoothed[f"smoothed_{name}"][index]) for name in names},
        )


def samples_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per method, pass and time (`tables.replay.REPLAY_SAMPLES`)."""
    parts = []
    prepared = rerun.prepared
    for name, method, states in filter_passes(case, rerun):
        columns = _keys(case, what_if, len(prepared.sample_time_ns)) | {
            "method": method,
            "pass": name,
        }
        columns |= {"time_ns": prepared.sample_time_ns}
        columns |= _estimate(states, prepared) | _errors(states, prepared)
        parts.append(pl.DataFrame({key: columns[key] for key in REPLAY_SAMPLES}, schema=dict(REPLAY_SAMPLES)))
    return pl.concat(parts).with_columns(pl.col(pl.Float64).fill_nan(None))


def _keys(case: Case, what_if: str, count: int) -> dict[str, Any]:
    return {"case": [case.name] * count, "what_if": what_if}


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

    Without a height of the reference the error down is NaN.

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
    return position, velocity, misalignment


def innovations_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per method and ping (`tables.replay.innovations_schema`)."""
    prepared, result = rerun.prepared, rerun.result
    times = prepared.streams.beams.time_ns[prepared.pings]
    beams = rerun.valid.shape[1]
    schema = innovations_schema(beams)
    parts = []
    for index, method in enumerate(case.replay.filters):
        columns = _keys(case, what_if, len(times)) | {
            "method": method,
            "time_ns": times,
            "status": [FIX_STATUS[code] for code in result["fix_status"][index]],
            "nis": result["nis"][index],
            "degrees": result["nis_dof"][index].astype(np.int64),
        }
        for k in range(beams):
            columns[f"beam{k + 1}_innovation_mps"] = result["innovation_mps"][index][:, k]
            columns[f"beam{k + 1}_innovation_sd_mps"] = result["innovation_sd_mps"][index][:, k]
        parts.append(pl.DataFrame({key: columns[key] for key in schema}, schema=schema))
    return pl.concat(parts).with_columns(pl.col(pl.Float64).fill_nan(None))


def pings_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per ping (`tables.replay.pings_schema`)."""
    prepared = rerun.prepared
    beams = prepared.streams.beams
    times, velocity = beams.time_ns[prepared.pings], beams.velocity_mps[prepared.pings]
    columns = _keys(case, what_if, len(times)) | {"time_ns": times}
    for k in range(velocity.shape[1]):
        columns[f"beam{k + 1}_mps"] = velocity[:, k]
        columns[f"beam{k + 1}_valid"] = rerun.valid[:, k]
    schema = pings_schema(velocity.shape[1])
    frame = pl.DataFrame({key: columns[key] for key in schema}, schema=schema)
    return frame.with_columns(pl.col(pl.Float64).fill_nan(None))


def imu_faults_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """One row: inertial readings rejected, and gaps between them inflated (`tables.replay.IMU_FAULTS`)."""
    counts = rerun.result["imu_faults"]
    columns = _keys(case, what_if, 1) | {
        "imu_rejected": sum(counts.values()) - counts["inflated_gaps"],
        "imu_gaps_inflated": counts["inflated_gaps"],
    }
    return pl.DataFrame({key: columns[key] for key in IMU_FAULTS}, schema=dict(IMU_FAULTS))


def path_table(streams: Streams) -> pl.DataFrame | None:
    """Positions of the reference (`tables.replay.PATH`), or None without positions."""
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
    """A row per method that uses the water and time (`tables.replay.CURRENTS`); empty where nothing measures it."""
    empty = pl.DataFrame(schema=dict(CURRENTS))
    sections = rerun.prepared.streams.through_water
    if not sections:
        return empty
    parts = [empty]
    times = rerun.prepared.sample_time_ns
    for index, method in enumerate(case.replay.filters):
        if not any(sensor.startswith(sections) for sensor in rerun.result["sensors"][index]):
            continue
        current = rerun.result["current_t_mps"][index]
        sd = np.sqrt(np.diagonal(rerun.result["current_covariance"][index], axis1=1, axis2=2))
        keys = {"case": case.name, "what_if": what_if, "method": method}
        columns: dict[str, Any] = {key: [word] * len(times) for key, word in keys.items()}
        columns |= {"time_ns": times, "north_mps": current[:, 0], "east_mps": current[:, 1]}
        columns |= {"sd_north_mps": sd[:, 0], "sd_east_mps": sd[:, 1]}
        parts.append(pl.DataFrame(columns, schema=dict(CURRENTS)))
    return pl.concat(parts)
