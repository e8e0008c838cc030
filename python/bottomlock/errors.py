"""Exceptions of the package: each is one line that names the place, and ends a command with exit code 2."""


class BottomlockError(Exception):
    """Base of every error that the package raises on input."""

    exit_code = 2


class ScenarioError(BottomlockError):
    """A scenario or geometry that is not valid."""


class DataError(BottomlockError):
    """Data (a log, a truth, a table) that are not valid."""


class OutputError(BottomlockError):
    """An output directory that cannot be written or holds something else."""


class EngineError(BottomlockError):
    """An engine that is not available or has failed."""
