"""Defects that the audit's table plants in a log, each with what must be found of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.audit.closure import Slope, null_space, suspects
from bottomlock.audit.robust import resolution
from bottomlock.audit.run import Audit, audit_log
from bottomlock.kernel import make_geometry
from tools.audit_worlds import Array, World

PRECISE = 20.0
"""A size is observable whose standard deviation is less than this part of it: 15 % are then three deviations."""
ALSO_WRONG = ("velocity_scale", "misalignment", "closure_bias", "closure_depends_on_velocity")
"""A velocity that is solved from a wrong beam is wrong against the reference; its closure has a mean, which may be all
that a steady course shows."""


@dataclass(frozen=True)
class Planted:
    """A defect in a log.

    Attributes:
        world: the log with the defect.
        kinds: findings that name it.
        beams: numbers of the beams that the finding must name (among others, where closure leaves several).
        size: planted, in the finding's unit; None where the finding has none.
        sd: standard deviation that the clean log allows; infinite where nothing in the log shows the defect.
        unit: of the size.
    """

    world: World
    kinds: tuple[str, ...]
    beams: tuple[int, ...] = ()
    size: float | None = None
    sd: float = 0.0
    unit: str = ""
    also: tuple[str, ...] = ()
    """Findings that are true as well: a consequence of the defect."""

    @property
    def observable(self) -> bool:
        """The log shows it."""
        return np.isfinite(self.sd) and (self.size is None or self.sd * PRECISE < abs(self.size))


def audited(world: World) -> Audit:
    """The audit of a log with all that is beside it."""
    return audit_log(
        world.log, stated=world.geometry, geometry_name="stated", mounting_rpy_rad=world.mounting_rpy_rad,
        reference=world.reference, imu=world.imu, depths=world.depths,
    )  # fmt: skip


def rows_of(world: World) -> Array:
    """(beams, 3) stated rows."""
    assert world.geometry is not None
    return np.asarray(world.geometry.directions_p)


def _channels(world: World, order: Sequence[int], sign: Sequence[float] = (1.0, 1.0, 1.0, 1.0)) -> World:
    log = world.log
    return world.with_log(
        replace(log, velocity_mps=log.velocity_mps[:, order] * np.array(sign), valid=log.valid[:, order])
    )


def _neighbour(world: World) -> int:
    """The first beam (from 0) that is not opposite beam 1."""
    weights = null_space(rows_of(world))[:, 0]
    return next(k for k in range(1, 4) if weights[k] * weights[0] < 0.0)


def _opposite(world: World) -> int:
    weights = null_space(rows_of(world))[:, 0]
    return next(k for k in range(1, 4) if weights[k] * weights[0] > 0.0)


def _shown(world: World) -> float:
    """0 where the instrument's velocity stands beside the beams, else infinite."""
    return 0.0 if world.log.instrument_mps is not None else np.inf


def swap_neighbours(world: World, _: Audit) -> Planted:
    """Beam 1 and a neighbour are exchanged."""
    order = [0, 1, 2, 3]
    k = _neighbour(world)
    order[0], order[k] = k, 0
    return Planted(_channels(world, order), ("swapped_beams", "order_or_bias"), (1, k + 1))


def swap_opposite(world: World, _: Audit) -> Planted:
    """Beam 1 and the one opposite are exchanged."""
    order = [0, 1, 2, 3]
    k = _opposite(world)
    order[0], order[k] = k, 0
    return Planted(_channels(world, order), ("swapped_beams",), (1, k + 1), sd=_shown(world))


def flip_sign(world: World, _: Audit) -> Planted:
    """Channel 3 has the opposite sign."""
    return Planted(
        _channels(world, [0, 1, 2, 3], (1.0, 1.0, -1.0, 1.0)), ("sign_flipped", "order_or_bias"), (3,)
    )


def _deviation(clean: Audit, kind: str, where: str, beam: int) -> float:
    """Standard deviation of one beam's scale (relative) or direction (rad) that the clean log allows."""
    regressed = [
        one
        for one in clean.assessment.explained
        if one.kind == kind and one.beam == beam and one.where == where
    ]
    if regressed:
        return regressed[0].size_sd
    slope = clean.assessment.slope
    if slope is None:
        return np.inf
    assert clean.assessment.rows is not None
    zero = Slope(np.full(3, 1e-6), slope.cov, slope.pings, slope.lag, slope.blocks)
    rows = clean.assessment.rows
    (one,) = (s for s in suspects(zero, null_space(rows)[:, 0], rows) if s.beam == beam)
    return one.scale_sd if kind == "beam_scale" else one.angle_sd_rad


def scale_recorded(world: World, clean: Audit) -> Planted:
    """Beam 2 reads 2 % too much, after the instrument has solved its velocity."""
    made = _channels(world, [0, 1, 2, 3], (1.0, 1.02, 1.0, 1.0))
    where = "recorded" if any(one.where == "recorded" for one in clean.assessment.explained) else "used"
    return Planted(made, ("beam_scale",), (2,), 2.0, 100.0 * _deviation(clean, "beam_scale", where, 1), "%")


def _motion(world: World) -> Array:
    """(n, 3) velocity of each ping for a change of the beams: the instrument's, else least squares."""
    log = world.log
    own = np.nan_to_num(log.velocity_mps) @ np.linalg.pinv(rows_of(world)).T
    return (
        own
        if log.instrument_mps is None
        else np.where(log.solved[:, None], np.nan_to_num(log.instrument_mps), own)
    )


def _unaware(world: World, change: Array) -> World:
    """Readings (n, 4) are changed before an instrument solves them with its nominal matrix."""
    log, rows = world.log, rows_of(world)
    y = np.where(log.valid, log.velocity_mps + change, log.velocity_mps)
    own = log.instrument_mps
    if own is not None:
        own = own.copy()
        for pattern in np.unique(log.valid, axis=0):
            if pattern.sum() >= 3:
                chosen = (log.valid == pattern).all(axis=1)
                own[chosen] += change[np.ix_(chosen, pattern)] @ np.linalg.pinv(rows[pattern]).T
    return world.with_log(replace(log, velocity_mps=y, instrument_mps=own))


def tilt_unaware(world: World, clean: Audit) -> Planted:
    """Transducer 2 leans 3° more than the instrument believes."""
    row = rows_of(world)[1]
    aside = np.cross([0.0, 0.0, 1.0], row)
    turned = Rotation.from_rotvec(np.deg2rad(3.0) * aside / np.linalg.norm(aside)).apply(row)
    change = np.zeros_like(world.log.velocity_mps)
    change[:, 1] = _motion(world) @ (turned - row)
    sd = np.rad2deg(_deviation(clean, "beam_direction", "unknown", 1))
    return Planted(_unaware(world, change), ("mistilted_beam",), (2,), 3.0, sd, "deg", ALSO_WRONG)


def scale_unaware(world: World, clean: Audit) -> Planted:
    """Transducer 3 reads 5 % too much, and the instrument solves with it."""
    change = np.zeros_like(world.log.velocity_mps)
    change[:, 2] = 0.05 * np.nan_to_num(world.log.velocity_mps[:, 2])
    sd = 100.0 * _deviation(clean, "beam_scale", "unknown", 2)
    return Planted(_unaware(world, change), ("beam_scale",), (3,), 5.0, sd, "%", ALSO_WRONG)


def bias(world: World, clean: Audit) -> Planted:
    """Channel 4 is 60 mm/s off in the record; without the instrument's velocity one combination shows it."""
    y = world.log.velocity_mps + np.array([0.0, 0.0, 0.0, 0.06])
    y = np.where(world.log.valid, y, world.log.velocity_mps)
    closure = clean.assessment.closures[0]
    made = world.with_log(replace(world.log, velocity_mps=y))
    if world.log.instrument_mps is None:
        return Planted(made, ("closure_bias",), (), 60.0, 1e3 * closure.median_sd_mps, "mm/s")
    return Planted(made, ("beam_bias",), (4,), 60.0, 1e3 * closure.median_sd_mps, "mm/s")


def stale(world: World, clean: Audit) -> Planted:
    """A ping of twenty repeats the one before it."""
    log = world.log
    rows = np.arange(20, log.pings, 20)
    rows = rows[log.full[rows - 1] & ~clean.unchanged[rows] & ~clean.unchanged[rows - 1]]
    y, valid = log.velocity_mps.copy(), log.valid.copy()
    y[rows], valid[rows] = y[rows - 1], valid[rows - 1]
    own = None if log.instrument_mps is None else log.instrument_mps.copy()
    if own is not None:
        own[rows] = own[rows - 1]
    made = world.with_log(replace(log, velocity_mps=y, valid=valid, instrument_mps=own))
    return Planted(made, ("stale_pings",), (), float(rows.size + clean.unchanged.sum()), 0.0, "pings")


def zeros(world: World, clean: Audit) -> Planted:
    """Beam 4 is zero and flagged valid in a ping of ten."""
    y = world.log.velocity_mps.copy()
    rows = np.arange(7, world.log.pings, 10)
    rows = rows[world.log.valid[rows, 3] & ~clean.unchanged[rows] & (np.abs(y[rows, 3]) > 0.05)]
    y[rows, 3] = 0.0
    made = world.with_log(replace(world.log, velocity_mps=y))
    return Planted(made, ("zero_as_valid",), (4,), float(rows.size), 0.0, "pings")


def copied(world: World, _: Audit) -> Planted:
    """Channel 4 is channel 1 once more."""
    return Planted(
        _channels(world, [0, 1, 2, 0]), ("identical_beams",), (1, 4), also=("velocity_without_beams",)
    )


def tilt_stated(world: World, _: Audit) -> Planted:
    """The geometry states a tilt that is 2° too small."""
    made = []
    for row in rows_of(world):
        aside = np.cross([0.0, 0.0, 1.0], row)
        made.append(Rotation.from_rotvec(np.deg2rad(-2.0) * aside / np.linalg.norm(aside)).apply(row))
    stated = make_geometry("directions", directions=made)
    return Planted(replace(world, geometry=stated), ("wrong_tilt",), (1, 2, 3, 4), 2.0, _shown(world), "deg")


def _rounded(world: World, y: Array) -> Array:
    """Readings in the steps of the log: unrounded ones never repeat by chance, as those of an instrument do.

    Before, they are spread over the step that they were rounded to: a change of less than a step is lost otherwise.
    """
    step = resolution(world.log.velocity_mps.ravel())
    spread = np.random.default_rng(7).uniform(-0.5, 0.5, y.shape)
    return np.asarray(np.round(y / step + spread) * step)


def clock_behind(world: World, behind_s: float) -> World:
    """The DVL's clock is behind."""
    return world.with_log(replace(world.log, time_ns=world.log.time_ns - round(behind_s * 1e9)))


def clock(world: World, clean: Audit) -> Planted:
    """The DVL's clock is 0.3 s behind."""
    made = clock_behind(world, 0.3)
    sd = np.inf if clean.mounting is None else clean.mounting.clock_offset_sd_s
    return Planted(made, ("clock_offset",), (), 0.3, sd, "s")


def _moved(world: World, change_mps: Array) -> World:
    """The instrument's velocity and its beams with a change (n, 3) of the velocity that the instrument measures."""
    own = world.log.instrument_mps
    assert own is not None
    moved = np.where(world.log.solved[:, None], change_mps, 0.0)
    y = world.log.velocity_mps + np.where(world.log.valid, moved @ rows_of(world).T, 0.0)
    return world.with_log(replace(world.log, velocity_mps=_rounded(world, y), instrument_mps=own + moved))


def yawed(world: World, angle_deg: float) -> World:
    """What beams in an instrument turned to starboard read of the same motion."""
    own = np.nan_to_num(np.asarray(world.log.instrument_mps))
    return _moved(world, Rotation.from_euler("z", angle_deg, degrees=True).inv().apply(own) - own)


def scaled(world: World, factor: float) -> World:
    """All beams read this many times the velocity."""
    return _moved(world, (factor - 1.0) * np.nan_to_num(np.asarray(world.log.instrument_mps)))


def lever_arm_of(world: World, ahead_m: float) -> World:
    """The DVL sits ahead of the reference's point."""
    reference = world.reference
    assert reference is not None
    attitude = Rotation.from_euler("ZYX", reference.rpy_rad[:, ::-1])
    rate = (
        (attitude[:-2].inv() * attitude[2:]).as_rotvec() / np.diff(reference.time_ns)[:, None].mean() / 2e-9
    )
    at = [np.interp(world.log.time_ns, reference.time_ns[1:-1], column) for column in rate.T]
    return _moved(world, np.cross(np.stack(at, axis=1), [ahead_m, 0.0, 0.0]))


def yaw(world: World, clean: Audit) -> Planted:
    """The instrument sits 5° to starboard, which the geometry does not state."""
    if world.log.instrument_mps is None or world.reference is None:
        return Planted(world, ("misalignment",), (), 5.0, np.inf, "deg")
    sd = np.inf if clean.mounting is None else float(np.rad2deg(clean.mounting.misalignment_sd_rad[2]))
    return Planted(yawed(world, 5.0), ("misalignment",), (), 5.0, sd, "deg")


def lever_arm(world: World, clean: Audit) -> Planted:
    """The DVL sits 1.5 m aft of the reference's point, which the geometry does not state."""
    if world.log.instrument_mps is None or world.reference is None:
        return Planted(world, ("lever_arm",), (), 1.5, np.inf, "m")
    sd = np.inf if clean.mounting is None else float(clean.mounting.lever_arm_sd_m[0])
    return Planted(lever_arm_of(world, -1.5), ("lever_arm",), (), 1.5, sd, "m")


DEFECTS: dict[str, Callable[[World, Audit], Planted]] = {
    "neighbours exchanged": swap_neighbours,
    "opposite beams exchanged": swap_opposite,
    "one beam's sign": flip_sign,
    "one beam ×1.02 in the record": scale_recorded,
    "one transducer ×1.05": scale_unaware,
    "one transducer leans 3°": tilt_unaware,
    "one channel +60 mm/s": bias,
    "repeated pings": stale,
    "zeros flagged valid": zeros,
    "one channel twice": copied,
    "stated tilt 2° too small": tilt_stated,
    "clock 0.3 s behind": clock,
    "mounting yaw 5°": yaw,
    "lever arm 1.5 m": lever_arm,
}
"""Name in the table, and what plants the defect."""
