"""The two consoles of the command, its exit codes, and what an interrupted command prints."""

import sys
from pathlib import Path
from typing import NoReturn

from rich.console import Console

EXIT_USAGE = 2
EXIT_INTERRUPTED = 130

console = Console(stderr=False)
errors = Console(stderr=True, soft_wrap=True, highlight=False)


def interrupted(out: Path) -> NoReturn:
    """Says how to resume, and ends the command."""
    errors.print(f"interrupted; finished chunks are kept in {out}: the same command resumes")
    sys.exit(EXIT_INTERRUPTED)
