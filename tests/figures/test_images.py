"""Figures drawn by two processes: the images that one process draws, in order."""

import shutil
import sys
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from bottomlock.figures import images
from bottomlock.figures.palette import STYLE, new_figure, png_bytes, svg_text


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure and nothing else."""

    figure: Figure


def _drawings() -> list[Drawing]:
    """Of unequal size."""
    drawings = []
    with mpl.rc_context(STYLE):
        for points in (10, 4000, 20, 30, 2000):
            figure = new_figure()
            figure.subplots().plot(np.arange(points), np.sin(np.arange(points) * points))
            drawings.append(Drawing(figure))
    return drawings


def _drawn_here() -> list[images.Images]:
    return [
        images.Images(svg_text(figure), png_bytes(figure)) for figure in (one.figure for one in _drawings())
    ]


@pytest.mark.long
def test_images_are_those_of_one_process() -> None:
    """Byte for byte, in the order of the figures."""
    with images.image_process() as draw:
        drawings = _drawings()
        drawn = draw(iter(drawings))
    assert [one for one, _ in drawn] == drawings
    assert [image for _, image in drawn] == _drawn_here()


@pytest.mark.long
def test_a_process_that_fails_costs_time_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends at once: the caller draws all."""
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with images.image_process() as draw:
        assert [image for _, image in draw(_drawings())] == _drawn_here()
