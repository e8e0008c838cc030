"""Innovations of the method that stands for all: pings rejected, and NIS against that of a consistent filter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from scipy.integrate import quad
from scipy.stats import norm

from bottomlock.kernel.models import Robust
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.limits import PROBABILITY
from bottomlock.statistics.chi_squared import mean_band

PREFERRED = ("tc", "lc")


@dataclass(frozen=True)
class Innovations:
    """Innovations of the method that stands for all.

    Attributes:
        method: its name.
        pings: with beams enough for it.
        rejected: part of them.
        nis, degrees: mean NIS and what Gaussian noise leads to.
        low, high: band of the mean of a consistent filter.
    """

    method: str
    pings: int
    rejected: float
    nis: float
    degrees: float
    low: float
    high: float

    @property
    def ratio(self) -> float:
        """NIS over its degrees."""
        return self.nis / self.degrees

    def words(self) -> str:
        """The numbers in one sentence."""
        band = f"{self.low:.3g} to {self.high:.3g}" if self.low > 0.0 else f"at most {self.high:.3g}"
        return (
            f"Method {self.method}: {100.0 * self.rejected:.3g} % of {self.pings} pings with beams rejected; NIS "
            f"{self.nis:.3g}, {band} for a consistent filter."
        )


def innovations_of(
    innovations: pl.DataFrame, methods: Sequence[str], beams: pl.Series, least_ratio: float
) -> Innovations | None:
    """The innovations of the first of `PREFERRED` and `methods` that has any; None if none has.

    Args:
        innovations: of the recording as it is.
        methods: of the case.
        beams: (n,) valid beams of each ping, in the order of the innovations.
        least_ratio: of `least_ratio`; 0 where the noise of the beams is not that of a DVL.
    """
    used = [m for m in (*PREFERRED, *methods) if m in methods]
    for method in dict.fromkeys(used):
        pings = innovations.filter(pl.col("method") == method)
        rows = pings.filter(pl.col("nis").is_not_null())
        if rows.height:
            # What the method can use is shown by the pings that it did use.
            enough = beams >= beams.filter(pings["nis"].is_not_null()).min()
            return _of(rows, method, int((enough & pings["nis"].is_null()).sum()), least_ratio)
    return None


def _of(rows: pl.DataFrame, method: str, unused: int, least_ratio: float) -> Innovations:
    count = rows.height + unused
    # A ping whose beams were all left out as outliers never becomes a fix: it counts as rejected.
    lost = int((rows["status"] == "rejected").sum()) + unused
    degrees = float(rows["degrees"].mean() or 1.0)  # type: ignore[arg-type]
    low, high = mean_band(degrees, rows.height, PROBABILITY)
    nis = float(rows["nis"].mean() or 0.0)  # type: ignore[arg-type]
    return Innovations(method, count, lost / count, nis, degrees, least_ratio * low, high)


def no_fix() -> Finding:
    """The finding where no method has a fix."""
    text = "No method had a single fix: no ping lies within the navigation, or no beam of them is valid."
    advice = "Check dvl.clock, and which pings have beams."
    return Finding("no_fix", "fault", float("inf"), text, "", advice, "dvl.clock")


def least_ratio(robust: Robust | None) -> float:
    """Least NIS over its degrees that noise as claimed leads to; 1 for Gaussian updates.

    A beam with the innovation z, in its claimed σ, gets the variance R/w, and NIS counts z² w. Student's t with ν
    degrees has w = (ν + 1)/(c (ν + z²/c)) with c = (ν + 3)/(ν + 1). If the noise is Gaussian as claimed, NIS over its
    degrees is then E(z² w) < 1 where the filter's own covariance is small against the noise, and between that and 1
    elsewhere: for ν = 4 it is 0.62. Gates only lower it.

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
