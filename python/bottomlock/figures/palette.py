"""One style for every figure: the look of each method, and ink that a page can recolour."""

import io
import re
import zlib
from dataclasses import dataclass
from html import escape
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path

from bottomlock.files.overwriting import Files


@dataclass(frozen=True)
class Stroke:
    """Colour, dash and marker of a method in every figure, and a line on it; the marker is one of matplotlib's."""

    colour: str
    dash: Any
    marker: str
    meaning: str = "a method of one's own"


def _dashes(*lengths: float) -> tuple[int, tuple[float, ...]]:
    """Lengths of strokes and gaps in widths of the line."""
    return 0, lengths


STROKES = {
    "ins": Stroke("#616080", _dashes(1, 1.4), "|", "nothing: the inertial system alone"),
    "lc": Stroke(
        "#7e9a93",
        _dashes(9, 2),
        "s",
        "velocity by least squares from all four beams, none lost: the reference",
    ),
    "tc": Stroke("#9233d2", "-", "o", "one row for every valid beam (tight coupling)"),
    "vb": Stroke(
        "#836258",
        _dashes(5, 1.4, 1, 1.4),
        "v",
        "a virtual beam from the filter's own velocity, assumed independent of it",
    ),
    "nsv": Stroke("#6da163", _dashes(4, 1.6), "^", "assumes that sway is zero, with a small variance"),
    "plcf": Stroke(
        "#164fff", _dashes(2.2, 1.3), "<", "uses only the platform components that the beams determine"
    ),
    "vhv": Stroke(
        "#327cff", _dashes(5, 1.4, 1, 1.4, 1, 1.4), ">", "takes heave from the filter to solve for sway"
    ),
    "elc": Stroke(
        "#e12209", _dashes(5, 3), "D", "for each component the least variance of vb, nsv, plcf and vhv"
    ),
    "info": Stroke("#498fe5", _dashes(1, 2.6), "x", "the observable principal axes through a velocity port"),
    "weak_sway": Stroke(
        "#0b93c5", _dashes(9, 1.6, 2.5, 1.6), "P", "assumes that sway is zero, with a large variance"
    ),
    "sway_current": Stroke(
        "#b93021",
        _dashes(12, 1.6),
        "*",
        "tc, then sway and heave through the water, with the current as states",
    ),
    "dead_reckoning": Stroke(
        "#989544",
        _dashes(2, 1, 6, 1),
        "1",
        "no filter: the DVL's velocity, or the last one, turned by the recorded attitude and summed up",
    ),
}
"""By method: the one table of looks and words. Colours are of middle lightness, so that they are legible on white and
on black; the tests state how far two methods are apart for every eye. Dash and marker are each method's own, so that
colour is never the only difference."""

UNFILLED = "|+x1"
"""Markers that are strokes alone."""

_OTHERS = ("#5c7a99", "#a8683a", "#8a7f1e", "#a35bb0", "#3e8a5a")
_OTHER_MARKERS = ("p", "h", "8", "d", "H")
_OTHER_DASH = _dashes(6, 1.4, 1, 1.4, 1, 1.4, 1, 1.4)
"""Looks of methods of one's own: a colour and a marker by the name, and a dash that no built-in method has."""

INK, FAINT, PAPER = "#1b1f24", "#8b949e", "#ffffff"
"""Text and axes; grid and secondary marks; background. A page replaces the first two by its own colours."""

STYLE: Any = {
    # Axes are placed.
    "figure.constrained_layout.use": False,
    "figure.autolayout": False,
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
    """The look of a method; a method without an entry in `STROKES` gets one derived from its name.

    >>> stroke("tc").colour, stroke("something_new") == stroke("something_new")
    ('#9233d2', True)
    """
    if method in STROKES:
        return STROKES[method]
    number = zlib.crc32(method.encode())
    return Stroke(
        _OTHERS[number % len(_OTHERS)], _OTHER_DASH, _OTHER_MARKERS[number // 7 % len(_OTHER_MARKERS)]
    )


def marks(method: str, points: int, place: float = 0.0, count: int = 5) -> Any:  # noqa: ANN401 - keywords of `plot`
    """Keywords of `plot` for a curve of some points with a few marks of its method.

    Args:
        method: its name.
        points: length of the curve.
        place: 0 to 1: the part of the distance between two marks by which they are shifted, so that the marks of
            curves that lie on one another stand side by side.
        count: number of marks.
    """
    step = max(1, points // count)
    look = stroke(method)
    return {
        "color": look.colour,
        "linestyle": look.dash,
        "marker": look.marker,
        "markersize": 6.5 if look.marker == "*" else 5.0,
        "markeredgewidth": 1.3 if look.marker in UNFILLED else 0.0,
        "markevery": (min(points - 1, round((0.15 + 0.85 * place) * step)), step),
    }


def swatch_svg(method: str) -> str:
    """The look of a method as a small SVG that stands beside its name in a text."""
    look = stroke(method)
    width, middle, scale = 1.6, (13.0, 6.0), 8.0 if look.marker == "*" else 6.4
    dash = "" if look.dash == "-" else " ".join(f"{width * length:g}" for length in look.dash[1])
    mark = MarkerStyle(look.marker)
    outline = mark.get_path().transformed(mark.get_transform())
    parts = []
    for (x, y), code in outline.iter_segments(curves=False, simplify=False):
        if code == Path.CLOSEPOLY:
            parts.append("Z")
        else:
            parts.append(
                f"{'M' if code == Path.MOVETO else 'L'}{middle[0] + scale * x:.1f} {middle[1] - scale * y:.1f}"
            )
    filled = mark.is_filled() and look.marker not in UNFILLED
    inside = look.colour if filled else "none"
    return (
        '<svg class="swatch" viewBox="0 0 26 12" width="26" height="12" aria-hidden="true" focusable="false">'
        f'<path d="M0 6H26" stroke="{look.colour}" stroke-width="{width}" stroke-dasharray="{dash}" fill="none"/>'
        f'<path d="{"".join(parts)}" stroke="{look.colour}" stroke-width="{0 if filled else 1.6}" '
        f'fill="{inside}"/></svg>'
    )


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


def svg_text(figure: Figure, style: Any = STYLE) -> str:  # noqa: ANN401 - matplotlib's
    """The figure as SVG in a style, on white by default; the same figure gives the same text."""
    buffer = io.StringIO()
    with mpl.rc_context(style):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = "\n".join(line.rstrip() for line in buffer.getvalue().splitlines()) + "\n"
    return re.sub(r'(?<= d=")[^"]+', lambda match: _shorter(match[0]), text)


def figure_files(figure: Figure, stem: str) -> Files:
    """The figure as PNG and SVG; `stem` is the path of both without an ending."""
    return {f"{stem}.png": png_bytes(figure), f"{stem}.svg": svg_text(figure)}


def _shorter(path: str) -> str:
    """Path data with one decimal of a point, invisible on paper and screen."""
    return re.sub(r"-?\d+\.\d{2,}", lambda number: f"{float(number[0]):.1f}", path)


def shown_figure(size_in: tuple[float, float]) -> Figure:
    """A new figure without axes, width and height in inches."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 - it chooses a backend; only who plots needs one

    with mpl.rc_context(STYLE):
        return plt.figure(figsize=size_in)


_HEAD = re.compile(r"<svg[^>]*>")
_NAMED = re.compile(r'(?<= id=")[^"]+|(?<=href="#)[^"]+|(?<=url\(#)[^)]+')
_METADATA = re.compile(r"<metadata>.*?</metadata>\s*", re.DOTALL)


def inline_svg(svg: str, name: str, caption: str) -> str:
    """The SVG for a page: ids made unique, ink replaced by the colours of the page, background removed.

    Args:
        svg: from `svg_text`.
        name: letters, digits and underscores, different for each figure of a page.
        caption: what the figure shows, for screen readers.
    """
    head = _HEAD.search(svg)
    assert head is not None  # an SVG
    inside = _METADATA.sub("", svg[head.end() :])
    inside = _NAMED.sub(lambda match: f"{name}-{match[0]}", inside).replace("xlink:href", "href")
    inside = inside.replace(f"fill: {PAPER}", "fill: none").replace(INK, "var(--ink)")
    box = re.search(r' viewBox="[^"]*"', head[0])
    width = _natural_width(head[0])
    return (
        f'<svg role="img" aria-label="{escape(caption)}"{width}{box[0] if box else ""}>'
        f"{inside.replace(FAINT, 'var(--faint)').strip()}"
    )


def _natural_width(head: str) -> str:
    """The width in CSS pixels, so that a figure is shown at the size at which its letters are.

    >>> _natural_width('<svg width="403.2pt">'), _natural_width("<svg>")
    (' width="538"', '')
    """
    said = re.search(r' width="([\d.]+)pt"', head)
    return "" if said is None else f' width="{round(float(said[1]) * 4.0 / 3.0)}"'
