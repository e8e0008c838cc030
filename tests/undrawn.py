"""Campaigns and reports without the time that drawing takes."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure


@contextmanager
def figures_undrawn(*, but_svg: bool = False) -> Iterator[None]:
    """Figures are set up but not drawn: an empty picture is written, for tests that judge something else.

    With `but_svg` what a page holds is drawn, and its PNG files are not.
    """
    drawn = Figure.savefig

    def save(figure: Figure, file: Path | BytesIO | StringIO, **settings: Any) -> None:  # noqa: ANN401 - matplotlib's
        if isinstance(file, Path):
            file.touch()
        elif isinstance(file, StringIO) and but_svg:
            drawn(figure, file, **settings)
        elif isinstance(file, StringIO):
            file.write('<?xml version="1.0"?>\n<svg xmlns="http://www.w3.org/2000/svg"></svg>\n')

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", save)
        yield
