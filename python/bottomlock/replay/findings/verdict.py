"""The verdict on a replay: fixes rejected, NIS against what a consistent filter has, and dead reckoning."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.stats import chi2, norm

from bottomlock.files.replay_tables import FORWARD
from bottomlock.kernel import local_earth
from bottomlock.kernel.models import Environment, Robust
from bottomlock.recordings.finding import Finding, Severity
from bottomlock.recordings.robust import correlation_rows
from bottomlock.replay.findings.limits import (
    HIGH_RATIO,
    MANY_REJECTED,
    PROBABILITY,
    WRONG_RATIO,
    WRONG_REJECTED,
)
from bottomlock.replay.findings.tracks import Agreement, metres
from bottomlock.statistics.chi_squared import CONSISTENT, OVERCONFIDENT, mean_band

ABSORBED, WRONG = "absorbed", "wrong"
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


def verdict_finding(
    seen: Innovations, cause: Finding | None, agreement: Agreement | None
) -> tuple[Finding, str]:
    """The first finding, and "consistent", "overconfident", "absorbed" or "wrong".

    Args:
        seen: of the method that stands for all.
        cause: the likeliest cause, or None.
        agreement: of that method with dead reckoning; None without dead reckoning.
    """
    state, severity, text, advice = CONSISTENT, "note", "Nothing is wrong with the filter's innovations.", ""
    likeliest = "" if cause is None else f"The likeliest cause: {cause.text} {cause.hint}"
    if agreement is not None and (agreement.leaves or agreement.lost):
        state, severity, text = WRONG, "fault", departure(agreement)
        until = "" if agreement.reckoned_refuted else " Until then take dead_reckoning."
        advice = (
            likeliest or f"No single cause stands out: check units, start, mounting, axes and clock.{until}"
        )
    elif seen.rejected > WRONG_REJECTED or seen.ratio > WRONG_RATIO:
        state, severity, text = WRONG, "fault", "Something is wrong: the beams do not fit the navigation."
        advice = likeliest or (
            "No single cause stands out: check start, mounting, axes and clock; are IMU and DVL of the same dive? "
            "`bottomlock audit` tests the log."
        )
    elif seen.rejected > MANY_REJECTED or seen.ratio > HIGH_RATIO:
        state, severity = OVERCONFIDENT, "warning"
        text = "The filter claims more than the beams confirm."
        advice = (
            f"The likeliest cause: {cause.text}" if cause is not None else
            "Larger dvl.beam_noise_mps or imu.errors would make it consistent."
        )  # fmt: skip
    elif cause is not None:
        state, severity = ABSORBED, "warning"
        text = "The innovations look consistent, but the filter has absorbed an error."
        advice = f"The likeliest: {cause.text} {cause.hint}"
    elif seen.nis > seen.high:
        text = "NIS is a little high: the claimed noise of the beams or the IMU is a little small."
    elif seen.nis < seen.low:
        text = "NIS is low: the claimed noise is larger than the real one."
    level: Severity = "fault" if severity == "fault" else "warning" if severity == "warning" else "note"
    score = float(seen.pings) * max(seen.ratio, seen.rejected)
    return Finding("verdict", level, score, text, seen.words(), advice), state


def departure(agreement: Agreement) -> str:
    """That a method leaves dead reckoning, in one sentence."""
    if agreement.lost:
        return (
            f"{agreement.method} is up to {metres(agreement.apart_m)} from dead reckoning, and claims a larger 1 sigma "
            f"itself: {metres(agreement.sd_m)} at the end, dead reckoning {metres(agreement.reckoned_sd_m)}."
        )
    return (
        f"{agreement.method} leaves dead reckoning by up to {metres(agreement.apart_m)}: {agreement.sigmas:.1f} times "
        "what both claim."
    )


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


_COMPONENTS = {
    "position": ("position", ("north_m", "east_m", "down_m")),
    "velocity": ("velocity", ("surge_mps", "sway_mps", "heave_mps")),
    "attitude": ("misalignment", ("north_rad", "east_rad", "down_rad")),
}
_ADVICE = {
    "position": "Check reference.lever_arm_m, the origin, dvl.errors.scale_factor_percent and start.position_sd_m.",
    "velocity": "Check reference.clock, reference.lever_arm_m, dvl.beam_noise_mps and dvl.errors.",
    "attitude": "Check reference.clock, mounting, start.heading_sd_deg, start.level_sd_deg and imu.errors.",
}
KNOWN = 10.0
"""Correlation times in a series from which on the time is known; a series with fewer is worth one value."""
FEWEST = 10
"""Samples from which on a claim is judged."""


def claims_findings(
    samples: pl.DataFrame, methods: Sequence[str], reference_sd_m: float = 0.0
) -> list[Finding]:
    """Position, velocity and attitude whose errors over claimed σ are far beyond chi-squared.

    Errors last: a series is worth as many values as it has correlation times, at least one an axis. The first sample is
    the start itself, whose deviations are given.

    Args:
        samples: `files.replay_tables.REPLAY_SAMPLES` of the recording.
        methods: of the case.
        reference_sd_m: 1 sigma of a position of the reference along an axis, which is in its errors.
    """
    used = [m for m in (*PREFERRED, *methods) if m in methods and m != "ins"]
    if not used:
        return []
    rows = samples.filter((pl.col("pass") == FORWARD) & (pl.col("method") == used[0])).slice(1)
    found = []
    for quantity, (what, ends) in _COMPONENTS.items():
        noise = reference_sd_m if quantity == "position" else 0.0
        ratios = [
            (rows[f"err_{what}_{end}"] / (rows[f"sd_{what}_{end}"] ** 2 + noise**2).sqrt())
            .drop_nulls()
            .to_numpy()
            for end in ends
        ]
        # A reference without a height has no error of down.
        ratios = [one[np.isfinite(one)] for one in ratios if len(one)]
        if not ratios:
            continue
        if min(len(one) for one in ratios) < FEWEST:
            continue
        squares = np.array([float(np.mean(one**2)) for one in ratios])
        worth = np.array([_worth(one) for one in ratios])
        mean = float(squares @ worth / worth.sum())
        if chi2.sf(squares @ worth, worth.sum()) > 1.0 - PROBABILITY or mean < HIGH_RATIO:
            continue
        most = float(np.sqrt(chi2.ppf(PROBABILITY, worth.sum()) / worth.sum()))
        worst = int(np.argmax(squares))
        found.append(
            Finding(
                "claims", "warning", float(mean * worth.sum()),
                f"The error of {quantity} is {np.sqrt(mean):.1f} times the claimed 1 sigma.",
                f"Method {used[0]}, RMS over time and axes against the reference, its noise included; a consistent "
                f"filter stays below {most:.1f} with errors that last as these ({worth.sum():.0f} independent values). "
                f"Worst is {ends[worst].rsplit('_', 1)[0]}: {np.sqrt(squares[worst]):.1f}.",
                f"{_ADVICE[quantity]} Or the reference is not that good.",
            )
        )  # fmt: skip
    return found


def _worth(ratios: NDArray[np.float64]) -> float:
    """Independent values that a series (n,) of errors is worth, at least one."""
    count = len(ratios) / correlation_rows(ratios, centred=False)
    return count if count > KNOWN else 1.0


NEAREST_POLE_DEG = 0.1
"""Nearer to a pole north turns by a degree in 200 m and less."""
HIGHEST_M = 10_000.0
DEEPEST_M = 11_500.0
"""Heights above and depths below the ellipsoid for which latitude (1e-11 rad) and gravity are checked."""
PLANE_M = 0.3
"""Depth by which the level may leave a tangent plane unremarked: 2 km from the origin."""
_RADIUS_M = 6_371_000.0


def earth_findings(environment: Environment, samples: pl.DataFrame) -> list[Finding]:
    """Places near a pole, beyond the heights of the model, and far from the origin of a tangent plane.

    Args:
        environment: of the replay's model.
        samples: `files.replay_tables.REPLAY_SAMPLES`, whose positions count.
    """
    position = samples.select("north_m", "east_m", "down_m").drop_nulls().to_numpy()
    position = position[np.isfinite(position).all(axis=1)]
    if not len(position):
        return []
    if environment.earth == "tangent_plane":
        return _plane(position)
    from_pole = np.abs(np.pi / 2.0 - abs(environment.latitude_rad)) * _RADIUS_M
    towards = position[:, 0] * np.sign(environment.latitude_rad)
    nearest_deg = float(np.rad2deg(np.hypot(from_pole - towards, position[:, 1]).min() / _RADIUS_M))
    depth = local_earth(environment, position)["depth_m"]
    found = []
    if nearest_deg < NEAREST_POLE_DEG:
        found.append(
            Finding(
                "near_pole", "warning", NEAREST_POLE_DEG / max(nearest_deg, 1e-6),
                f"The track comes within {nearest_deg:.3f} deg of a pole, where north has no meaning.",
                f"Headings are from north at the vehicle and hold to within {NEAREST_POLE_DEG:g} deg of the pole; "
                "position, velocity, level and gravity hold there too.",
                "Do not aid by headings there (attitude.aids, heading), and read positions, not yaw.", "origin.earth",
            )
        )  # fmt: skip
    if float(depth.max()) > DEEPEST_M or float(-depth.min()) > HIGHEST_M:
        found.append(
            Finding(
                "height_limits", "warning", 1.0,
                f"The track lies between {depth.min():.0f} and {depth.max():.0f} m below the ellipsoid.",
                f"Latitude and gravity of the model hold from {HIGHEST_M:.0f} m above to {DEEPEST_M:.0f} m below it.",
                "Check the height of the origin and the unit of depths and heights.", "origin.height_m",
            )
        )  # fmt: skip
    return found


def _plane(position: np.ndarray) -> list[Finding]:
    distance_m = float(np.hypot(position[:, 0], position[:, 1]).max())
    below_m = distance_m**2 / (2.0 * _RADIUS_M)
    if below_m < PLANE_M:
        return []
    return [
        Finding(
            "tangent_plane", "warning", (below_m / PLANE_M) ** 2,
            f"The track goes {distance_m / 1000:.1f} km from the origin of a tangent plane, which leaves the level of "
            f"the sea by {below_m:.1f} m there.",
            f"Level and gravity are off by {np.rad2deg(distance_m / _RADIUS_M):.3f} deg, depths by as many metres.",
            'Navigate on the ellipsoid: origin.earth = "ellipsoid", the default.', "origin.earth",
        )
    ]  # fmt: skip
