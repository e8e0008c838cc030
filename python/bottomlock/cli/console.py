"""The consoles of the command, its exit codes, and the tables and messages that commands share."""

import json
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console

from bottomlock.errors import EXIT_INTERRUPTED, Note

if TYPE_CHECKING:
    from rich.console import ConsoleOptions, RenderableType
    from rich.progress import ProgressColumn
    from rich.segment import Segment
    from rich.table import Table
    from rich.text import Text

    from bottomlock.cli.common import Common

EXIT_DEPARTURE = 1
"""The numbers were computed, and differ from the expected verdicts."""

EXIT_NOTHING_VALID = 1
"""A log was converted, and none of its pings has a valid beam."""

EXIT_USAGE = 2

# Of C0, DEL and C1 all but tab and line feed, which rich lays out; and what reverses the order of what is read.
_CONTROLS = {*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A)} - {0x09, 0x0A}
_CODES = {code: chr(code).encode("unicode_escape").decode() for code in _CONTROLS}


class SafeConsole(Console):
    """A console that prints control characters of file names and messages as their codes, so that they do nothing.

    Those of rich itself, of bars and colours, pass.
    """

    def render_str(self, text: str, **settings: Any) -> "Text":  # noqa: ANN401 - as rich has them
        """Text from a string, measured as it will be printed."""
        return super().render_str(text.translate(_CODES), **settings)

    def render(
        self, renderable: "RenderableType", options: "ConsoleOptions | None" = None
    ) -> "Iterator[Segment]":
        """Pieces of anything, for texts that were no strings."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=segment.text.translate(_CODES))


# No markup: a path such as `out[/red]` is printed as it is. What has colours is a `rich.text.Text`.
console = SafeConsole(stderr=False, markup=False, emoji=False)
help_console = Console(stderr=False, markup=False, emoji=False)
errors = SafeConsole(stderr=True, soft_wrap=True, highlight=False, markup=False, emoji=False)


def say(line: object) -> None:
    """Prints a line as it is: paths stay whole, and numbers have no colour."""
    console.print(line, highlight=False, soft_wrap=True)


FILE_COLUMNS = 1000
"""Width of what is printed into a file or a pipe: no line is broken and no cell of a table is cut."""

_state = {"no bars": False}


def bars_are_off() -> bool:
    """Whether progress bars are left out, by --no-progress or --quiet."""
    return _state["no bars"]


def prepare_consoles(common: "Common | None" = None) -> None:
    """Prints notes as one line each, and characters that the terminal does not know as their codes.

    What goes into a file or a pipe is not wrapped, unless COLUMNS says how wide it may be.

    Args:
        common: options of every command; those of a command without any by default.
    """
    if common is not None:
        _state["no bars"] = common.quiet or common.no_progress
        console.quiet = common.quiet
        if common.quiet:
            warnings.simplefilter("ignore", Note)
    if not console.is_terminal:
        asked = os.environ.get("COLUMNS", "")
        console.soft_wrap = not asked.isdigit()
        console.width = int(asked) if asked.isdigit() else FILE_COLUMNS
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    others = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, Note):
            errors.print(f"bottomlock: note: {message}")
        else:
            others(message, category, filename, lineno, file, line)

    warnings.showwarning = show
    if not console.quiet:
        warnings.simplefilter("always", Note)


def note(line: str) -> None:
    """Prints a line about the run, as the program's, beside its results."""
    errors.print(f"bottomlock: {line}")


def print_json(content: object, *, sort_keys: bool = True) -> None:
    """Prints JSON for a program in place of tables for a reader."""
    console.file.write(json.dumps(content, indent=2, sort_keys=sort_keys, ensure_ascii=sort_keys) + "\n")


@contextmanager
def late_bar(label: str, *columns: "ProgressColumn", interrupted: str = "") -> Iterator[Callable[..., None]]:
    """A bar that the first report starts: what is refused before it leaves none on the screen.

    Args:
        label: before the bar.
        columns: after it, before the time left.
        interrupted: what to print after Ctrl-C, which then ends the command; "" for as Python ends it.

    Yields:
        Takes the keywords of `rich.progress.Progress.update`; with `restart` the clock of the rate starts again.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    shown = (TextColumn("{task.description:>12}", markup=False), BarColumn(), *columns, TextColumn("left"))
    bar = Progress(*shown, TimeRemainingColumn(), console=errors, disable=bars_are_off())
    task = bar.add_task(label, total=None)

    def report(*, restart: bool = False, **changes: Any) -> None:  # noqa: ANN401 - as rich has them
        bar.start()
        if restart:
            bar.reset(task, completed=changes["completed"])
        bar.update(task, **changes)

    try:
        try:
            yield report
        finally:
            # Before the last line, which is not the bar's.
            if bar.live.is_started:
                bar.stop()
    except KeyboardInterrupt:
        if not interrupted:
            raise
        errors.print(f"interrupted; {interrupted}")
        sys.exit(EXIT_INTERRUPTED)


def narrow_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence["str | Text"]], *, left: int = 1
) -> "Table":
    """A table that fits 80 columns: so many columns from the left are of words, the others of numbers."""
    from rich import box

    from bottomlock.cli.fitted_table import FittedTable

    table = FittedTable(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for k, name in enumerate(columns):
        table.add_column(name, no_wrap=k == 0, justify="left" if k < left else "right")
    for row in rows:
        table.add_row(*row)
    return table
