"""Sphinx: beside each link of the gallery the first figure of its page, as it was drawn at this build."""

from __future__ import annotations

from pathlib import PurePosixPath

from docutils import nodes
from sphinx.application import Sphinx

GALLERY = "gallery/index"


def thumbnails(app: Sphinx, doctree: nodes.document, name: str) -> None:
    """Puts the first figure of each page into its row of the gallery's table, which becomes a table of cards.

    Raises:
        LookupError: for a page without a figure.
    """
    if name != GALLERY:
        return
    (table,) = doctree.findall(nodes.table)
    table["classes"].append("gallery")
    (body,) = table.findall(nodes.tbody)
    for row in body.findall(nodes.row):
        link = next(iter(row.findall(nodes.reference)))
        page = f"gallery/{PurePosixPath(link['refuri']).stem}"
        figure = next(iter(app.env.get_doctree(page).findall(nodes.image)), None)
        if figure is None:
            raise LookupError(f"{page} has no figure for the gallery")
        # The words beside it say what it is of.
        picture = nodes.image(uri=figure["uri"], candidates=figure["candidates"], alt="", loading="lazy")
        shown = nodes.reference("", "", picture, refuri=link["refuri"], internal=True, classes=["thumbnail"])
        next(iter(row.findall(nodes.entry))).insert(0, nodes.paragraph("", "", shown))


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers it; Sphinx calls this."""
    app.connect("doctree-resolved", thumbnails)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
