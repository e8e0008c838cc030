"""The files of a figure, which a page links below it."""

import polars as pl

from bottomlock.figures.images import Images
from bottomlock.files.overwriting import Files
from bottomlock.tables.spreadsheet import csv_text


def figure_files(stem: str, images: Images, data: pl.DataFrame) -> Files:
    """PNG, SVG, PDF, and what the figure shows as CSV with all digits.

    Args:
        stem: path from the page, without an ending.
        images: of the figure, PDF too.
        data: every point of it.
    """
    return {
        f"{stem}.png": images.png,
        f"{stem}.svg": images.svg,
        f"{stem}.pdf": images.pdf,
        f"{stem}.csv": csv_text(data, float_precision=None),
    }
