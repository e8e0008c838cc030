"""Pages on a terminal: the third writer, beside HTML and Markdown."""

from collections.abc import Sequence

from rich.text import Text

from bottomlock.cli.console import console, narrow_table
from bottomlock.pages.page import Block, Detail, Part, Table, Terms, kind_of, plain_text

COLOURS = {
    "fault": "red", "no": "red", "overconfident": "red",
    "warning": "yellow", "partly": "yellow", "conservative": "yellow",
    "yes": "green", "consistent": "green", "note": "dim",
}  # fmt: skip
"""Of verdicts."""

WIDTH = 80
"""Of a terminal; a table of words whose rows are wider is printed as a list."""


def print_part(part: Part) -> None:
    """Prints the text and the tables of a part, the tables under its heading."""
    print_blocks(part.heading, part.blocks)


def print_blocks(heading: str, blocks: Sequence[Block]) -> None:
    """Prints text and tables, the tables under a heading."""
    for block in blocks:
        if isinstance(block, str):
            console.print(plain_text(block), highlight=False)
        elif isinstance(block, Table):
            print_table(plain_text(heading), block)
        elif isinstance(block, Terms):
            for term, meaning in block.rows:
                console.print(f"{plain_text(term)}: {plain_text(meaning)}")
        elif isinstance(block, Detail):
            print_blocks(heading, block.blocks)


def print_headline(pieces: Sequence[str]) -> None:
    """Prints the one conclusion of a page, its verdict in colour."""
    console.print(Text(" ").join(coloured(piece, "bold") for piece in pieces), highlight=False)


def coloured(cell: str, style: str = "") -> Text:
    """A cell without its marks, a verdict in its colour."""
    return Text(plain_text(cell), f"{style} {COLOURS.get(kind_of(cell), '')}".strip())


def print_table(title: str, table: Table) -> None:
    """Prints a table, narrow enough for 80 columns where its cells allow; one of long words as a list."""
    wide = any(sum(map(len, row)) > WIDTH for row in table.rows)
    if wide and table.left == len(table.columns) > 2:
        for number, (kind, head, *others, last) in enumerate(table.rows, start=1):
            lines = [*map(plain_text, others), f"→ {plain_text(last)}" if last else ""]
            below = "".join(f"\n   {line}" for line in lines if line)
            console.print(Text.assemble(f"{number}. ", coloured(kind), " ", coloured(head, "bold"), below))
        return
    rows = ([coloured(cell) for cell in row] for row in table.rows)
    console.print(narrow_table(title, table.columns, rows, left=table.left))
