"""Cells of a water profile screened and combined to one row of beams a ping, as a filter takes them.

A cell is left out of a beam

- within the bottom's side lobes: these leave the transducer straight towards the bottom, and their echo covers every
  cell beyond that distance. With R_i the range of beam i to the bottom and θ_i its angle from the mean direction of the
  beams that is where range + half a cell > min R_i cos θ_i;
- at a correlation below the limit;

and of every beam where their closure, the combination to which no velocity contributes (`closure_rows`), is beyond the
limit: fish, a wake or an obstacle is in one of them, and which of them it is does not show.
"""

from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from bottomlock.config.sensors import WaterCells
from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.streams import Flags, Floats, Times, WaterBeams

CLOSURE_SIGMAS = 3.0
"""Default limit of a closure, in standard deviations by the noise of the beams."""
SAME_PING_S = 1.0
"""Longest time between a profile and the bottom ranges of its ping, which some instruments record apart."""


class CellTable(Protocol):
    """Cells of pings, a row each, sorted by time and cell: `io.beam_table.WaterTable`."""

    @property
    def time_ns(self) -> Times:
        """(n,)."""

    @property
    def cell(self) -> Times:
        """(n,) number of the cell from the transducer on, from 1."""

    @property
    def range_m(self) -> Floats:
        """(n,) along the beam to the middle of the cell."""

    @property
    def velocity_mps(self) -> Floats:
        """(n, B); NaN where none."""

    @property
    def valid(self) -> Flags:
        """(n, B)."""

    @property
    def quality(self) -> Floats:
        """(n, B) correlation, 0 to 255; NaN where none."""

    @property
    def sd_mps(self) -> Floats:
        """(n, B) 1 sigma; NaN where none."""


@dataclass(frozen=True)
class CellCounts:
    """Readings, of one beam in one chosen cell each, by what became of them; the first reason counts."""

    used: int = 0
    not_valid: int = 0
    side_lobes: int = 0
    correlation: int = 0
    closure: int = 0

    def __add__(self, other: "CellCounts") -> "CellCounts":
        """The counts of both."""
        return CellCounts(*(getattr(self, one.name) + getattr(other, one.name) for one in fields(CellCounts)))

    def text(self) -> str:
        """The counts in one line."""
        words = {
            "not_valid": "not valid in the record",
            "side_lobes": "within the bottom's side lobes",
            "correlation": "of too low a correlation",
            "closure": "of too large a closure",
        }
        out = [f"{getattr(self, name)} {why}" for name, why in words.items() if getattr(self, name)]
        return f"{self.used} used" + (f"; left out: {', '.join(out)}" if out else "")


def water_beams(
    table: CellTable,
    geometry: BeamGeometry,
    section: WaterCells,
    *,
    beam_sd_mps: Floats,
    bottom: tuple[Times, Floats] | None = None,
) -> tuple[WaterBeams, CellCounts]:
    """One row a ping: of each beam the mean of its chosen cells that pass, and what was left out.

    Neighbouring cells overlap and share the vehicle's motion in waves, so the noise of a mean is that of one cell, the
    RMS over the cells. The range of a row is the mean over the beams that have a velocity, else over the chosen cells.

    Args:
        table: cells of any number of pings.
        geometry: the beams.
        section: which cells are used, and their noise.
        beam_sd_mps: (B,) 1 sigma of the beams where neither the table nor the section has one.
        bottom: (m,) rising times of pings of the bottom, and (m, B) their ranges along the beams, NaN where none.

    Raises:
        DataError: for another number of beams than the geometry's, and a valid beam whose velocity or range is not
            finite.

    Examples:
        Two cells of a vehicle that moves at 1 m/s along beam 1, the second cell lost to that beam:

        >>> from types import SimpleNamespace
        >>> table = SimpleNamespace(
        ...     time_ns=np.array([0, 0]), cell=np.array([1, 2]), range_m=np.array([2.0, 4.0]),
        ...     velocity_mps=np.array([[1.0, 0.0, 0.0], [9.0, 0.5, 0.5]]), quality=np.full((2, 3), 200.0),
        ...     valid=np.array([[True, True, True], [False, True, True]]), sd_mps=np.full((2, 3), 0.05),
        ... )  # fmt: skip
        >>> three = BeamGeometry.from_angles([0.4] * 3, [0.0, 2.0, 4.0])
        >>> rows, counts = water_beams(table, three, WaterCells(), beam_sd_mps=np.full(3, 0.1))
        >>> rows.velocity_mps.tolist(), round(float(rows.range_m[0]), 3), counts.text()
        ([[1.0, 0.25, 0.25]], 2.667, '5 used; left out: 1 not valid in the record')
    """
    _check(table, geometry)
    chosen = np.isin(table.cell, section.cells)
    time_ns, range_m = table.time_ns[chosen], table.range_m[chosen]
    velocity, valid = table.velocity_mps[chosen], table.valid[chosen]
    stated = beam_sd_mps if section.noise_mps is None else section.noise_mps
    sd = np.where(table.sd_mps[chosen] > 0.0, table.sd_mps[chosen], stated)

    good = valid
    nearest = _side_lobe_range(time_ns, geometry, bottom)
    apart = good & ~(range_m + 0.5 * cell_size_m(table) > nearest)[:, None]
    correlated = apart & ~(table.quality[chosen] < section.min_correlation)
    closed = correlated & _closes(geometry, velocity, correlated, sd, section)[:, None]
    counts = CellCounts(
        used=int(closed.sum()),
        not_valid=int((~good).sum()),
        side_lobes=int((good & ~apart).sum()),
        correlation=int((apart & ~correlated).sum()),
        closure=int((correlated & ~closed).sum()),
    )
    return _combined(time_ns, range_m, velocity, closed, sd), counts


def check_cells(table: CellTable, section: WaterCells) -> None:
    """Checks that every chosen cell is in some ping of a recording.

    Raises:
        DataError: for one that is in none.
    """
    there = np.unique(table.cell)
    for cell in section.cells:
        if cell not in there:
            raise DataError(
                f"water cell {cell} is in no ping", expected=f"cells of {int(there[0])} to {int(there[-1])}"
            )


def cell_size_m(table: CellTable) -> float:
    """Length of a cell along the beam, the median step between the cells of a ping; 0 where no ping has two."""
    step, cells = np.diff(table.range_m), np.diff(table.cell)
    inside = (np.diff(table.time_ns) == 0) & (cells > 0)
    return float(np.median(step[inside] / cells[inside])) if inside.any() else 0.0


def _check(table: CellTable, geometry: BeamGeometry) -> None:
    beams = table.velocity_mps.shape[1]
    if beams != geometry.beams:
        raise DataError(f"water cells have {beams} beams", expected=f"the geometry's {geometry.beams}")
    wrong = np.argwhere(
        table.valid & ~(np.isfinite(table.velocity_mps) & np.isfinite(table.range_m)[:, None])
    )
    if wrong.size:
        row, beam = (int(index) for index in wrong[0])
        raise DataError(
            f"beam {beam + 1} is valid and its velocity or range is not finite",
            place=f"water cells: row {row}",
            expected="both",
        )


def _side_lobe_range(time_ns: Times, geometry: BeamGeometry, bottom: tuple[Times, Floats] | None) -> Floats:
    """(n,) distance straight to the bottom at each time; infinite where the ping has no range to it."""
    if bottom is None or not len(bottom[0]):
        return np.full(len(time_ns), np.inf)
    bottom_time_ns, bottom_range_m = bottom
    directions = np.asarray(geometry.directions_p)
    axis = directions.mean(axis=0)
    straight = bottom_range_m * (directions @ (axis / np.linalg.norm(axis)))
    least = np.where(straight > 0.0, straight, np.inf).min(axis=1)
    at, same = same_ping(bottom_time_ns, time_ns)
    return np.asarray(np.where(same, least[at], np.inf))


def same_ping(times_ns: Times, wanted_ns: Times) -> tuple[Times, Flags]:
    """(m,) `nearest_rows`, and whether they are close enough to be of the same ping."""
    at = nearest_rows(times_ns, wanted_ns)
    return at, np.asarray(np.abs(times_ns[at] - wanted_ns) <= SAME_PING_S * 1e9)


def nearest_rows(times_ns: Times, wanted_ns: Times) -> Times:
    """(m,) row of the rising times (n,), at least one, nearest to each of the wanted ones (m,).

    >>> nearest_rows(np.array([0, 10, 20]), np.array([-5, 4, 6, 99])).tolist()
    [0, 0, 1, 2]
    """
    after = np.clip(np.searchsorted(times_ns, wanted_ns), 0, len(times_ns) - 1)
    before = np.maximum(after - 1, 0)
    closer = np.abs(times_ns[before] - wanted_ns) < np.abs(times_ns[after] - wanted_ns)
    return np.asarray(np.where(closer, before, after))


def _closes(geometry: BeamGeometry, velocity: Floats, valid: Flags, sd: Floats, section: WaterCells) -> Flags:
    """(n,) whether every closure of the valid beams of a cell is within the limit; beams without one pass."""
    directions = np.asarray(geometry.directions_p)
    passes = np.ones(len(valid), dtype=np.bool_)
    for beams in np.unique(valid, axis=0):
        rows = closure_rows(directions[beams])
        same = (valid == beams).all(axis=1)
        closure = velocity[same][:, beams] @ rows.T
        limit: float | Floats | None = section.max_closure_mps
        if limit is None:
            limit = CLOSURE_SIGMAS * np.sqrt(sd[same][:, beams] ** 2 @ rows.T**2)
        passes[same] = (np.abs(closure) <= limit).all(axis=1)
    return passes


def _combined(time_ns: Times, range_m: Floats, velocity: Floats, used: Flags, sd: Floats) -> WaterBeams:
    pings, first = np.unique(time_ns, return_index=True)
    if not len(pings):
        none = np.zeros((0, velocity.shape[1]))
        return WaterBeams(pings, none, none.astype(bool), none, np.zeros(0))

    def total(values: Floats) -> Floats:
        return np.asarray(np.add.reduceat(values, first, axis=0))

    number = total(used.astype(np.float64))
    valid, each = number > 0.0, np.maximum(number, 1.0)
    mean = total(np.where(used, velocity, 0.0)) / each
    square = total(np.where(used, sd**2, 0.0)) / each
    of_beam = total(np.where(used, range_m[:, None], 0.0)) / each
    of_cells = total(range_m) / total(np.ones(len(time_ns)))
    beams = valid.sum(axis=1)
    return WaterBeams(
        time_ns=pings,
        velocity_mps=np.where(valid, mean, np.nan),
        valid=valid,
        # A beam that is not there has the noise of one, which nothing uses.
        sd_mps=np.where(valid, np.sqrt(square), sd[first]),
        range_m=np.where(beams > 0, of_beam.sum(axis=1) / np.maximum(beams, 1), of_cells),
    )
