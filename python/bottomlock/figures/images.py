"""Figures as images."""

from dataclasses import dataclass

from matplotlib.figure import Figure

from bottomlock.figures.palette import png_bytes, svg_text
from bottomlock.files.overwriting import Files


@dataclass(frozen=True)
class Images:
    """A figure as SVG and as PNG."""

    svg: str
    png: bytes

    def files(self, stem: str) -> Files:
        """Both as files, which a page links below the figure; `stem` is their path from the page, without an ending."""
        return {f"{stem}.png": self.png, f"{stem}.svg": self.svg}


def images_of(figure: Figure) -> Images:
    """The images of a figure."""
    return Images(svg_text(figure), png_bytes(figure))
