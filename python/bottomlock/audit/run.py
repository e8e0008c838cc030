"""A whole audit: the log, the reference of the same time, and all findings."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.audit.checks import ALWAYS, CHECKS, OF_LOG
from bottomlock.audit.context import Context
from bottomlock.audit.logs import read_log
from bottomlock.files.atomic_write import plain
from bottomlock.io.beams import read_geometry
from bottomlock.recordings.finding import Finding, ranked
from bottomlock.recordings.rig_motion import Tracked


class Audit(Context):
    """An audit of a log that has been read: what is estimated of it, and what is found.

    Raises:
        DataError: for a geometry with another number of beams than the log.

    Examples:
        >>> from bottomlock import BeamGeometry
        >>> from bottomlock.audit.logs import BeamLog
        >>> rng, janus = np.random.default_rng(3), BeamGeometry.janus(0.35)
        >>> motion = rng.normal(size=(400, 3)) * [0.5, 0.3, 0.2]
        >>> readings = janus.beam_velocities(motion) + 0.01 * rng.normal(size=(400, 4))
        >>> own = readings @ np.linalg.pinv(janus.directions_p).T
        >>> log = BeamLog("dive", np.arange(400) * 10**8, readings[:, [1, 0, 2, 3]], np.ones((400, 4), bool), own)
        >>> [(one.kind, one.beams) for one in Audit(log, stated=janus).findings]
        [('swapped_beams', (1, 2))]
    """

    @cached_property
    def findings(self) -> list[Finding]:
        """Ranked, the worst first."""
        found = [one for check in ALWAYS for one in check(self.log)]
        if self.locked:
            found += [one for check in OF_LOG for one in check(self.log)]
            found += [one for check in CHECKS for one in check(self)]
        return ranked(found)


def audit_file(
    path: str | Path,
    *,
    geometry: str | Path | None = None,
    reference: Tracked | None = None,
) -> Audit:
    """Reads and audits a log.

    Args:
        path: a beam table (CSV or Parquet), or a log whose columns the geometry file maps.
        geometry: TOML file or packaged name to compare with.
        reference: attitude and velocity of the same time.

    Raises:
        DataError: for a log that cannot be read or does not fit the geometry.
        ScenarioError: for a geometry file with a fault.
    """
    instrument = None if geometry is None else read_geometry(geometry)
    log = read_log(path, None if instrument is None else instrument.columns)
    made = Audit(
        log,
        None if instrument is None else instrument.geometry,
        None if geometry is None else str(geometry),
        np.zeros(3) if instrument is None else instrument.mounting_rpy_rad,
        reference,
    )  # fmt: skip
    assert made.findings is not None  # so that what does not fit is refused here
    return made


_OF_MATRIX = (
    "directions", "direction_sd_rad", "tilt_rad", "tilt_sd_rad", "azimuth_rad", "azimuth_sd_rad", "scale", "scale_sd",
    "bias_mps", "bias_sd_mps", "residual_mps", "excitation_mps", "regression", "pings", "observable",
)  # fmt: skip


def numbers_of(audit: Audit) -> dict[str, Any]:
    """All results in the types of JSON, in SI units and radians."""
    log, match, valid = audit.log, audit.beams.match, audit.log.valid.sum(axis=1)
    closures = [vars(one) | {"beam_sigma_mps": one.beam_sigma_mps} for one in audit.closures]
    content = {
        "log": log.place, "geometry": audit.geometry_name, "pings": log.pings, "beams": log.beams,
        "duration_s": float(log.time_s.max()),
        "pings_by_valid_beams": {k: (valid == k).sum() for k in range(log.beams, -1, -1)},
        "full_pings_used": audit.whole.sum(), "unchanged_pings": log.unchanged.sum(),
        "findings": audit.findings, "converted": log.beside,
        "matrix": audit.matrix and {name: getattr(audit.matrix, name) for name in _OF_MATRIX},
        "match": match and {
            "beam": match.beam + 1, "sign": match.sign, "off_rad": match.off_rad,
            "rotation_rad": match.rotation.as_rotvec(),
        },
        "closure": [{name: of for name, of in one.items() if name != "values_mps"} for one in closures],
        "closure_slope": audit.beams.slope, "mounting": audit.mounting,
    }  # fmt: skip
    return dict(plain(content))
