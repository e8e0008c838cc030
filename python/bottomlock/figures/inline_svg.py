"""A figure within a page: an SVG in the page's colours, with no more points than a screen can show."""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from html import escape

import numpy as np
from numpy.typing import NDArray

from bottomlock.figures.palette import FAINT, INK, PAPER

TOLERANCE_PT = 0.15
"""Greatest distance of a point that is left out from the line that is drawn: a fifth of a pixel of a figure shown at
its greatest width. The files of a figure keep every point."""

_REFERENCE = re.compile(r"#([\w.-]+)")
_COMMANDS = re.compile(r"(?:L[^MLQCZz]*)+|[MQC][^MLQCZz]*|[Zz]")
_MOVED = re.compile(r"translate\((\S+?)(?: (\S+?))?\)")

_Step = tuple[str, NDArray[np.int64]]


def inline_svg(svg: str, name: str, words: str) -> str:
    """The SVG for a page: ids made unique, ink replaced by the colours of the page, background removed.

    Curves are thinned to `TOLERANCE_PT`, coordinates are written in tenths of a point relative to one another, and what
    nothing refers to is left out.

    Args:
        svg: from `palette.svg_text`.
        name: letters, digits and underscores, different for each figure of a page.
        words: what the figure shows, for screen readers.
    """
    top = ET.fromstring(svg[svg.index("<svg") :].replace("xlink:href", "href"))  # noqa: S314 - our own
    uses = {
        found
        for element in top.iter()
        for key, value in element.attrib.items()
        if key == "href" or "url(#" in value
        for found in _REFERENCE.findall(value)
    }
    ids = {one: f"{name}-{k}" for k, one in enumerate(sorted(uses))}
    glyphs = {one: f"{name}-{one}" for one in uses if "DejaVu" in one}
    box = f' viewBox="{top.attrib["viewBox"]}"' if "viewBox" in top.attrib else ""
    inside = "".join(part for child in top for part in _written(child, ids | glyphs))
    width = _natural_width(top.attrib.get("width", ""))
    return f'<svg role="img" aria-label="{escape(words)}"{width}{box}>{inside}</svg>'


def _natural_width(said: str) -> str:
    """The width in CSS pixels, so that a figure is shown at the size at which its letters are.

    >>> _natural_width("403.2pt"), _natural_width("")
    (' width="538"', '')
    """
    return f' width="{round(float(said.removesuffix("pt")) * 4.0 / 3.0)}"' if said.endswith("pt") else ""


def _written(element: ET.Element, ids: dict[str, str]) -> Iterator[str]:
    """An element and what it holds; of a group that says nothing, what it holds."""
    tag = element.tag.rpartition("}")[2]
    if tag == "metadata":
        return
    said = "".join(f' {key}="{escape(value)}"' for key, value in _attributes(tag, element.attrib, ids))
    inside = (element.text or "").strip() + "".join(
        part for child in element for part in _written(child, ids)
    )
    if tag in {"g", "defs"} and not (said and inside):
        yield inside if tag == "g" or not inside else f"<defs>{inside}</defs>"
    else:
        yield f"<{tag}{said}>{inside}</{tag}>" if inside else f"<{tag}{said}/>"


def _attributes(tag: str, given: dict[str, str], ids: dict[str, str]) -> Iterator[tuple[str, str]]:
    for key, value in given.items():
        if key == "id":
            if value in ids:
                yield key, ids[value]
        elif key == "d":
            yield key, compact_path(value)
        elif key == "style":
            yield key, _coloured(value)
        elif tag == "use" and key == "transform" and _MOVED.fullmatch(value):
            x, y = _MOVED.fullmatch(value).groups()  # type: ignore[union-attr]
            yield from (
                (axis, _tenths(one)) for axis, one in (("x", x), ("y", y or "0")) if float(one) != 0.0
            )
        elif key == "transform":
            yield key, _MOVED.sub(_moved, value)
        elif key in {"x", "y"}:
            yield key, _tenths(value)
        else:
            yield key, _REFERENCE.sub(lambda found: f"#{ids[found[1]]}", value) if "#" in value else value


def _moved(found: re.Match[str]) -> str:
    return f"translate({_tenths(found[1])} {_tenths(found[2] or '0')})"


def _tenths(number: str) -> str:
    """A number with one decimal.

    >>> _tenths("63.623047"), _tenths("0.04"), _tenths("12.0")
    ('63.6', '0', '12')
    """
    return f"{round(float(number), 1) + 0.0:g}" if abs(float(number)) < 1e5 else number


def _coloured(style: str) -> str:
    """A style without blanks, its ink and paper those of the page."""
    style = re.sub(r"([:;]) ", r"\1", style).replace(f"fill:{PAPER}", "fill:none")
    return style.replace(INK, "var(--ink)").replace(FAINT, "var(--faint)")


def compact_path(data: str) -> str:
    """The data of a path, thinned, in tenths and relative.

    >>> compact_path("M 10 10 L 20 10.04 L 30 10 L 30 20.5 z")
    'M10 10l20 0 0 10.5z'
    """
    text, last, at = [], "", np.zeros(2, dtype=np.int64)
    for command, points in _thinned(_steps(data)):
        if command == "z":
            text.append("z")
            last = command
            continue
        # A path begins at an absolute place; what follows is relative to the point before it.
        name = "M" if not text else command.lower()
        text.append("" if name == last else name)
        start = np.concatenate([at[None], points[:-1]]) if name == "l" else at
        shifts = (points if name == "M" else points - start).ravel()
        at = points[-1]
        text.append(_numbers(shifts, glued=name != last))
        last = name
    return "".join(text)


def _numbers(tenths: NDArray[np.int64], *, glued: bool) -> str:
    """Whole tenths as decimals, parted by a blank where there is no minus."""
    words = []
    for k, one in enumerate(tenths.tolist()):
        whole, part = divmod(abs(one), 10)
        size = f"{whole}.{part}" if part and whole else f".{part}" if part else f"{whole}"
        sign = "-" if one < 0 else "" if glued and k == 0 else " "
        words.append(sign + size)
    return "".join(words)


def _steps(data: str) -> list[_Step]:
    """Commands with their points (n, 2) in tenths; lines that follow one another are one step."""
    steps = []
    for found in _COMMANDS.finditer(data):
        words = found[0].replace("L", " ")
        command = "L" if found[0][0] == "L" else words[0].upper()
        tenths = np.rint(np.array(words.lstrip("MQCZz").split(), dtype=float) * 10.0).astype(np.int64)
        steps.append(("z" if command == "Z" else command, tenths.reshape(-1, 2)))
    return steps


def _thinned(steps: list[_Step]) -> Iterator[_Step]:
    """The same with fewer points on lines."""
    at = np.zeros((1, 2), dtype=np.int64)
    for command, points in steps:
        if command == "L" and len(points) > 1:
            line = np.concatenate([at, points])
            yield command, line[_kept(line, 10.0 * TOLERANCE_PT)][1:]
        else:
            yield command, points
        at = points[-1:] if len(points) else at


def _kept(line: NDArray[np.int64], tolerance: float) -> NDArray[np.bool_]:
    """Which points of a line (n, 2) remain so that none is farther than the tolerance from what is drawn.

    From a point that stays, the next one is the last that a straight line reaches while it passes every point between
    within the tolerance: each of those leaves a sector of directions, and the sectors are intersected.
    """
    x, y = line[:, 0].tolist(), line[:, 1].tolist()
    kept = np.zeros(len(x), dtype=bool)
    at = 0
    while at < len(x) - 1:
        kept[at] = True
        low, high, first, farthest, last = -math.pi, math.pi, None, 0.0, at + 1
        for k in range(at + 1, len(x)):
            distance = math.hypot(x[k] - x[at], y[k] - y[at])
            if distance < farthest - tolerance:
                break
            if distance > tolerance:
                direction = math.atan2(y[k] - y[at], x[k] - x[at])
                first = direction if first is None else first
                turned = math.remainder(direction - first, 2.0 * math.pi)
                if not low <= turned <= high:
                    break
                half = math.asin(tolerance / distance)
                low, high = max(low, turned - half), min(high, turned + half)
            farthest, last = max(farthest, distance), k
        at = last
    kept[-1] = True
    return kept
