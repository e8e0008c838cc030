"""Exceptions of the package: each is one line that names the place, and ends a command with exit code 2."""


class BottomlockError(Exception):
    """Base of everything that the package refuses."""

    exit_code = 2


class ScenarioError(BottomlockError):
    """A scenario or geometry file that makes no sense."""


class DataError(BottomlockError):
    """Data (a log, a truth, a table) that make no sense."""


class OutputError(BottomlockError):
    """An output directory that cannot be written or belongs to something else."""


class EngineError(BottomlockError):
    """A way to compute that is not there, or has broken down."""
