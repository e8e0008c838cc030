"""Water Linked DVLs on a serial line: `wrz` (velocity) with four `wru` (transducers), each with its CRC-8.

The instrument sends a `wrz` and then its transducers, so a `wru` belongs to the `wrz` before it. The deprecated `wrx`
is a velocity too; `wrt` holds distances alone, so logs of `wrx` and `wrt` have no beam velocities.
"""

import math
import re
from dataclasses import dataclass, field

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty
from bottomlock.io.sentences import LONGEST_LINE, crc8_07, hexadecimal, lines_of, number, whole

NAME = "waterlinked-serial"
_BEAMS = 4
_SENTENCE = re.compile(rb"wr[a-z!?](?:,[^*,]{0,200}){0,16}\*[0-9a-fA-F]{2}")
_KINDS = {
    b"wrt": "wrt (distances alone, deprecated)",
    b"wrp": "wrp (dead reckoning)",
    b"wrs": "wrs (two meanings by version)",
}
ADVICE = (
    "the log has velocities but no beams (wru): update the instrument's firmware to 2.1 or later, "
    "or record its TCP port 16171"
)


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return re.search(rb"(^|[\s\x00,])wr[zuxtp],-?\d", head) is not None


@dataclass
class _Ping:
    """A velocity report and the transducers that follow it."""

    position: int
    velocity: tuple[float, float, float]
    verdict: int
    altitude: float
    fom: float
    interval_ms: float
    validity_us: int | None
    beams: dict[int, tuple[float, float, float, float]] = field(default_factory=dict)


def _sentences(line: bytes, position: int, account: Account, *, trust: bool) -> list[list[bytes]]:
    """The fields of the good sentences in a line; what else stands there is counted."""
    if len(line) > LONGEST_LINE:
        account.read += 1
        account.skip("line too long", position, line)
        return []
    found: list[list[bytes]] = []
    at = 0
    while match := _SENTENCE.search(line, at):
        text, _, digits = match.group().rpartition(b"*")
        good = crc8_07(text) == hexadecimal(digits)
        inner = text.find(b"wr", 1)
        if not good and inner > 0:
            # A sentence that was cut off, then a whole one: look again from the second.
            account.read += 1
            account.skip("merged line", position, line)
            at = match.start() + inner
            continue
        account.read += 1
        if good or trust:
            found.append(text.split(b","))
            if not good:
                account.flag("bad checksum, kept on request", position, text)
        else:
            account.skip("bad checksum", position, match.group())
        at = match.end()
    if at == 0:
        account.read += 1
        account.skip("truncated" if b"wr" in line else "not a sentence", position, line)
    elif line[at:].strip():
        account.read += 1
        account.skip("truncated", position, line[at:])
    return found


def _velocity(fields: list[bytes], position: int) -> _Ping | None:
    """A `wrz` or `wrx` as a ping without beams yet; None where a field is not what it should be."""
    if fields[0] == b"wrz" and len(fields) == 12:
        x, y, z, valid, altitude, fom, _, validity, _, interval, _ = fields[1:]
        validity_us = whole(validity)
    elif fields[0] == b"wrx" and len(fields) == 9:
        interval, x, y, z, fom, altitude, valid, _ = fields[1:]
        validity_us = None
    else:
        return None
    numbers = [number(text) for text in (x, y, z, altitude, fom, interval)]
    if any(value is None for value in numbers) or valid not in {b"y", b"n"}:
        return None
    vx, vy, vz, altitude_m, fom_mps, interval_ms = (NAN if v is None else v for v in numbers)
    return _Ping(position, (vx, vy, vz), int(valid == b"y"), altitude_m, fom_mps, interval_ms, validity_us)


def _transducer(fields: list[bytes]) -> tuple[int, tuple[float, float, float, float]] | None:
    """Id and velocity, distance, rssi, nsd of a `wru`."""
    if len(fields) != 6 or fields[1] not in {b"0", b"1", b"2", b"3"}:
        return None
    values = [number(text) for text in fields[2:]]
    velocity, distance, rssi, nsd = (NAN if v is None else v for v in values)
    return (int(fields[1]), (velocity, distance, rssi, nsd)) if None not in values else None


def _pings(data: bytes, account: Account, *, trust: bool) -> list[_Ping]:
    pings: list[_Ping] = []
    for position, line in lines_of(data):
        for fields in _sentences(line, position, account, trust=trust):
            kind = fields[0]
            if kind in {b"wrz", b"wrx"}:
                ping = _velocity(fields, position)
                if ping is None:
                    account.skip("velocity report with wrong fields", position, b",".join(fields))
                else:
                    pings.append(ping)
            elif kind == b"wru":
                transducer = _transducer(fields)
                if transducer is None:
                    account.skip("transducer report with wrong fields", position, b",".join(fields))
                elif not pings:
                    account.skip("transducer report before any velocity", position)
                elif transducer[0] in pings[-1].beams:
                    account.skip("transducer report without its velocity report", position)
                else:
                    pings[-1].beams[transducer[0]] = transducer[1]
                    account.pass_by("wru (joined to its wrz)", position)
            else:
                account.pass_by(_KINDS.get(kind, kind.decode("ascii", "replace")), position)
    return pings


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Velocity reports with their transducers.

    Raises:
        DataError: where there is no velocity report, or none has beams and the instrument's velocity alone is not
            requested.
    """
    account = Account(unit="line")
    pings = _pings(data, account, trust=options.ignore_checksum)
    with_beams = any(ping.beams for ping in pings)
    if pings and not with_beams and not options.instrument_only:
        raise DataError(f"{place}: {ADVICE}; --instrument-only converts the velocities as they are")
    absolute = bool(pings) and all(ping.validity_us is not None for ping in pings)
    rows = Rows(_BEAMS if with_beams else 0, account)
    sum_ns = 0
    for ping in pings:
        if not math.isfinite(ping.interval_ms) or abs(ping.interval_ms) > 1e9:
            account.skip("no interval since the last report", ping.position)
            continue
        sum_ns += round(ping.interval_ms * 1e6)
        time_ns = (ping.validity_us or 0) * 1000 if absolute else sum_ns
        if with_beams and len(ping.beams) < _BEAMS:
            account.flag("transducer report missing", ping.position)
        _add(rows, ping, time_ns)
    table = rows.finish(negate=options.negate_beams)
    raise_if_empty(account, place, "velocity report")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="frd",
        clock="the instrument's, microseconds since 1970 where it is set" if absolute else "sum of intervals",
        time_of="validity" if absolute else "record",
        quality="signal strength rssi, dBm",
        geometry="waterlinked_a50",
        notes=[
            "a beam has no flag of its own: it counts as valid where its distance is not -1",
            *([] if absolute else ["the reports carry no clock: time is the sum of their intervals"]),
        ],
    )


def _add(rows: Rows, ping: _Ping, time_ns: int) -> None:
    """A ping to the table; a beam is lost where its distance is negative."""
    lost = (NAN, NAN, NAN, NAN)
    beams = [ping.beams.get(k, lost) for k in range(rows.beams)]
    rows.add(
        ping.position,
        time_ns,
        [b[0] for b in beams],
        [b[1] >= 0.0 for b in beams],
        range_m=[b[1] if b[1] >= 0.0 else NAN for b in beams],
        quality=[b[2] for b in beams],
        instrument=ping.velocity,
        verdict=ping.verdict,
        extra={
            "altitude_m": ping.altitude if ping.altitude >= 0.0 else NAN,
            "instrument_sd_mps": ping.fom,
            **{f"beam{k + 1}_noise_dbm": b[3] for k, b in enumerate(beams)},
        },
    )
