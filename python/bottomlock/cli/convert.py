"""The command `bottomlock convert`: a recorded file of any known format to the beam table, with an account."""

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bottomlock.errors import OutputError
from bottomlock.io.beam_table import Account, Reason, Recording, sidecar, write_recording
from bottomlock.io.formats import NAMES, read_recording
from bottomlock.io.rows import Options

console = Console(stderr=False)
SHOWN = 28


def convert(
    file: Path,
    *,
    to: Annotated[
        Path, Parameter(help="Parquet file for the beam table; its account goes beside it as JSON.")
    ],
    format: Annotated[  # noqa: A002 - the option's name
        str | None, Parameter(help=f"Of the file; found from its content by default: {', '.join(NAMES)}.")
    ] = None,
    columns: Annotated[
        Path | None, Parameter(help="TOML file with the column map of a CSV or Parquet table.")
    ] = None,
    topic: Annotated[str | None, Parameter(help="Of a bag that holds several of the message.")] = None,
    instrument_only: Annotated[
        bool, Parameter(negative="", help="Take records without beams, for the instrument's own velocity.")
    ] = False,
    keep_stale: Annotated[
        bool, Parameter(negative="", help="Leave beams valid that repeat the report before, unchanged.")
    ] = False,
    negate_beams: Annotated[
        bool,
        Parameter(negative="", help="Turn the sign of the beams: they are positive away from the bottom."),
    ] = False,
    ignore_checksum: Annotated[
        bool, Parameter(negative="", help="Keep text records whose checksum does not fit, flagged.")
    ] = False,
    force: Annotated[bool, Parameter(negative="", help="Overwrite a table that is there.")] = False,
) -> None:
    """Converts a recorded DVL log to the beam table that fix, audit and replay read, and tells what was skipped.

    Parameters
    ----------
    file
        The log: a file, or the folder of a ROS 2 bag.
    """
    if to.suffix.lower() != ".parquet":
        raise OutputError(f"{to}: expected a name that ends in .parquet")
    for path in (to, sidecar(to)):
        if path.exists() and not force:
            raise OutputError(f"{path}: is there already; --force overwrites it")
        if path.exists() and path.resolve() == file.resolve():
            raise OutputError(f"{path}: is the file to be read")
    options = Options(
        instrument_only=instrument_only,
        keep_stale=keep_stale,
        negate_beams=negate_beams,
        ignore_checksum=ignore_checksum,
        topic=topic,
        columns=None if columns is None else str(columns),
    )
    recording = read_recording(file, format=format, options=options)
    write_recording(recording, to, source=file)
    tell(recording)
    console.print(f"wrote {to} and {sidecar(to).name}", soft_wrap=True, highlight=False)


def _fates(account: Account) -> Table | None:
    """What did not become a plain row, a reason a line; None where there is nothing to tell."""
    kinds = {"skipped": account.skipped, "flagged": account.flagged, "other": account.other}
    if not any(kinds.values()):
        return None
    shown = Table(box=None, pad_edge=False)
    shown.add_column("records")
    shown.add_column("reason")
    shown.add_column("count", justify="right")
    shown.add_column(f"first {account.unit}", justify="right")
    for kind, reasons in kinds.items():
        for name, reason in reasons.items():
            shown.add_row(kind, _reason(name, reason), str(reason.count), str(reason.first))
    return shown


def _reason(name: str, reason: Reason) -> str:
    """A reason, with how the first record of it begins: the account beside the table has more."""
    short = reason.detail if len(reason.detail) <= SHOWN else reason.detail[: SHOWN - 1] + "…"
    return escape(f"{name}: {short}" if short else name)


def tell(recording: Recording) -> None:
    """Prints what was read and what was not."""
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
    lines += recording.corrected
    lines += recording.notes
    if recording.geometry:
        lines.append(f"packaged geometry: {recording.geometry}")
    for line in lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    fates = _fates(account)
    if fates is not None:
        console.print(fates)
