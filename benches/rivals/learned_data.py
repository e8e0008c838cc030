"""What the learned rivals see of a mission: the last pings, the last second of inertial means, and the baseline.

A sample belongs to a time of the grid and holds readings up to it alone. Beams are padded to four; an instrument is
described to a network by the directions of its beams, so that one network serves all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

PINGS = 8
"""Pings of a sample, the newest last."""
BEAMS = 4
BINS = 25
"""Parts of the second before a sample, over each of which the inertial means are averaged."""
INERTIAL_SCALE = np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0])
GRAVITY_MPS2 = 9.8


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples side by side, n of them.

    Attributes:
        beams: (n, PINGS, 4) beam velocities, m/s, zero where there is none.
        valid: (n, PINGS, 4) which are there; of the newest ping all false where none was at the sample's time.
        directions: (n, 4, 3) of the beams, platform frame, zero for one that the instrument lacks.
        noise_mps: (n,) claimed noise of a beam.
        inertial: (n, 6, BINS) angular rate and specific force (gravity added), scaled.
        velocity_mps: (n, 3) the truth, platform frame; NaN where it is sealed.
    """

    beams: Floats
    valid: Flags
    directions: Floats
    noise_mps: Floats
    inertial: Floats
    velocity_mps: Floats

    @property
    def true_beams(self) -> Floats:
        """(n, 4) b · v."""
        return np.einsum("nbk,nk->nb", self.directions, self.velocity_mps)

    @property
    def exists(self) -> Flags:
        """(n, 4) whether the instrument has the beam."""
        return np.any(self.directions != 0.0, axis=2)


def samples_of(mission: Mission) -> Samples:
    """A sample for every time of the mission's grid."""
    pings, count = mission.pings, mission.geometry.beams
    beams, valid = np.zeros((len(pings.time_ns), BEAMS)), np.zeros((len(pings.time_ns), BEAMS), bool)
    valid[:, :count] = pings.valid[:, :BEAMS]
    scale = 1.0 / mission.geometry.sound_speed_scale
    beams[:, :count] = np.where(pings.valid, pings.velocity_mps * scale, 0.0)[:, :BEAMS]
    # Rows before the first ping are empty; a time of the grid without a ping has an empty newest one.
    at = np.searchsorted(pings.time_ns, mission.grid_ns, side="right") - 1
    is_now = (at >= 0) & (pings.time_ns[np.maximum(at, 0)] == mission.grid_ns)
    past = np.where(is_now, at - 1, at)
    rows = past[:, None] - np.arange(PINGS - 2, -1, -1)
    rows = np.concatenate([rows, np.where(is_now, at, -1)[:, None]], axis=1)
    there = rows >= 0
    rows = np.maximum(rows, 0)
    directions = np.zeros((len(at), BEAMS, 3))
    directions[:, :count] = mission.geometry.directions_p[:BEAMS]
    truth = mission.truth
    return Samples(
        beams=beams[rows] * there[..., None],
        valid=valid[rows] & there[..., None],
        directions=directions,
        noise_mps=np.full(len(at), mission.model.dvl.beam_noise_sd_mps),
        inertial=_inertial(mission),
        velocity_mps=np.full((len(at), 3), np.nan) if truth is None else truth.velocity_p_mps,
    )


def joined(parts: Sequence[Samples]) -> Samples:
    """The samples of several missions."""
    names = Samples.__dataclass_fields__
    return Samples(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def with_fewer_beams(samples: Samples, generator: np.random.Generator) -> Samples:
    """The samples with some beams left out from some past ping on, as an outage has it: more masks to learn.

    A number of beams, from none to all, is kept at random; in half of the samples the others miss in all pings.
    """
    count = len(samples.beams)
    order = generator.random((count, BEAMS)).argsort(axis=1).argsort(axis=1)
    kept = order < generator.integers(0, BEAMS + 1, count)[:, None]
    since = np.where(generator.random(count) < 0.5, 0, generator.integers(0, PINGS, count))
    is_hit = np.arange(PINGS) >= since[:, None]
    valid = samples.valid & (kept[:, None] | ~is_hit[..., None])
    return replace(samples, beams=np.where(valid, samples.beams, 0.0), valid=valid)


def mirrored(samples: Samples, is_mirrored: Flags) -> Samples:
    """The samples (n,) that are named, with port and starboard exchanged: what a vehicle on a mirrored path reads."""
    vector = np.where(is_mirrored[:, None], [1.0, -1.0, 1.0], 1.0)
    # A rate is an axial vector; its signs are opposite.
    both = np.hstack([np.where(is_mirrored[:, None], [-1.0, 1.0, -1.0], 1.0), vector])
    return replace(
        samples,
        directions=samples.directions * vector[:, None],
        inertial=samples.inertial * both[..., None],
        velocity_mps=samples.velocity_mps * vector,
    )


class Baseline(NamedTuple):
    """The model-based answer: beams (n, 4), and velocity (n, 3) by least squares on measured and averaged ones."""

    beams: Floats
    velocity_mps: Floats


PRIOR_SPEED_MPS = 2.0
"""Where no ping of a sample has a beam; the scenarios' vehicles make about 2 m/s."""


def baseline(samples: Samples) -> Baseline:
    """The moving average of each missing beam; one without a past is that of the mean velocity of the others."""
    weights = samples.valid[:, :-1].astype(float)
    total = weights.sum(axis=1)
    average = (samples.beams[:, :-1] * weights).sum(axis=1) / np.maximum(total, 1.0)
    now = samples.valid[:, -1]
    known = now | (total > 0.0)
    filled = np.where(now, samples.beams[:, -1], average)
    # Measured beams weigh more than averaged ones, and both than the prior of a velocity straight ahead.
    weight = np.where(now, 1.0, np.where(known, 0.25, 0.0))
    prior = np.zeros((len(filled), 3))
    prior[:, 0] = PRIOR_SPEED_MPS
    velocity = weighted_velocity(samples.directions, filled, weight, prior, 1e-4)
    expected = np.einsum("nbk,nk->nb", samples.directions, velocity)
    return Baseline(np.where(known, filled, expected), velocity)


def weighted_velocity(
    directions: Floats, beams: Floats, weight: Floats, prior: Floats, prior_weight: float
) -> Floats:
    """Least squares over the beams (n, 4) and a weak prior (n, 3)."""
    information = np.einsum("nbi,nb,nbj->nij", directions, weight, directions) + prior_weight * np.eye(3)
    right = np.einsum("nbi,nb->ni", directions, weight * beams) + prior_weight * prior
    return np.linalg.solve(information, right[..., None])[..., 0]


def _inertial(mission: Mission) -> Floats:
    """Means over the parts of the second before each time of the grid."""
    imu = mission.imu
    readings = (
        np.hstack([imu.omega_p_radps, imu.force_p_mps2 + np.array([0.0, 0.0, GRAVITY_MPS2])]) / INERTIAL_SCALE
    )
    dt_s = np.diff(imu.time_ns, prepend=imu.time_ns[0]) * 1e-9
    integral = np.cumsum(readings * dt_s[:, None], axis=0)
    edges_s = (mission.grid_ns[:, None] * 1e-9) + np.linspace(-1.0, 0.0, BINS + 1)
    times_s = imu.time_ns * 1e-9
    at = np.stack([np.interp(edges_s, times_s, column) for column in integral.T], axis=1)
    means: Floats = np.diff(at, axis=2) * BINS
    return means
