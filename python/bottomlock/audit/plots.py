"""A log to look into: closure, readings of the beams and their outliers, and which returned, against time."""

import numpy as np

from bottomlock.audit.figures import BLUE, COLOURS, jumps
from bottomlock.audit.run import Audit
from bottomlock.figures.beams import valid_panel
from bottomlock.figures.series import Curve, Panel, View
from bottomlock.pages.plots import Plots

CAPTION = "Closure and beams against time"
FEWEST = 5
"""Pings of a log that has curves."""


def plots_of(audit: Audit) -> Plots | None:
    """Curves of a log whose times rise; None for another, which the figures show by ping."""
    log, assessment = audit.log, audit.assessment
    if not log.beams or log.pings < FEWEST or (np.diff(log.time_ns) < 0).any():
        return None
    full = log.time_ns[assessment.full]
    panels = []
    closures = [one.values_mps for one in assessment.closures if len(one.values_mps) == len(full)]
    if closures:
        colours = (BLUE, *COLOURS[1:])
        labels = ["closure"] if len(closures) == 1 else [f"closure {k + 1}" for k in range(len(closures))]
        curves = [
            Curve(label, colours[k % len(colours)], full, 1e3 * one, kind="dots")
            for k, (label, one) in enumerate(zip(labels, closures, strict=True))
        ]
        panels.append(Panel("closure of full pings, mm/s", curves, decimals=1))
    readings = np.where(log.valid, log.velocity_mps, np.nan)
    names = [f"beam {k + 1}" for k in range(log.beams)]
    looks = [COLOURS[k % len(COLOURS)] for k in range(log.beams)]
    panels.append(
        Panel(
            "velocity along the beams, m/s",
            [
                Curve(*look, log.time_ns, readings[:, k])
                for k, look in enumerate(zip(names, looks, strict=True))
            ],
            decimals=3,
        )
    )
    if len(full) >= FEWEST:
        off = 1e3 * jumps(log.velocity_mps[assessment.full])
        panels += [
            Panel(
                f"{name} less its median of five pings, mm/s",
                [Curve(name, colour, full, off[:, k], kind="dots")],
                decimals=1,
            )
            for k, (name, colour) in enumerate(zip(names, looks, strict=True))
        ]
    panels.append(valid_panel(log.time_ns, log.valid, colours=COLOURS))
    return Plots(CAPTION, (), {(): View(panels)}, int(log.time_ns[0]))
