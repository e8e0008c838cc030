"""What the given files hold: the log of a DVL, and every other stream in tables, bags and logs of autopilots."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bottomlock.errors import DataError
from bottomlock.files.table_file import content
from bottomlock.io import ardupilot, ros, table, tlog
from bottomlock.io.beam_table import Recording
from bottomlock.io.columns import column_names
from bottomlock.io.formats import format_of, read_recording
from bottomlock.io.rows import Options
from bottomlock.replay.init.any_table import NAMES, AnyTable, read_any_table
from bottomlock.replay.init.bag import bag_tables
from bottomlock.replay.init.beam_columns import beam_columns
from bottomlock.replay.init.found import Found, find_streams
from bottomlock.replay.init.names import named
from bottomlock.support.nearest import did_you_mean


@dataclass(eq=False)
class Sources:
    """Streams of the given files.

    Attributes:
        recording: of the DVL, with its path; None where the DVL is a velocity in a table.
        log: path of the DVL's log.
        streams: of all tables.
        parts: names of the topics and messages of all logs.
        words: a line for each file: what it holds.
    """

    recording: Recording | None = None
    log: Path | None = None
    streams: list[Found] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    words: list[str] = field(default_factory=list)

    def of(self, *kinds: str) -> list[Found]:
        """The streams of some kinds, in the order of the files."""
        return [one for one in self.streams if one.kind in kinds]


def read_sources(files: Sequence[Path], without: Sequence[str] = ()) -> Sources:
    """Reads every file, and finds its streams.

    Args:
        files: logs, tables and bags.
        without: topics of bags and messages of autopilots' logs that are left out.

    Raises:
        DataError: for no file, one that cannot be read, and one without anything that a case could use; for a name in
            `without` that no file holds.
    """
    if not files:
        raise DataError("no file is named: bottomlock replay --init FILE... looks at logs and tables")
    found = Sources()
    for path in files:
        name = format_of(path)
        if name == ros.NAME:
            _bag(found, path, without)
        elif name in {ardupilot.NAME, tlog.NAME}:
            tables, words = autopilot_tables(path, name)
            _parts(found, path, tables, without)
            found.words += [f"{path.name}: {one}" for one in words]
        elif name is not None and name != table.NAME:
            _log(found, path, name)
        else:
            _table(found, path, read_any_table(path))
    for one in without:
        if one not in found.parts:
            hint = did_you_mean(one, found.parts) or ","
            held = ", ".join(found.parts) or "none"
            raise DataError(
                f"is '{one}'{hint} expected a topic or message of the logs: {held}", key="--without"
            )
    return found


def _take(found: Sources, path: Path, recording: Recording) -> None:
    if found.recording is not None:
        raise DataError(f"is the second log of a DVL, after {found.log}", place=path, hint="name one of them")
    found.recording, found.log = recording, path
    beams = recording.table.beams
    what = f"{recording.table.rows} pings of {beams} beams" if beams else f"{recording.table.rows} velocities"
    found.words.append(f"{path.name}: {what} ({recording.format})")


def _log(found: Sources, path: Path, name: str) -> None:
    try:
        recording = read_recording(path, format=name)
    except DataError as first:
        try:
            recording = read_recording(path, format=name, options=Options(instrument_only=True))
        except DataError:
            raise first from None
    _take(found, path, recording)


def _bag(found: Sources, path: Path, without: Sequence[str]) -> None:
    tables = bag_tables(path)
    try:
        _take(found, path, read_recording(path, format=ros.NAME))
    except DataError as error:
        if not tables:
            raise
        found.words.append(str(error))
    _parts(found, path, tables, without)


def _parts(found: Sources, path: Path, tables: Sequence[AnyTable], without: Sequence[str]) -> None:
    """Takes the tables of a log of several, but those that are left out."""
    found.parts += [one.part for one in tables]
    for one in tables:
        if one.part not in without:
            _table(found, path, one)


def _table(found: Sources, path: Path, one: AnyTable) -> None:
    columns = beam_columns(one)
    if columns is not None:
        recording = table.read_frame(columns.frame, columns.columns, str(path))
        _take(found, path, replace(recording, notes=[*recording.notes, columns.why]))
        found.words.append(f"{path.name}: {columns.why}")
    streams = [
        stream for stream in find_streams(one) if not (columns is not None and stream.kind == "velocity")
    ]
    if not streams and columns is None:
        known = [name for name in one.frame.columns if named(name) is not None]
        which = (
            f"{', '.join(known)} alone make no stream" if known else "none of its columns has a known name"
        )
        raise DataError(
            f"{which} ({column_names(one.frame)})",
            place=path,
            hint=NAMES,
        )
    if streams:
        rows = one.frame.height
        rate = ""
        if streams[0].times.time_ns is not None and rows > 2:
            step_s = float(np.median(np.diff(streams[0].times.time_ns))) * 1e-9
            rate = f", {1.0 / step_s:.4g} Hz" if step_s > 0.0 else ""
        kinds = ", ".join(stream.kind for stream in streams)
        where = f" {one.part}" if one.part else ""
        said = f"; {one.remark}" if one.remark else ""
        found.words.append(f"{path.name}{where}: {kinds} ({rows} rows{rate}){said}")
    found.streams += streams


def autopilot_tables(path: Path, name: str) -> tuple[list[AnyTable], list[str]]:
    """A table for each message and sensor, and what has to be said of the log.

    Args:
        path: the log.
        name: of its format, `ardupilot.NAME` or `tlog.NAME`.

    Raises:
        DataError: for a log that cannot be read, or has no stream.
    """
    reader = ardupilot if name == ardupilot.NAME else tlog
    log = reader.streams(content(path, reader.TIMES_ITS_SIZE), str(path))
    tables = [
        AnyTable(
            path,
            one.to_frame(),
            plain=False,
            units={},
            part=one.name,
            remark=one.remark,
            independent=one.independent,
        )
        for one in log.streams
    ]
    return tables, [f"clock: {log.clock}", *log.notes]
