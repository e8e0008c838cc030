"""Draw what the first page shows: a vehicle with its four beams, two of them lost, and the mark of the site.

    python tools/site_drawings.py                 # docs/figures/vehicle_*.svg, docs/_static/mark.svg

The beams are those of an x-Janus, tilted by 30° so that they are seen apart, in an oblique projection.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bottomlock
from bottomlock.files.atomic_write import write_text

DOCS = Path(__file__).resolve().parent.parent / "docs"
BEAMS_P = np.asarray(bottomlock.BeamGeometry.janus(np.deg2rad(30.0)).directions_p)
"""Unit vectors of beams 1 to 4: forward, starboard, down."""
LOST = (1, 4)
"""The two that look ahead, over the edge of the bottom."""

SCHEMES = {
    "light": {
        "ink": "#1b1f24",
        "soft": "#57606a",
        "hull": "#f2c14e",
        "bottom": "#d9cfbd",
        "cliff": "#b5a78c",
    },
    "dark": {"ink": "#e6edf3", "soft": "#9198a1", "hull": "#e3b341", "bottom": "#4a4438", "cliff": "#2f2b23"},
}
RETURNED, GONE = "#3b82f6", "#e0562f"
DEPTH = 190.0
"""From the instrument to the bottom, in units of the drawing."""
INSTRUMENT = np.array([245.0, 108.0])
"""Where the instrument stands in the drawing."""

ALT = (
    "An underwater vehicle seen from its starboard side, with four beams of sound from its belly. Beams 2 and 3, "
    "which look back, reach the bottom and return; beams 1 and 4, which look ahead, pass the edge of the bottom and "
    "are lost. An arrow ahead of the vehicle is its velocity; the ellipse at its tip is the uncertainty, longer along "
    "one direction."
)


def seen(point_p: NDArray[np.float64]) -> NDArray[np.float64]:
    """A point (forward, starboard, down) from the instrument, in the drawing: starboard is towards the viewer."""
    forward, starboard, down = point_p
    across = np.array([-0.35, 0.30])
    return np.asarray(INSTRUMENT + np.array([forward, down]) + starboard * across)


def path(points: list[NDArray[np.float64]], *, closed: bool = False) -> str:
    """Data of an SVG path through points of the drawing."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + ("Z" if closed else "")


def bottom(colours: dict[str, str]) -> str:
    """A plate of bottom that ends ahead of the vehicle, with the face of its edge."""
    far, near, edge, fall = -135.0, 135.0, 12.0, np.array([0.0, 200.0])
    corners = [(-400.0, far), (edge, far), (edge, near), (-400.0, near)]
    top = [seen(np.array([x, y, DEPTH])) for x, y in corners]
    ahead = [top[1], top[2], top[2] + fall, top[1] + fall]
    beside = [top[2], top[3], top[3] + fall, top[2] + fall]
    return (
        f'<path d="{path(top, closed=True)}" fill="{colours["bottom"]}"/>'
        f'<path d="{path(ahead, closed=True)}" fill="{colours["cliff"]}"/>'
        f'<path d="{path(beside, closed=True)}" fill="{colours["cliff"]}" opacity="0.7"/>'
    )


def beam(number: int, colours: dict[str, str]) -> str:
    """A beam to the bottom with its footprint, or past the edge of the bottom into the deep, dashed."""
    direction = BEAMS_P[number - 1] / BEAMS_P[number - 1, 2]
    lost = number in LOST
    end = seen(direction * DEPTH * (1.25 if lost else 1.0))
    stroke = f'stroke="{GONE if lost else RETURNED}"'
    line = f'<path d="{path([INSTRUMENT, end])}" {stroke} stroke-width="2.5" fill="none"'
    if lost:
        arms = [end + 6.0 * np.array(arm) for arm in ((-1, -1), (1, 1), (-1, 1), (1, -1))]
        line += f' stroke-dasharray="3 6"/><path d="{path(arms[:2])}{path(arms[2:])}" {stroke} stroke-width="2.5"/>'
    else:
        line += (
            f'/><ellipse cx="{end[0]:.1f}" cy="{end[1]:.1f}" rx="15" ry="6" fill="{RETURNED}" fill-opacity="0.35" '
            f'{stroke} stroke-width="1.5"/>'
        )
    side = {1: 18.0, 2: -26.0, 3: 26.0, 4: 18.0}[number]
    return line + text(end + np.array([side, 5.0]), str(number), colours["ink"], "middle")


def vehicle(colours: dict[str, str]) -> str:
    """A torpedo with nose to the right: propeller, fins, hull, and the instrument in its belly."""
    x, y = INSTRUMENT - np.array([0.0, 27.0])
    ink = f'stroke="{colours["ink"]}" stroke-width="1.6" stroke-linejoin="round"'
    fin = f'<path d="M-100 -14L-122 -34H-104L-76 -21Z" fill="{colours["hull"]}" {ink}/>'
    return (
        f'<g transform="translate({x:g} {y:g})"><path d="M-128 0H-136M-136 -15V15" {ink} fill="none"/>{fin}'
        f'<g transform="scale(1 -1)">{fin}</g>'
        f'<path d="M-128 0Q-96 -24 -60 -24H92A24 24 0 0 1 92 24H-60Q-96 24 -128 0Z" fill="{colours["hull"]}" {ink}/>'
        f'<path d="M62 -24V24" {ink} opacity="0.35"/>'
        f'<path d="M-16 23H16L11 32H-11Z" fill="{colours["ink"]}"/></g>'
    )


def estimate(colours: dict[str, str]) -> str:
    """The velocity ahead of the nose with its ellipse of uncertainty."""
    nose = INSTRUMENT + np.array([124.0, -27.0])
    tip = nose + np.array([84.0, 0.0])
    x, y = tip
    return (
        f'<ellipse cx="{x}" cy="{y}" rx="30" ry="13" transform="rotate(-24 {x} {y})" fill="{RETURNED}" '
        f'fill-opacity="0.22" stroke="{RETURNED}" stroke-width="1.5"/>'
        f'<path d="{path([nose, tip - np.array([8.0, 0.0])])}" stroke="{colours["ink"]}" stroke-width="2.5"/>'
        f'<path d="M{x} {y}l-12 -6v12Z" fill="{colours["ink"]}"/>'
    )


def text(place: NDArray[np.float64], words: str, colour: str, anchor: str = "start") -> str:
    """A line of text in the drawing."""
    x, y = place
    return f'<text x="{x:.0f}" y="{y:.0f}" fill="{colour}" text-anchor="{anchor}">{words}</text>'


def words(colours: dict[str, str]) -> str:
    """The labels."""
    lines = (
        (392.0, 32.0, "velocity, and", "soft", "start"),
        (392.0, 50.0, "how sure it is", "soft", "start"),
        (118.0, 172.0, "two beams", "soft", "end"),
        (118.0, 190.0, "return", "soft", "end"),
        (392.0, 172.0, "two are lost:", "soft", "start"),
        (392.0, 190.0, "no bottom there", "soft", "start"),
    )
    return "".join(
        text(np.array([x, y]), line, colours[colour], anchor) for x, y, line, colour, anchor in lines
    )


def drawing(scheme: str) -> str:
    """The vehicle and its beams for a light or a dark page."""
    colours = SCHEMES[scheme]
    far, near = (3, 4), (2, 1)
    parts = [
        bottom(colours),
        *(beam(number, colours) for number in (*far, *near)),
        vehicle(colours),
        estimate(colours),
        words(colours),
    ]
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 520 390" width="520" height="390" role="img" '
        'font-family="system-ui, sans-serif" font-size="15">\n'
        f"<title>{ALT}</title>\n" + "\n".join(parts) + "\n</svg>\n"
    )


def mark() -> str:
    """The mark of the site: four beams from one point, two of them lost; legible at 16 px on light and on dark."""
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">\n'
        '<rect width="32" height="32" rx="7" fill="#14304f"/>\n'
        '<path d="M16 10L5 27M16 10L12 27" stroke="#7fb5ff" stroke-width="2.6" stroke-linecap="round"/>\n'
        '<path d="M16 10L20 27M16 10L27 27" stroke="#ff8a66" stroke-width="2.2" stroke-dasharray="2.4 3.6"/>\n'
        '<rect x="8" y="4" width="16" height="7" rx="3.5" fill="#f2c14e"/>\n'
        "</svg>\n"
    )


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=DOCS)
    asked = parser.parse_args()
    for scheme in SCHEMES:
        write_text(asked.out / "figures" / f"vehicle_{scheme}.svg", drawing(scheme))
    write_text(asked.out / "_static" / "mark.svg", mark())
    return 0


if __name__ == "__main__":
    sys.exit(main())
