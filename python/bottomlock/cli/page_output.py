"""Pages on a terminal: the third writer, beside HTML and Markdown."""

from bottomlock.cli.console import console, narrow_table
from bottomlock.pages.page import Part, Table, plain_text


def print_part(part: Part) -> None:
    """Prints the text and the tables of a part, the tables under its heading."""
    for block in part.blocks:
        if isinstance(block, str):
            console.print(plain_text(block).replace("\n", " "))
        elif isinstance(block, Table):
            print_table(plain_text(part.heading), block)


def print_table(title: str, table: Table) -> None:
    """Prints a table, narrow enough for 80 columns where its cells allow."""
    shown = narrow_table(title, table.columns[: table.left], table.columns[table.left :], wraps=True)
    for row in table.rows:
        shown.add_row(*(plain_text(cell) for cell in row))
    console.print(shown)
