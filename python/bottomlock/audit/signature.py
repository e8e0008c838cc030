"""Response of the velocity to angular rates: the signature of a lever arm, where accelerations are too weak.

A DVL at a rigid lever arm l reads R_pdᵀ (ω × l) = K ω besides the velocity of the platform. K = −R_pdᵀ [l×] has two
equal singular values |l| and one zero; roll rate acts along y and z of the platform, pitch rate along x and z. The
vehicle's own motion during rotations (it sways as it rolls) is in K as well, and need not fit a lever arm.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from bottomlock.audit.logs import Reference
from bottomlock.audit.motion import Motion
from bottomlock.audit.robust import Array, fit_linear, sigmas_for
from bottomlock.recordings.finding import Finding
from bottomlock.recordings.streams import Inertial

SLOW_S = 4.0
"""Slower motion is removed: it is the vehicle's manoeuvring."""


@dataclass(frozen=True, eq=False)
class Signature:
    """Response of the velocity (rows: DVL x, y, z) to the platform's rates (columns), m/s per rad/s."""

    response_m: Array
    sd_m: Array
    resampled_m: Array
    blocks: int

    @property
    def singular_m(self) -> Array:
        """(3,) singular values: |l|, |l|, 0 for a rigid arm."""
        return np.asarray(np.linalg.svd(self.response_m, compute_uv=False))


def find_signature(
    time_ns: NDArray[np.int64], velocity_mps: Array, reference: Reference, imu: Inertial | None
) -> Signature | None:
    """Response of the velocity (n, 3) at times (n,) to the rates of the platform; None from fewer than 100 pings."""
    motion = Motion(reference, imu, zero_ns=int(time_ns[0]))
    time_s = np.asarray((time_ns - time_ns[0]) * 1e-9)
    inside = motion.within(time_s, 0.5)
    if inside.sum() < 100:
        return None
    size = max(3, round(SLOW_S / float(np.median(np.diff(time_s)))))

    def quick(values: Array) -> Array:
        return np.asarray(values - uniform_filter1d(values, size, axis=0))

    fit = fit_linear(quick(motion.omega_tp_p_radps(time_s[inside])), quick(velocity_mps[inside]))
    copies = np.swapaxes(fit.resampled, 1, 2)
    return Signature(fit.parameters.T, np.std(copies, axis=0), copies, fit.blocks)


def signature_findings(signature: Signature | None) -> list[Finding]:
    """Horizontal response of the velocity to roll and pitch rates, and whether a rigid lever arm explains it."""
    if signature is None:
        return []
    K, sd = signature.response_m, signature.sd_m
    significant = []
    for column, name, axis, expected in ((0, "rolls", "y", 90.0), (1, "pitches", "x", 0.0)):
        length = float(np.hypot(*K[:2, column]))
        if length > sigmas_for(signature.blocks) * float(np.hypot(*sd[:2, column])):
            azimuth = np.rad2deg(np.arctan2(K[1, column], K[0, column]))
            copies = np.rad2deg(
                np.arctan2(signature.resampled_m[:, 1, column], signature.resampled_m[:, 0, column])
            )
            spread = float(np.std((copies - azimuth + 180.0) % 360.0 - 180.0))
            off = float((azimuth - expected + 90.0) % 180.0 - 90.0)
            significant.append((name, axis, float(azimuth), spread, off))
    if not significant:
        return []
    values = signature.singular_m
    rigid = values[1] > 0.6 * values[0] and values[2] < 0.3 * values[0]
    parts = "; ".join(
        f"when the platform {name} the velocity changes along azimuth {azimuth:.0f} ± {spread:.1g} deg of the DVL, "
        f"{abs(off):.0f} deg off the platform's {axis}"
        for name, axis, azimuth, spread, off in significant
    )
    worst = max(significant, key=lambda one: abs(one[4]))
    conclusion = (
        "A rigid lever arm fits."
        if rigid
        else "A rigid lever arm alone does not fit: the vehicle's own sway may contribute, so this is not conclusive."
    )
    return [
        Finding(
            "rate_signature",
            "warning" if abs(worst[4]) > max(10.0, sigmas_for(signature.blocks) * worst[3]) else "note", 0.0,
            f"The velocity depends on the angular rates: {parts}.",
            f"Singular values {', '.join(f'{value:.2f}' for value in values)} m; a lever arm has two equal and one "
            f"zero. {conclusion}",
            "Take the mounting of the DVL from a drawing, or drive straight ahead with the attitude recorded.",
            size=worst[4], unit="deg",
        )
    ]  # fmt: skip
