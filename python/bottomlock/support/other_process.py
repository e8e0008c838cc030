"""A process beside this one, for work that keeps the interpreter busy."""

import contextlib
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def other_process(serve: Callable[[], None]) -> Iterator[subprocess.Popen[bytes]]:
    """Starts a process of this Python that calls a function of a module; it ends with the context at the latest.

    What it prints to the standard error is lost: the caller does without it where it fails. It is not a process of
    `multiprocessing`, which would run the caller's main module again.

    Args:
        serve: called without arguments; it reads the standard input and writes to the standard output.
    """
    call = f"import sys; sys.path = {sys.path!r}; from {serve.__module__} import {serve.__name__} as serve; serve()"
    with subprocess.Popen(  # noqa: S603 - our own code
        [sys.executable, "-c", call],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:
        assert process.stdin is not None
        try:
            yield process
        finally:
            process.kill()
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()
