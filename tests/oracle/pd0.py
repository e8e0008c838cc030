"""Teledyne PD0 read byte by byte, as the manual tells it: slow, and without our code."""

from typing import NamedTuple


class Literal(NamedTuple):
    """An ensemble whose sum fits: number, coordinates, clock fields, bottom track, other types by id."""

    number: int
    coordinates: int
    clock: tuple[int, ...]
    heading_deg: float
    velocity_mmps: tuple[int, ...] | None
    range_cm: tuple[int, ...] | None
    types: list[tuple[int, bytes]]


def u16(data: bytes, at: int) -> int:
    """Little-endian, unsigned."""
    return data[at] + 256 * data[at + 1]


def i16(data: bytes, at: int) -> int:
    """Little-endian, two's complement."""
    value = u16(data, at)
    return value - 65_536 if value >= 32_768 else value


def literal_ensembles(data: bytes) -> list[Literal]:
    """All ensembles, tried at every byte of the file."""
    found, at = [], 0
    while at + 6 <= len(data):
        if data[at] != 0x7F or data[at + 1] != 0x7F:
            at += 1
            continue
        size = u16(data, at + 2)
        if (
            at + size + 2 > len(data)
            or size < 8
            or sum(data[at : at + size]) % 65_536 != u16(data, at + size)
        ):
            at += 1
            continue
        record = data[at : at + size]
        starts = [u16(record, 6 + 2 * k) for k in range(record[5])]
        types = [(u16(record, a), record[a:b]) for a, b in zip(starts, [*starts[1:], size], strict=True)]
        by_id = dict(types)
        fixed, variable, bottom = by_id[0x0000], by_id[0x0080], by_id.get(0x0600)
        found.append(
            Literal(
                number=u16(variable, 2) + 65_536 * variable[11],
                coordinates=(fixed[25] // 8) % 4,
                clock=tuple(variable[4:11]),
                heading_deg=u16(variable, 18) / 100,
                velocity_mmps=None if bottom is None else tuple(i16(bottom, 24 + 2 * k) for k in range(4)),
                range_cm=None if bottom is None else tuple(u16(bottom, 16 + 2 * k) for k in range(4)),
                types=types,
            )
        )
        at += size + 2
    return found
