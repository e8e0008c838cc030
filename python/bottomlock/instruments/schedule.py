"""The records of a run in the order of sending: bytes, time and faults; nothing here knows how they are sent."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import polars as pl

from bottomlock.encoders.ping import Ping
from bottomlock.encoders.registry import Encoder
from bottomlock.instruments.faults import FaultDraws, Faults
from bottomlock.instruments.readings import Readings, pings
from bottomlock.io.columns import frame_of
from bottomlock.recordings.streams import Depths, Inertial

LATENCY_NS = 10_000_000
"""Time from the last echo to the sending of a record, where none is given."""

POWERED_S = 60.0
"""The instrument was switched on so long before the first reading: zero of the clocks that count from there."""


@dataclass(frozen=True, eq=False)
class Record:
    """Bytes that are due at a time.

    Attributes:
        due_ns: when to send them, on the true clock.
        data: the bytes; empty for a dropped record.
        ping: the ping on the true clock with its own beams; None for other instruments than the DVL.
        stated: the ping as the record states it, with a stepped clock or stale beams; None as above.
        faults: kinds of faults.
        closes: the connection is closed after it.
    """

    due_ns: int
    data: bytes
    ping: Ping | None = None
    stated: Ping | None = None
    faults: frozenset[str] = frozenset()
    closes: bool = False


def records(
    readings: Readings,
    encoder: Encoder,
    faults: Faults,
    *,
    seed: int,
    latency_ns: int = LATENCY_NS,
    offset_ns: int = 0,
) -> Iterator[Record]:
    """The DVL's records, in order; the same arguments give the same bytes.

    Args:
        readings: the run.
        encoder: of the format.
        faults: which faults, how often.
        seed: of the faults.
        latency_ns: from the last echo to the sending.
        offset_ns: added to every time of the run: the clock of the instruments.

    Raises:
        DataError: for a number that the format does not hold.
    """
    draws = FaultDraws(faults, seed)
    powered_ns = readings.first_ns + offset_ns - round(POWERED_S * 1e9)
    step_ns, behind_ns = round(faults.clock_step_s * 1e9), 0
    before: Ping | None = None
    due_ns = readings.first_ns + offset_ns
    for ping in pings(readings, latency_ns=latency_ns, offset_ns=offset_ns):
        kinds = draws.next()
        if "clock_steps" in kinds:
            back = draws.detail() < 0.5
            # A clock that counts from the start of the instrument cannot go back beyond it.
            back = back and ping.sent_ns + behind_ns - step_ns > powered_ns
            behind_ns += -step_ns if back else step_ns
        if "stale" in kinds and before is None:
            kinds -= {"stale"}
        stated = _moved(_stale(ping, before) if "stale" in kinds and before is not None else ping, behind_ns)
        data = encoder.encode(stated)
        if "half_lines" in kinds:
            data = data[: 1 + int(draws.detail() * (len(data) - 1))]
        if "duplicates" in kinds:
            data *= 2
        if "drops" in kinds:
            data = b""
        # A ping from far off may still be on its way when the next one is due: records keep their order.
        due_ns = max(due_ns, ping.transmission_ns)
        yield Record(due_ns, data, ping, stated, kinds, "reconnects" in kinds)
        before = stated


def _stale(ping: Ping, before: Ping) -> Ping:
    """A ping whose beams and number are still those of the one before, under its own times and velocity."""
    return replace(
        ping,
        number=before.number,
        beam_velocity_mps=before.beam_velocity_mps,
        range_m=before.range_m,
        water_velocity_mps=before.water_velocity_mps,
    )


def _moved(ping: Ping, by_ns: int) -> Ping:
    """A ping on a clock that is ahead."""
    if not by_ns:
        return ping
    return replace(
        ping,
        time_ns=ping.time_ns + by_ns,
        trigger_ns=ping.sent_ns + by_ns,
        transmission_ns=ping.transmission_ns + by_ns,
    )


def imu_lines(imu: Inertial, *, offset_ns: int = 0) -> Iterator[Record]:
    """Lines `time_ns,wx,wy,wz,fx,fy,fz`: ns, rad/s, m/s², forward, right, down; every digit, so that bits survive."""
    rows = zip(imu.time_ns.tolist(), imu.omega_p_radps.tolist(), imu.force_p_mps2.tolist(), strict=True)
    for time_ns, omega, force in rows:
        at = time_ns + offset_ns
        yield Record(at, f"{at},{','.join(map(repr, (*omega, *force)))}\n".encode())


def depth_lines(depth: Depths, *, offset_ns: int = 0) -> Iterator[Record]:
    """Lines `time_ns,depth`: ns, m."""
    for time_ns, depth_m in zip(depth.time_ns.tolist(), depth.depth_m.tolist(), strict=True):
        at = time_ns + offset_ns
        yield Record(at, f"{at},{depth_m!r}\n".encode())


_AXES = {
    "position_t_m": ("true_north_m", "true_east_m", "true_down_m"),
    "velocity_p_mps": ("true_surge_mps", "true_sway_mps", "true_heave_mps"),
    "rpy_rad": ("true_roll_rad", "true_pitch_rad", "true_yaw_rad"),
}


def sent_table(readings: Readings, records: list[Record]) -> pl.DataFrame:
    """A row a ping that was due.

    Returns:
        Columns: number; time_ns, trigger_ns and transmission_ns on the true clock; stated_time_ns and
        stated_transmission_ns as the record states them; bytes sent; faults, joined by "+", "" for none; beamK_mps,
        beamK_valid, beamK_range_m as measured, null where lost; sent_beamK_mps as the record holds them (those of
        another ping in a stale one); velocity_valid, whether the record states a velocity; and the true states at the
        ping (true_surge_mps ...), null for a recording.
    """
    rows = []
    for one in records:
        ping, stated = one.ping, one.stated
        if ping is None or stated is None:
            continue
        row: dict[str, Any] = {
            "number": ping.number,
            "time_ns": ping.time_ns,
            "trigger_ns": ping.sent_ns,
            "transmission_ns": one.due_ns,
            "stated_time_ns": stated.time_ns,
            "stated_transmission_ns": stated.transmission_ns,
            "bytes": len(one.data),
            "faults": "+".join(sorted(one.faults)),
            "velocity_valid": stated.velocity_p_mps is not None,
        }
        for k in range(readings.geometry.beams):
            row[f"beam{k + 1}_mps"] = float(ping.beam_velocity_mps[k])
            row[f"beam{k + 1}_valid"] = bool(ping.valid[k])
            row[f"beam{k + 1}_range_m"] = float(ping.range_m[k])
            row[f"sent_beam{k + 1}_mps"] = float(stated.beam_velocity_mps[k])
        for name, axes in _AXES.items():
            truth = (
                None if readings.truth is None else getattr(readings.truth, name)[ping.number - 1].tolist()
            )
            row |= dict.fromkeys(axes, math.nan) if truth is None else dict(zip(axes, truth, strict=True))
        rows.append(row)
    return frame_of(rows)
