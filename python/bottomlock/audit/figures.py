"""Figures of an audit: distribution of the closure, beam directions, and what can be looked into against time."""

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.ndimage import median_filter
from scipy.stats import norm

from bottomlock.audit.robust import Array
from bottomlock.audit.run import Audit
from bottomlock.figures.palette import FAINT, INK, STYLE
from bottomlock.figures.series import Curve, Panel, View, valid_panel
from bottomlock.pages.plots import Plots

BLUE, ORANGE, GREEN, GREY = "#5394ec", "#fa632e", "#129e64", "#999194"
COLOURS = (BLUE, ORANGE, GREEN, "#b24397", "#a05200", "#8952ff", "#4191bc", "#7d6331")


def closure_figure(audit: Audit) -> Figure | None:
    """Histogram of the first closure on a logarithmic scale, with a Gaussian of its robust sigma; None without one."""
    if not audit.assessment.closures:
        return None
    closure = audit.assessment.closures[0]
    values, spread = closure.values_mps, max(closure.sigma_mps, 1e-6)
    reach = max(6.0 * spread, float(np.quantile(np.abs(values), 0.998)))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.6, 3.6), layout="constrained")
        axes = figure.add_subplot()
        edges = np.linspace(-reach, reach, 81)
        inside = np.clip(values, -reach, reach)
        axes.hist(1e3 * inside, bins=list(1e3 * edges), color=BLUE, alpha=0.75, label="recorded")
        middle = 0.5 * (edges[1:] + edges[:-1])
        expected = norm.pdf(middle, closure.median_mps, spread) * len(values) * (edges[1] - edges[0])
        axes.plot(
            1e3 * middle,
            expected,
            color=INK,
            linewidth=1.4,
            label=f"Gaussian of its robust sigma, {1e3 * spread:.3g} mm/s",
        )
        axes.set_yscale("log")
        axes.set_ylim(0.5, 12.0 * max(float(np.histogram(inside, edges)[0].max()), float(expected.max())))
        axes.set_xlabel("closure, mm/s (values beyond are counted in the outermost bars)")
        axes.set_ylabel("pings")
        axes.legend(loc="upper right", frameon=False, fontsize=8.5)
    return figure


def jumps(readings_mps: Array) -> Array:
    """(n, beams) readings minus the median of the five pings about them, which the vehicle's motion hardly affects.

    >>> jumps(np.array([[0.0], [0.0], [0.0], [9.0], [0.0], [0.0]])).ravel().tolist()
    [0.0, 0.0, 0.0, 9.0, 0.0, 0.0]
    """
    return np.asarray(readings_mps - median_filter(readings_mps, size=(5, 1), mode="nearest"))


def geometry_figure(audit: Audit) -> Figure | None:
    """Beam directions from above: estimated as points, stated as rings; None where not observable."""
    matrix = audit.assessment.matrix
    if matrix is None or not matrix.observable.all():
        return None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.4, 4.4), layout="constrained")
        axes = figure.add_subplot(projection="polar")
        axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
        axes.set_theta_direction(-1)  # type: ignore[attr-defined]
        tilt, azimuth = _polar(matrix.directions)
        axes.set_ylim(0.0, 1.35 * float(np.rad2deg(tilt).max()))
        if audit.stated is not None:
            stated_tilt, stated_azimuth = _polar(audit.stated)
            axes.plot(
                stated_azimuth,
                np.rad2deg(stated_tilt),
                "o",
                markersize=15,
                markerfacecolor="none",
                color=GREY,
                label="stated",
            )
            axes.legend(loc="lower right", bbox_to_anchor=(1.12, -0.08), frameon=False, fontsize=8.5)
        for k in range(len(tilt)):
            flipped = matrix.directions[k, 2] < 0.0
            axes.plot(
                azimuth[k], np.rad2deg(tilt[k]), "x" if flipped else "o", color=COLOURS[k], markersize=8
            )
            axes.annotate(
                f"{k + 1}{' (−)' if flipped else ''}",
                (azimuth[k], np.rad2deg(tilt[k])),
                xytext=(8, 8),
                textcoords="offset points",
            )
        axes.tick_params(labelsize=8.0)
        axes.spines["polar"].set_visible(False)
        axes.set_rlabel_position(157.5)  # type: ignore[attr-defined]
        axes.yaxis.grid(visible=True, color=FAINT, alpha=0.4)
        axes.set_title("beams from above: azimuth from x towards y, tilt in deg", fontsize=9.0)
    return figure


def _polar(directions: Array) -> tuple[Array, Array]:
    """(n,) tilt and azimuth of (n, 3) directions, rad, of those that point up of their opposites."""
    vectors = np.where(directions[:, 2:3] < 0.0, -directions, directions)
    tilt = np.arctan2(np.hypot(vectors[:, 0], vectors[:, 1]), vectors[:, 2])
    return np.asarray(tilt), np.asarray(np.arctan2(vectors[:, 1], vectors[:, 0]))


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
