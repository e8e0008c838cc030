"""Sphinx: mathematics as MathML, made when the site is built: no script, no request, and it prints.

On a forge the same `$...$` is drawn by the forge.
"""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx

_TAG = re.compile(r"\s*\\tag\{([^}]*)\}\s*\Z")


def mathml(latex: str, *, display: bool) -> str:
    r"""The MathML of a formula; `\tag{1}` at its end is its number, at the end of the line.

    Raises:
        ValueError: for a command or an alignment that would not be drawn.
    """
    tag = _TAG.search(latex)
    drawn: str = convert(_TAG.sub("", latex).strip(), display="block" if display else "inline")
    drawn = drawn.replace("<mo>&#x0005E;</mo>", '<mo stretchy="false">&#x0005E;</mo>')  # a hat of one letter
    unknown = re.search(r"\\\w+|<mi>&</mi>", drawn)
    if unknown:
        raise ValueError(f"{latex.strip()}: '{unknown[0]}' has no MathML; write it with other commands")
    if not display:
        return drawn
    number = f'<span class="number">({tag[1]})</span>' if tag else ""
    return f'<div class="math">{drawn}{number}</div>\n'


def inline(writer: Any, node: nodes.math) -> None:  # noqa: ANN401 - Sphinx's writer of HTML
    """Writes a formula within a line."""
    writer.body.append(mathml(node.astext(), display=False))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.math_block) -> None:  # noqa: ANN401 - Sphinx's writer of HTML
    """Writes a formula on its own."""
    writer.body.append(mathml(node.astext(), display=True))
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers it; Sphinx calls this."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
