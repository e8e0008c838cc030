"""A table that moves its columns together before a cell would be cut."""

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table

_UNBOUNDED = 10_000
"""Width at which every table has the one that its cells ask for."""


class FittedTable(Table):
    """A table whose columns stand two blanks apart, or one where the terminal is too narrow for that."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The lines of the table."""
        asked = self.__rich_measure__(console, options.update(max_width=_UNBOUNDED)).maximum
        if asked > options.max_width:
            self.padding, self.show_edge = 0, False
        yield from super().__rich_console__(console, options)
