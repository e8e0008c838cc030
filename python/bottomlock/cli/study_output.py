"""The progress bar of studies, and the command that reproduces one."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from bottomlock.cli.console import errors, interrupted, late_bar


@contextmanager
def study_bar(out: Path) -> Iterator[Callable[[str, float], None]]:
    """A progress bar, called with the current part and the fraction done; an interruption ends the command."""
    columns = (
        TextColumn("{task.description:>22}", markup=False),
        BarColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    try:
        with late_bar(Progress(*columns, console=errors)) as bar:
            task = bar.add_task("", total=1.0)

            def report(words: str, fraction: float) -> None:
                bar.start()
                bar.update(task, description=words, completed=fraction)

            yield report
    except KeyboardInterrupt:
        interrupted(out, kept="parts")


def command_line(name: str, scenarios: Sequence[str], given: Mapping[str, object]) -> str:
    """The command of a study with the options that have a value.

    >>> command_line("masks", ["straight"], {"--world": "survey", "--runs": None})
    'bottomlock masks straight --out DIR --world survey'
    """
    options = [f"{option} {value}" for option, value in given.items() if value is not None]
    return " ".join(["bottomlock", name, *scenarios, "--out DIR", *options])
