"""What the checks of an audit look at: a log with what stands beside it, and what is estimated of both, once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from bottomlock.arrays import rising
from bottomlock.audit import defects
from bottomlock.audit.closure import Closure, Slope, closure_of, closure_slope, null_space, null_space_cov
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_RAD
from bottomlock.audit.logs import Array, BeamLog, Flags, Times
from bottomlock.audit.matrix import LEAST_PINGS, READINGS_TO_VELOCITY, Match, Matrix, find_matrix, match
from bottomlock.audit.mounting import Mounting, find_mounting
from bottomlock.audit.robust import significant
from bottomlock.io.beams import check_beam_count, packaged_geometries, read_geometry
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.axes import from_angles
from bottomlock.recordings.closure import Reordered, find_order
from bottomlock.recordings.rig_motion import Tracked

BETTER, FAR_BETTER = 0.5, 0.2
"""An order is considered whose closure is smaller than this of the stated one's; of a matrix by regression, than this.

A fault of one channel in the record alone shows in every row of such a matrix, and another order may halve its closure.
"""

TURNED_RAD = 1e-9
"""A smaller common rotation is none."""
Pairs = tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Beams:
    """What full pings show of the beams, beside stated ones or without.

    Attributes:
        row: (n,) rows of the log with full pings: every beam valid, not stale, no zero of a beam that is 0 when lost.
        readings_mps: (n, beams) there.
        matrix: the beam matrix by regression against the instrument's velocity, or None.
        stated: (beams, 3) stated directions times scale in the frame of the instrument's velocity, or None.
        copies: pairs of channels that hold the same numbers.
    """

    row: Times
    readings_mps: Array
    matrix: Matrix | None = None
    stated: Array | None = None
    copies: Pairs = ()

    @cached_property
    def seen(self) -> Matrix | None:
        """The beam matrix where it is observable."""
        return self.matrix if self.matrix is not None and self.matrix.observable.all() else None

    @cached_property
    def match(self) -> Match | None:
        """Its match with the stated geometry."""
        return match(self.seen.directions, self.stated) if self.seen and self.stated is not None else None

    @cached_property
    def _assumed(self) -> Array | None:
        """(beams, 3) rows whose closure is judged, as stated or found; None where it is not judged."""
        rows = self.seen.rows if self.seen else self.stated
        return None if len(self.row) < LEAST_PINGS or self.copies else rows

    @cached_property
    def reordered(self) -> Reordered | None:
        """Orders other than assumed."""
        if self._assumed is None or len(self._assumed) < 4:
            return None
        better = FAR_BETTER if self.seen else BETTER
        return find_order(self.readings_mps, self._assumed, better=better, least_mps=MATERIAL_MPS)

    @cached_property
    def rows(self) -> Array | None:
        """(beams, 3) geometry in the order and with the signs of the log."""
        rows = self.seen.rows if self.seen else self.stated
        if rows is None or self.reordered is None or self.reordered.or_bias:
            return rows
        order = self.reordered.orders[0]
        return np.asarray(np.array(order.sign)[:, None] * rows[list(order.beam)])

    @cached_property
    def closures(self) -> list[Closure]:
        """Statistics, one for each combination in the null space; none for three beams."""
        return [closure for closure, _ in self._closures]

    @cached_property
    def _closures(self) -> list[tuple[Closure, Array]]:
        """Each with the covariance (3, 3) that uncertain rows give its slope on the velocity."""
        rows, closures, cov = self.rows, [], np.zeros((3, 3))
        if rows is None or self._assumed is None:
            return []
        middle = np.linalg.pinv(rows) @ np.median(self.readings_mps, axis=0)
        for weights in null_space(rows).T:
            if self.seen and rows is self.seen.rows:
                cov = null_space_cov(rows, self.seen.resampled, weights)
            closure = closure_of(weights, self.readings_mps, float(np.sqrt(middle @ cov @ middle)))
            closures.append((closure, cov))
        return closures

    @cached_property
    def slope(self) -> Slope | None:
        """Slope of the first closure on the velocity."""
        if self.rows is None or not self._closures or self.doubtful:
            return None
        if self.seen and self.rows is self.seen.rows and self.seen.regression != READINGS_TO_VELOCITY:
            # Rows from a regression on the velocity leave no part of the closure that follows it.
            return None
        closure, cov = self._closures[0]
        velocity = self.readings_mps @ np.linalg.pinv(self.rows).T
        return closure_slope(closure.values_mps, velocity, self.row, cov)

    @cached_property
    def biased(self) -> dict[int, tuple[float, float]]:
        """Beams with a bias against the instrument's own velocity: its size and 1 sigma, m/s.

        The regression observes the biases that act like a velocity, the closure the rest. A bias that the instrument
        has included in its velocity is observed by the closure alone.
        """
        m = self.seen
        if m is None or not self.closures:
            return {}
        if not significant(m.bias_mps, m.bias_sd_mps, m.blocks, MATERIAL_MPS).any():
            return {}
        bias, variance = m.bias_mps, m.bias_sd_mps**2
        # A regression of the readings holds the whole bias; one of the velocity lacks the part in the closure.
        for one in self.closures if m.regression == READINGS_TO_VELOCITY else []:
            share = one.weights / float(one.weights @ one.weights)
            bias = bias + share * one.median_mps
            variance = variance + (share * one.median_sd_mps) ** 2
        sd = np.sqrt(variance)
        sure = np.flatnonzero(significant(bias, sd, m.blocks, MATERIAL_MPS))
        return {int(k): (float(bias[k]), float(sd[k])) for k in sure}

    @property
    def ambiguous(self) -> bool:
        """Another order explains the closure as simply as that of `rows`."""
        return self.reordered is not None and (self.reordered.or_bias or len(self.reordered.orders) > 1)

    @property
    def doubtful(self) -> bool:
        """The order may be wrong, or a beam biased; a bias that the instrument's velocity shows leaves no doubt."""
        return self.reordered is not None and self.reordered.or_bias and not self.biased

    @property
    def depends(self) -> bool:
        """The closure depends on the velocity."""
        return self.slope is not None and self.slope.material

    def _single(self, beams: Flags) -> list[int]:
        """Those of the beams that are not read twice."""
        twice = {beam for pair in self.copies for beam in pair}
        return [int(k) for k in np.flatnonzero(beams) if int(k) not in twice]

    @property
    def moved(self) -> list[int]:
        """Channels that are another beam than stated."""
        return [] if self.match is None else self._single(self.match.beam != np.arange(len(self.match.beam)))

    @property
    def flipped(self) -> list[int]:
        """Channels of the opposite sign of the stated beam."""
        return [] if self.match is None else self._single(self.match.sign < 0)

    @property
    def off(self) -> list[int]:
        """Channels off their stated direction."""
        m, found = self.seen, self.match
        if m is None or found is None:
            return []
        return self._single(significant(found.off_rad, m.direction_sd_rad, m.blocks, MATERIAL_RAD))

    @property
    def turned_rad(self) -> float:
        """Size of the common rotation from the stated geometry."""
        return 0.0 if self.match is None else float(self.match.rotation.magnitude())

    @property
    def fits(self) -> bool:
        """Nothing shows that the beams are not the stated ones."""
        if self.turned_rad >= TURNED_RAD or self.moved or self.flipped or self.off:
            return False
        ordered = self.reordered is None or (self.reordered.or_bias and not self.doubtful)
        return ordered and not self.depends


def platform_rows(geometry: BeamGeometry) -> Array:
    """(beams, 3) directions times scale, platform frame."""
    return geometry.sound_speed_scale * np.asarray(geometry.directions_p)


@dataclass(frozen=True, eq=False)
class Context:
    """A log and what is known beside it.

    Attributes:
        log: the pings.
        stated: geometry to compare with, in the platform frame, or None.
        geometry_name: its name, or None.
        mounting_rpy_rad: roll, pitch, yaw from DVL axes to platform axes that the geometry contains.
        reference: attitude and velocity of the same time.
    """

    log: BeamLog
    stated: BeamGeometry | None = None
    geometry_name: str | None = None
    mounting_rpy_rad: ArrayLike = (0.0, 0.0, 0.0)
    reference: Tracked | None = None

    def __post_init__(self) -> None:
        """Checks that log and geometry have the same number of beams.

        Raises:
            DataError: where they differ.
        """
        if self.stated is not None and self.log.beams:
            check_beam_count(self.log.place, self.log.beams, self.stated.beams)

    @cached_property
    def copies(self) -> tuple[tuple[int, int], ...]:
        """Pairs of channels, from 0, that hold the same numbers."""
        return tuple((one.beams[0] - 1, one.beams[1] - 1) for one in defects.copies(self.log))

    @cached_property
    def locked(self) -> bool:
        """The log ever had lock."""
        return not defects.why_never_locked(self.log)

    @cached_property
    def whole(self) -> Flags:
        """(n,) pings with every beam: valid, not stale, and no zero of a beam that reads zero when lost."""
        lost_is_zero = [beam - 1 for one in defects.zeros(self.log) for beam in one.beams]
        used = (self.log.velocity_mps[:, lost_is_zero] != 0.0).all(axis=1) & (self.log.beams > 0)
        return np.asarray(self.log.full & ~self.log.unchanged & used & self.locked)

    @cached_property
    def matrix(self) -> Matrix | None:
        """The beam matrix by regression against the instrument's velocity, or None."""
        log, solved = self.log, self.whole & self.log.solved
        if log.instrument_mps is None or not log.own_frame or log.beams < 3:
            return None
        return find_matrix(log.velocity_mps[solved], log.instrument_mps[solved])

    @cached_property
    def stated_rows(self) -> Array | None:
        """(beams, 3) stated directions times scale in the frame of the instrument's velocity, or None."""
        if self.stated is None or not self.log.beams:
            return None
        return np.asarray(from_angles(*self.stated_rpy_rad).inv().apply(platform_rows(self.stated)))

    @cached_property
    def stated_rpy_rad(self) -> Array:
        """(3,) stated roll, pitch, yaw from the frame of the instrument's velocity to the platform's.

        An instrument may give its velocity in its own axes, or rotate it by a mounting that it has been told: the frame
        is taken in which its own solution has the stated beams.
        """
        rpy_rad = np.array(self.mounting_rpy_rad, dtype=np.float64)
        seen = self.matrix is not None and self.matrix.observable.all()
        if self.matrix is None or not seen or self.stated is None:
            return rpy_rad
        rows = platform_rows(self.stated)
        in_own, in_platform = (
            float(np.linalg.norm(self.matrix.rows - of))
            for of in (from_angles(*rpy_rad).inv().apply(rows), rows)
        )
        return rpy_rad if in_own <= in_platform else np.zeros(3)

    def _beside(self, rows: Array | None) -> Beams:
        """The beams beside stated rows (beams, 3)."""
        row = np.flatnonzero(self.whole)
        return Beams(row, self.log.velocity_mps[row], self.matrix, rows, self.copies)

    @cached_property
    def beams(self) -> Beams:
        """The beams beside the stated geometry."""
        return self._beside(self.stated_rows)

    @cached_property
    def packaged(self) -> dict[str, Beams]:
        """The beams beside each other packaged geometry of as many that they fit."""
        if self.whole.sum() < LEAST_PINGS:
            return {}
        names = (one for one in packaged_geometries() if one != self.geometry_name)
        known = {one: read_geometry(one).geometry for one in names}
        tried = {
            name: self._beside(platform_rows(of)) for name, of in known.items() if of.beams == self.log.beams
        }
        fits = {name: one for name, one in tried.items() if one.fits}
        # At rest every order closes alike.
        return {} if len(fits) == len(tried) > 1 else fits

    @cached_property
    def closures(self) -> list[Closure]:
        """Of the beams; of a packaged geometry that fits where nothing is known of them; else the error velocity's."""
        if self.log.error_velocity_mps is not None and not self.log.beams:
            error = self.log.error_velocity_mps[np.isfinite(self.log.error_velocity_mps)]
            return [closure_of(np.ones(1), error[:, None])] if len(error) >= LEAST_PINGS else []
        if self.beams.rows is None and self.packaged and not self.copies:
            return next(iter(self.packaged.values())).closures
        return self.beams.closures

    @cached_property
    def velocity(self) -> tuple[Times, Array]:
        """Times (m,) and velocities (m, 3), DVL frame: the instrument's own, else least squares of full pings.

        Only those with a time later than all before: repeats and steps back have their own findings.
        """
        log, rows = self.log, self.beams.rows
        velocity, known = np.zeros((log.pings, 3)), np.zeros(log.pings, dtype=bool)
        if log.instrument_mps is not None:
            velocity, solved = log.instrument_mps, log.solved
            known = solved & self.whole if (solved & self.whole).sum() > 100 and log.beams else solved
        elif rows is not None:
            velocity, known = np.asarray(log.velocity_mps @ np.linalg.pinv(rows).T), self.whole
        at = np.flatnonzero(known if log.own_frame and self.locked else np.zeros_like(known))
        at = at[rising(log.time_ns[at])]
        return log.time_ns[at], velocity[at]

    @cached_property
    def mounting(self) -> Mounting | None:
        """Mounting of the DVL, or None."""
        if self.reference is None or not len(self.velocity[0]):
            return None
        return find_mounting(*self.velocity, self.reference)
