"""Figures as images, by two processes: matplotlib takes one core, and images are most of a report's time."""

import gc
import pickle
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from matplotlib.figure import Figure

from bottomlock.figures.palette import png_bytes, svg_text


@dataclass(frozen=True)
class Images:
    """A figure as SVG and as PNG."""

    svg: str
    png: bytes


class Draw(Protocol):
    """What `image_process` gives."""

    def __call__(self, figures: Sequence[Figure]) -> list[Images]:
        """The images of some figures, in order; once."""


@contextmanager
def image_process() -> Iterator[Draw]:
    """Starts a process that draws half of the figures; the images do not depend on who draws them.

    It imports matplotlib while the caller prepares the figures. Where it fails, all are drawn here.
    """
    # Not a pool of `multiprocessing`, which would run the main module of whoever calls this again.
    command = [sys.executable, "-c", f"import sys; sys.path = {sys.path!r}; from {__name__} import _serve; _serve()"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)  # noqa: S603 - our own

    def draw(figures: Sequence[Figure]) -> list[Images]:
        pickled = [pickle.dumps(figure) for figure in figures]
        here, there = _halves([len(data) for data in pickled])
        with ThreadPoolExecutor(max_workers=1) as sender:
            answer = sender.submit(process.communicate, pickle.dumps([pickled[k] for k in there]))
            images = {k: _images(figures[k]) for k in here}
            written, _ = answer.result()
        if process.returncode == 0:
            images |= dict(zip(there, pickle.loads(written), strict=True))  # noqa: S301 - our own
        return [images[k] if k in images else _images(figure) for k, figure in enumerate(figures)]

    try:
        yield draw
    finally:
        process.kill()
        process.communicate()


def _images(figure: Figure) -> Images:
    return Images(svg_text(figure), png_bytes(figure))


def _halves(sizes: Sequence[int]) -> tuple[list[int], list[int]]:
    """Numbers of the figures of each process: the time of one is about as its pickled size.

    >>> _halves([1, 9, 3, 4])
    ([1], [3, 2, 0])
    """
    halves: tuple[list[int], list[int]] = ([], [])
    totals = [0, 0]
    for k in sorted(range(len(sizes)), key=lambda k: -sizes[k]):
        lighter = int(totals[1] < totals[0])
        halves[lighter].append(k)
        totals[lighter] += sizes[k]
    return halves


def _serve() -> None:
    """Reads figures and writes their images."""
    # The collector would walk through every artist, again and again, and free nothing.
    gc.disable()
    figures = pickle.loads(sys.stdin.buffer.read())  # noqa: S301 - the caller's
    sys.stdout.buffer.write(pickle.dumps([_images(pickle.loads(figure)) for figure in figures]))  # noqa: S301
