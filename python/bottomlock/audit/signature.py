"""What turns do to the velocity: the signature of a lever arm, where accelerations are too weak.

A DVL on a rigid arm l reads R_pdᵀ (ω × l) = K ω besides the motion of the platform. K = −R_pdᵀ [l×] has two equal
singular values |l| and one zero, and shows a roll along y and z of the platform, a pitch along x and z. What a
vehicle does of its own while it turns (it sways as it rolls) is in K too, and need not look like an arm.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from bottomlock.audit.findings import SIGMAS, Finding
from bottomlock.audit.logs import Inertial, Reference
from bottomlock.audit.motion import Motion
from bottomlock.audit.robust import Array, fit_linear

SLOW_S = 4.0
"""Motion slower than this is taken away: it is the vehicle going places."""


@dataclass(frozen=True, eq=False)
class Signature:
    """Response of the velocity (rows: DVL x, y, z) to the platform's rates (columns), m/s per rad/s."""

    response_m: Array
    sd_m: Array
    resampled_m: Array

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

    fit = fit_linear(quick(motion.rate_p_radps(time_s[inside])), quick(velocity_mps[inside]))
    copies = np.swapaxes(fit.resampled, 1, 2)
    return Signature(fit.parameters.T, np.std(copies, axis=0), copies)


def signature_findings(signature: Signature | None) -> list[Finding]:
    """Where a roll or a pitch moves the velocity in the plane, and whether a rigid arm could do it."""
    if signature is None:
        return []
    K, sd = signature.response_m, signature.sd_m
    told = []
    for column, name, axis, expected in ((0, "rolls", "y", 90.0), (1, "pitches", "x", 0.0)):
        length = float(np.hypot(*K[:2, column]))
        if length > SIGMAS * float(np.hypot(*sd[:2, column])):
            turned = np.rad2deg(np.arctan2(K[1, column], K[0, column]))
            copies = np.rad2deg(
                np.arctan2(signature.resampled_m[:, 1, column], signature.resampled_m[:, 0, column])
            )
            spread = float(np.std((copies - turned + 180.0) % 360.0 - 180.0))
            off = float((turned - expected + 90.0) % 180.0 - 90.0)
            told.append((name, axis, float(turned), spread, off))
    if not told:
        return []
    values = signature.singular_m
    rigid = values[1] > 0.6 * values[0] and values[2] < 0.3 * values[0]
    parts = "; ".join(
        f"when the platform {name} the velocity moves along azimuth {turned:.0f} ± {spread:.1g} deg of the DVL, "
        f"{abs(off):.0f} deg off the platform's {axis}"
        for name, axis, turned, spread, off in told
    )
    worst = max(told, key=lambda one: abs(one[4]))
    judged = (
        "A rigid lever arm fits."
        if rigid
        else "A rigid lever arm alone does not fit, so that the vehicle's own sway may be in it: a suspicion, no proof."
    )
    return [
        Finding(
            "rate_signature", "warning" if abs(worst[4]) > SIGMAS * worst[3] and abs(worst[4]) > 10.0 else "note",
            worst[4], "deg", 0.0,
            f"The velocity answers to the rates: {parts}.",
            f"Singular values {', '.join(f'{value:.2f}' for value in values)} m; an arm has two equal and one "
            f"zero. {judged}",
            "Find the mounting of the DVL from a drawing, or drive straight ahead with the attitude recorded.",
        )
    ]  # fmt: skip
