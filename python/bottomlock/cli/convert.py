"""The command `bottomlock convert`: a recorded file of any known format to the beam table."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from bottomlock.cli.common import Force
from bottomlock.cli.console import EXIT_NOTHING_VALID, console, errors, late_bar, narrow_table, say
from bottomlock.cli.parameters import beside, check_ending
from bottomlock.errors import OutputError
from bottomlock.io.rows import PLAIN, Options

if TYPE_CHECKING:
    from rich.table import Table

    from bottomlock.io.beam_table import Account, BeamTable, Reason, Recording, WaterTable

SHOWN = 28
BAR_FROM_BYTES = 50_000_000


def convert(
    file: Path,
    *,
    out: Annotated[Path | None, Parameter(alias=("-o", "--to"))] = None,
    init: bool = False,
    format: Annotated[  # noqa: A002 - the option's name
        str | None,
        Parameter(
            help="Format of the file, by default found from its content: linkquest-csv, nucleus-csv, nortek-ascii, "
            "cerulean-dvkfc, cerulean-dvext, waterlinked-json, waterlinked-serial, nucleus, nortek-dvl, nortek-ad2cp, "
            "wayfinder, pd0, ros, ardupilot-bin, mavlink-tlog, table."
        ),
    ] = None,
    options: Annotated[Options, Parameter(name="*")] = PLAIN,
    force: Force = False,
) -> None:
    """Convert a recorded DVL log to a beam table.

    The commands fix, audit and replay read the table; records that were skipped are counted. Exit code 1 where no ping
    of the table has a valid beam.

    Args:
        file: The log: a file, or the folder of a ROS 2 bag.
        out: Parquet file for the beam table, FILE_beams.parquet by default; an account of the conversion goes beside it
            as JSON. With --init the column map to write, FILE_map.toml by default.
        init: Write a commented column map (TOML) of a CSV or Parquet table.
    """
    from bottomlock.files.overwriting import check_free
    from bottomlock.io.beam_table import sidecar, water_file, write_recording
    from bottomlock.io.formats import read_recording
    from bottomlock.replay.init.column_map import write_map

    out = out or beside(file, "map.toml" if init else "beams.parquet")
    if init:
        write_map(file, out, force=force)
        say(f"wrote {out}; now: bottomlock convert {file} --out beams.parquet --columns {out}")
        return
    check_ending(out, ".parquet")
    _check_account(file, out)
    inputs = [file, *(file.iterdir() if file.is_dir() else ()), *map(Path, filter(None, [options.columns]))]
    check_free(out, sidecar(out), water_file(out), inputs=inputs, force=force)
    with _bar(file):
        recording = read_recording(file, format=format, options=options)
    write_recording(recording, out, source=file)
    print_recording(recording)
    water = "" if recording.water is None else f", {water_file(out).name}"
    say(f"wrote {out}{water} and {sidecar(out).name}")
    missing = _nothing_valid(recording.table)
    if missing:
        errors.print(
            f"bottomlock: {file}: none of its {recording.table.rows} pings has a valid {missing}: the table gives no "
            "velocity; was the instrument in the water, with the bottom in its range?"
        )
        sys.exit(EXIT_NOTHING_VALID)


def _check_account(file: Path, out: Path) -> None:
    """Says why a log in JSON needs a table of another name."""
    from bottomlock.io.beam_table import sidecar

    if sidecar(out).exists() and file.exists() and sidecar(out).samefile(file):
        raise OutputError(
            f"is the log, and the account of {out.name} has the same name",
            place=sidecar(out),
            hint=f"choose another name for --out, such as {out.stem}_beams.parquet",
        )


@contextlib.contextmanager
def _bar(file: Path) -> Iterator[None]:
    """A bar with rate and time left while a long file is read."""
    from rich.progress import DownloadColumn, TransferSpeedColumn

    from bottomlock.io.progress import progress_to

    size = file.stat().st_size if file.is_file() else 0
    if size <= BAR_FROM_BYTES:
        yield
        return
    with (
        late_bar("reading", DownloadColumn(), TransferSpeedColumn()) as report,
        progress_to(lambda reached: report(total=size, completed=reached)),
    ):
        yield


def _nothing_valid(table: BeamTable) -> str:
    """What no ping of a table has: a valid beam, or in a table without beams a valid velocity; "" where one has."""
    import numpy as np

    if table.beams:
        return "" if table.valid.any() else "beam"
    known = np.isfinite(table.instrument_mps).all(axis=1) & (table.instrument_valid != 0)
    return "" if known.any() else "velocity"


def _fates(account: Account) -> Table | None:
    """The records that did not become a plain row, a row per reason; None if there are none."""
    kinds = {"skipped": account.skipped, "flagged": account.flagged, "other": account.other}
    if not any(kinds.values()):
        return None
    rows = [
        [kind, _reason(name, reason), str(reason.count), str(reason.first)]
        for kind, reasons in kinds.items()
        for name, reason in reasons.items()
    ]
    return narrow_table("", ["records", "reason", "count", f"first {account.unit}"], rows, left=2)


def _reason(name: str, reason: Reason) -> str:
    """A reason with the start of its first record; the account beside the table has more."""
    short = reason.detail if len(reason.detail) <= SHOWN else reason.detail[: SHOWN - 1] + "…"
    return f"{name}: {short}" if short else name


def _water_line(water: WaterTable) -> str:
    """What the water returned, in a line."""
    import numpy as np

    pings, cells = len(np.unique(water.time_ns)), np.unique(water.cell)
    of = "cell 1" if len(cells) == 1 else f"cells {cells[0]} to {cells[-1]}"
    return f"water track: {pings} pings, {of}, {int(water.valid.sum())} of {water.valid.size} beam velocities valid"


def print_recording(recording: Recording) -> None:
    """Prints what was read and what was not."""
    import numpy as np

    table, account = recording.table, recording.account
    lines = [
        f"{recording.format}: {account.read} records read, {table.rows} pings kept, {account.lost} skipped"
    ]
    if table.rows:
        seconds = (int(table.time_ns[-1]) - int(table.time_ns[0])) * 1e-9
        lines.append(f"{seconds:.1f} s on the clock: {recording.clock} (time of {recording.time_of})")
    if table.beams:
        counts = np.bincount(table.beams_valid, minlength=table.beams + 1)
        parts = [f"{counts[k]} with {k}" for k in range(table.beams, -1, -1) if counts[k]]
        lines.append(f"beams valid, of {table.beams}: {', '.join(parts)}")
    said = table.instrument_valid
    if (said >= 0).any():
        lines.append(
            f"the instrument's own velocity ({recording.frame}): {(said == 1).sum()} of {table.rows} valid"
        )
    if recording.water is not None:
        lines.append(_water_line(recording.water))
    lines += recording.notes
    if recording.geometry:
        lines.append(f"packaged geometry: {recording.geometry}")
    for line in lines:
        say(line)
    fates = _fates(account)
    if fates is not None:
        console.print(fates)
