"""The progress bar of studies."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from bottomlock.cli.console import errors, interrupted


@contextmanager
def study_bar(out: Path) -> Iterator[Callable[[str, float], None]]:
    """A progress bar, called with the current part and the fraction done; an interruption ends the command."""
    columns = (TextColumn("{task.description:>22}"), BarColumn(), TextColumn("left"), TimeRemainingColumn())
    try:
        with Progress(*columns, console=errors) as bar:
            task = bar.add_task("", total=1.0)
            yield lambda words, fraction: bar.update(task, description=words, completed=fraction)
    except KeyboardInterrupt:
        interrupted(out, kept="parts")
