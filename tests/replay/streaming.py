"""A log pushed through `Navigator` one reading after the other: what a replay has to equal, bit for bit."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Any

from bottomlock.kernel import Navigator
from bottomlock.kernel.models import DepthModel, MagnetometerModel, Model

STREAMS = ("imu", "dvl", "depth", "attitude", "heading", "gps")
TIMES = ("imu_time_ns", "dvl_time_ns", "depth_time_ns", "attitude_time_ns", "heading_time_ns", "gps_time_ns")


def events(log: dict[str, Any]) -> Iterator[tuple[int, int, int]]:
    """Time, stream and row in order of time, at the same time in the order of `STREAMS`."""

    def of(stream: int, key: str) -> list[tuple[int, int, int]]:
        return [(int(t), stream, row) for row, t in enumerate(log.get(key, ()))]

    return iter(heapq.merge(*(of(stream, key) for stream, key in enumerate(TIMES))))


def push(
    navigator: Navigator,
    model: Model,
    log: dict[str, Any],
    name: str,
    time_ns: int,
    row: int,
) -> Any:  # noqa: ANN401
    """Pushes one reading of a stream and returns the reports."""
    if name == "imu":
        return navigator.push_imu(
            time_ns, omega_p_radps=log["omega_p_radps"][row], force_p_mps2=log["force_p_mps2"][row]
        )
    if name == "dvl":
        return navigator.push_beams(
            time_ns, log["beam_velocity_mps"][row], log["beam_valid"][row], sd_mps=log["beam_sd_mps"][row]
        )
    if name == "depth":
        return navigator.push_depth(time_ns, float(log["depth_m"][row]), sd_m=model.of(DepthModel).sd_m)
    if name == "heading":
        assert model.heading is not None
        sd_rad = model.heading.sd_rad
        return navigator.push_heading(time_ns, float(log["heading_rad"][row]), sd_rad=sd_rad)
    if name == "attitude":
        sds = model.of(MagnetometerModel)
        return navigator.push_attitude(
            time_ns,
            log["attitude_t_p"][row],
            roll_pitch_sd_rad=sds.roll_pitch_sd_rad,
            yaw_sd_rad=sds.yaw_sd_rad,
        )
    raise AssertionError("positions without velocity are not streamed here")
