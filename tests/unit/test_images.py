"""Figures drawn by two processes: the images that one process draws, in order."""

import shutil
import sys
from typing import IO

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from bottomlock.figures import images
from bottomlock.figures.palette import STYLE, new_figure, png_bytes, svg_text


def _figures() -> list[Figure]:
    """Of unequal size."""
    figures = []
    with mpl.rc_context(STYLE):
        for points in (10, 4000, 20, 30, 2000):
            figure = new_figure()
            figure.subplots().plot(np.arange(points), np.sin(np.arange(points) * points))
            figures.append(figure)
    return figures


def _drawn_here() -> list[images.Images]:
    return [images.Images(svg_text(figure), png_bytes(figure)) for figure in _figures()]


def test_images_are_those_of_one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Byte for byte, in the order of the figures; both processes draw."""
    sizes: list[int] = []
    send = images._send

    def noted(to: IO[bytes], data: bytes) -> None:
        sizes.append(len(data))
        send(to, data)

    monkeypatch.setattr(images, "_send", noted)
    with images.image_process() as draw:
        assert draw(iter(_figures())) == _drawn_here()
    assert 0 < len(sizes) < len(_figures())


def test_a_process_that_fails_costs_time_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends at once: the caller draws all."""
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with images.image_process() as draw:
        assert draw(_figures()) == _drawn_here()
