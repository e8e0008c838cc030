"""Pings of a live DVL: records cut from the byte stream, and each read by the reader of its format.

A ping is what `bottomlock convert` makes of the same bytes, with three differences that follow from not knowing the
future: a ping whose time does not rise is handed on (the engine counts it), a Water Linked serial report is taken as
soon as its fourth transducer is in, and a sum of intervals begins with the first report after the start. Water that a
record of its own holds comes with the next ping of the bottom.
"""

import re
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beam_table import BeamTable, WaterTable, joined
from bottomlock.io.formats import LIVE
from bottomlock.io.rows import PLAIN, Options, RecordOptions
from bottomlock.live.readings import Reader
from bottomlock.recordings.readings import Ping

_MOST_HELD = 16
"""Records of the water that are held for the next ping of the bottom; of more the last."""


@dataclass
class PingReader(Reader[Ping]):
    """The pings of a byte stream in one format.

    Args:
        format: a key of `io.formats.LIVE`.
        beams: number of beams of the geometry.
        options: of the reader.
    """

    format: str
    beams: int
    options: Options = PLAIN

    def __post_init__(self) -> None:
        """Chooses framer and reader.

        Raises:
            DataError: for a format that is no stream of beams.
        """
        if self.format not in LIVE:
            raise DataError(
                f"format '{self.format}' is no stream of beams", expected=f"one of {', '.join(LIVE)}"
            )
        chosen = LIVE[self.format]
        assert chosen.stream is not None
        self._read, self._stream = chosen.read, chosen.stream
        self.framer = self._cut = self._stream.frame(self.beams)
        # A report whose transducers are all missing is a ping with all beams lost, not a log without beams.
        only = self._stream.lost or self.options.instrument_only
        self._settings = RecordOptions(**asdict(replace(self.options, instrument_only=only)))
        self._water: list[WaterTable] = []
        self._before: tuple[bytes, ...] | None = None
        self._absolute: bool | None = None
        self._sum_ns = 0

    def feed(self, data: bytes) -> list[Ping]:
        """The pings that `data` completes."""
        return [ping for record in self._cut.feed(data) for ping in self._pings(record)]

    def flush(self) -> list[Ping]:
        """The ping whose lines are held, where no more of them have come for a while."""
        return [ping for record in self._cut.flush() for ping in self._pings(record)]

    def _pings(self, record: bytes) -> list[Ping]:
        self.records += 1
        if self._stream.kind is not None and record[2] not in {self._stream.kind, *self._stream.water}:
            self.skipped.add("another kind of record")
            return []
        try:
            recording = self._read(record, "record", self._settings)
        except DataError as error:
            self.skipped.add(_reason(error))
            return []
        table = recording.table
        if recording.water is not None:
            self._water = [*self._water[1 - _MOST_HELD :], recording.water]
        if not table.rows:
            return []
        if table.beams > self.beams:
            self.skipped.add(f"{table.beams} beams, the geometry has {self.beams}")
            return []
        absolute = recording.time_of == "validity" or not self._stream.sums
        if self._absolute is None:
            self._absolute = absolute
        if absolute != self._absolute:
            self.skipped.add(
                "no time of validity" if self._absolute else "a time of validity among intervals"
            )
            return []
        found = []
        sum_ns = self._sum_ns
        water, self._water = self._water, []
        for row in range(table.rows):
            time_ns = int(table.time_ns[row])
            if not absolute:
                # The reader's sum begins with this record's first interval.
                time_ns = self._sum_ns = sum_ns + time_ns
            ping = self._ping(table, row, time_ns, record, only=table.rows == 1)
            # Other axes are not those of the beams' directions.
            own = ping.instrument_mps if recording.frame == "frd" else np.full(3, np.nan)
            found.append(replace(ping, instrument_mps=own))
        if water and found and absolute:
            found[-1] = replace(found[-1], water=joined(water))
        return found

    def _ping(self, table: BeamTable, row: int, time_ns: int, record: bytes, *, only: bool) -> Ping:
        valid = _padded(table.valid[row], self.beams, fill=False)
        stale = False
        if self._stream.repeats:
            block = tuple(
                column[row].tobytes()
                for column in (table.velocity_mps, table.range_m, table.quality, *_noise(table))
            )
            stale = block == self._before and bool(valid.any())
            self._before = block
            if stale and not self.options.keep_stale:
                valid = np.zeros_like(valid)
        pattern = self._stream.transmission
        sent = pattern.search(record) if pattern is not None and only else None
        flag = int(table.instrument_valid[row])
        return Ping(
            time_ns=time_ns,
            transmission_ns=int(sent.group(1)) * 1000 if sent and self._absolute else time_ns,
            velocity_mps=_padded(table.velocity_mps[row], self.beams, fill=np.nan),
            valid=valid,
            sd_mps=_padded(table.sd_mps[row], self.beams, fill=np.nan),
            range_m=_padded(table.range_m[row], self.beams, fill=np.nan),
            instrument_mps=table.instrument_mps[row],
            instrument_valid=None if flag < 0 else bool(flag),
            stale=stale,
        )


def _noise(table: BeamTable) -> list[NDArray[np.float64]]:
    return [table.extra[name] for name in table.extra if name.endswith("_noise_dbm")]


def _padded(values: NDArray, beams: int, *, fill: float | bool) -> NDArray:  # type: ignore[type-arg]
    """A row with as many beams as the geometry: what a record does not have is lost."""
    if len(values) == beams:
        return values
    return np.concatenate([values, np.full(beams - len(values), fill, dtype=values.dtype)])


def _reason(error: DataError) -> str:
    """Why a record gave no ping, without what differs from record to record."""
    text = str(error).removeprefix("record: ")
    skipped = re.search(r"skipped: [0-9]+ (.*?) \(first", text)
    if skipped:
        return skipped.group(1)
    return re.sub(r"[0-9]+", "…", text)[:80]
