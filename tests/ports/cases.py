"""Estimates and independent decoders that several tests of ports share."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega

from bottomlock.kernel import BeamGeometry, solve_velocity
from bottomlock.ports.estimate import Estimate, State
from bottomlock.recordings.readings import Ping

Floats = NDArray[np.float64]

JANUS = BeamGeometry.janus(np.deg2rad(20.0))
BEAM_SD = 0.02
TRUTH = np.array([1.8, -0.3, 0.15])
SECOND = 1_000_000_000
START = 1_800_000_000 * SECOND
MASKS = {
    "4 beams": (1, 1, 1, 1),
    "3 beams": (1, 1, 1, 0),
    "2 opposite": (1, 0, 1, 0),
    "2 neighbours": (1, 1, 0, 0),
    "1 beam": (1, 0, 0, 0),
}
_SD_MPS = np.array([0.15, 0.25, 0.08])
INERTIAL_M2PS2: Floats = np.array([[1.0, 0.95, 0.9], [0.95, 1.0, 0.92], [0.9, 0.92, 1.0]]) * np.outer(
    _SD_MPS, _SD_MPS
)
"""Covariance of an inertial solution before a ping, with correlations as a turn leaves them."""
# Correlated as a navigator's is after an outage: a long axis across the platform's.
JOINT_FACTOR = (
    np.random.default_rng(24).normal(0.0, 1.0, (9, 9))
    * np.array([[1.0, 1.0, 0.3, 0.002, 0.002, 0.01, 0.03, 0.08, 0.02]]).T
)


def fused(mask: tuple[int, ...]) -> Floats:
    """(3, 3) covariance of the inertial solution after a ping of these beams, m²/s²."""
    rows = JANUS.directions_p[np.array(mask, dtype=bool)]
    after = np.linalg.inv(np.linalg.inv(INERTIAL_M2PS2) + rows.T @ rows / BEAM_SD**2)
    return np.asarray(0.5 * (after + after.T), dtype=np.float64)


def ping(mask: tuple[int, ...], velocity: Floats = TRUTH, sent_ns: int = 0) -> Ping:
    seen = np.array(mask, dtype=bool)
    beams = JANUS.beam_velocities([velocity])[0]
    made = Ping.of_beams(sent_ns, np.where(seen, beams, np.nan))
    return replace(made, sd_mps=np.full(4, BEAM_SD), range_m=np.where(seen, 30.0, np.nan))


def from_beams(mask: tuple[int, ...], time_ns: int = START, *, state: State = "OK") -> Estimate:
    beams = ping(mask)
    fixes = solve_velocity(JANUS, [beams.velocity_mps], [beams.valid], method="info", beam_sd_mps=BEAM_SD)
    return Estimate.from_fix(time_ns, fixes, state=state, beams=beams)


def navigated(time_ns: int = START, **changes: Any) -> Estimate:  # noqa: ANN401 - fields of an estimate
    joint = JOINT_FACTOR @ JOINT_FACTOR.T / 9.0
    settings: dict[str, Any] = {
        "time_ns": time_ns,
        "mode": "navigation",
        "velocity_p_mps": TRUTH,
        "covariance_m2ps2": joint[6:, 6:],
        "rank": 3,
        "information_s2pm2": np.eye(3) / BEAM_SD**2,
        "attitude_t_p": [np.cos(0.3), 0.0, 0.0, np.sin(0.3)],
        "position_t_m": [10.0, -20.0, 5.0],
        "navigation_covariance": joint,
        "omega_p_radps": [0.01, 0.02, -0.1],
        "reset_counter": 7,
    }
    return Estimate(**(settings | changes))


def mavlink(data: bytes | None) -> Any:  # noqa: ANN401 - the library is not typed
    """The one message of some bytes, parsed by the library as a receiver would."""
    assert data is not None
    (message,) = ardupilotmega.MAVLink(None).parse_buffer(bytearray(data))
    assert data[0] == 0xFD  # MAVLink 2
    return message


def mip(data: bytes | None) -> dict[str, Any]:
    """A MIP packet taken apart, written from the manual alone."""
    assert data is not None
    assert (data[:2], data[2]) == (b"ue", 0x13)
    assert len(data) == 6 + data[3]
    a = b = 0
    for byte in data[:-2]:
        a = (a + byte) % 256
        b = (b + a) % 256
    assert data[-2:] == bytes((a, b))
    assert (data[4], data[5]) == (data[3], 0x2A)
    at, out = 6, {}
    for key, code in (
        ("timebase", "B"), ("reserved", "B"), ("ns", "Q"), ("frame", "B"),
        ("velocity", "3f"), ("sd", "3f"), ("flags", "H"),
    ):  # fmt: skip
        values = struct.unpack_from(">" + code, data, at)
        out[key] = values[0] if len(values) == 1 else np.array(values)
        at += struct.calcsize(">" + code)
    assert at == len(data) - 2
    return out
