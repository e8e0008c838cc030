"""What the checks of an audit look at: a log with what stands beside it, and what is estimated of both, once."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.arrays import rising
from bottomlock.audit import defects
from bottomlock.audit.beams import BeamAssessment, assess_beams, rematched
from bottomlock.audit.closure import closure_of
from bottomlock.audit.logs import BeamLog, Reference
from bottomlock.audit.matrix import LEAST_PINGS, Matrix, find_matrix
from bottomlock.audit.mounting import Mounting, find_mounting, platform_rows, rows_as_stated
from bottomlock.audit.robust import Array
from bottomlock.io.beams import check_beam_count, packaged_geometries, read_geometry
from bottomlock.kernel import BeamGeometry


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
    reference: Reference | None = None

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
    def whole(self) -> NDArray[np.bool_]:
        """(n,) pings with every beam: valid, not stale, and no zero of a beam that reads zero when lost."""
        lost_is_zero = [beam - 1 for one in defects.zeros(self.log) for beam in one.beams]
        used = (self.log.velocity_mps[:, lost_is_zero] != 0.0).all(axis=1)
        return np.asarray(self.log.full & ~self.log.unchanged & used & self.locked)

    @cached_property
    def _stated(self) -> tuple[Array | None, Array]:
        rpy_rad = np.array(self.mounting_rpy_rad, dtype=np.float64)
        if self.stated is None or not self.log.beams:
            return None, rpy_rad
        return rows_as_stated(self.stated, rpy_rad, self.log)

    @property
    def stated_rows(self) -> Array | None:
        """(beams, 3) stated directions times scale in the frame of the instrument's velocity, or None."""
        return self._stated[0]

    @property
    def stated_rpy_rad(self) -> Array:
        """(3,) stated mounting of the frame of the instrument's velocity."""
        return self._stated[1]

    @property
    def stated_lever_arm_m(self) -> Array:
        """(3,) mean of the stated ones of the beams."""
        return np.zeros(3) if self.stated is None else np.asarray(self.stated.lever_arms_p_m).mean(axis=0)

    @cached_property
    def packaged(self) -> dict[str, BeamAssessment]:
        """The beams against each other packaged geometry of as many that they fit."""
        names = (one for one in packaged_geometries() if one != self.geometry_name)
        known = {one: read_geometry(one).geometry for one in names}
        seen = self.matrix is not None and self.matrix.observable.all()
        tried = {
            one: rematched(self.assessment, platform_rows(of))
            if seen
            else assess_beams(self.log, self.whole, self.matrix, platform_rows(of), self.copies)
            for one, of in known.items()
            if of.beams == self.log.beams
        }
        fits = {name: one for name, one in tried.items() if one.fits}
        # At rest every order closes alike.
        return {} if len(fits) == len(tried) > 1 else fits

    @cached_property
    def matrix(self) -> Matrix | None:
        """The beam matrix by regression against the instrument's velocity, or None."""
        log, solved = self.log, self.whole & self.log.solved
        if log.instrument_mps is None or not log.own_frame or log.beams < 3:
            return None
        return find_matrix(log.velocity_mps[solved], log.instrument_mps[solved])

    @cached_property
    def assessment(self) -> BeamAssessment:
        """Of the beams; the closure of an instrument that records its error velocity in their place.

        Where nothing is known of the beams, the closures are those of a packaged geometry that fits.
        """
        log = self.log
        if log.beams:
            found = assess_beams(log, self.whole, self.matrix, self.stated_rows, self.copies)
            if found.rows is None and found.full.sum() >= LEAST_PINGS and self.packaged and not self.copies:
                found = replace(found, closures=next(iter(self.packaged.values())).closures)
            return found
        none = BeamAssessment(full=np.zeros(log.pings, dtype=bool))
        if log.error_velocity_mps is not None:
            error = log.error_velocity_mps[np.isfinite(log.error_velocity_mps)]
            if len(error) >= LEAST_PINGS:
                none.closures.append(closure_of(np.ones(1), error[:, None]))
        return none

    @cached_property
    def velocity(self) -> tuple[NDArray[np.int64], Array]:
        """Times (m,) and velocities (m, 3), DVL frame: the instrument's own, else least squares of full pings.

        Only those with a time later than all before: repeats and steps back have their own findings.
        """
        log, rows = self.log, self.assessment.rows
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
