"""The water table of the cells that a reader found, as `rows` makes the beam table of its pings."""

import numpy as np
from numpy.typing import ArrayLike

from bottomlock.io.account import Account, Flags, Integers
from bottomlock.io.columns import LATEST_NS
from bottomlock.io.table_columns import Floats
from bottomlock.io.water_table import WaterTable


# Instruments also send the not-a-numbers that signal.
@np.errstate(invalid="ignore")
def make_water(
    account: Account,
    position: ArrayLike,
    time_ns: ArrayLike,
    cell: ArrayLike,
    range_m: ArrayLike,
    velocity: ArrayLike,
    valid: ArrayLike,
    *,
    quality: ArrayLike | None = None,
    sd: ArrayLike | None = None,
    negate: bool = False,
) -> WaterTable | None:
    """The table of n cells, sorted by time and cell; None for n = 0.

    A valid beam without a finite velocity becomes invalid and is flagged; an infinity becomes NaN. Of two cells of one
    time and number the first in the file stands, and cells whose time is out of range are left out; both are flagged.

    Args:
        account: takes what is left out or changed.
        position: (n,) of each cell's record in the file.
        time_ns: (n,).
        cell: (n,) from 1 on.
        range_m: (n,) along the beam, to the middle of the cell.
        velocity: (n, beams), m/s, of the vehicle through the water, as `valid`, `quality` and `sd`.
        valid: (n, beams).
        quality: correlation, 0 to 255; None where the records hold none.
        sd: m/s; None where the records hold none.
        negate: turns the sign of the velocities.
    """
    at, times, number = (np.asarray(one, dtype=np.int64) for one in (position, time_ns, cell))
    if not len(at):
        return None
    speed, along = _finite(velocity), _finite(range_m)
    good = np.asarray(valid, dtype=bool)
    usable = good & np.isfinite(speed) & np.isfinite(along)[:, None]
    wrong: Flags = np.asarray((good & ~usable).any(axis=1))
    account.flag_where("valid water beam without a finite velocity and range", wrong, at)
    kept = _sorted(times, number, at, account)
    if not len(kept):
        return None

    def chosen(values: Floats) -> Floats:
        return values if len(kept) == len(at) and (np.diff(kept) == 1).all() else values[kept]

    none = np.full((len(kept), speed.shape[1]), np.nan)
    return WaterTable(
        time_ns=times[kept],
        cell=number[kept],
        range_m=along[kept],
        velocity_mps=chosen(np.negative(speed, out=speed) if negate else speed),
        valid=usable[kept],
        quality=none if quality is None else chosen(_finite(quality)),
        sd_mps=none if sd is None else chosen(_finite(sd)),
    )


def _finite(values: ArrayLike) -> Floats:
    """Own numbers, NaN for what is not finite: an infinity is no measurement."""
    found = np.array(values, dtype=np.float64)
    found[~np.isfinite(found)] = np.nan
    return found


def _sorted(times: Integers, number: Integers, at: Integers, account: Account) -> Integers:
    """Indices of the cells whose time is in range by time and number, without those that repeat another."""
    late = np.abs(times) >= LATEST_NS
    account.flag_where("water cells without a time in range", late, at)
    step_ns, cells = np.diff(times), np.diff(number)
    if not late.any() and ((step_ns > 0) | ((step_ns == 0) & (cells > 0))).all():
        return np.arange(len(times))
    order = np.lexsort((number, times))
    order = order[~late[order]]
    repeats: Flags = np.zeros(len(at), dtype=bool)
    repeats[order[1:]] = (np.diff(times[order]) == 0) & (np.diff(number[order]) == 0)
    account.flag_where("water cells that repeat a time", repeats, at)
    return order[~repeats[order]]
