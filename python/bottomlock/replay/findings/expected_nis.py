"""What NIS a consistent filter has when heavy-tailed noise is assumed of the beams.

A beam with the innovation z, in its claimed σ, gets the variance R/w, and NIS counts z² w. Student's t with ν degrees
has w = (ν + 1)/(c (ν + z²/c)) with c = (ν + 3)/(ν + 1). If the noise is Gaussian as claimed, NIS over its degrees is
then E(z² w) < 1 where the filter's own covariance is small against the noise, and between that and 1 elsewhere: for ν
= 4 it is 0.62. Gates only lower it.
"""

import numpy as np
from scipy.integrate import quad
from scipy.stats import norm

from bottomlock.kernel.models import Robust


def least_ratio(robust: Robust | None) -> float:
    """Least NIS over its degrees that noise as claimed leads to; 1 for Gaussian updates.

    >>> round(least_ratio(Robust(tail="student_t", student_t_degrees=4.0)), 2), least_ratio(None)
    (0.62, 1.0)
    """
    if robust is None or robust.tail == "gaussian":
        return 1.0
    value, _ = quad(lambda z: z * z * float(weight(robust, z)) * norm.pdf(z), -np.inf, np.inf)
    return float(value)


def weight(robust: Robust, z: float) -> float:
    """Fraction of its information that a beam keeps, z its innovation in claimed σ."""
    degrees = robust.student_t_degrees
    c = (degrees + 3.0) / (degrees + 1.0)
    return float((degrees + 1.0) / (c * (degrees + z * z / c)))
