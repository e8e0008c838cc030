"""The panel of valid beams, which every page and figure against time shares."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bottomlock.figures.palette import STROKES
from bottomlock.figures.series import Panel, Times, held_curve

BEAM_COLOURS = tuple(
    STROKES[method].colour for method in ("tc", "consistent", "nsv", "elc", "ins", "weak_sway", "vhv", "plcf")
)


def valid_panel(
    time_ns: Times,
    valid: NDArray[np.bool_],
    *,
    colours: Sequence[str] = BEAM_COLOURS,
    title: str = "beams valid",
) -> Panel:
    """A line for each beam while it is valid, from beam 1 down.

    Args:
        time_ns: (n,) of the pings, in order.
        valid: (n, beams).
        colours: of the beams, again from the first where there are more beams.
        title: above the panel.
    """
    curves = [
        held_curve(f"beam {k + 1}", colours[k % len(colours)], time_ns, one, k + 1.0)
        for k, one in enumerate(valid.T)
    ]
    return Panel(title, curves, decimals=0, names=[f"{k + 1}" for k in range(len(curves))])
