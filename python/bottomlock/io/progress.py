"""How far the reading of a file is: readers tell the byte they have reached, a command shows it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_reached: ContextVar[Callable[[int], None] | None] = ContextVar("reached", default=None)


@contextmanager
def progress_to(report: Callable[[int], None]) -> Iterator[None]:
    """Within it, readers call `report` with the number of bytes that they have searched, block by block."""
    token = _reached.set(report)
    try:
        yield
    finally:
        _reached.reset(token)


def reporter() -> Callable[[int], None] | None:
    """What a reader calls with the bytes it has read; None where nobody listens."""
    return _reached.get()


def sparse_reporter(every: int = 1 << 22) -> Callable[[int], None]:
    """As `reporter`, for a reader of small records: it reports one position in `every` bytes."""
    report, reported = reporter(), 0

    def reached(at: int) -> None:
        nonlocal reported
        if report is not None and at > reported + every:
            reported = at
            report(at)

    return reached
