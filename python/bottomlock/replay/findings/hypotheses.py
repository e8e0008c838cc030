"""Which single mistake explains that a velocity does not follow the inertial readings, by the fit of the rig."""

from dataclasses import dataclass, field

import numpy as np

from bottomlock.recordings.rig_fit import LOOSE, PARTS, Match, Recorded, fit
from bottomlock.recordings.rig_search import fit_anyhow
from bottomlock.recordings.rotation import rotation_vectors
from bottomlock.recordings.streams import Floats

LEAST_DROP = 36.0
"""Least fall of the cost that a cause must explain: chi-squared of three parameters by chance is below 26 (1e-5)."""
LEAST_PART = 0.02
"""And this part of the whole cost: a model that is a little wrong everywhere gains a little from any parameter."""
LARGE = {"scale": 0.6, "rotation": float(np.deg2rad(20.0)), "clock": 0.5}
LARGE_PART = 0.3
"""A larger mistake than these must explain this part of the cost, as a wrong unit (0.94) and a turned DVL (0.95) do on
dives of tests/dive.py, and clocks of 0.7 to 1.5 s. A fit makes one of a speed that hardly changes: 0.12 on sections of
St Pere without one, a clock of 1 s on that from 800 to 900 s."""
DISCRETE_PART = 0.4
"""... as a mistaken axis, sign or unit must."""
ENOUGH = 0.88
"""Causes that explain this part of what the best one does are as good: the simplest of them stands."""
SIGMAS = 5.0
MATERIAL = {"rotation": np.deg2rad(1.5), "scale": 0.012, "clock": 0.03, "lever": 0.25}
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
OFF_AXES_RAD = np.deg2rad(10.0)
"""Axes that are turned by more than this from any permutation are a mounting."""
SIMPLER = ("units", "gyros", "axes", "clock", "scale", "gyro_bias", "rotation", "lever")
"""Order in which causes that explain alike are preferred; all but the first three are parameters of the fit."""
GYROS = {
    "x": np.array([-1.0, 1.0, 1.0]), "y": np.array([1.0, -1.0, 1.0]), "z": np.array([1.0, 1.0, -1.0]),
    "x, y and z": -np.ones(3),
}  # fmt: skip
"""Axes about which the angular rate has the wrong sign."""
UNITS = {"deg/s taken for rad/s": np.pi / 180.0, "rad/s taken for deg/s": 180.0 / np.pi}


@dataclass(frozen=True, eq=False)
class Mistake:
    """A mistake that may have been made.

    Attributes:
        name: one of `SIMPLER`.
        of: which of its kind.
        axes: (3, 3) of the velocity with it; a rotation is about these.
        gyros: factor of the rates with it.
    """

    name: str
    of: str = ""
    axes: Floats = field(default_factory=lambda: np.eye(3))
    gyros: float | Floats = 1.0

    def fit(
        self, recorded: Recorded, tight: dict[str, float], sigma_mps: float | None = None
    ) -> Match | None:
        """The fit with it, all else near what is stated."""
        free = {self.name} & set(PARTS)
        prior = tight if free else tight | BESIDE_DISCRETE
        recorded = recorded.with_gyros(self.gyros)
        return fit(recorded, prior=prior, free=free, axes=self.axes, sigma_mps=sigma_mps)


@dataclass(frozen=True, eq=False)
class Cause:
    """A mistake, the fit with it, and the fall of the cost."""

    mistake: Mistake
    match: Match
    drop: float

    @property
    def name(self) -> str:
        """Of the mistake."""
        return self.mistake.name

    def leaves_mps(self, recorded: Recorded, tight: dict[str, float]) -> float:
        """Scatter that is left with it; infinite where it cannot be fitted."""
        own = self.mistake.fit(recorded, tight)
        return np.inf if own is None else own.sigma_mps

    @property
    def values(self) -> Floats:
        """The parameter that is mistaken, a rotation with the axes that it is about; empty for other mistakes."""
        if self.name == "rotation":
            return np.asarray(rotation_vectors(self.match.turned[None])[0])
        return self.match.part(self.name) if self.name in PARTS else np.zeros(0)

    def significant(self, stated: Match, tight: dict[str, float]) -> bool:
        """Whether the mistake is larger than its noise, and than what does no harm, and explains enough."""
        if self.name not in PARTS:
            return self.drop > DISCRETE_PART * stated.cost
        size = np.abs(self.values)
        if size.max() > LARGE.get(self.name, np.inf) and self.drop < LARGE_PART * stated.cost:
            return False
        least = BIAS_FACTOR * tight["gyro_bias"] if self.name == "gyro_bias" else MATERIAL[self.name]
        return bool((size > np.maximum(least, SIGMAS * self.match.part_sd(self.name))).any())


@dataclass(frozen=True, eq=False)
class Comparison:
    """A velocity against inertial readings.

    Attributes:
        stated: the fit with everything near what is stated.
        causes: that explain the difference, the likeliest first.
        unexplained: whether none of them removes a difference that is not far within the noise of a velocity.
    """

    stated: Match
    causes: list[Cause]
    unexplained: bool


def tight_priors(gyro_bias_radps: float, accel_bias_mps2: float) -> dict[str, float]:
    """1 sigma of every parameter as a case states it: a sixth of what is material, which then costs `LEAST_DROP`."""
    stated = {name: float(size) / np.sqrt(LEAST_DROP) for name, size in MATERIAL.items()}
    return stated | {"gyro_bias": max(gyro_bias_radps, 1e-7), "accel_bias": max(accel_bias_mps2, 1e-4)}


def compare(
    recorded: Recorded, tight: dict[str, float], sigma_mps: float, *, unit_is_right: bool = False
) -> Comparison | None:
    """Fits what is stated, what is best, and every single mistake.

    Args:
        recorded: readings and velocities as the case states them.
        tight: 1 sigma of what is stated.
        sigma_mps: claimed noise of a velocity, per axis.
        unit_is_right: whether something else shows that the unit of the gyros is as stated.
    """
    free, near = fit(recorded, prior=LOOSE), fit(recorded, prior=tight)
    if free is None or near is None:
        return None
    fails = near.sigma_mps > 1.15 * free.sigma_mps or near.sigma_mps > 2.0 * sigma_mps or not free.plausible
    # Only a comparison that fails gets the search over axes and units.
    mistakes = [Mistake(name) for name in SIMPLER if name in PARTS] + (_discrete(recorded) if fails else [])
    mistakes = [one for one in mistakes if not (unit_is_right and one.name == "units")]
    own = [free, near, *(one.fit(recorded, tight) for one in mistakes if one.name not in PARTS)]
    least = 0.7 * sigma_mps
    sigma = max(min(one.sigma_mps for one in own if one is not None), least)
    stated, free = fit(recorded, prior=tight, sigma_mps=sigma), fit(recorded, prior=LOOSE, sigma_mps=sigma)
    if stated is None or free is None:
        return None
    matches = [(one, one.fit(recorded, tight, sigma)) for one in mistakes]
    causes = [Cause(one, match, stated.cost - match.cost) for one, match in matches if match is not None]
    causes = [one for one in causes if one.significant(stated, tight)]
    material = [one for one in causes if one.drop > max(LEAST_DROP, LEAST_PART * stated.cost)]
    most = stated.cost - min([free.cost, *(one.match.cost for one in causes)])
    kept = [
        one
        for one in material
        if one.drop >= REMOVED * most and one.leaves_mps(recorded, tight) < MOST_LEFT * sigma_mps
    ]
    best = max((one.drop for one in kept), default=0.0)
    alike = [one for one in kept if one.drop >= ENOUGH * best]
    alike.sort(key=lambda one: (SIMPLER.index(one.name), -one.drop))
    rest = sorted((one for one in kept if one not in alike), key=lambda one: -one.drop)
    unexplained = bool(material) and not kept and near.sigma_mps > least
    return Comparison(stated, _told_apart(alike + rest), unexplained)


def _told_apart(causes: list[Cause]) -> list[Cause]:
    """The first, and two more at most that fit as well, one of each other kind: the log does not tell them apart."""
    found: dict[str, Cause] = {}
    for one in causes:
        if one is causes[0] or one.match.cost < AS_WELL * causes[0].match.cost:
            found.setdefault(one.name, one)
    return list(found.values())[:3]


def _discrete(recorded: Recorded) -> list[Mistake]:
    """Mistaken units, signs and axes; of an IMU whose axes are left-handed rates turn the other way."""
    tried = [Mistake("units", what, gyros=factor) for what, factor in UNITS.items()]
    tried += [Mistake("gyros", what, gyros=signs) for what, signs in GYROS.items()]
    for hand in (1.0, -1.0):
        found = fit_anyhow(recorded.with_gyros(hand))
        if found is None:
            continue
        M = nearest_axes(found.turned)
        right_handed = np.linalg.det(found.turned) > 0.0
        if M is None and hand > 0.0 and right_handed:
            tried.append(Mistake("rotation", axes=found.turned))
        elif M is not None and not np.array_equal(M, np.eye(3)) and (hand > 0.0 or not right_handed):
            tried.append(Mistake("axes", axes=M, gyros=hand))
    return tried


def nearest_axes(turned: Floats) -> Floats | None:
    """The signed permutation of axes that a matrix (3, 3) is near; None where it is near none.

    >>> nearest_axes(np.array([[0.1, 0.995, 0.0], [-0.995, 0.1, 0.0], [0.0, 0.0, 1.0]])).tolist()
    [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    M = np.where(np.abs(turned) > np.sqrt(0.5), np.sign(turned), 0.0)
    return M if 0.5 * (float((M * turned).sum()) - 1.0) > np.cos(OFF_AXES_RAD) else None
