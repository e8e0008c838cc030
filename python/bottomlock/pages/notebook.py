"""A table of a page as a notebook shows it."""

from bottomlock.pages.page import Table, plain_text
from bottomlock.support.notebook import html_table


def notebook_table(table: Table) -> str:
    """The table as HTML without a style of its own, without marks."""
    rows = [[plain_text(cell) for cell in row] for row in table.rows]
    return html_table(plain_text(table.caption), rows, [plain_text(name) for name in table.columns])
