"""Live use under seeded faults: nothing is sent that must not be, no estimate jumps, nothing breaks.

A case is a run of 9 s with beams lost and returning, and some of the faults below, put together from its number. The
engine is given the bytes and their times of arrival, as it is on a host, without waiting for the time to pass.
"""

import functools
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bottomlock.io.sentences import xor_of
from bottomlock.live.engine import Engine
from bottomlock.ports.estimate import SILENT
from tests.live.world import START_NS, Sent, World, config

S = 1_000_000_000
Entry = tuple[int, int, bytes]
"""Arrival, source (0 DVL, 1 IMU, -1 and -2 their new connections), bytes."""

SECONDS = 9.0
SHORT = ('navigation.method = "tc"', 'navigation.method = "tc"\nnavigation.horizon_s = 0.5')
"""What the configuration of every case has besides that of the tests."""
LOSSES: tuple[Callable[[float], tuple[int, ...]], ...] = (
    lambda _: (),
    lambda t: (1, 2) if 3.0 <= t < 5.0 else (0, 1, 2, 3) if 5.0 <= t < 6.5 else (),
    lambda t: (0,) if 3.0 <= t < 7.0 else (),
    lambda t: (0, 1, 2, 3) if 3.0 <= t < 7.5 else (),
    lambda t: tuple(k for k in range(4) if int(t * 3.0 + 1.7 * k) % 3 == 0) if t > 2.5 else (),
)
STEPS = (0, 0, 300_000_000, -300_000_000, 3600 * S, -3600 * S)


@functools.cache
def recorded(form: str, losses: int, step_ns: int) -> tuple[Entry, ...]:
    """A run without faults of the line, whose DVL's clock is set by `step_ns` at 4 s."""
    world = World(
        SECONDS, LOSSES[losses], form=form, offset_ns=lambda t: -S + (step_ns if t > 4.0 else 0), imu_hz=50.0
    )
    return tuple(world.arrivals(imu=True))


def dropped(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """Records that never come, one by one or a second of them, of one source or both."""
    begin = START_NS + draw.randrange(2 * S, 8 * S)
    end, source, part = begin + draw.randrange(S), draw.choice([0, 1, 2]), draw.choice([0.2, 1.0])
    return [e for e in entries if not (begin <= e[0] < end and source in {e[1], 2} and draw.random() < part)]


def repeated(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """Records that come twice, at once or some records later."""
    found = list(entries)
    for _ in range(20):
        at = draw.randrange(len(entries))
        arrival_ns, source, data = entries[at]
        found.append((arrival_ns + draw.choice([1000, 250_000_000]), source, data))
    return sorted(found, key=lambda e: e[0])


def halved(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """Records whose end, with the line's end, is missing."""
    return [(a, s, d[: draw.randrange(len(d) + 1)] if draw.random() < 0.02 else d) for a, s, d in entries]


def garbage(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """Bytes of nothing between the records, also long ones without an end of line, and beginnings of records."""
    found = []
    for arrival_ns, source, data in entries:
        found.append((arrival_ns, source, data))
        if draw.random() < 0.02:
            rubbish = draw.choice(
                [draw.randbytes(40), b"\x7f\x7f\xff\xff", b'{"time":', b"x" * 70_000, b"\n\n\r\n"]
            )
            found.append((arrival_ns, source, rubbish + draw.choice([b"", b"\n"])))
    return found


def stalled(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """A line that stands still and then delivers everything at once."""
    begin = START_NS + draw.randrange(2 * S, 7 * S)
    end, source = begin + draw.randrange(2 * S), draw.choice([0, 1])
    return sorted(
        ((max(a, end) if s == source and begin <= a < end else a, s, d) for a, s, d in entries),
        key=lambda e: e[0],
    )


def reconnected(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """A connection that is lost within a record and made again."""
    at = draw.randrange(len(entries))
    arrival_ns, source, data = entries[at]
    return [
        *entries[:at],
        (arrival_ns, source, data[: len(data) // 2]),
        (arrival_ns, -1 - source, b""),
        *entries[at + 1 :],
    ]


def spiked(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """Inertial readings beyond the full scale, that are no number, or that stand still in time."""
    found = []
    for arrival_ns, source, data in entries:
        fields = data.partition(b"*")[0].split(b",")
        if source == 1 and len(fields) == 7 and draw.random() < 0.01:
            fields[draw.randrange(1, 7)] = draw.choice([b"1e4", b"nan", b"-5000", b"", b"1e400"])
            line = b",".join(fields)
            found.append((arrival_ns, source, line + b"*%02X\n" % xor_of(line)))
        else:
            found.append((arrival_ns, source, data))
    return found


def rechunked(entries: list[Entry], draw: random.Random) -> list[Entry]:
    """Records in pieces, which come some microseconds apart."""
    found = []
    for arrival_ns, source, data in entries:
        cut = draw.randrange(len(data) + 1) if data else 0
        found += [
            (arrival_ns, source, data[:cut]),
            (arrival_ns + draw.randrange(1, 20_000), source, data[cut:]),
        ]
    return sorted(found, key=lambda e: e[0])


FAULTS = (dropped, repeated, halved, garbage, stalled, reconnected, spiked, rechunked)


@dataclass
class Outcome:
    """What a case came to: messages, states that were seen, and what was wrong, "" for nothing."""

    messages: int
    states: frozenset[str]
    wrong: str


@dataclass(frozen=True)
class Case:
    """A case: format of the DVL, its faults by name, and what arrives."""

    form: str
    names: str
    entries: tuple[Entry, ...]


def case_of(number: int) -> Case:
    draw = random.Random(number)
    form = draw.choice(["waterlinked-json", "pd0"])
    entries = list(recorded(form, draw.randrange(len(LOSSES)), draw.choice(STEPS)))
    faults = draw.sample(FAULTS, draw.randrange(1, 4))
    for fault in faults:
        entries = fault(entries, draw)
    return Case(form, ", ".join(fault.__name__ for fault in faults), tuple(entries))


def run_case(number: int) -> Outcome:
    """One case, given to the engine without sockets."""
    case = case_of(number)
    names = case.names
    engine = Engine(config("navigation", format=case.form, change=SHORT))
    sent: list[Sent] = []
    seen: set[str] = set()
    now = START_NS
    for arrival_ns, source, data in case.entries:
        now = max(now, arrival_ns)
        try:
            if source < 0:
                messages = engine.connected(-1 - source, now)
                messages += engine.connected(-1 - source, now)
            else:
                messages = engine.arrive(source, now, data)
        except Exception as error:  # noqa: BLE001 - what the harness looks for
            return Outcome(len(sent), frozenset(seen), f"{names}: {type(error).__name__}: {error}")
        seen.add(engine.state)
        if messages and engine.state in SILENT:
            return Outcome(len(sent), frozenset(seen), f"{names}: sent in state {engine.state}")
        sent += [Sent.parse(message.data) for message in messages]
    return Outcome(len(sent), frozenset(seen), wrong_in(sent, names))


def wrong_in(sent: Sequence[Sent], names: str) -> str:
    """The first message that is not finite, out of order, or jumps by more than 3 sigma without a reset."""
    for before, after in pairwise(sent):
        if not (np.isfinite(after.velocity).all() and (after.sd > 0.0).all()):
            return f"{names}: not finite: {after}"
        if after.time_ns <= before.time_ns:
            return f"{names}: time goes back: {before.time_ns}, {after.time_ns}"
        jump = np.abs(after.velocity - before.velocity) / np.hypot(before.sd, after.sd)
        if jump.max() > 3.0 and after.resets == before.resets:
            return f"{names}: jump of {jump.max():.1f} sigma at {(after.time_ns - START_NS) / S:.2f} s"
    return ""
