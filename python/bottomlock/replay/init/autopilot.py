"""Streams of an autopilot's log, as tables."""

from pathlib import Path

from bottomlock.files.table_file import content
from bottomlock.io import ardupilot, tlog
from bottomlock.replay.init.any_table import AnyTable


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
