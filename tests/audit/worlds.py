"""Simulated logs with what stands beside them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from bottomlock import BeamGeometry
from bottomlock.audit.logs import BeamLog, tracked
from bottomlock.audit.run import Audit
from bottomlock.io.beams import read_geometry
from bottomlock.recordings.rig_motion import Tracked

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class World:
    """A log with what the audit is given beside it.

    Attributes:
        name: of the log.
        log: the pings.
        geometry: stated, or None.
        mounting_rpy_rad: (3,) stated mounting, which the geometry contains.
        reference: recorded beside the log, or None.
    """

    name: str
    log: BeamLog
    geometry: BeamGeometry | None
    mounting_rpy_rad: Array
    reference: Tracked | None = None

    def with_log(self, log: BeamLog) -> World:
        """The same with another log."""
        return replace(self, log=log)


@dataclass(frozen=True)
class Noise:
    """How a simulated instrument measures: 1 sigma of a beam, m/s; correlation of consecutive pings; and the rest.

    `unequal` is the factor of beam 1; `lost` the fraction of beams lost, in runs of `run` pings; `resolution_mps` what
    readings are rounded to; `shared_mps` a common wander of the measured velocity.
    """

    sd_mps: float = 0.01
    correlation: float = 0.3
    unequal: float = 1.0
    lost: float = 0.1
    run: float = 4.0
    resolution_mps: float = 0.001
    shared_mps: float = 0.0


def oscillations(rng: np.random.Generator, time_s: Array, sizes: tuple[float, float, float]) -> Array:
    """(n, 3) sums of five oscillations of 6 to 60 s on each axis, RMS `sizes`."""
    out = np.zeros((len(time_s), 3))
    for axis, size in enumerate(sizes):
        for _ in range(5):
            rate = 2.0 * np.pi / rng.uniform(6.0, 60.0)
            out[:, axis] += size * np.sqrt(0.4) * np.sin(rate * time_s + rng.uniform(0.0, 2.0 * np.pi))
    return out


def coloured(rng: np.random.Generator, pings: int, beams: int, correlation: float) -> Array:
    """(pings, beams) noise of unit variance with this correlation of consecutive pings."""
    white = rng.normal(size=(pings, beams))
    white[1:] *= np.sqrt(1.0 - correlation**2)
    return np.asarray(lfilter([1.0], [1.0, -correlation], white, axis=0))


def lost_beams(
    rng: np.random.Generator, pings: int, beams: int, fraction: float, run: float
) -> NDArray[np.bool_]:
    """(pings, beams) True where a beam is lost, in runs of mean length `run` (a chain of two states)."""
    lost = np.zeros((pings, beams), dtype=bool)
    ends, begins = 1.0 / run, fraction / max(1.0 - fraction, 1e-9) / run
    draws = rng.random((pings, beams))
    for k in range(1, pings):
        lost[k] = np.where(lost[k - 1], draws[k] >= ends, draws[k] < begins)
    return lost


def simulated(
    seed: int,
    *,
    pings: int = 4000,
    noise: Noise = Noise(),
    speed: float = 1.0,
    instrument: bool = True,
    beside: bool = True,
    geometry: str = "waterlinked_a50",
    step_s: float = 0.25,
) -> World:
    """A dive of a vehicle that weaves, with the instrument's velocity and a reference of attitude and velocity.

    Args:
        seed: of everything drawn.
        pings: number of pings.
        noise: of the beams.
        speed: factor of all motion; 0 is at rest.
        instrument: with the instrument's own velocity, by least squares of three or four beams.
        beside: with attitude and velocity beside the log.
        geometry: packaged name.
        step_s: between pings.
    """
    rng = np.random.default_rng(seed)
    stated = read_geometry(geometry).geometry
    rows = np.asarray(stated.directions_p)
    t = np.arange(pings) * step_s
    fine = np.arange(0.0, t[-1] + 8.0, 0.1) - 4.0
    at = np.concatenate([fine, t])
    body = speed * (np.array([0.8, 0.0, 0.0]) + oscillations(rng, at, (0.4, 0.25, 0.15)))
    angles = speed * oscillations(rng, at, (0.06, 0.05, 0.5))
    attitude = Rotation.from_euler("ZYX", angles[:, ::-1])
    few = len(fine)
    y = body[few:] @ rows.T
    beam = noise.sd_mps * coloured(rng, pings, len(rows), noise.correlation)
    beam[:, 0] *= noise.unequal
    y += beam + noise.shared_mps * coloured(rng, pings, 3, 0.98) @ rows.T
    y = np.round(y / noise.resolution_mps) * noise.resolution_mps
    valid = ~lost_beams(rng, pings, len(rows), noise.lost, noise.run)
    y = np.where(valid, y, 0.0)
    time_ns = np.round(t * 1e9).astype(np.int64)
    own, solved = _own(y, valid, rows, noise.resolution_mps) if instrument else (None, None)
    log = BeamLog("simulated", time_ns, y, valid, own, solved)
    if not beside:
        return World("simulated", log, stated, np.zeros(3))
    velocity_t = attitude[:few].apply(body[:few]) + 0.002 * rng.normal(size=(few, 3))
    fine_ns = np.round(fine * 1e9).astype(np.int64)
    return World(
        "simulated", log, stated, np.zeros(3),
        tracked(fine_ns, angles[:few] + 1e-4 * rng.normal(size=(few, 3)), velocity_t),
    )  # fmt: skip


def _own(y: Array, valid: NDArray[np.bool_], rows: Array, step: float) -> tuple[Array, NDArray[np.bool_]]:
    """Least squares of the valid beams, rounded; and whether there are three of them."""
    own = np.zeros((len(y), 3))
    patterns, place = np.unique(valid, axis=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        if pattern.sum() >= 3:
            chosen = place == k
            own[chosen] = y[chosen][:, pattern] @ np.linalg.pinv(rows[pattern]).T
    return np.round(own / step) * step, valid.sum(axis=1) >= 3


def audited(world: World) -> Audit:
    """The audit of a log with all that is beside it."""
    return Audit(
        world.log, stated=world.geometry, geometry_name="stated", mounting_rpy_rad=world.mounting_rpy_rad,
        reference=world.reference,
    )  # fmt: skip
