"""One cause for a beam matrix that is not the stated one: a single beam, a common tilt, scale or rotation.

The log shows two things of the instrument: the solution W (3, beams) that it applies, v = W y, and, by the closure, the
space that its beams span. Four beams leave W three numbers short of the beams: every M = W⁺ + n cᵀ with W n = 0 solves
W M = 1. The matrix W⁺, of least norm, is the one of an instrument that solves the recorded readings by least squares.
Had a channel been changed after the instrument solved (in recording, by conversion), y = T y_solved with
T = 1 + s e_k e_kᵀ for a scale and 1 + e_k δᵀ A⁺ for a direction, then W = A⁺ T⁻¹, whose pseudo-inverse differs from A
in every beam although only one is at fault. An explanation therefore predicts W⁺ under each place where its cause may
sit, and the fit says which agrees:

    used      the instrument solves with the changed matrix:    W⁺ = T A
    recorded  the channel was changed after the instrument:      W⁺ = (A⁺ T⁻¹)⁺
    unknown   the instrument solves with A, unaware:             W⁺ = A, and only the closure shows it (`closure`)

Where the readings were regressed on the velocity, the regression gives T A for the first two and T A (A⁺ T A)⁻¹ for the
third. Explanations are compared by BIC (Schwarz 1978), so that a further number must earn its place.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2 as chi_squared

from bottomlock.audit.findings import MATERIAL_RAD, MATERIAL_SCALE
from bottomlock.audit.matrix import READINGS_TO_VELOCITY, Matrix
from bottomlock.audit.robust import Array

TOLERANCE = 0.1 * min(MATERIAL_SCALE, MATERIAL_RAD)
"""A stated geometry is exact to a tenth of what is reported: files round to 0.05 %."""
FITS = 1e-3
"""An explanation whose residuals are less probable than this does not explain."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """A cause with its numbers.

    Attributes:
        kind: "none", "scale", "tilt", "rotation" (of all beams), "beam_scale", "beam_direction", "free".
        where: "used", "recorded", "unknown".
        beam: from 0; -1 where it is not a single beam.
        size: relative, or rad; of the beam or of all.
        size_sd: its standard deviation.
        tilt_change_rad: part of a direction that is tilt.
        rows: (beams, 3) the beams under this explanation, in the order and with the signs of the log.
        chi2: of the residuals, with `free` degrees of freedom.
        free: degrees of freedom.
        share: probability among the explanations tried, equal before the log.
    """

    kind: str
    where: str
    beam: int
    size: float
    size_sd: float
    tilt_change_rad: float
    rows: Array
    chi2: float
    free: int
    share: float = 0.0

    @property
    def fits(self) -> bool:
        """The residuals are as small as they should be."""
        return self.free == 0 or float(chi_squared.sf(self.chi2, self.free)) > FITS


def explain(matrix: Matrix, base: Array | None) -> list[Explanation]:
    """Explanations of a matrix, the most probable first.

    Args:
        matrix: by regression against the instrument's velocity.
        base: (beams, 3) stated rows in the order and with the signs of the log; None: a Janus of unknown tilt, azimuth
            and scale (four beams).
    """
    data = matrix.rows.ravel()
    copies = matrix.resampled.reshape(len(matrix.resampled), -1)
    cov = np.cov(copies, rowvar=False) + TOLERANCE**2 * np.eye(data.size)
    whiten = np.linalg.inv(np.linalg.cholesky(cov))
    nuisance = 0 if base is not None else 3
    nearest = None if base is not None else _janus_near(matrix.rows)
    made = []
    for kind, where, beam, count, predict in _candidates(matrix, common=base is not None):

        def rows_of(p: Array, predict: _Predict = predict, count: int = count) -> tuple[Array, Array]:
            start = base if base is not None else nearest(p[count:]) if nearest is not None else matrix.rows
            return predict(start, p[:count])

        fit = least_squares(
            lambda p, rows_of=rows_of: whiten @ (rows_of(p)[0].ravel() - data),
            np.zeros(count + nuisance), x_scale=0.01,
        )  # fmt: skip
        value, rows = np.asarray(fit.x), rows_of(np.asarray(fit.x))[1]
        spread = np.linalg.pinv(fit.jac.T @ fit.jac) if fit.x.size else np.zeros((0, 0))
        size, sd, lean = _size(kind, value[:count], spread[:count, :count])
        made.append(
            Explanation(
                kind, where, beam, size, sd, lean, rows, float(2.0 * fit.cost), data.size - fit.x.size
            )
        )
    made.append(Explanation("free", "used", -1, 0.0, 0.0, 0.0, matrix.rows, 0.0, 0))
    return _shared(made, data.size, matrix.pings)


def _shared(made: list[Explanation], numbers: int, pings: int) -> list[Explanation]:
    """The explanations with their shares, by BIC, the most probable first."""
    bic = np.array([one.chi2 + (numbers - one.free) * np.log(pings) for one in made])
    weight = np.exp(-0.5 * (bic - bic.min()))
    shares = weight / weight.sum()
    told = [Explanation(**(vars(one) | {"share": float(s)})) for one, s in zip(made, shares, strict=True)]
    return sorted(told, key=lambda one: -one.share)


_Predict = Callable[[Array, Array], tuple[Array, Array]]
"""Base rows and parameters to what the regression gives, and to the beams as they are."""


def _candidates(matrix: Matrix, *, common: bool) -> Iterator[tuple[str, str, int, int, _Predict]]:
    """Kind, place, beam, number of parameters, prediction."""
    yield "none", "used", -1, 0, lambda base, _: (base, base)
    if common:
        yield "scale", "used", -1, 1, lambda base, p: _twice((1.0 + p[0]) * base)
        yield "tilt", "used", -1, 1, lambda base, p: _twice(_leaned(base, p[0]))
        yield "rotation", "used", -1, 3, lambda base, p: _twice(Rotation.from_rotvec(p).apply(base))
    exact = matrix.regression == READINGS_TO_VELOCITY
    beams = len(matrix.rows)
    places = ("used", "recorded") if exact else ("used", "unknown")
    for where in places if beams > 3 else ("used",):
        for beam in range(beams):
            yield "beam_scale", where, beam, 1, _one_beam(beam, where, _scaled)
            yield "beam_direction", where, beam, 2, _one_beam(beam, where, _turned)


def _twice(rows: Array) -> tuple[Array, Array]:
    return rows, rows


def _one_beam(beam: int, where: str, change: Callable[[Array, Array], Array]) -> _Predict:
    """Prediction of a change of one row."""

    def predict(base: Array, p: Array) -> tuple[Array, Array]:
        rows = base.copy()
        rows[beam] = change(base[beam], p)
        if where == "used":
            return rows, rows
        solve = np.linalg.pinv(base)
        if where == "unknown":
            return rows @ np.linalg.inv(solve @ rows), rows
        T = np.eye(len(base))
        if change is _scaled:
            T[beam, beam] += p[0]
        else:
            T[beam] += (rows[beam] - base[beam]) @ solve
        return np.asarray(np.linalg.pinv(solve @ np.linalg.inv(T))), rows

    return predict


def _scaled(row: Array, p: Array) -> Array:
    return np.asarray((1.0 + p[0]) * row)


def _turned(row: Array, p: Array) -> Array:
    """The row turned by p[0] away from z (or −z) and by p[1] across it, rad."""
    along, aside = _axes(row)
    turn = float(np.hypot(*p))
    if turn < 1e-12:
        return row
    length = float(np.linalg.norm(row))
    return np.asarray(np.cos(turn) * row + np.sin(turn) / turn * length * (p[0] * along + p[1] * aside))


def _axes(row: Array) -> tuple[Array, Array]:
    """Unit vectors across a row: towards a larger angle from its end of the z axis, and along the azimuth."""
    unit = row / np.linalg.norm(row)
    aside = np.cross([0.0, 0.0, 1.0], unit)
    if np.linalg.norm(aside) < 1e-6:
        aside = np.array([0.0, 1.0, 0.0])
    aside = aside / np.linalg.norm(aside)
    away = np.cross(aside, unit)
    return (away if away[2] * unit[2] < 0.0 else -away), aside


def _leaned(base: Array, by_rad: float) -> Array:
    return np.array([_turned(row, np.array([by_rad, 0.0])) for row in base])


def _size(kind: str, p: Array, cov: Array) -> tuple[float, float, float]:
    """Size, its standard deviation and the change of tilt of an explanation's parameters."""
    if not p.size:
        return 0.0, 0.0, 0.0
    if p.size == 1:
        return float(p[0]), float(np.sqrt(cov[0, 0])), float(p[0]) if kind == "tilt" else 0.0
    size = float(np.linalg.norm(p))
    unit = p / max(size, 1e-12)
    return size, float(np.sqrt(unit @ cov @ unit)), float(p[0]) if kind == "beam_direction" else 0.0


def _janus_near(rows: Array) -> Callable[[Array], Array]:
    """Janus beams (4, 3) near these rows, in their order and signs, by changes of tilt, azimuth and scale."""
    sign = np.where(rows[:, 2] < 0.0, -1.0, 1.0)
    unit = sign[:, None] * rows / np.linalg.norm(rows, axis=1)[:, None]
    lean = float(np.median(np.arccos(np.clip(unit[:, 2], -1.0, 1.0))))
    around = np.arctan2(unit[:, 1], unit[:, 0])
    place = np.argsort(np.argsort((around - around[0]) % (2.0 * np.pi)))
    turn = around - place * 0.5 * np.pi
    first = float(np.arctan2(np.median(np.sin(turn)), np.median(np.cos(turn))))

    def janus(p: Array) -> Array:
        tilt, azimuth = lean + p[0], first + p[1] + place * 0.5 * np.pi
        x, y = np.cos(azimuth) * np.sin(tilt), np.sin(azimuth) * np.sin(tilt)
        return np.asarray((1.0 + p[2]) * sign[:, None] * np.stack([x, y, np.full(4, np.cos(tilt))], axis=1))

    return janus
