"""Noise of each ping of a log with heavy tails, from what the ping itself shows.

Student's t with ν degrees of freedom and scale s is Gaussian noise whose variance differs from ping to ping (Lange,
Little & Taylor 1989). A ping whose beams differ by z from the pings around it, with S = B D Bᵀ + s²R, shows
q = zᵀS⁻¹ s²R S⁻¹z, of which ρ = tr(S⁻¹ s²R) is expected: as many numbers as it has beams where the vehicle is
steady, as it has redundant beams where nothing is known of its motion. Given q, the noise is Student's t with ν + ρ
degrees of freedom and the scale s √((ν + q)/(ν + ρ)). Its tail is lighter, so that one covariance serves a filter.
"""

import numpy as np

from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.streams import Floats
from bottomlock.replay.beam_noise import MOST_DEGREES, BeamNoise, student_halfwidths
from bottomlock.replay.screen_beams import Screened

OF_MEDIAN = 0.4
"""Variance of the median of four pings over that of one, about: the least scatter of a prediction."""
STEP = 0.01
"""Relative step of the noise of a ping: pings of the same noise are solved together."""


def ping_noise(
    geometry: BeamGeometry, velocity_mps: Floats, sd_mps: Floats, noise: BeamNoise, screened: Screened
) -> tuple[Floats, Floats]:
    """Noise (n,) of each ping over the claimed one, and its half-widths (n, 3) over the standard deviation.

    A ping that no others predict, and a log whose noise is Gaussian or was not measured, keep those of the screening
    and of the log.

    Args:
        geometry: the beams.
        velocity_mps: (n, B) beam velocities.
        sd_mps: (B,) claimed noise of the beams, 1 sigma.
        noise: of the log.
        screened: the pings after the test.
    """
    B = np.asarray(geometry.directions_p)
    factor, halfwidths = screened.factor.copy(), noise.halfwidths.copy()
    judged = np.isfinite(screened.expected_mps).all(axis=1) & (noise.degrees < MOST_DEGREES)
    if not judged.any():
        return factor, halfwidths
    scale = noise.factor / student_halfwidths(noise.degrees)[:, 0]
    # The scatter of passed pings about their prediction holds their own noise as well as the prediction's.
    own = np.diag(np.linalg.inv(B.T @ (B / (scale[judged].min() * sd_mps[:, None]) ** 2)))
    D = np.diag(np.maximum(np.diag(screened.scatter_m2ps2) - own, OF_MEDIAN * own))
    for beams in np.unique(screened.valid[judged], axis=0):
        rows = np.flatnonzero(judged & (screened.valid == beams).all(axis=1))
        if not beams.any():
            continue
        A = B[beams]
        R = scale[rows, None, None] ** 2 * np.diag(sd_mps[beams] ** 2)
        W = np.linalg.inv(A @ D @ A.T + R)
        z = velocity_mps[rows][:, beams] - screened.expected_mps[rows] @ A.T
        weighted = np.einsum("nij,nj->ni", W, z)
        q = np.einsum("ni,nij,nj->n", weighted, R, weighted)
        shown = np.trace(W @ R, axis1=1, axis2=2)
        degrees = noise.degrees[rows] + shown
        quantiles = student_halfwidths(degrees)
        found = scale[rows] * np.sqrt((noise.degrees[rows] + q) / degrees) * quantiles[:, 0]
        factor[rows] = np.exp(STEP * np.round(np.log(found) / STEP))
        halfwidths[rows] = quantiles / quantiles[:, :1]
    return factor, halfwidths
