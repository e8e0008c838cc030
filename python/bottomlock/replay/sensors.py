"""The sensors of a case beside IMU and DVL: the entries of each in the kernel's model, options and log.

A sensor is a section of the case and a line of `SENSORS`; nothing else here names the sensors one by one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bottomlock import units
from bottomlock.config.aiding_errors import GpsErrors
from bottomlock.kernel.models import (
    DepthModel,
    HeadingModel,
    MagnetometerModel,
    Settings,
)
from bottomlock.recordings.axes import to_angles
from bottomlock.recordings.streams import Times
from bottomlock.replay.dvl_sections import WaterTrackStream
from bottomlock.replay.stream_sections import (
    AcousticPositionStream,
    AttitudeStream,
    DepthStream,
    EffortStream,
    GpsStream,
    ThrustStream,
)
from bottomlock.replay.streams import Streams

Within = Callable[[Times], slice]
"""Rows of a stream between the start and the last inertial reading."""


@dataclass(frozen=True)
class Sensor:
    """Declaration of a sensor of a case.

    Attributes:
        section: its section in a case.
        model: sections of the kernel's model in SI, of its section or None.
        log: the kernel's log arrays, of its section, the recording and its rows within the navigation.
        options: what its section adds to the filter's options, for instance a lever arm.
    """

    section: str
    model: Callable[[Any], dict[str, Settings]]
    log: Callable[[Any, Streams, Within], dict[str, Any]]
    options: Callable[[Any], dict[str, Any]] = lambda _: {}


def _depth_model(stream: DepthStream | None) -> dict[str, Settings]:
    if stream is None:
        return {"depth": DepthModel(sd_m=1.0, bias_sd_m=0.0, bias_time_s=1.0)}
    return stream.kernel_models()


def _depth_log(_: DepthStream, streams: Streams, within: Within) -> dict[str, Any]:
    if streams.depths is None:
        return {}
    rows = within(streams.depths.time_ns)
    return {"depth_time_ns": streams.depths.time_ns[rows], "depth_m": streams.depths.depth_m[rows]}


def _attitude_log(stream: AttitudeStream, streams: Streams, within: Within) -> dict[str, Any]:
    if streams.attitudes is None:
        return {}
    none, rows = slice(0, 0), within(streams.attitudes.time_ns)
    whole, yaw = (rows if stream.aids == kind else none for kind in ("attitude", "heading"))
    return {
        "attitude_time_ns": streams.attitudes.time_ns[whole],
        "attitude_rpy_rad": to_angles(streams.attitudes.attitude[whole]),
        "heading_time_ns": streams.attitudes.time_ns[yaw],
        "heading_rad": to_angles(streams.attitudes.attitude[yaw])[:, 2].copy(),
    }


def _gps_log(stream: GpsStream, streams: Streams, within: Within) -> dict[str, Any]:
    if not stream.aids:
        return {}
    positions = streams.positions["gps"]
    rows = within(positions.time_ns)
    return {"gps_time_ns": positions.time_ns[rows], "gps_position_t_m": positions.position_t_m[rows]}


def _acoustic_position_log(_: AcousticPositionStream, streams: Streams, within: Within) -> dict[str, Any]:
    positions = streams.positions["acoustic_position"]
    rows = within(positions.time_ns)
    sd = {} if positions.sd_m is None else {"acoustic_position_sd_m": positions.sd_m[rows]}
    return sd | {
        "acoustic_position_time_ns": positions.time_ns[rows],
        "acoustic_position_t_m": positions.position_t_m[rows],
    }


def _acoustic_position_model(stream: AcousticPositionStream | None) -> dict[str, Settings]:
    return {} if stream is None else stream.kernel_models()


def _attitude_model(stream: AttitudeStream | None) -> dict[str, Settings]:
    if stream is None:
        return {
            "magnetometer": MagnetometerModel(
                yaw_sd_rad=units.rad_from_deg(5.0), roll_pitch_sd_rad=units.rad_from_deg(1.0)
            ),
            "heading": HeadingModel(sd_rad=units.rad_from_deg(5.0)),
        }
    return stream.kernel_models()


def _gps_model(stream: GpsStream | None) -> dict[str, Settings]:
    return (GpsErrors() if stream is None else stream).kernel_models()


def _water_log(_: WaterTrackStream, streams: Streams, within: Within) -> dict[str, Any]:
    water = streams.water
    if water is None:
        return {}
    rows = within(water.time_ns)
    return {
        "water_track_time_ns": water.time_ns[rows],
        "water_track_velocity_mps": water.velocity_mps[rows],
        "water_track_valid": water.valid[rows],
        "water_track_sd_mps": water.sd_mps[rows],
        "water_track_range_m": water.range_m[rows],
    }


def _driven_model(stream: ThrustStream | EffortStream | None) -> dict[str, Settings]:
    return {} if stream is None else stream.kernel_models()


def _thrust_log(_: ThrustStream, streams: Streams, within: Within) -> dict[str, Any]:
    if streams.revolutions is None:
        return {}
    rows = within(streams.revolutions.time_ns)
    return {
        "thrust_time_ns": streams.revolutions.time_ns[rows],
        "thrust_revolutions_hz": streams.revolutions.revolutions_hz[rows],
    }


def _effort_log(_: EffortStream, streams: Streams, within: Within) -> dict[str, Any]:
    if streams.forces is None:
        return {}
    rows = within(streams.forces.time_ns)
    return {
        "effort_time_ns": streams.forces.time_ns[rows],
        "effort_force_p_n": streams.forces.force_p_n[rows],
    }


SENSORS = (
    Sensor(
        section="depth",
        model=_depth_model,
        log=_depth_log,
        options=DepthStream.kernel_options,
    ),
    Sensor(section="attitude", model=_attitude_model, log=_attitude_log),
    Sensor(
        section="gps",
        model=_gps_model,
        log=_gps_log,
        options=GpsStream.kernel_options,
    ),
    Sensor(
        section="acoustic_position",
        model=_acoustic_position_model,
        log=_acoustic_position_log,
        options=AcousticPositionStream.kernel_options,
    ),
    Sensor(
        section="water_track",
        model=lambda _: {},
        log=_water_log,
        options=lambda _: {"water_track": True},
    ),
    Sensor(section="thrust", model=_driven_model, log=_thrust_log, options=ThrustStream.kernel_options),
    Sensor(section="effort", model=_driven_model, log=_effort_log, options=EffortStream.kernel_options),
)
