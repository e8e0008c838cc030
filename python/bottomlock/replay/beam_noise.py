"""Beam noise measured on a log: scale and tail of the closure, to which no velocity contributes.

With A (beams, 3), N its left null space and R the claimed covariance of the beams, u = (Nᵀ R N)^(-1/2) Nᵀ y is
independent of the velocity and has unit variance where the noise is as claimed. Student's t, fitted to u by maximum
likelihood about zero, gives a scale and ν degrees of freedom. `factor` is the half-width of its 68.3 % interval, so
that one standard deviation covers what it states also where ν is below 2 and no variance exists. With heavy tails no
multiple of one standard deviation covers 95.4 % at two and 99.7 % at three: `halfwidths` has these intervals.

For four beams of a Janus with equal noise, u is also the normalised difference between a beam and the velocity of the
other three. Noise that acts as a velocity, such as a wrong speed of sound, is not in the closure.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import poch
from scipy.stats import norm, t

from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.robust import sd_about_zero
from bottomlock.recordings.streams import Flags, Floats

FEWEST_PINGS = 100
"""Fewest pings with every beam that measure the noise; the standard error of the scale is then 10 % or less."""
GAUSSIAN = (1.0, 2.0, 3.0)
MOST_DEGREES = 1000.0
"""Degrees of freedom at which Student's t is a Gaussian."""
NO_NOISE = 1e-3
"""Normalised closure below which beams were computed from a velocity and hold no noise of their own."""


@dataclass(frozen=True)
class NoiseGroup:
    """Noise of a group of pings.

    Attributes:
        name: which pings.
        pings: number of pings of the group with every beam.
        factor: measured over claimed standard deviation, 1 if not measured.
        degrees: ν of Student's t; infinite for a Gaussian, and if not measured.
        halfwidths: half-widths of the 68.3, 95.4 and 99.7 % intervals over the measured standard deviation.
        fallback: why nothing was measured and the claimed noise is used; empty where it was measured.
    """

    name: str
    pings: int
    factor: float = 1.0
    degrees: float = np.inf
    halfwidths: tuple[float, float, float] = GAUSSIAN
    fallback: str = ""


@dataclass(frozen=True, eq=False)
class BeamNoise:
    """Noise of every ping: `factor` (n,) and `halfwidths` (n, 3) as in `NoiseGroup`, and the groups."""

    factor: Floats
    halfwidths: Floats
    groups: tuple[NoiseGroup, ...]


def claimed_noise(pings: int) -> BeamNoise:
    """The noise that the geometry file states, Gaussian."""
    return BeamNoise(np.ones(pings), np.tile(GAUSSIAN, (pings, 1)), ())


def measure_noise(
    geometry: BeamGeometry,
    velocity_mps: Floats,
    valid: Flags,
    sd_mps: Floats,
    instrument_valid: NDArray[np.bool_] | None = None,
) -> BeamNoise:
    """Noise of pings from the closure of those with every beam.

    Args:
        geometry: the beams.
        velocity_mps: (n, B) beam velocities.
        valid: (n, B) validity.
        sd_mps: (B,) claimed noise of the beams, 1 sigma.
        instrument_valid: (n,) the instrument's own flag of its velocity. Pings with and without it are measured apart;
            a group with too few pings gets the noise of all.
    """
    u, whole = normalised_closure(geometry, velocity_mps, valid, sd_mps)
    every = np.ones(len(valid), dtype=bool)
    pooled = _measure("all pings", u)
    noise = _assign(claimed_noise(len(valid)), every, pooled)
    if instrument_valid is None or instrument_valid.all() or not instrument_valid.any():
        return noise
    for name, member in (("accepted", instrument_valid), ("not accepted", ~instrument_valid)):
        group = _measure(f"pings {name} by the instrument", u[member[whole]])
        if group.fallback and not pooled.fallback:
            group = NoiseGroup(
                group.name, group.pings, pooled.factor, pooled.degrees, pooled.halfwidths,
                f"{group.fallback}; noise of all pings",
            )  # fmt: skip
        noise = _assign(noise, member, group)
    return BeamNoise(noise.factor, noise.halfwidths, noise.groups[1:])


def normalised_closure(
    geometry: BeamGeometry, velocity_mps: Floats, valid: Flags, sd_mps: Floats
) -> tuple[Floats, Flags]:
    """Closure (m, B − rank) of the pings with every beam over its claimed σ, and which pings (n,) these are.

    Examples:
        Beam 1 of a Janus is 40 mm/s off, noise 20 mm/s: the closure 40 mm/s over √4 × 20 mm/s is 1.

        >>> janus = BeamGeometry.janus(0.35)
        >>> u, _ = normalised_closure(janus, np.array([[0.04, 0, 0, 0]]), np.ones((1, 4), bool), np.full(4, 0.02))
        >>> u.round(9).tolist()
        [[1.0]]
    """
    whole = np.asarray(valid.all(axis=1))
    N = closure_rows(geometry.directions_p).T
    L = np.linalg.cholesky(N.T @ (N * sd_mps[:, None] ** 2)) if N.size else np.zeros((0, 0))
    return np.asarray(np.linalg.solve(L, N.T @ velocity_mps[whole].T).T), whole


def fit_student_t(u: Floats) -> tuple[float, float]:
    """Scale and degrees of freedom (1 to `MOST_DEGREES`) of Student's t about zero, by maximum likelihood.

    Source: Lange, Little & Taylor, Robust statistical modeling using the t distribution, JASA 84 (1989), with the
    likelihood maximised directly.
    """

    def split(p: Floats) -> tuple[float, float]:
        return float(np.exp(p[0])), float(min(1.0 + np.exp(min(p[1], 10.0)), MOST_DEGREES))

    def cost(p: Floats) -> float:
        scale, degrees = split(p)
        x = u / scale
        # As scipy's t.logpdf, in a fifth of its time.
        constant = np.log(poch(0.5 * degrees, 0.5)) - 0.5 * (np.log(degrees) + np.log(np.pi))
        return float(-np.mean(constant - (degrees + 1) / 2 * np.log1p(x * x / degrees) - np.log(scale)))

    start = np.array([np.log(max(float(sd_about_zero(u)), NO_NOISE)), np.log(4.0)])
    return split(minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-9}).x)


def student_halfwidths(degrees: Floats) -> Floats:
    """(..., 3) half-widths of the 68.3, 95.4 and 99.7 % intervals of Student's t of scale 1."""
    return np.asarray(t.isf(norm.sf(GAUSSIAN), np.asarray(degrees)[..., None]))


def _measure(name: str, u: Floats) -> NoiseGroup:
    """Noise of a group of pings with normalised closures u (m, k)."""
    if not u.shape[1]:
        return NoiseGroup(name, 0, fallback="no redundant beams")
    if len(u) < FEWEST_PINGS:
        return NoiseGroup(name, len(u), fallback=f"{len(u)} pings with every beam, fewer than {FEWEST_PINGS}")
    if np.median(np.abs(u)) < NO_NOISE:
        return NoiseGroup(
            name, len(u), fallback="the beams agree exactly, as if they were computed from a velocity"
        )
    scale, degrees = fit_student_t(u.ravel())
    one, two, three = scale * student_halfwidths(np.asarray(degrees))
    return NoiseGroup(name, len(u), float(one), degrees, (1.0, float(two / one), float(three / one)))


def _assign(noise: BeamNoise, member: Flags, group: NoiseGroup) -> BeamNoise:
    return BeamNoise(
        np.where(member, group.factor, noise.factor),
        np.where(member[:, None], group.halfwidths, noise.halfwidths),
        (*noise.groups, group),
    )
