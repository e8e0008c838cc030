"""Figures drawn by two processes: the images that one process draws, in order."""

import subprocess
import sys

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


def test_images_are_those_of_one_process() -> None:
    """Byte for byte, in the order of the figures; both processes draw."""
    shares: list[bytes] = []
    send = images._send
    with pytest.MonkeyPatch.context() as patch, images.image_process() as draw:
        patch.setattr(images, "_send", lambda to, data: (shares.append(data), send(to, data)))
        assert draw(iter(_figures())) == _drawn_here()
    assert 0 < len(shares) < len(_figures())


def test_a_process_that_fails_costs_time_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed, or a Python that does not start: the caller draws all."""
    start = subprocess.Popen

    def dead(_: list[str], **settings: int) -> "subprocess.Popen[bytes]":
        process = start([sys.executable, "-c", "import os; os._exit(9)"], **settings)
        process.wait()
        return process

    monkeypatch.setattr(images.subprocess, "Popen", dead)
    with images.image_process() as draw:
        assert draw(_figures()) == _drawn_here()
