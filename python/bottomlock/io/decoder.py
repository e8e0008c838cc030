"""A format is declared once: its bytes, of a file or of a stream that has not ended, to pings; columns at the end.

A decoder is given bytes in any pieces, and its rows depend on the bytes alone, not on how they were cut
(`tests/io/test_framing.py`). A file is fed whole and its rows become columns; a stream gives each ping once it is
whole.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bottomlock.errors import DataError
from bottomlock.io.beam_table import MOST_BEAMS, Account, BeamTable, Recording, WaterTable
from bottomlock.io.binary_records import BLOCK, Binary, Framing, blocks
from bottomlock.io.framing import Framer, Lines
from bottomlock.io.ros_messages import decode, stamp_ns
from bottomlock.io.rows import (
    NAN,
    PLAIN,
    Options,
    make_table,
    make_water,
    raise_if_empty,
    whole_times,
)
from bottomlock.io.sentences import LONGEST_LINE, xor_of

LONGEST_SENDING_NS = 10_000_000_000
"""Between a ping and its sending; a greater difference is no time of sending."""


@dataclass(kw_only=True, slots=True)
class Cells:
    """What the water returned to a ping, by cell.

    Attributes:
        number: (n,) from 1 on.
        range_m: (n,) along the beam, to the middle of the cell.
        velocity: (n, beams) m/s, as `valid`, `quality` and `sd`.
        valid: (n, beams).
        quality: correlation, 0 to 255; None where the records hold none.
        sd: m/s; None where the records hold none.
    """

    number: ArrayLike
    range_m: ArrayLike
    velocity: ArrayLike
    valid: ArrayLike
    quality: ArrayLike | None = None
    sd: ArrayLike | None = None


@dataclass(kw_only=True, slots=True)
class Row:
    """A ping as its record holds it; an empty sequence, and NaN, where it holds nothing.

    Attributes:
        position: of the record.
        time_ns: on the instrument's clock; None until it is known.
        velocity: (n,) m/s, as the following.
        valid: (n,).
        range_m: (n,).
        quality: (n,) as `BeamTable.quality`.
        sd: (n,) m/s.
        instrument: (3,) m/s.
        verdict: as `BeamTable.instrument_valid`.
        arrival_ns: host's clock; None where the record has none.
        stale: the beams repeat those of the record before.
        extra: further columns by name; those of a beam that the table does not have are left out.
        sent_ns: when the record was sent, on the instrument's clock; None where it does not say.
        water_m: range of the layer of the water whose velocities these are, with nothing of the bottom; None for a ping
            of the bottom.
        there: beams, from 1, whose records have come, of formats with a record a beam.
        cells: of the water; None without.
        alone: the record is of the water alone, and no ping.
        group: by what a decoder tells its records apart.
    """

    position: int
    time_ns: int | None
    velocity: list[float]
    valid: list[bool]
    range_m: list[float] = field(default_factory=list)
    quality: list[float] = field(default_factory=list)
    sd: list[float] = field(default_factory=list)
    instrument: list[float] = field(default_factory=lambda: [NAN] * 3)
    verdict: int = -1
    arrival_ns: int | None = None
    stale: bool = False
    extra: dict[str, float] = field(default_factory=dict)
    sent_ns: int | None = None
    water_m: float | None = None
    there: frozenset[int] = frozenset()
    cells: Cells | None = None
    alone: bool = False
    group: int = 0

    @property
    def beams(self) -> int:
        """Number of beams, to the last that is there where each has a record."""
        return max(self.there, default=len(self.velocity))

    def of_axes(self, axes: list[float], **extra: float) -> "Row":
        """The ping without its beams and water, with the instrument's velocity (3,), and further columns."""
        return replace(
            self, velocity=[], valid=[], range_m=[], quality=[], cells=None,
            instrument=axes, verdict=int(all(map(math.isfinite, axes))), extra=self.extra | extra,
        )  # fmt: skip


class Taken(NamedTuple):
    """A record of a stream: the table of its pings, the frame of their velocity, its water, and when it was sent."""

    table: BeamTable
    frame: str
    water: WaterTable | None = None
    sent_ns: int | None = None


@dataclass
class Decoder:
    """Bytes of one format to rows.

    Attributes:
        place: names the file in errors.
        options: of `bottomlock convert`.
        beams: most beams of a record.
        account: what became of every record.
        rows: of the pings so far; of a stream those that have not been taken.
        framer: cuts the bytes into records.
    """

    place: str = "record"
    options: Options = PLAIN
    beams: int = MOST_BEAMS
    unit: ClassVar = "line"
    frame: ClassVar = "none"
    """Of the instrument's own velocity, as `Recording.frame`."""

    def __post_init__(self) -> None:
        """Begins."""
        self.account = Account(unit=self.unit)
        self.rows: list[Row] = []
        self.framer = Framer()
        self._before = ""
        """The beams of the record before."""

    def fresh(self, position: int, beams: object, valid: list[bool]) -> tuple[list[bool], bool]:
        """Which beams are a new measurement, and whether they repeat those of the record before.

        All beams lost read alike from record to record without being a repeat; nor is 1 the same as 1.0.
        """
        before, self._before = self._before, repr(beams)
        stale = any(valid) and before == self._before
        if stale:
            self.account.flag("stale repeat", position)
        return [one and (not stale or self.options.keep_stale) for one in valid], stale

    @property
    def waiting(self) -> bool:
        """Whether a ping is held of which more lines may come."""
        return False

    def feed(self, data: bytes) -> None:
        """Takes bytes."""
        raise NotImplementedError

    def close(self) -> None:
        """Takes the end of a file."""

    def flush(self) -> None:
        """Ends a ping of which no more lines have come for a while."""

    def reset(self) -> None:
        """Forgets a record that has begun: the connection was made anew."""
        self.framer.reset()

    def ready(self) -> list[Row]:
        """The rows that are whole, which are then no longer held."""
        found, self.rows = self.rows, []
        return found

    def take(self) -> list[Taken]:
        """What has become whole since the last call, in the order of the records."""
        found = []
        for row in self.ready():
            table, water = self._made([row], row.beams)
            sent_ns = row.sent_ns
            if (
                sent_ns is not None
                and table.rows
                and abs(sent_ns - int(table.time_ns[0])) > LONGEST_SENDING_NS
            ):
                self.account.flag("sent at a time that is not near its own", row.position)
                sent_ns = None
            found.append(Taken(table, self.frame, water, sent_ns))
        return found

    def _made(self, rows: Sequence[Row], beams: int) -> tuple[BeamTable, WaterTable | None]:
        """The tables of rows: of the pings, and of their water."""
        account, negate = self.account, self.options.negate_beams
        table = table_of([row for row in rows if not row.alone], beams, account, negate=negate)
        return table, water_of(rows, beams, account, negate=negate)

    def recording(self) -> Recording:
        """The table of a file that was fed whole, and what is known of it.

        Raises:
            DataError: where no record is a ping.
        """
        raise NotImplementedError

    def tables(self, what: str, beams: int, rows: Sequence[Row] | None = None) -> Recording:
        """The tables of rows, by default of all, with the account; what is known of the format is left to the caller.

        Raises:
            DataError: where no record is a ping; `what` names one.
        """
        table, water = self._made(self.rows if rows is None else rows, beams)
        raise_if_empty(self.account, self.place, what)
        return Recording(table, self.account, self.frame, clock="", time_of="record", water=water)


class LineDecoder(Decoder):
    """Lines of text, one after the other."""

    longest: ClassVar = LONGEST_LINE
    """Longest line that is read, bytes."""

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self.framer = self._lines = Lines(self.longest)

    def feed(self, data: bytes) -> None:
        """Takes bytes."""
        for position, line in self._lines.numbered(data):
            if len(line) > self.longest:
                self.account.read += 1
                self.account.skip("line too long", position, line)
                self.lost()
            else:
                self.line(position, line)

    def close(self) -> None:
        """Ends the last line."""
        self.feed(b"\n")

    def line(self, position: int, line: bytes) -> None:
        """Takes a line that is not empty, without blanks around it, with its number from 1."""
        raise NotImplementedError

    def lost(self) -> None:
        """A line cannot be read."""


class TableDecoder(LineDecoder):
    """A header with the names of the columns, and a line a record."""

    longest = 1 << 24
    prefix: ClassVar = ""
    """What may stand before a column's name."""
    needed: ClassVar[tuple[str, ...]]
    """Names of the columns that are read."""
    also: ClassVar[tuple[str, ...]] = ()
    """Names of those that may be missing, and are then empty."""
    what: ClassVar[str]
    """The log, in words."""
    _width = 0

    def line(self, position: int, line: bytes) -> None:
        """Takes the header or a record; DataError where the header lacks a column."""
        fields = line.split(b",")
        if not self._width:
            self.header(fields)
            return
        self.account.read += 1
        if len(fields) != self._width:
            self.account.skip("truncated" if len(fields) < self._width else "merged line", position, line)
        elif not self.record(position, [b"" if k is None else fields[k] for k in self._at], line):
            self.account.skip("a field that is no number", position, line)

    def header(self, fields: list[bytes]) -> None:
        """Takes the names of the columns.

        Raises:
            DataError: naming the first that is missing.
        """
        self._width = len(fields)
        names = [name.strip().decode("utf-8", "replace").removeprefix(self.prefix) for name in fields]
        places = {name: k for k, name in enumerate(names)}
        for name in self.needed:
            if name not in places:
                key = f"column '{self.prefix}{name}'"
                raise DataError("is missing", place=self.place, key=key, expected=self.what)
        self._at = [places.get(name) for name in (*self.needed, *self.also)]

    def record(self, position: int, fields: list[bytes], line: bytes) -> bool:
        """Takes the needed fields of a line; false where one is not what it should be."""
        raise NotImplementedError

    def tables(self, what: str, beams: int, rows: Sequence[Row] | None = None) -> Recording:
        """As `Decoder.tables`; a file without a header has no column."""
        if not self._width:
            self.header([])
        return super().tables(what, beams, rows)


class SentenceDecoder(LineDecoder):
    """Sentences `$NAME,fields*HH` of lines; HH is a checksum of what stands between `$` and `*`."""

    form: ClassVar[re.Pattern[bytes]]
    """What they look like, as `pattern`."""
    wanted: ClassVar[tuple[bytes, ...]]
    """Names of those that are read."""

    @staticmethod
    def pattern(name: bytes, longest: int) -> re.Pattern[bytes]:
        """Pattern of sentences: name, at most so many characters behind it, checksum in two hexadecimal digits."""
        return re.compile(rb"\$(%s(?:,[^*$]{0,%d})?)\*([0-9A-Fa-f]{2})" % (name, longest))

    def fits(self, text: bytes, given: int) -> bool:
        """Whether a checksum is that of a text: the exclusive or of NMEA 0183."""
        return xor_of(text) == given

    def sentence(self, position: int, text: bytes) -> None:
        """Takes a wanted sentence, from `$` to `*`."""
        raise NotImplementedError

    def line(self, position: int, line: bytes) -> None:
        """Takes a line; what else there is goes to the account."""
        account = self.account
        account.read += 1
        at = 0
        for match in self.form.finditer(line):
            account.read += at > 0
            at = match.end()
            text, digits = match.groups()
            if not self.fits(text, int(digits, 16)):
                account.skip("bad checksum", position, match.group())
                continue
            name = text.split(b",", 1)[0]
            if name in self.wanted:
                self.sentence(position, text)
            else:
                account.pass_by("$" + name.decode("ascii"), position)
        if not at:
            account.skip("truncated" if b"$" in line else "not a sentence", position, line)
        elif line[at:].strip():
            account.read += 1
            account.skip("truncated", position, line[at:])


class MessageDecoder(Decoder):
    """Messages of ROS 2, which their transport keeps apart, so that each call of `feed` has one."""

    unit = "message"
    frame = "frd"
    type: ClassVar[str]
    """A key of `ros_messages.DEFINITIONS`."""
    later: ClassVar[str | None] = None
    """Another definition of it."""

    def feed(self, data: bytes) -> None:
        """Takes a message as ROS 2 serialises it, in the version that it holds from its first byte to its last."""
        self.account.read += 1
        faults = []
        for definition in dict.fromkeys((None, self.later)):
            try:
                message = decode(data, self.type, definition)
            except DataError as error:
                faults.append(str(error))
            else:
                self.message(self.account.read, stamp_ns(message.header), message)
                return
        self.account.skip(faults[0], self.account.read)

    def message(self, position: int, arrival_ns: int, message: Any) -> None:  # noqa: ANN401 - the library's own object
        """Takes a message with its number and when it came."""
        raise NotImplementedError


class RecordDecoder(Decoder):
    """Binary records."""

    unit = "byte"
    framing: ClassVar[Framing]
    """How the bytes are cut."""

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self.framer = self._binary = Binary(self.framing)

    def feed(self, data: bytes) -> None:
        """Takes bytes."""
        for position, record in self._binary.records(data, self.account):
            self.record(position, record)

    def close(self) -> None:
        """Counts what has begun as cut off."""
        for position, record in self._binary.records(b"", self.account, last=True):
            self.record(position, record)

    def record(self, position: int, data: bytes) -> None:
        """Takes a whole record with its place."""
        raise NotImplementedError


@dataclass(frozen=True)
class Format:
    """A format that is read from bytes.

    Attributes:
        name: as commands and configurations take it.
        title: of the instrument.
        sniff: whether the beginning of a file looks like it.
        decoder: makes its decoder, as `Decoder`.
        live: whether it comes as a stream.
        figures: whether its records can hold a figure of merit of each beam, 1 sigma.
    """

    name: str
    title: str
    sniff: Callable[[bytes], bool]
    decoder: Callable[[str, Options, int], Decoder]
    live: bool = True
    figures: bool = False

    def read(self, data: bytes, place: str, options: Options = PLAIN) -> Recording:
        """The pings of a file.

        Raises:
            DataError: where no record is a ping, with what there was.
        """
        decoder = self.decoder(place, options, MOST_BEAMS)
        for at in blocks(len(data)):
            decoder.feed(data[at : at + BLOCK])
        decoder.close()
        return replace(decoder.recording(), format=self.name)


def table_of(rows: Sequence[Row], beams: int, account: Account, *, negate: bool) -> BeamTable:
    """The table of so many beams of rows whose times are known; of the water, with every beam lost."""
    of_water = np.array([row.water_m is not None for row in rows], dtype=bool)

    def column(values: list[Any], lost: float = NAN) -> np.ndarray:
        found = np.array(values)
        found[of_water] = lost
        return found

    def per_beam(name: str) -> np.ndarray | None:
        values = [getattr(row, name)[:beams] for row in rows]
        return column(values) if values and len(values[0]) == beams else None

    names = rows[0].extra if rows else ()
    return make_table(
        account,
        beams,
        [row.position for row in rows],
        [row.time_ns for row in rows],
        column([row.velocity[:beams] for row in rows]),
        column([row.valid[:beams] for row in rows], lost=False),
        range_m=per_beam("range_m"),
        quality=per_beam("quality"),
        sd=per_beam("sd"),
        instrument=column([row.instrument for row in rows]),
        verdict=column([row.verdict for row in rows], lost=0),
        arrival_ns=[row.arrival_ns for row in rows],
        stale=[row.stale for row in rows],
        extra={
            name: column([row.extra[name] for row in rows])
            for name in names
            if not name.startswith("beam") or int(name[4]) <= beams
        },
        negate=negate,
    )


def water_of(rows: Sequence[Row], beams: int, account: Account, *, negate: bool) -> WaterTable | None:
    """The cells of the rows that have any; None without."""
    found = [(row, cells) for row in rows if (cells := _cells_of(row, beams)) is not None]
    if not found:
        return None
    count = [len(np.asarray(cells.number)) for _, cells in found]

    def column(name: str) -> np.ndarray | None:
        values = [getattr(cells, name) for _, cells in found]
        return None if values[0] is None else np.concatenate([np.asarray(one) for one in values])

    number, range_m, velocity, valid = map(column, ("number", "range_m", "velocity", "valid"))
    assert number is not None
    return make_water(
        account,
        np.repeat([row.position for row, _ in found], count),
        np.repeat(whole_times([row.time_ns for row, _ in found]), count),
        number,
        range_m,  # type: ignore[arg-type]
        velocity,  # type: ignore[arg-type]
        valid,  # type: ignore[arg-type]
        quality=column("quality"),
        sd=column("sd"),
        negate=negate,
    )


def _cells_of(row: Row, beams: int) -> Cells | None:
    """The cells of a row; of one whose velocities are those of a layer, that as cell 1."""
    if row.water_m is None:
        return row.cells
    return Cells(
        number=[1], range_m=[row.water_m], velocity=[row.velocity[:beams]], valid=[row.valid[:beams]]
    )
