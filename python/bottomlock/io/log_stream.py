"""A stream of an autopilot's log, and the velocities that a DVL sent to it, which have no beams."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bottomlock.arrays import rising
from bottomlock.errors import DataError
from bottomlock.io.account import Flags, Floats, Integers
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.rows import Options, make_table, raise_if_empty
from bottomlock.io.sentences import printable
from bottomlock.libraries import pl, transform

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


VELOCITY = ("surge_mps", "sway_mps", "heave_mps")
ESTIMATE = "the autopilot's own estimate of the same sensors, not independent"
ADVICE = (
    "record the DVL's own output beside it, for a Water Linked its TCP stream (port 16171), and convert that; keep "
    "these velocities with --instrument-only"
)
CLEARER = 1.3
"""The frame of a velocity is told by a misfit that is so many times smaller than that of the other."""
MOST_INTERVAL_S = 10.0
"""A displacement over more is no velocity of a DVL."""
MOST_GAP_NS = 1_000_000_000
"""Attitudes further apart say nothing of the time between."""
_FEWEST = 20


@dataclass(frozen=True, eq=False)
class LogStream:
    """A stream of a log.

    Attributes:
        name: message and sensor, for instance "IMU 0".
        time_ns: (n,) of each row, on the log's clock.
        columns: (n,) each, by names that state the unit.
        remark: what has to be said of it; "".
        independent: whether it is measured, not estimated from other streams of the log.
    """

    name: str
    time_ns: Integers
    columns: dict[str, Floats]
    remark: str = ""
    independent: bool = True

    def to_frame(self) -> "pl.DataFrame":
        """The columns with `time_ns`."""
        return pl.DataFrame({"time_ns": self.time_ns, **self.columns})


@dataclass(eq=False)
class LogStreams:
    """The streams of a log.

    Attributes:
        streams: in the order in which they are to be preferred, of each kind.
        account: of its records.
        clock: what `time_ns` counts.
        notes: remarks for the user, a sentence each.
    """

    streams: list[LogStream]
    account: Account
    clock: str
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Recorded attitudes: rising times (n,), ns, and rotations to the level frame."""

    time_ns: Integers
    to_level: "Rotation"

    def at(self, time_ns: Integers) -> "tuple[Rotation, Flags]":
        """Attitudes at other times (m,), interpolated, and whether two less than `MOST_GAP_NS` apart stand around."""
        first = self.time_ns[0]
        turn = transform.Slerp((self.time_ns - first) * 1e-9, self.to_level)
        after = np.clip(np.searchsorted(self.time_ns, time_ns), 1, len(self.time_ns) - 1)
        gap = self.time_ns[after] - self.time_ns[after - 1]
        near = (gap < MOST_GAP_NS) | np.isin(time_ns, self.time_ns)
        inside = (time_ns >= first) & (time_ns <= self.time_ns[-1]) & near
        return turn((np.clip(time_ns, first, self.time_ns[-1]) - first) * 1e-9), inside


def finish(log: LogStreams, place: str) -> LogStreams:
    """The log without positions that stand still, and with a note of its damaged parts, once it has a stream.

    Raises:
        DataError: where it has none, with what was left out.
    """
    still = [one.name for one in log.streams if _never_moves(one.columns)]
    log.notes += [f"{name} never moves, and is left out" for name in still]
    log.streams = [one for one in log.streams if one.name not in still]
    if not log.streams:
        why = "; ".join(log.notes) or "no message of a sensor"
        raise DataError(f"holds no stream that a replay could use ({why})", place=place)
    if log.account.lost:
        lost = ", ".join(
            f"{one.count} {why} (first at byte {one.first})" for why, one in log.account.skipped.items()
        )
        log.notes.append(f"damaged parts are left out: {lost}")
    return log


def change_of_pressure(stream: LogStream) -> float:
    """Of several pressures the one that moves most is the depth's: the other is that of the air in the hull."""
    return float(np.ptp(stream.columns["pressure_pa"])) if "pressure_pa" in stream.columns else 0.0


def _never_moves(columns: Mapping[str, Floats]) -> bool:
    """Whether columns are of positions that stand still."""
    return all(part in columns and np.ptp(columns[part]) == 0.0 for part in ("north_m", "east_m"))


def attitudes_of(streams: Sequence[LogStream]) -> Attitudes | None:
    """The attitudes of the first stream that has them, Euler angles or quaternions; None for fewer than two."""
    for one in streams:
        angles = next((unit for unit in ("deg", "rad") if f"yaw_{unit}" in one.columns), None)
        if angles is None and "q_w" not in one.columns:
            continue
        names = (
            [f"{part}_{angles}" for part in ("yaw", "pitch", "roll")]
            if angles
            else [f"q_{k}" for k in "xyzw"]
        )
        values = np.stack([one.columns[name] for name in names], axis=1)
        good = np.isfinite(values).all(axis=1) & rising(one.time_ns)
        if angles is None:
            good &= np.linalg.norm(values, axis=1) > 0.5
        if good.sum() < 2:
            continue
        of = transform.Rotation
        turned = (
            of.from_euler("ZYX", values[good], degrees=angles == "deg")
            if angles
            else of.from_quat(values[good])
        )
        return Attitudes(one.time_ns[good], turned)
    return None


def velocity_of_displacements(
    name: str, end_ns: Integers, interval_s: Floats, moved_m: Floats, valid: Flags, remark: str = ""
) -> LogStream:
    """Mean body velocities over the intervals of displacements, each at the middle of its interval.

    Args:
        name: of the stream.
        end_ns: (n,) end of each interval.
        interval_s: (n,).
        moved_m: (n, 3) forward, right, down.
        valid: (n,) whether the sender has confidence in it.
        remark: of the stream.
    """
    usable = (interval_s > 0.0) & (interval_s < MOST_INTERVAL_S)
    interval_s = np.where(usable, interval_s, np.nan)
    velocity = moved_m / interval_s[:, None]
    middle_ns = end_ns - np.round(np.nan_to_num(interval_s) * 0.5e9).astype(np.int64)
    valid = valid & np.isfinite(velocity).all(axis=1)
    columns = dict(zip(VELOCITY, velocity.T, strict=True))
    return LogStream(name, middle_ns, columns | {"valid": valid.astype(np.float64)}, remark)


def body_velocity(name: str, time_ns: Integers, velocity: Floats, log: LogStreams) -> LogStream | None:
    """Body velocities of a message that is defined north, east, down, and into which senders write body axes, too.

    The accelerometers tell the two apart: turned to the level frame with the attitude, they integrate to the changes of
    the velocity in its true frame. Where they do not tell, the definition holds.

    Returns:
        The stream; None with a note without an attitude in the log, as a velocity in the level frame is no body
        velocity then.
    """
    attitude = attitudes_of(log.streams)
    imu = next((one for one in log.streams if "acc_x_mps2" in one.columns), None)
    if attitude is None:
        log.notes.append(
            f"{name} is a velocity north, east, down, and no attitude turns it to the vehicle's axes"
        )
        return None
    turned, known = attitude.at(time_ns)
    velocity = np.where(known[:, None], velocity, np.nan)
    misfit = dict.fromkeys(("body", "level"), np.nan)
    if imu is not None and len(time_ns) > _FEWEST:
        misfit = {
            frame: _misfit(time_ns, turned.apply(velocity) if frame == "body" else velocity, attitude, imu)
            for frame in misfit
        }
    told = misfit["level"] > CLEARER * misfit["body"]
    sure = told or misfit["body"] > CLEARER * misfit["level"]
    why = (
        f"the accelerometers fit {misfit['body']:.2g} m/s in body axes, {misfit['level']:.2g} m/s in north, east, down"
        if sure
        else "the accelerometers do not tell"
    )
    remark = (
        f"taken as body axes, which some senders write into it: {why}"
        if told
        else f"taken as north, east, down, as it is defined, and turned with the recorded attitude: {why}"
    )
    values = velocity if told else turned.inv().apply(velocity)
    return LogStream(name, time_ns, dict(zip(VELOCITY, np.asarray(values).T, strict=True)), remark)


def _misfit(time_ns: Integers, velocity_t: Floats, attitude: "Attitudes", imu: LogStream) -> float:
    """RMS change of a level velocity from row to row beyond that of the accelerometers, m/s."""
    turned, _ = attitude.at(imu.time_ns)
    force = np.stack([imu.columns[f"acc_{axis}_mps2"] for axis in "xyz"], axis=1)
    acceleration = turned.apply(force)
    acceleration = acceleration - acceleration.mean(axis=0)
    steps_s = np.clip(np.diff(imu.time_ns) * 1e-9, 0.0, 1.0)
    moved = np.vstack([np.zeros(3), np.cumsum(acceleration[1:] * steps_s[:, None], axis=0)])
    seconds, at = (imu.time_ns - imu.time_ns[0]) * 1e-9, (time_ns - imu.time_ns[0]) * 1e-9
    inside = (at >= 0.0) & (at <= seconds[-1]) & np.isfinite(velocity_t).all(axis=1)
    if inside.sum() < _FEWEST:
        return float("nan")
    felt = np.stack([np.interp(at[inside], seconds, moved[:, k]) for k in range(3)], axis=1)
    left = np.diff(velocity_t[inside] - felt, axis=0)
    return float(np.sqrt(np.mean((left - np.median(left, axis=0)) ** 2)))


def velocities_recording(log: LogStreams, place: str, name: str, options: Options) -> Recording:
    """The velocity of a log as a table without beams, or why it is none.

    Raises:
        DataError: without `instrument_only`, with advice; for a log without velocities, or with several.
    """
    found = [one for one in log.streams if set(VELOCITY) <= one.columns.keys()]
    words = ", ".join(f"{one.name} ({len(one.time_ns)})" for one in found)
    if not options.instrument_only:
        held = f"velocities of a DVL, {words}, but no beams" if found else "no DVL"
        others = ", ".join(one.name for one in log.streams)
        what = (
            ADVICE
            if found
            else f"it holds {others}: bottomlock replay --init takes it beside the log of a DVL"
        )
        raise DataError(f"holds {held}", place=place, hint=what)
    if options.topic is not None:
        found = [one for one in found if one.name == options.topic]
    if len(found) != 1:
        choose = (
            "choose one with --topic" if found else "expected VISO, VISV, VISION_POSITION_DELTA or the like"
        )
        wanted = f" named '{printable(options.topic)}'" if options.topic is not None else ""
        raise DataError(
            f"holds {len(found)} velocities{wanted} ({words or 'none'})", place=place, hint=choose
        )
    (one,) = found
    rows = len(one.time_ns)
    velocity = np.stack([one.columns[axis] for axis in VELOCITY], axis=1)
    valid = one.columns.get("valid", np.ones(rows)) == 1.0
    account = Account(unit="message", read=rows)
    none = np.empty((rows, 0))
    table = make_table(
        account, 0, np.arange(1, rows + 1), one.time_ns, none, none,
        instrument=velocity, verdict=(valid & np.isfinite(velocity).all(axis=1)).astype(np.int8),
    )  # fmt: skip
    raise_if_empty(account, place, one.name)
    return Recording(
        format=name, table=table, account=account, frame="frd", clock=log.clock, time_of="record",
        notes=[note for note in (one.remark, *log.notes) if note],
    )  # fmt: skip
