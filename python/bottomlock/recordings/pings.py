"""Velocities of pings by least squares, an order of their beams that closes better, and their noise.

The noise of a velocity and of accelerometers is told from how far both part over one to several pings. In the axes of
the platform at the beginning of a segment, y = C v − ∫ C f dt is a line in time (`recordings.rig_motion`). Second
differences of y over L pings remove the line, whatever its slope, and leave

    6 σ² + 2 N² T,   T = L times the interval between pings,

with σ the noise of the velocity and N that of the integrated specific force, the errors of the rotation and of low
rates included. Both follow from the variance at several L. Accelerations of the vehicle are in both and cancel.

Third differences of C v alone leave 20 σ² and what the vehicle's acceleration changes by. σ is the smaller of the two:
one is too large where the accelerometers are poor, the other where the vehicle is quick for its pings.
"""

from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.closure import Reordered, find_order
from bottomlock.recordings.noise_growth import Walk, noise_growth
from bottomlock.recordings.rig_fit import Recorded
from bottomlock.recordings.robust import sd_about_median
from bottomlock.recordings.streams import Flags, Floats, Integers

OUTLIER = 5.0
"""Misfits beyond this many times the median are outliers."""
UNSTABLE = 8.0
"""A set of beams that makes the noise larger than this gives no velocity."""


def ping_velocity(
    directions_p: Floats, time_ns: Integers, velocity_mps: Floats, valid: Flags
) -> tuple[Integers, Floats]:
    """Times (p,) and velocities (p, 3), platform frame, of the pings whose beams determine all of it.

    Args:
        directions_p: (B, 3) of the beams.
        time_ns: (n,) times.
        velocity_mps, valid: (n, B).
    """
    found = np.full((len(time_ns), 3), np.nan)
    misfit = np.zeros(len(time_ns))
    patterns, which = np.unique(valid, axis=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        if pattern.sum() < 3:
            continue
        B = directions_p[pattern]
        inverse = np.linalg.pinv(B)
        if np.linalg.norm(inverse, 2) > UNSTABLE:
            continue
        rows = np.flatnonzero(which.ravel() == k)
        y = velocity_mps[rows][:, pattern]
        found[rows] = y @ inverse.T
        if pattern.sum() > 3:
            misfit[rows] = np.linalg.norm(y - found[rows] @ B.T, axis=1)
    tested = misfit > 0.0
    if tested.any():
        found[misfit > OUTLIER * max(float(np.median(misfit[tested])), 1e-6)] = np.nan
    good = np.isfinite(found).all(axis=1)
    return time_ns[good], found[good]


CLOSES_BETTER = 2.5
"""Exchanged beams are a finding from this ratio of the closures."""
LEAST_PINGS = 30


def better_order(
    directions_p: Floats, velocity_mps: Floats, valid: Flags, claimed_mps: float
) -> Reordered | None:
    """Another order or sign of four or five beams in which they close far better; None where the stated is as good."""
    full = valid.all(axis=1)
    if not 4 <= len(directions_p) <= 5 or full.sum() < LEAST_PINGS:
        return None
    least_mps = 0.5 * CLOSES_BETTER * claimed_mps
    return find_order(velocity_mps[full], directions_p, better=1.0 / CLOSES_BETTER, least_mps=least_mps)


LAGS = (1, 2, 3, 4, 6, 8, 12, 16)
LONGEST_S = 5.0
"""Over longer intervals the Earth's rate, which is left out, tilts gravity by more than a good DVL's noise."""
LEAST_DIFFERENCES = 40
CLEAR = 0.5
"""Part that the accelerometers may have in the variance over one ping: beyond it the velocity's own is not clear."""
EVEN = 0.25
"""Pings whose intervals differ by more than this part of one are not differenced."""


@dataclass(frozen=True, eq=False)
class PingNoise:
    """Noise of a velocity and of the specific force beside it.

    Attributes:
        velocity_sd_mps: (3,) of a ping, platform axes.
        force: random walk of the integrated specific force, RMS over the axes, m/s/√s.
        differences: number of second differences of one ping that it was found from.
    """

    velocity_sd_mps: Floats
    force: Walk
    differences: int


def ping_noise(recorded: Recorded) -> PingNoise | None:
    """Noise of a recording's velocity and specific force; None with too few even pings."""
    segments = recorded.integrated()
    if segments is None or len(recorded.time_ns) < 3:
        return None
    at = segments.at(recorded.time_ns)
    if at.kept.sum() < LEAST_DIFFERENCES:
        return None
    turned = np.einsum("pij,pj->pi", at.C, recorded.velocity_p_mps[at.kept])
    y = turned - at.S
    interval_s = float(np.median(np.diff(recorded.time_ns))) * 1e-9
    bends = []
    for lag in LAGS:
        if len(y) <= 2 * lag or (lag > 2 and lag * interval_s > LONGEST_S):
            break
        first, middle, last = slice(0, -2 * lag), slice(lag, -lag), slice(2 * lag, None)
        even = at.segment[first] == at.segment[last]
        for one, other in ((first, middle), (middle, last)):
            even &= np.abs(at.time_s[other] - at.time_s[one] - lag * interval_s) < EVEN * interval_s
        if even.sum() < LEAST_DIFFERENCES:
            continue
        # Gravity is in the line: a jitter of 10 ms would leave 0.1 m/s, were the pings taken to be even.
        whole = at.time_s[last] - at.time_s[first]
        share = 2.0 * (at.time_s[middle] - at.time_s[first]) / np.maximum(whole, 1e-9)
        bend = ((2.0 - share)[:, None] * y[first] - 2.0 * y[middle] + share[:, None] * y[last])[even]
        bends.append((lag, np.einsum("pji,pj->pi", at.C[middle][even], bend)))
    grown = noise_growth(bends, interval_s)
    if grown is None:
        return None
    third = turned[3:] - 3.0 * turned[2:-1] + 3.0 * turned[1:-2] - turned[:-3]
    even = (at.segment[3:] == at.segment[:-3]) & (
        np.abs(at.time_s[3:] - at.time_s[:-3] - 3.0 * interval_s) < EVEN * interval_s
    )
    alone = np.full(3, np.inf)
    if even.sum() >= LEAST_DIFFERENCES:
        body = np.einsum("pji,pj->pi", at.C[1:-2][even], third[even])
        alone = sd_about_median(body, axis=0) / np.sqrt(20.0)
    is_clear = grown.walk_of * interval_s < CLEAR * grown.white
    beside = np.where(is_clear | ~np.isfinite(alone), np.sqrt(grown.white / 6.0), np.inf)
    counted = max(len(body) for _, body in bends)
    return PingNoise(np.minimum(beside, alone), grown.walk.over(2.0), counted)


def tilt_of_noise(velocity_sd_mps: Floats) -> float:
    """Tilt of equally noisy beams around the vertical whose least squares has this noise, rad.

    Of three or four beams on a cone of tilt θ the level noise is √2 / tan θ times the vertical.

    >>> round(float(np.rad2deg(tilt_of_noise(np.array([0.124, 0.124, 0.0409])))))
    25
    """
    level = float(np.sqrt(np.mean(velocity_sd_mps[:2] ** 2)))
    return float(np.arctan2(np.sqrt(2.0) * float(velocity_sd_mps[2]), level))


def beam_noise(directions: Floats, velocity_sd_mps: Floats) -> float:
    """Noise of a beam, m/s, with which least squares of all beams has this noise on average over the axes.

    Args:
        directions: (B, 3) of the beams, platform axes.
        velocity_sd_mps: (3,).
    """
    gain = np.diag(np.linalg.inv(directions.T @ directions))
    return float(np.sqrt(np.mean(velocity_sd_mps**2 / gain)))
