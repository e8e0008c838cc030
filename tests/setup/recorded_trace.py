"""A recorded stream of an A50 through the configuration of the set-up page: what the autopilot would have been sent.

The recording has no IMU. The bytes of one are made here: HIGHRES_IMU and ATTITUDE of a vehicle that does not turn and
has the velocities that the recording shows, with errors as the configuration claims them. So lost beams, stale reports
and their times are the recording's, and the inertial bridge between them is ours.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from bottomlock.io.beams import read_geometry
from bottomlock.kernel import EARTH_RATE_RADPS, normal_gravity_mps2, solve_velocity
from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine
from bottomlock.setup.form import SetupForm, config_text, geometry_of

START_NS = 1_790_000_000_000_000_000
LATITUDE_DEG, IMU_HZ, CALM_S = 32.8, 50, 6.0
ACCEL_BIAS_MPS2, GYRO_BIAS_RADPS = np.array([0.03, -0.03, 0.02]), np.deg2rad([20.0, -20.0, 20.0]) / 3600.0
LIMIT_S = 0.4
"""PX4 stops to aid after as long without a message (docs/ports.md)."""


def recording(name: str) -> list[bytes]:
    """The lines of a recorded stream; skips where the recordings are not there."""
    folder = os.environ.get("BOTTOMLOCK_RECORDINGS")
    path = Path(folder or "") / "a50_waterlinked_json" / name
    if folder is None or not path.is_file():
        pytest.skip(f"BOTTOMLOCK_RECORDINGS names no folder with a50_waterlinked_json/{name}")
    return path.read_bytes().splitlines(keepends=True)


@dataclass(frozen=True)
class Trace:
    """Lines with their times of arrival, s from the first, and the number of valid beams of each."""

    lines: list[bytes]
    time_s: np.ndarray
    beams: np.ndarray
    shown_valid: np.ndarray


def trace(lines: list[bytes]) -> Trace:
    """The trace of lines.

    Before it the vehicle lies still with the first report's beams for `CALM_S`, as an alignment needs.
    """
    reports = [json.loads(line) for line in lines]
    first = dict(reports[0], velocity_valid=True)
    calm = []
    for k in range(round(CALM_S * 10)):
        # Not the same bytes twice: a report that repeats the one before is stale.
        beams = [dict(one, velocity=1e-4 * ((k + one["id"]) % 3)) for one in first["transducers"]]
        calm.append(dict(first, time=100.0, vx=0.0, vy=0.0, vz=0.0, transducers=beams))
    whole = calm + reports
    time_s = np.cumsum([report["time"] for report in whole]) * 1e-3
    return Trace(
        [json.dumps(report).encode() + b"\r\n" for report in whole],
        time_s,
        np.array([sum(one["beam_valid"] for one in report["transducers"]) for report in whole]),
        np.array([report["velocity_valid"] for report in whole]),
    )


def of_form(form: SetupForm, folder: Path) -> LiveConfig:
    """The configuration of a form; the recording's json_v1 has no stamps, so they are those of arrival."""
    (folder / "geometry.toml").write_text(geometry_of(form), encoding="utf-8")
    text = config_text(form, "geometry.toml").replace(
        '"waterlinked-json"\n', '"waterlinked-json"\nclock = "arrival"\n'
    )
    return parse_config(text, place="live.toml", folder=folder)


def autopilot(moves: Trace) -> Iterator[tuple[float, bytes]]:
    """Bytes of HIGHRES_IMU at 50 Hz and ATTITUDE at 10 Hz of a vehicle with the velocities of a trace."""
    link = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    time_s, velocity = smooth_velocity(moves)
    random = np.random.default_rng(5)
    latitude = np.deg2rad(LATITUDE_DEG)
    earth = EARTH_RATE_RADPS * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    gravity = np.array([0.0, 0.0, normal_gravity_mps2(latitude)])
    for k in range(int(time_s[-1] * IMU_HZ)):
        at_s = k / IMU_HZ
        window = np.array([at_s - 1.0 / IMU_HZ, at_s])
        change = [np.diff(np.interp(window, time_s, velocity[:, axis]))[0] * IMU_HZ for axis in range(3)]
        force = np.array(change) - gravity + ACCEL_BIAS_MPS2 + random.normal(0.0, 0.01, 3)
        omega = earth + GYRO_BIAS_RADPS + random.normal(0.0, 5e-4, 3)
        message = ardupilotmega.MAVLink_highres_imu_message(
            round(at_s * 1e6), *force.tolist(), *omega.tolist(), 0, 0, 0, 0, 0, 0, 0, 63
        )
        data = bytes(message.pack(link))
        if k % 5 == 0:
            data += bytes(
                ardupilotmega.MAVLink_attitude_message(round(at_s * 1e3), 0, 0, 0.5, 0, 0, 0).pack(link)
            )
        yield at_s, data


VELOCITY = 0
"""Place of the port of the form that sends velocities; the other sends distances."""


def smooth_velocity(moves: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Times and velocities (n, 3) of the pings that determine all of it, as a mean over five of them."""
    geometry = read_geometry("waterlinked_a50").geometry
    times, found = [0.0], [np.zeros(3)]
    for line, at_s in zip(moves.lines, moves.time_s, strict=True):
        beams = json.loads(line)["transducers"]
        valid = np.array([[one["beam_valid"] for one in beams]])
        if valid.sum() < 3:
            continue
        measured = np.array([[one["velocity"] for one in beams]])
        fixes = solve_velocity(geometry, measured, valid, method="info", beam_sd_mps=0.02)
        times.append(float(at_s))
        found.append(np.asarray(fixes.velocity_p_mps)[0])
    values = np.array(found)
    kernel = np.ones(5) / 5.0
    padded = np.pad(values, ((2, 2), (0, 0)), mode="edge")
    return np.array(times), np.stack([np.convolve(padded[:, k], kernel, "valid") for k in range(3)], axis=1)


def sent(config: LiveConfig, moves: Trace, whole: Trace | None = None) -> tuple[np.ndarray, list[str]]:
    """Times at which the autopilot is sent a velocity, s, and the states with their reasons in their order.

    With `whole`, the trace with all its beams, there is an IMU that moves as that shows.
    """
    engine = Engine(config)
    arrivals = [(at, 0, line) for at, line in zip(moves.time_s.tolist(), moves.lines, strict=True)]
    arrivals += [(at, 1, data) for at, data in autopilot(whole)] if whole is not None else []
    times, states = [], []
    for at_s, place, arrived in sorted(arrivals, key=lambda one: one[:2]):
        messages = [
            one for one in engine.arrive(place, START_NS + round(at_s * 1e9), arrived) if one.port == VELOCITY
        ]
        times += [at_s] * len(messages)
        states.append(f"{engine.state}: {engine.machine.why}")
    return np.array(times), list(dict.fromkeys(states))


def gaps(times: np.ndarray, moves: Trace) -> list[tuple[float, float]]:
    """Begin and length of each time over `LIMIT_S` without a message, while a beam is valid at any moment of it, s.

    Counted from the first message on to the end of the trace; a report holds until the next.
    """
    found = []
    for begin, end in zip(times, [*times[1:], moves.time_s[-1]], strict=True):
        if end - begin <= LIMIT_S:
            continue
        first = max(int(np.searchsorted(moves.time_s, begin, "right")) - 1, 0)
        last = int(np.searchsorted(moves.time_s, end, "left"))
        if moves.beams[first:last].any():
            found.append((float(begin), float(end - begin)))
    return found
