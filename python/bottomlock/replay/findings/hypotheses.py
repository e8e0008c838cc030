"""Which single mistake explains that a velocity does not follow the inertial readings."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.rig_fit import LOOSE, Match, Recorded, fit
from bottomlock.recordings.streams import Floats

LEAST_DROP = 36.0
"""Least fall of the cost that a cause must explain: chi-squared of three parameters by chance is below 26 (1e-5)."""
LEAST_PART = 0.02
"""And this part of the whole cost: a model that is a little wrong everywhere gains a little from any parameter."""
LARGE = {"scale": 0.6, "rotation": float(np.deg2rad(20.0))}
LARGE_PART = 0.3
"""A larger mistake than these must explain this part of the cost, as a wrong unit (0.94) and a turned DVL (0.95) do on
dives of tests/dive.py. A fit makes one of a speed that hardly changes: 0.12 on sections of St Pere without one."""
ENOUGH = 0.88
"""Causes that explain this part of what the best one does are as good: the simplest of them stands."""
SIGMAS = 5.0
MATERIAL = {"rotation": np.deg2rad(1.5), "scale": 0.012, "clock": 0.03, "gyro_bias": 0.0, "lever": 0.25}
BIAS_FACTOR = 4.0
"""A gyro bias is a finding beyond this many claimed standard deviations."""
MOST_LEFT = 3.0
"""Scatter that a cause may leave over the noise of a velocity."""
AS_WELL = 1.1
"""Cost of a further cause over that of the first up to which the log does not tell them apart."""
BESIDE_DISCRETE = {"rotation": 0.05, "clock": 0.05}
"""Freedom beside a mistaken axis, sign or unit."""
REMOVED = 0.5
"""Part of what all mistakes together explain that a cause must explain alone; else it is not the cause."""
SIMPLER = ("units", "gyros", "axes", "clock", "scale", "gyro_bias", "rotation", "lever")
"""Order in which causes that explain alike are preferred."""


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause: its name, the fit with it, the fall of the cost, and the factor of the gyros with it."""

    name: str
    match: Match
    drop: float
    gyros: float | Floats = 1.0


@dataclass(frozen=True, eq=False)
class Comparison:
    """A velocity against inertial readings.

    Attributes:
        stated: the fit with everything near what is stated.
        free: the best fit with everything free.
        causes: that explain the difference, the likeliest first.
        unexplained: whether there is a difference that none of them removes.
    """

    stated: Match
    free: Match
    causes: list[Cause]
    unexplained: bool


def tight_priors(gyro_bias_radps: float, accel_bias_mps2: float) -> dict[str, float]:
    """1 sigma of every parameter as a case states it: what a careful installation leaves."""
    return {
        "rotation": float(np.deg2rad(0.5)), "scale": 0.005, "clock": 0.008, "gyro_bias": max(gyro_bias_radps, 1e-7),
        "accel_bias": max(accel_bias_mps2, 1e-4), "lever": 0.1,
    }  # fmt: skip


def _axes() -> dict[str, tuple[Floats, float]]:
    """Ways in which axes are mistaken: matrix from the velocity's axes, and the sign of the gyros."""
    quarter = [
        np.asarray(Rotation.from_euler("Z", 90 * k, degrees=True).as_matrix()).round(9) + 0.0
        for k in range(4)
    ]
    found = {f"turned by {90 * k} deg about the vertical": (quarter[k], 1.0) for k in (1, 2, 3)}
    found["reversed"] = (-np.eye(3), 1.0)
    found["upside down (roll 180 deg)"] = (np.diag([1.0, -1.0, -1.0]), 1.0)
    found["upside down (pitch 180 deg)"] = (np.diag([-1.0, 1.0, -1.0]), 1.0)
    found["y reversed"] = (np.diag([1.0, -1.0, 1.0]), 1.0)
    found["x reversed"] = (np.diag([-1.0, 1.0, 1.0]), 1.0)
    found["z reversed"] = (np.diag([1.0, 1.0, -1.0]), 1.0)
    mirror = np.diag([1.0, -1.0, 1.0])
    for k in range(4):
        found[f"left-handed {k}"] = (quarter[k] @ mirror, -1.0)
        found[f"left-handed, upside down {k}"] = (quarter[k] @ np.diag([1.0, 1.0, -1.0]), -1.0)
    return found


GYROS = {
    "x": np.array([-1.0, 1.0, 1.0]),
    "y": np.array([1.0, -1.0, 1.0]),
    "z": np.array([1.0, 1.0, -1.0]),
    "x, y and z": -np.ones(3),
}
"""Axes about which the angular rate has the wrong sign."""
UNITS = {"deg/s taken for rad/s": np.pi / 180.0, "rad/s taken for deg/s": 180.0 / np.pi}


def compare(recorded: Recorded, tight: dict[str, float], sigma_mps: float) -> Comparison | None:
    """Fits what is stated, what is best, and every single mistake.

    Args:
        recorded: readings and velocities as the case states them.
        tight: 1 sigma of what is stated.
        sigma_mps: claimed noise of a velocity, per axis.
    """
    free = fit(recorded, prior=LOOSE)
    near = fit(recorded, prior=tight)
    if free is None or near is None:
        return None
    # Only a comparison that fails gets the search over axes and units, which takes a second or two.
    sigma = max(min(free.sigma_mps, near.sigma_mps), sigma_mps)
    suspects = _discrete(recorded, tight, sigma) if _fails(near, free, sigma_mps) else []
    sigma = max(
        min([free.sigma_mps, near.sigma_mps, *(one.match.sigma_mps for one in suspects)]), 0.7 * sigma_mps
    )
    stated = fit(recorded, prior=tight, sigma_mps=sigma)
    free = fit(recorded, prior=LOOSE, sigma_mps=sigma)
    if stated is None or free is None:
        return None
    causes = [
        *_continuous(recorded, tight, stated, sigma),
        *_repeat(recorded, tight, stated, suspects, sigma),
    ]
    material = [one for one in causes if one.drop > max(LEAST_DROP, LEAST_PART * stated.cost)]
    least = min([free.cost, *(one.match.cost for one in causes)])
    kept = [
        one for one in material if _removes(one, stated, least) and _fits(recorded, tight, one, sigma_mps)
    ]
    best = max((one.drop for one in kept), default=0.0)
    alike = [one for one in kept if one.drop >= ENOUGH * best]
    alike.sort(key=lambda one: (SIMPLER.index(one.name.split(":")[0]), -one.drop))
    rest = sorted((one for one in kept if one not in alike), key=lambda one: -one.drop)
    return Comparison(stated, free, alike[:1] + _others(alike, rest), bool(material) and not kept)


def _removes(cause: Cause, stated: Match, least_cost: float) -> bool:
    """Whether most of what any fit removes is gone with the cause."""
    return cause.drop >= REMOVED * (stated.cost - least_cost)


def _fits(recorded: Recorded, tight: dict[str, float], cause: Cause, sigma_mps: float) -> bool:
    """Whether what is left with the cause is near the noise of a velocity, by its own scatter."""
    name = cause.name.split(":")[0]
    prior = tight if name in LOOSE else tight | BESIDE_DISCRETE
    own = fit(recorded.with_gyros(cause.gyros), prior=prior, free={name}, axes=cause.match.axes)
    return own is not None and own.sigma_mps < MOST_LEFT * sigma_mps


def _others(alike: list[Cause], rest: list[Cause]) -> list[Cause]:
    """Further causes that fit as well as the first, one of each other kind: the log does not tell them apart."""
    found: dict[str, Cause] = {}
    for one in alike[1:] + rest:
        if one.match.cost < AS_WELL * alike[0].match.cost:
            found.setdefault(one.name.split(":")[0], one)
    found.pop(alike[0].name.split(":")[0] if alike else "", None)
    return list(found.values())[:2]


def _fails(near: Match, free: Match, sigma_mps: float) -> bool:
    return near.sigma_mps > 1.15 * free.sigma_mps or near.sigma_mps > 2.0 * sigma_mps or not free.plausible


def _continuous(recorded: Recorded, tight: dict[str, float], stated: Match, sigma: float) -> list[Cause]:
    found = []
    for name in ("rotation", "scale", "clock", "gyro_bias", "lever"):
        one = fit(recorded, prior=tight, free={name}, sigma_mps=sigma)
        if one is None:
            continue
        values, sd = one.part(name), one.part_sd(name)
        size = float(np.abs(values).max())
        if size > LARGE.get(name, np.inf) and stated.cost - one.cost < LARGE_PART * stated.cost:
            continue
        least = BIAS_FACTOR * tight["gyro_bias"] if name == "gyro_bias" else MATERIAL[name]
        if size > least and bool((np.abs(values) > SIGMAS * sd).any()):
            found.append(Cause(name, one, stated.cost - one.cost))
    return found


def _discrete(recorded: Recorded, tight: dict[str, float], sigma: float) -> list[Cause]:
    """The best of the mistaken axes and units, with a little freedom beside them."""
    some = tight | BESIDE_DISCRETE
    tried: list[tuple[str, Floats | None, float | Floats]] = [
        (f"axes:{words}", axes, sign) for words, (axes, sign) in _axes().items()
    ]
    for kind, of_gyros in (("units", UNITS), ("gyros", GYROS)):
        tried += [(f"{kind}:{words}", None, gyros) for words, gyros in of_gyros.items()]
    found = []
    for name, axes, gyros in tried:
        one = fit(recorded.with_gyros(gyros), prior=some, axes=axes, sigma_mps=sigma)
        if one is not None:
            found.append(Cause(name, one, 0.0, gyros))
    found.sort(key=lambda one: one.match.cost)
    again = []
    for cause in found[:3]:
        match = fit(recorded.with_gyros(cause.gyros), prior=some, axes=cause.match.axes)
        if match is not None:
            again.append(Cause(cause.name, match, 0.0, cause.gyros))
    return again


def _repeat(
    recorded: Recorded, tight: dict[str, float], stated: Match, causes: list[Cause], sigma: float
) -> list[Cause]:
    found = []
    some = tight | BESIDE_DISCRETE
    for one in causes:
        match = fit(recorded.with_gyros(one.gyros), prior=some, axes=one.match.axes, sigma_mps=sigma)
        if match is not None and match.cost < 0.6 * stated.cost:
            found.append(Cause(one.name, match, stated.cost - match.cost, one.gyros))
    return found
