"""A page as files, beside each other."""

from pathlib import Path

from bottomlock.files.atomic_write import write_text
from bottomlock.pages.page import Page, html, markdown


def write_pages(stem: Path, page: Page) -> None:
    """Writes `stem`.md and `stem`.html."""
    write_text(stem.with_name(f"{stem.name}.md"), markdown(page))
    write_text(stem.with_name(f"{stem.name}.html"), html(page))
