"""Records of an ArduPilot DataFlash log (.BIN), which describes itself: formats, units and factors are records of it.

A record is A3 95, its type, and the columns that a record FMT of that type lists. FMTU names a unit and a factor for
each column by a character that UNIT and MULT explain. A record has no checksum: one that is not followed by the head of
another, or by the end, may have lost bytes, and is left out.

Source: ArduPilot, AP_Logger/LogStructure.h and the LogStructure.h of each library.
"""

import math
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.account import Account, Flags, Floats, Integers
from bottomlock.io.progress import sparse_reporter

HEAD = b"\xa3\x95"
_FMT, _FMT_BYTES = 128, 89
_PADDING = (b"\xff", b"\x00")
_TYPES = {
    "a": "(32,)<i2", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4", "d": "<f8",
    "g": "<f2", "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4",
    "M": "u1", "q": "<i8", "Q": "<u8",
}  # fmt: skip
_FACTORS = {"c": 1e-2, "C": 1e-2, "e": 1e-2, "E": 1e-2, "L": 1e-7}
_SI = {
    "rad/s": ("rad/s", 1.0), "deg/s": ("rad/s", math.pi / 180.0), "m/s/s": ("m/s/s", 1.0), "rad": ("rad", 1.0),
    "deg": ("rad", math.pi / 180.0), "degheading": ("rad", math.pi / 180.0), "deglatitude": ("rad", math.pi / 180.0),
    "deglongitude": ("rad", math.pi / 180.0), "m": ("m", 1.0), "m/s": ("m/s", 1.0), "Pa": ("Pa", 1.0),
    "s": ("s", 1.0),
}  # fmt: skip
"""Units as a log names them: quantity, and its size in SI."""
_UNKNOWN = {"", "UNKNOWN"}
_INSTANCES = ("I", "C", "Instance")
"""Columns that number the sensors, where no FMTU says which does."""


@dataclass(frozen=True, eq=False)
class Records:
    """Records of one name.

    Attributes:
        place: the file, for errors.
        name: as the log has it: "IMU", "ATT" ....
        formats: character of each column's type, by the column's name.
        values: (n,) with a field for each column, as stored.
        units: of the columns, as the log states them; "" where it does not.
        factors: from a stored to a stated number, by MULT; none for a column without.
        instance: column with the number of the sensor; "" without.
    """

    place: str
    name: str
    formats: dict[str, str]
    values: NDArray[np.void]
    units: dict[str, str] = field(default_factory=dict)
    factors: dict[str, float] = field(default_factory=dict)
    instance: str = ""

    def has(self, *columns: str) -> bool:
        """Whether the records have these columns."""
        return set(columns) <= self.formats.keys()

    def numbers(self, column: str, unit: str) -> Floats:
        """(n,) of a column, in a unit of this file's list; one that the log does not state is taken to be it.

        Raises:
            DataError: where the log states another quantity, or two factors.
        """
        where = f"{self.place}: {self.name}.{column}"
        implied, stated = _FACTORS.get(self.formats[column]), self.factors.get(column)
        if implied is not None and stated is not None and not math.isclose(implied, stated, rel_tol=1e-6):
            raise DataError(
                f"{where} has the factor {stated:g} by its MULT and {implied:g} by its type '{self.formats[column]}'",
                expected="one, is the log damaged?",
            )
        chosen = implied if stated is None else stated
        factor = 1.0 if chosen is None else chosen
        values = np.asarray(self.values[column], dtype=np.float64)
        found = self.units.get(column, "")
        if found not in _UNKNOWN:
            wanted, size = _SI[unit]
            theirs = _SI.get(found)
            if theirs is None or theirs[0] != wanted:
                raise DataError(
                    f"{where} is in {found} by the log's own UNIT",
                    expected=unit,
                    hint="is it a log of ArduPilot?",
                )
            if theirs[1] != size:
                factor *= theirs[1] / size
        # Divided, where that is exact: 1e-7 has no exact binary form, 1e7 has.
        return np.asarray(values / round(1.0 / factor) if _inverse(factor) else values * factor)

    def time_ns(self, column: str = "TimeUS") -> Integers:
        """(n,) since boot, from microseconds."""
        return np.asarray(self.values[column], dtype=np.int64) * 1000

    def instances(self) -> Iterator[tuple[str, "Records"]]:
        """The records of each sensor, with its name: "IMU 0"; "ATT" where there is one only."""
        if not self.instance:
            yield self.name, self
            return
        which = self.values[self.instance]
        for one in np.unique(which):
            yield f"{self.name} {one}", self.where(which == one)

    def where(self, chosen: Flags) -> "Records":
        """Some of the records."""
        return replace(self, values=self.values[chosen])


def _inverse(factor: float) -> bool:
    """Whether a factor is one over a whole number above 1."""
    return 0.0 < factor < 1.0 and math.isclose(round(1.0 / factor) * factor, 1.0, rel_tol=1e-12)


def sniff(head: bytes) -> bool:
    """Whether a file begins with the record FMT of the record FMT."""
    return head.startswith(HEAD + bytes([_FMT, _FMT, _FMT_BYTES])) and head[5:9] == b"FMT\0"


def parse(data: bytes, place: str, account: Account) -> dict[str, Records]:
    """Every record that can be read, by name, with an account of what cannot.

    Raises:
        DataError: for a type that two records FMT describe differently.
    """
    offsets, formats = _offsets(data, place, account)
    raw = np.frombuffer(data, dtype=np.uint8)
    found: dict[str, Records] = {}
    for kind, (name, types, columns) in formats.items():
        if not offsets[kind]:
            continue
        at = np.frombuffer(offsets[kind], dtype=np.int64)
        layout = np.dtype([(column, _TYPES[c]) for column, c in zip(columns, types, strict=True)])
        body = np.lib.stride_tricks.sliding_window_view(raw, layout.itemsize)[at + len(HEAD) + 1]
        values = np.ascontiguousarray(body).view(layout)[:, 0]
        instance = next((column for column in _INSTANCES if column in columns), "")
        found[name] = Records(place, name, dict(zip(columns, types, strict=True)), values, instance=instance)
    return _with_units(found, {kind: name for kind, (name, _, _) in formats.items()})


_Formats = dict[int, tuple[str, str, tuple[str, ...]]]
_OF_FMT = ("FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))


def _offsets(data: bytes, place: str, account: Account) -> tuple[list["array[int]"], _Formats]:
    """Where the records of each type are, and the name, types and columns of each that can be read."""
    offsets = [array("q") for _ in range(256)]
    lengths = [0] * 256
    lengths[_FMT] = _FMT_BYTES
    formats: _Formats = {_FMT: _OF_FMT}
    at, end, first, second = 0, len(data), HEAD[0], HEAD[1]
    # Boards log to pages of a fixed size: from here on there is nothing but filling.
    filling = min(len(data.rstrip(one)) for one in _PADDING)
    reached = sparse_reporter()
    while at < end:
        length = (
            lengths[data[at + 2]] if at + 3 <= end and data[at] == first and data[at + 1] == second else 0
        )
        after = at + length
        whole = length and after <= end
        if whole and (data.startswith(HEAD, after) or after == end or after >= filling):
            kind = data[at + 2]
            account.read += 1
            offsets[kind].append(at)
            if kind == _FMT:
                _define(data[at + 3 : after], place, at, lengths, formats)
            at = after
            reached(at)
            continue
        if at >= filling:
            break
        again = data.find(HEAD, at + 1)
        if length and not whole and again < 0:
            account.skip("breaks off within a record", at)
        elif length and whole:
            account.skip("record that no other follows: bytes are lost or wrong", at, data[at : at + 16])
        else:
            account.skip("bytes of no known record", at, data[at : at + 16])
        at = end if again < 0 else again
    return offsets, formats


def _define(body: bytes, place: str, at: int, lengths: list[int], formats: _Formats) -> None:
    """Takes a record FMT: length of a type, and its columns where all of them are known."""
    kind, length = body[0], body[1]
    name, types, columns = (_text(body[a:b]) for a, b in ((2, 6), (6, 22), (22, 86)))
    names = tuple(columns.split(",")) if columns else ()
    if lengths[kind] and (kind == _FMT or formats.get(kind, (name, types, names)) != (name, types, names)):
        if kind == _FMT:
            return
        raise DataError(
            f"record type {kind} is {formats[kind][0]} and, from byte {at} on, {name}",
            place=place,
            expected="one log in a file, are two joined?",
        )
    lengths[kind] = length
    known = len(names) == len(types) == len(set(names)) and all(c in _TYPES for c in types)
    if known and 3 + sum(np.dtype(_TYPES[c]).itemsize for c in types) == length:
        formats[kind] = (name, types, names)


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("latin-1")


def _with_units(found: dict[str, Records], names: dict[int, str]) -> dict[str, Records]:
    """The records with what FMTU says of their columns."""
    units = {_id(one): _text(bytes(one["Label"])) for one in _rows(found, "UNIT", "Id", "Label")}
    factors = {_id(one): float(f"{float(one['Mult']):.7g}") for one in _rows(found, "MULT", "Id", "Mult")}
    for row in _rows(found, "FMTU", "FmtType", "UnitIds", "MultIds"):
        records = found.get(names.get(int(row["FmtType"]), ""))
        if records is None:
            continue
        for column, unit in zip(records.formats, _text(bytes(row["UnitIds"])), strict=False):
            records.units[column] = units.get(unit, "") if unit not in "-#" else ""
            if unit == "#":
                found[records.name] = records = replace(records, instance=column)
        for column, factor in zip(records.formats, _text(bytes(row["MultIds"])), strict=False):
            if factor not in "-?" and factor in factors:
                records.factors[column] = factors[factor]
    return found


def _rows(found: dict[str, Records], name: str, *columns: str) -> NDArray[np.void] | list[np.void]:
    records = found.get(name)
    return records.values if records is not None and records.has(*columns) else []


def _id(row: np.void) -> str:
    return chr(int(row["Id"]) & 0xFF)
