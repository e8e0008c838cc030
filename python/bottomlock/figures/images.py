"""Figures as images, by two processes: matplotlib takes one core, and images are most of a report's time."""

import contextlib
import gc
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import IO, Protocol, TypeVar

from matplotlib.figure import Figure

from bottomlock.figures.palette import png_bytes, svg_text
from bottomlock.files.overwriting import Files


@contextmanager
def other_process(serve: Callable[[], None]) -> Iterator[subprocess.Popen[bytes]]:
    """Starts a process of this Python that calls a function of a module; it ends with the context at the latest.

    What it prints to the standard error is lost: the caller does without it where it fails. It is not a process of
    `multiprocessing`, which would run the caller's main module again.

    Args:
        serve: called without arguments; it reads the standard input and writes to the standard output.
    """
    call = f"import sys; sys.path = {sys.path!r}; from {serve.__module__} import {serve.__name__} as serve; serve()"
    with subprocess.Popen(  # noqa: S603 - our own code
        [sys.executable, "-c", call],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:
        assert process.stdin is not None
        try:
            yield process
        finally:
            process.kill()
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()


PREPARING = 0.25
"""Time to prepare a figure, by the time to draw it."""


class Drawn(Protocol):
    """What has a figure."""

    @property
    def figure(self) -> Figure:
        """Itself."""


D = TypeVar("D", bound=Drawn)


@dataclass(frozen=True)
class Images:
    """A figure as SVG and as PNG."""

    svg: str
    png: bytes

    def files(self, stem: str) -> Files:
        """Both as files, which a page links below the figure; `stem` is their path from the page, without an ending."""
        return {f"{stem}.png": self.png, f"{stem}.svg": self.svg}


class Draw(Protocol):
    """What `image_process` gives."""

    def __call__(self, drawings: Iterable[D]) -> list[tuple[D, Images]]:
        """Each drawing with its images, in order; to be called once."""


@contextmanager
def image_process() -> Iterator[Draw]:
    """Starts a process that draws half of the figures, and gives a function that draws.

    The process imports matplotlib meanwhile, and draws while the caller prepares the next figures. The images do not
    depend on who draws them; where the process fails, the caller draws all of them.
    """
    with other_process(_serve) as process:
        yield partial(_draw, process)


def _draw(process: subprocess.Popen[bytes], drawings: Iterable[D]) -> list[tuple[D, Images]]:
    assert process.stdin is not None
    assert process.stdout is not None
    kept: list[D] = []
    ours: list[int] = []
    theirs: list[int] = []
    load_here = load_there = 0.0
    with ThreadPoolExecutor(max_workers=1) as sender:
        for k, drawing in enumerate(drawings):
            kept.append(drawing)
            data = pickle.dumps(drawing.figure)
            load_here += PREPARING * len(data)
            # The time of a figure is about as its size.
            if load_there <= load_here:
                sender.submit(_send, process.stdin, data)
                theirs.append(k)
                load_there += len(data)
            else:
                ours.append(k)
                load_here += len(data)
        sender.submit(process.stdin.close)
        images = {k: images_of(kept[k].figure) for k in ours}
        written = process.stdout.read()
    if process.wait() == 0:
        images |= dict(zip(theirs, pickle.loads(written), strict=True))  # noqa: S301 - our own
    return [(one, images[k] if k in images else images_of(one.figure)) for k, one in enumerate(kept)]


def _send(to: IO[bytes], data: bytes) -> None:
    to.write(len(data).to_bytes(8, "big") + data)
    to.flush()


def images_of(figure: Figure) -> Images:
    """The images of a figure, drawn here."""
    return Images(svg_text(figure), png_bytes(figure))


def _serve() -> None:
    """Reads figures until there are no more, then writes their images."""
    # The collector would walk through every artist, again and again, and free nothing.
    gc.disable()
    images = []
    while size := sys.stdin.buffer.read(8):
        figure = pickle.loads(sys.stdin.buffer.read(int.from_bytes(size, "big")))  # noqa: S301 - the caller's
        images.append(images_of(figure))
    sys.stdout.buffer.write(pickle.dumps(images))
