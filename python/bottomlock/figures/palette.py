"""One style for every figure: colour and dash of each method, and ink that a page can recolour."""

import io
import re
import zlib
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Stroke:
    """Colour and dash of a method in every figure."""

    colour: str
    dash: Any = "-"


_DOTS, _DASHES, _DASH_DOT, _LONG = (0, (1, 1.4)), (0, (4, 1.6)), (0, (4, 1.4, 1, 1.4)), (0, (8, 2))

STROKES = {
    "ins": Stroke("#999194"),
    "lc": Stroke("#696c70", _LONG),
    "tc": Stroke("#5394ec"),
    "vb": Stroke("#fa632e"),
    "nsv": Stroke("#129e64"),
    "plcf": Stroke("#b24397"),
    "vhv": Stroke("#a05200", _DASH_DOT),
    "elc": Stroke("#75a131", _DASHES),
    "vb_exact": Stroke("#4f65c6", _DASHES),
    "info": Stroke("#4191bc", _DOTS),
    "weak_sway": Stroke("#8952ff"),
    "sway_current": Stroke("#f64f60"),
    "consistent": Stroke("#7d6331", _DASHES),
}
"""By method. Colours are of middle lightness, so that they are legible on white and on black, and distinct for
colour-blind readers (the tests state how far); methods that coincide (tc, vb_exact, info; nsv, elc) differ in dash."""

_OTHERS = ("#5c7a99", "#a8683a", "#8a7f1e", "#a35bb0", "#3e8a5a")

INK, FAINT, PAPER = "#1b1f24", "#8b949e", "#ffffff"
"""Text and axes; grid and secondary marks; background. A page replaces the first two by its own colours."""

STYLE: Any = {
    "svg.hashsalt": "bottomlock",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.8,
    "axes.titlesize": 10.0,
    "axes.labelsize": 10.0,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": FAINT,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "figure.facecolor": PAPER,
    "axes.facecolor": "none",
    "savefig.facecolor": PAPER,
    "lines.solid_capstyle": "round",
    "path.simplify": True,
}

WIDTH_IN, HEIGHT_IN = 5.6, 4.1
"""Small enough that the text is legible on a telephone."""


def stroke(method: str) -> Stroke:
    """Colour and dash of a method; a method without an entry in `STROKES` gets one derived from its name.

    >>> stroke("tc").colour, stroke("something_new") == stroke("something_new")
    ('#5394ec', True)
    """
    if method in STROKES:
        return STROKES[method]
    return Stroke(_OTHERS[zlib.crc32(method.encode()) % len(_OTHERS)], (0, (6, 1.4, 1, 1.4, 1, 1.4)))


def draw_order(methods: list[str]) -> list[str]:
    """The methods with solid lines first, so that a dashed line shows on a solid one that it coincides with."""
    return sorted(methods, key=lambda method: stroke(method).dash != "-")


def new_figure(height_in: float = HEIGHT_IN, width_in: float = WIDTH_IN) -> Figure:
    """An empty figure; to be called inside `mpl.rc_context(STYLE)`."""
    return Figure(figsize=(width_in, height_in))


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG on white."""
    buffer = io.BytesIO()
    with mpl.rc_context(STYLE):
        figure.savefig(buffer, format="png", dpi=200, metadata={"Software": None})
    return buffer.getvalue()


def svg_text(figure: Figure) -> str:
    """The figure as SVG on white; the same figure gives the same text."""
    buffer = io.StringIO()
    with mpl.rc_context(STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = "\n".join(line.rstrip() for line in buffer.getvalue().splitlines()) + "\n"
    return re.sub(r'(?<= d=")[^"]+', lambda match: _shorter(match[0]), text)


def inline_svg(svg: str, name: str, words: str) -> str:
    """The SVG for a page: ids made unique, ink replaced by the colours of the page, background removed.

    Args:
        svg: from `svg_text`.
        name: letters, digits and underscores, different for each figure of a page.
        words: what the figure shows, for screen readers.
    """
    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r' width="[^"]*pt" height="[^"]*pt"', "", body, count=1) if "pt" in body[:400] else body
    body = re.sub(r'\bid="', f'id="{name}-', body)
    body = re.sub(r'href="#', f'href="#{name}-', body)
    body = re.sub(r"url\(#", f"url(#{name}-", body)
    body = (
        body.replace(f"fill: {PAPER}", "fill: none").replace(INK, "var(--ink)").replace(FAINT, "var(--faint)")
    )
    quoted = words.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    return body.replace("<svg", f'<svg role="img" aria-label="{quoted}"', 1)


def _shorter(path: str) -> str:
    """Path data with two decimals of a point, invisible on paper and screen."""
    return re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", path)
