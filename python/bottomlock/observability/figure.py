"""Figure of observability: the standard deviations that a filter claims along a truth, a panel a group of states."""

import math

import numpy as np
from matplotlib.figure import Figure

from bottomlock.figures.palette import STROKES
from bottomlock.figures.series import Curve, Floats, Panel
from bottomlock.figures.timeline import timeline_figure
from bottomlock.observability.analysis import Deviations
from bottomlock.units import mps2_from_mg, radps_from_deg_per_h

GROUPS = (
    (("position",), "position, m", 1.0),
    (("velocity",), "velocity, m/s", 1.0),
    (("tilt", "yaw"), "misalignment, °", math.radians(1.0)),
    (("accel bias",), "accelerometer bias, mg", mps2_from_mg(1.0)),
    (("gyro bias",), "gyro bias, °/h", radps_from_deg_per_h(1.0)),
    (("beam bias",), "beam bias, m/s", 1.0),
    (("scale factor",), "scale factor, %", 0.01),
)
"""First words of the states that share a panel, its title, and the size of its unit in SI."""
_COLOURS = [STROKES[method].colour for method in ("tc", "consistent", "nsv", "weak_sway")]
_DASHES = ((), (6.0, 2.0), (2.0, 2.0), (6.0, 2.0, 2.0, 2.0))
_WIDE = 8.0
"""Ratio between greatest and least value from which an axis is logarithmic."""


def deviation_figure(history: Deviations, *, title: str) -> Figure:
    """1 sigma of every state against time; a line that stays where it began is of a state that nothing shows."""
    return timeline_figure(deviation_panels(history), int(history.time_ns[0]), utc=False, title=title)


def deviation_panels(history: Deviations) -> list[Panel]:
    """A panel for each group of states that the model has."""
    panels = []
    for words, title, unit_si in GROUPS:
        members = [k for k, state in enumerate(history.states) if state.startswith(words)]
        if members:
            curves = [_curve(history, k, place, unit_si) for place, k in enumerate(members)]
            panels.append(Panel(title, curves, log=_is_wide(np.concatenate([one.value for one in curves]))))
    return panels


def _curve(history: Deviations, state: int, place: int, unit_si: float) -> Curve:
    look = place % len(_COLOURS)
    return Curve(
        history.states[state],
        _COLOURS[look],
        history.time_ns,
        history.sd[:, state] / unit_si,
        dash=_DASHES[look],
    )


def _is_wide(value: Floats) -> bool:
    positive = value[value > 0.0]
    return bool(positive.size and positive.max() > _WIDE * positive.min())
