"""The IMU of a first case: units, axes, clock, noise, each guessed from its readings."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from bottomlock.errors import DataError
from bottomlock.recordings.streams import Flags, Floats, Inertial, Integers
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import (
    Guess,
    axes_with_down,
    axis_names,
    down_axis,
    force_unit,
    gravity_unsteady,
    omega_unit,
)
from bottomlock.replay.read_tables import FORCE_SI, OMEGA_SI

HANDED = 1.4
"""Ratio of the unsteadiness of gravity from which it tells left-handed axes from right-handed ones."""
TILTED_RAD = np.deg2rad(25.0)
WILD, AROUND = 100.0, 7
"""A reading so many times as large as 99 % of all, and as the median of so many around it, is not of a vehicle."""


@dataclass(frozen=True, eq=False)
class ImuPart:
    """An IMU as guessed.

    Attributes:
        found: its columns.
        time_ns: (n,) rising, of the rows used.
        rows: (n,) rows of the table.
        force_s_mps2, omega_s_radps: (n, 3) in the sensor's own axes.
        force, omega: units.
        increments: whether they are increments, over `interval_s` where no column says.
        handed: whether gravity tells right-handed axes from left-handed ones.
        axes: (3, 3) from sensor to platform axes, and why.
        rate_hz: of the readings.
        even_hz: rate of a clock whose stamps are not used as times; None for the stamps.
        made: whether they are made from an attitude, since no file holds any.
        left_out: what is wrong with rows that are not used, and the first of them, for a remark.
        unordered, first_unordered: rows that repeat a time or go back, and the first of them.
        tilted: how far gravity is off that axis; "" where it is near.
    """

    found: Found
    time_ns: Integers
    rows: Integers
    force_s_mps2: Floats
    omega_s_radps: Floats
    force: Guess
    omega: Guess
    increments: bool
    axes: Floats
    axes_why: str
    axes_known: bool
    rate_hz: float
    even_hz: float | None = None
    left_out: tuple[str, ...] = ()
    unordered: int = 0
    first_unordered: int = 0
    handed: bool = False
    made: bool = False
    tilted: str = ""

    @property
    def force_p_mps2(self) -> Floats:
        """(n, 3) in platform axes."""
        return np.asarray(self.force_s_mps2 @ self.axes.T)

    @property
    def omega_p_radps(self) -> Floats:
        """(n, 3) in platform axes."""
        return np.asarray(self.omega_s_radps @ self.axes.T)

    @property
    def inertial(self) -> Inertial:
        """The readings in platform axes."""
        return Inertial(self.time_ns, self.force_p_mps2, self.omega_p_radps)

    def with_axes(self, axes: Floats, why: str, *, known: bool) -> "ImuPart":
        """The same with other axes."""
        return replace(self, axes=axes, axes_why=why, axes_known=known)

    @property
    def axis_names(self) -> tuple[str, str, str]:
        """The case's `axes`."""
        return axis_names(self.axes)


def guess_imu(found: Found, duration_s: float | None, omega_is: Guess | None = None) -> ImuPart:
    """Units and axes of an IMU.

    Args:
        found: its columns.
        duration_s: of the other streams, for a table without times.
        omega_is: unit of the angular rate where it is known from elsewhere.

    Raises:
        DataError: for readings without gravity, and a table without times where nothing gives its rate.
    """
    place = str(found.table.path)
    values = found.values(*(f"{kind}{k}" for kind in ("force", "omega") for k in range(3)))
    whole = np.isfinite(values).all(axis=1)
    wild = np.zeros(len(values), dtype=np.bool_)
    wild[whole] = wild_rows(values[whole, :3]) | wild_rows(values[whole, 3:])
    left_out = (
        (~whole, "without six numbers"), (wild, f"with a reading beyond {WILD:g} times those around it"),
    )  # fmt: skip
    whole &= ~wild
    even_hz = None
    if found.times.time_ns is None:
        if duration_s is None:
            raise DataError("has no column of times, and no other stream gives the IMU's rate", place=place)
        even_hz = float(f"{len(values) / duration_s:.3g}")
        time_ns = np.round(np.arange(len(values)) * 1e9 / even_hz).astype(np.int64)
    else:
        time_ns = found.times.time_ns
    before = np.maximum.accumulate(time_ns)
    rises = np.concatenate([[True], time_ns[1:] > before[:-1]])
    rows = np.flatnonzero(whole & rises)
    if len(rows) < 50:
        raise DataError(
            f"has {len(rows)} rows with six numbers and a rising time", place=place, expected="50 or more"
        )
    time_ns, force, omega = time_ns[rows], values[rows, :3], values[rows, 3:]
    step_s = float(np.median(np.diff(time_ns))) * 1e-9
    increments = "increments" in found.extra
    if increments:
        interval = (
            found.values("interval")[rows] if "interval" in found.extra else np.full((len(rows), 1), step_s)
        )
        force, omega = force / interval, omega / interval
    of_force = force_unit(force)
    if of_force is None:
        size = float(np.median(np.linalg.norm(force, axis=1)))
        raise DataError(
            f"|f| of {found.columns['force0']} ... has a median of {size:.3g}",
            place=place,
            expected="gravity in it, 9.8 m/s², 1 g or 1000 mg",
            hint="is gravity removed? log the raw accelerations",
        )
    force = force * FORCE_SI[of_force.value] * of_force.factor
    of_omega = omega_is or omega_unit(
        time_ns, force, omega, found.units.get("omega0", "") if not increments else "rad/s"
    )
    omega = omega * OMEGA_SI[of_omega.value]
    axis, sign, angle = down_axis(force)
    mean = float(np.mean(force[:, axis]))
    why = (
        f"the mean specific force on {'xyz'[axis]} is {mean:+.2f} m/s², so "
        f"{'-' if sign < 0 else ''}{'xyz'[axis]} points down"
    )
    tilted = (
        f"gravity is {np.rad2deg(angle):.0f} deg off that axis: mounting_roll_deg and mounting_pitch_deg turn an IMU "
        "that is mounted at an angle"
    ) * bool(angle > TILTED_RAD)  # fmt: skip
    axes = axes_with_down(axis, sign)
    steady = {s: gravity_unsteady(time_ns, force @ axes.T, s * omega @ axes.T) for s in (1.0, -1.0)}
    handed = bool(max(steady.values()) > HANDED * min(steady.values()))
    if handed and steady[-1.0] < steady[1.0]:
        axes = np.diag([1.0, -1.0, 1.0]) @ axes + 0.0
        why += (
            f"; gravity stays in place to {steady[-1.0]:.3g} m/s in 20 s with left-handed axes, to "
            f"{steady[1.0]:.3g} with "
            "right-handed ones"
        )
    return ImuPart(
        found=found, time_ns=time_ns, rows=rows, force_s_mps2=force, omega_s_radps=omega, force=of_force,
        omega=of_omega,
        increments=increments, axes=axes, axes_why=why, axes_known=axis == 2 and sign > 0.0, handed=handed,
        rate_hz=1.0 / step_s, even_hz=even_hz, unordered=int((whole & ~rises).sum()),
        left_out=tuple(
            f"rows {words} are left out: {np.sum(of)}, the first of them row {np.argmax(of)}"
            for of, words in left_out if of.any()
        ),
        first_unordered=int(np.argmax(whole & ~rises)), tilted=tilted,
    )  # fmt: skip


def wild_rows(values: Floats) -> Flags:
    """(n,) which rows (n, 3) hold a filler or a gross error in place of a reading; not the first rows of a turn."""
    size = np.abs(values).max(axis=1)
    usual = float(np.percentile(size, 99.0)) if len(size) else 0.0
    if not usual > 0.0:
        return np.zeros(len(size), dtype=bool)
    return np.asarray((size > WILD * usual) & (size > WILD * median_filter(size, AROUND, mode="nearest")))
