"""Output of an audit: findings, figures and one page."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import norm

from bottomlock.audit.findings import findings_table
from bottomlock.audit.robust import Array
from bottomlock.audit.run import Audit, numbers_of
from bottomlock.figures.palette import INK
from bottomlock.figures.series import Curve, Figure, Panel, valid_panel
from bottomlock.files.atomic_write import json_text, parquet_bytes
from bottomlock.files.overwriting import Files
from bottomlock.pages.page import Block, Page, Part, Picture, Pictures, Table, Viewer, html
from bottomlock.pages.pieces import explained, findings_part, json_part
from bottomlock.pages.plots import Plots
from bottomlock.text import number

BLUE, ORANGE, GREEN = "#5394ec", "#fa632e", "#129e64"
COLOURS = (BLUE, ORANGE, GREEN, "#b24397", "#a05200", "#8952ff", "#4191bc", "#7d6331")


def closure_figure(audit: Audit) -> Figure | None:
    """Histogram of the first closure on a logarithmic scale, with a Gaussian of its robust sigma; None without one."""
    if not audit.assessment.closures:
        return None
    closure = audit.assessment.closures[0]
    values, spread = closure.values_mps, max(closure.sigma_mps, 1e-6)
    reach = max(6.0 * spread, float(np.quantile(np.abs(values), 0.998)))
    edges = np.linspace(-reach, reach, 81)
    inside, middle = np.clip(values, -reach, reach), 0.5 * (edges[1:] + edges[:-1])
    expected = norm.pdf(middle, closure.median_mps, spread) * len(values) * (edges[1] - edges[0])
    counts = np.histogram(inside, edges)[0].astype(np.float64)
    label = f"Gaussian of its robust sigma, {1e3 * spread:.3g} mm/s"
    curves = [
        Curve("recorded", BLUE, 1e3 * middle, counts, kind="bars"),
        Curve(label, INK, 1e3 * middle, expected),
    ]
    x_label = "closure, mm/s (values beyond are counted in the outermost bars)"
    return Figure("", [Panel("pings", curves, log=True, x_label=x_label)], size_in=(5.6, 3.6))


def jumps(readings_mps: Array) -> Array:
    """(n, beams) readings minus the median of the five pings about them, which the vehicle's motion hardly affects.

    >>> jumps(np.array([[0.0], [0.0], [0.0], [9.0], [0.0], [0.0]])).ravel().tolist()
    [0.0, 0.0, 0.0, 9.0, 0.0, 0.0]
    """
    return np.asarray(readings_mps - median_filter(readings_mps, size=(5, 1), mode="nearest"))


CAPTION = "Closure and beams against time"
FEWEST = 5
"""Pings of a log that has curves."""


def _closures(audit: Audit) -> list[Array]:
    """The closures that have a value of each full ping."""
    pings = int(audit.assessment.full.sum())
    return [one.values_mps for one in audit.assessment.closures if len(one.values_mps) == pings]


def plots_of(audit: Audit) -> Plots | None:
    """Curves of a log whose times rise; None for another, which the figures show by ping."""
    log, full = audit.log, audit.assessment.full
    if not log.beams or log.pings < FEWEST or (np.diff(log.time_ns) < 0).any():
        return None
    at, panels = log.time_ns[full], []
    closures = [
        Curve(f"closure {k + 1}", COLOURS[k % len(COLOURS)], at, 1e3 * one, kind="dots")
        for k, one in enumerate(_closures(audit))
    ]
    if closures:
        panels.append(Panel("closure of full pings, mm/s", closures, decimals=1))
    readings = np.where(log.valid, log.velocity_mps, np.nan)
    looks = [(f"beam {k + 1}", COLOURS[k % len(COLOURS)]) for k in range(log.beams)]
    beams = [Curve(*look, log.time_ns, column) for look, column in zip(looks, readings.T, strict=True)]
    panels.append(Panel("velocity along the beams, m/s", beams, decimals=3))
    if len(at) >= FEWEST:
        panels += [
            Panel(
                f"{name} less its median of five pings, mm/s",
                [Curve(name, colour, at, off, kind="dots")],
                decimals=1,
            )
            for (name, colour), off in zip(looks, 1e3 * jumps(log.velocity_mps[full]).T, strict=True)
        ]
    panels.append(valid_panel(log.time_ns, log.valid, colours=COLOURS))
    return Plots(CAPTION, (), {(): Figure(CAPTION, panels, int(log.time_ns[0]))})


CAPTIONS = {
    "closure": "Closure of the full pings, and a Gaussian of its robust sigma.",
    "curves": "Closure, readings of the beams, their deviation from the median over five pings, and which are valid.",
}
"""Caption of each figure, by its file's name."""


def drawings(audit: Audit, plots: Plots | None) -> dict[str, Figure]:
    """The figures of an audit, by name; `plots` are its curves against time."""
    made = {
        "closure": closure_figure(audit),
        "curves": None if plots is None else plots.first,
    }
    return {name: figure for name, figure in made.items() if figure is not None}


def audit_files(audit: Audit) -> Files:
    """The contents of audit.json, findings.parquet, the figures and audit.html.

    The same log gives the same bytes.
    """
    content = numbers_of(audit)
    files: Files = {
        "audit.json": json_text(content),
        "findings.parquet": parquet_bytes(findings_table(audit.findings)),
    }
    drawn, plots = Pictures(""), plots_of(audit)
    pictures = {
        name: drawn.add(figure, name, CAPTIONS[name], "wide" if name == "curves" else "")
        for name, figure in drawings(audit, plots).items()
    }
    page = html(explained(page_of(audit, content, pictures, plots)))
    return files | drawn.files | {"audit.html": page}


def page_of(
    audit: Audit,
    numbers: dict[str, Any],
    pictures: Mapping[str, Picture] | None = None,
    plots: Plots | None = None,
) -> Page:
    """An audit laid out: findings, figures, what was estimated.

    Args:
        audit: result.
        numbers: `numbers_of(audit)`.
        pictures: its figures, by name.
        plots: what the reader can look into.
    """
    shown: list[Block] = list((pictures or {}).values())
    if pictures and plots is not None:
        # In place of the curves what the reader can look into where scripts run.
        shown = [one for name, one in pictures.items() if name != "curves"]
        shown.append(Viewer(plots, [pictures["curves"]]))
    estimates = list(_estimates(numbers))
    parts = [
        findings_part([finding.to_json() for finding in audit.findings]),
        *([Part("figures", "Figures", shown)] if shown else []),
        *(
            [
                Part(
                    "estimates",
                    "Estimates",
                    [Table(("Of", "Quantity", "Value"), estimates, _CAPTION, left=2)],
                )
            ]
            if estimates
            else []
        ),
        json_part("numbers", "All numbers", "audit.json", numbers),
    ]
    return Page("Audit of the DVL", parts, "bottomlock", about=_counts(audit))


def _counts(audit: Audit) -> str:
    """How many pings there are, with how many beams."""
    log = audit.log
    counts = np.bincount(log.valid.sum(axis=1), minlength=log.beams + 1)
    told = ", ".join(f"{counts[beams]} with {beams}" for beams in range(log.beams, -1, -1) if counts[beams])
    used = f"beams valid: {told}; {audit.assessment.full.sum()} full pings used" if log.beams else "no beams"
    compared = f"; compared with {audit.geometry_name}" if audit.geometry_name else ""
    three = "\n\nThree beams have no closure: only a reference can check them." if log.beams == 3 else ""
    return f"{log.place}: {log.pings} pings in {log.time_s.max():.1f} s; {used}{compared}{three}"


DEG, MM, HUNDRED = np.rad2deg(1.0), 1e3, 100.0
ESTIMATES = (
    ("matrix", "tilt of the beams, °", "tilt_rad", "tilt_sd_rad", DEG),
    ("matrix", "azimuth of the beams, °", "azimuth_rad", "azimuth_sd_rad", DEG),
    ("matrix", "scale of the beams", "scale", "scale_sd", 1.0),
    ("matrix", "bias of the beams, mm/s", "bias_mps", "bias_sd_mps", MM),
    ("matrix", "residual, mm/s", "residual_mps", "", MM),
    ("matrix", "full pings with the instrument's velocity", "pings", "", 1.0),
    ("match", "stated beam of the channels", "beam", "", 1.0),
    ("match", "sign", "sign", "", 1.0),
    ("match", "off the stated direction, °", "off_rad", "", DEG),
    ("closure", "weights of the beams", "weights", "", 1.0),
    ("closure", "median, mm/s", "median_mps", "median_sd_mps", MM),
    ("closure", "robust sigma, mm/s", "sigma_mps", "", MM),
    ("closure", "sigma from ping to ping, mm/s", "white_sigma_mps", "", MM),
    ("closure", "95 % of the sizes, mm/s", "p95_mps", "", MM),
    ("closure", "99 % of the sizes, mm/s", "p99_mps", "", MM),
    ("closure", "largest, mm/s", "max_mps", "", MM),
    ("closure", "beyond 3 sigma (Gaussian: 0.27), %", "beyond_3_sigma", "", HUNDRED),
    (
        "mounting",
        "roll, pitch, yaw of the DVL against the platform, °",
        "rpy_rad",
        "misalignment_sd_rad",
        DEG,
    ),
    ("mounting", "lever arm x, y, z, m", "lever_arm_p_m", "lever_arm_sd_m", 1.0),
    ("mounting", "reference time minus DVL time, s", "clock_offset_s", "clock_offset_sd_s", 1.0),
    ("mounting", "scale, %", "scale", "scale_sd", HUNDRED),
    ("mounting", "explained of the velocity, %", "explained", "", HUNDRED),
)
"""Of which block of audit.json, name with unit, names of value and 1 sigma there, and the factor to the unit."""
_CAPTION = "Value, a number a beam or axis, ± 1 sigma; the matrix is the one that the instrument uses."


def _estimates(numbers: Mapping[str, Any]) -> Iterator[list[str]]:
    """A row per estimate."""
    for block, title, name, sd_name, factor in ESTIMATES:
        found = numbers[block] or []
        for one in found if isinstance(found, list) else [found]:
            values, sds = (np.atleast_1d(np.array(one.get(key), dtype=float)) for key in (name, sd_name))
            told = [f"{value:.5g}" for value in factor * values]
            spreads = ["" if np.isnan(sd) else f" ± {number(float(sd), 2)}" for sd in factor * sds]
            each = zip(told, spreads if sd_name else [""] * len(told), strict=True)
            yield [block.replace("_", " "), title, ", ".join(map("".join, each))]
