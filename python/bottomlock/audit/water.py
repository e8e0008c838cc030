"""Water against the bottom: their difference is the current, unless the water's beams have a wrong sign or scale.

With v the velocity by the bottom's beams and u that by the closest cell of water, both turned to north and east, v − u
is the current. Beams of the water that read s times too much give u = s (v − c), so that

    v − u = c + (1/s − 1) u,

a current that grows with the vehicle's speed. s is fitted with a current that drifts evenly on means over `WINDOW`
pings, whose noise hardly weakens the slope. A varying current that the vehicle steers against gives a slope too, so
that only a large one is a finding.
"""

from dataclasses import dataclass

import numpy as np

from bottomlock.audit.logs import BeamLog, Reference
from bottomlock.audit.robust import LEAST_BLOCKS, Array, fit_linear, significant
from bottomlock.config.sensors import WaterCells
from bottomlock.io.beam_table import WaterTable
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.robust import sd_about_zero
from bottomlock.recordings.streams import Flags
from bottomlock.recordings.water_cells import same_ping, water_beams

WINDOW = 10
"""Pings of a mean."""
FEWEST = 20 * WINDOW
"""Pings with both from which they are compared."""
MATERIAL = 0.2
"""Smaller departures of the scale are no finding: those that a vehicle causes which steers against the current."""
STILL_MPS = 0.02
"""Standard deviation of the velocity over ground up to which the vehicle shows no scale."""
UNUSED_MPS = 1.0
"""Noise of a beam, which nothing here uses: no closure leaves a cell out."""


@dataclass(frozen=True, eq=False)
class WaterAgreement:
    """The closest cell against the bottom.

    Attributes:
        pings: number of pings with all beams of both.
        cell: number of the cell.
        range_m: mean range along the beam to its middle.
        current_mps: north and east, mean.
        ping_sd_mps: the same of one ping, 1 sigma, from ping to ping.
        beam_sd_mps: noise of a beam of the water with that of the bottom, 1 sigma, from ping to ping.
        drift_mps_per_h: even drift of the current, north and east.
        scale: factor in the readings of the water; 1 where they are right, negative with a wrong sign.
        scale_sd: 1 sigma; infinite with too few independent windows.
        blocks: number of independent windows.
    """

    pings: int
    cell: int
    range_m: float
    current_mps: Array
    ping_sd_mps: Array
    beam_sd_mps: float
    drift_mps_per_h: Array
    scale: float
    scale_sd: float
    blocks: int

    @property
    def wrong(self) -> bool:
        """The scale is off, by its slope, whose error is Gaussian also where the scale is far from 1."""
        slope, sd = 1.0 / self.scale - 1.0, self.scale_sd / self.scale**2
        return bool(significant(slope, sd, self.blocks, MATERIAL))


def water_agreement(
    log: BeamLog, whole: Flags, water: WaterTable, geometry: BeamGeometry, attitude: Reference
) -> WaterAgreement | None:
    """Compares the closest cell with the bottom; None with too few pings of both, or a vehicle that hardly moves.

    Args:
        log: pings of the bottom.
        whole: (n,) its pings with all beams, which are no repeats.
        water: cells of water.
        geometry: the beams.
        attitude: of the platform.

    Raises:
        DataError: for water with another number of beams.
    """
    if not water.rows or not whole.any():
        return None
    cell = int(water.cell.min())
    section = WaterCells(cells=(cell,), max_closure_mps=np.finfo(np.float64).max)
    beams, _ = water_beams(water, geometry, section, beam_sd_mps=np.full(geometry.beams, UNUSED_MPS))
    order = np.argsort(log.time_ns[whole], kind="stable")
    at = np.flatnonzero(whole)[order]
    near, same = same_ping(log.time_ns[at], beams.time_ns)
    rows = np.flatnonzero(beams.valid.all(axis=1) & attitude.spans(beams.time_ns) & same)
    if len(rows) < FEWEST:
        return None
    time_ns, bottom = beams.time_ns[rows], log.velocity_mps[at[near[rows]]]
    turn = attitude.at(time_ns)
    solve = np.linalg.pinv(geometry.directions_p).T
    through = turn.apply(beams.velocity_mps[rows] @ solve)[:, :2]
    current = turn.apply((bottom - beams.velocity_mps[rows]) @ solve)[:, :2]
    time_s = (time_ns - time_ns[0]) * 1e-9
    means = [_means(values) for values in (time_s[:, None], through, current)]
    if np.std(means[1] + means[2], axis=0).max() < STILL_MPS:
        return None
    hours = (means[0][:, 0] - means[0][:, 0].mean()) / 3600.0
    fit = fit_linear(_columns(means[1], hours), means[2].ravel())
    one_ping = sd_about_zero(np.diff(current, axis=0), axis=0) / np.sqrt(2.0)
    beam = sd_about_zero(np.diff(bottom - beams.velocity_mps[rows], axis=0)) / np.sqrt(2.0)
    scale = 1.0 / (1.0 + float(fit.parameters[0]))
    return WaterAgreement(
        pings=len(rows),
        cell=cell,
        range_m=float(beams.range_m[rows].mean()),
        current_mps=np.median(current, axis=0),
        ping_sd_mps=one_ping,
        beam_sd_mps=float(beam),
        drift_mps_per_h=fit.parameters[3:],
        scale=scale,
        scale_sd=scale**2 * float(np.std(fit.resampled[:, 0])) if fit.blocks >= LEAST_BLOCKS else np.inf,
        blocks=fit.blocks,
    )


def _means(values: Array) -> Array:
    """(n // WINDOW, k) means of consecutive rows (n, k)."""
    count = len(values) // WINDOW
    return np.asarray(values[: count * WINDOW].reshape(count, WINDOW, -1).mean(axis=1))


def _columns(through: Array, hours: Array) -> Array:
    """(2 n, 5) the velocity through the water, a constant and a drift of each axis; rows north and east in turn."""
    constant = np.tile(np.eye(2), (len(through), 1))
    return np.column_stack([through.ravel(), constant, np.repeat(hours, 2)[:, None] * constant])
