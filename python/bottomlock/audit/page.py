"""Output of an audit: findings, figures and one page."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.stats import norm

from bottomlock.audit.logs import Array
from bottomlock.audit.run import Audit, numbers_of
from bottomlock.figures.palette import INK
from bottomlock.figures.series import BEAM_COLOURS, Curve, Figure, Panel, valid_panel
from bottomlock.files.atomic_write import json_text, parquet_bytes
from bottomlock.files.columns import FINDINGS
from bottomlock.files.overwriting import Files
from bottomlock.pages.page import Block, Page, Part, Pictures, Table, Viewer, html
from bottomlock.pages.pieces import explained, findings_part, json_part
from bottomlock.pages.plots import Plots
from bottomlock.text import number


def closure_figure(audit: Audit) -> Figure | None:
    """Histogram of the first closure on a logarithmic scale, with a Gaussian of its robust sigma; None without one."""
    if not audit.closures:
        return None
    closure = audit.closures[0]
    values, spread = closure.values_mps, max(closure.sigma_mps, 1e-6)
    reach = max(6.0 * spread, float(np.quantile(np.abs(values), 0.998)))
    edges = np.linspace(-reach, reach, 81)
    inside, middle = np.clip(values, -reach, reach), 0.5 * (edges[1:] + edges[:-1])
    expected = norm.pdf(middle, closure.median_mps, spread) * len(values) * (edges[1] - edges[0])
    counts = np.histogram(inside, edges)[0].astype(np.float64)
    label = f"Gaussian of its robust sigma, {1e3 * spread:.3g} mm/s"
    curves = [
        Curve("recorded", BEAM_COLOURS[0], 1e3 * middle, counts, kind="bars"),
        Curve(label, INK, 1e3 * middle, expected),
    ]
    x_label = "closure, mm/s (values beyond are counted in the outermost bars)"
    return Figure("", [Panel("pings", curves, log=True, x_label=x_label)], size_in=(5.6, 3.6))


FEWEST = 5
"""Pings of a log that has curves."""
CLOSURE = "Closure of the full pings, and a Gaussian of its robust sigma."
CURVES = (
    "Closure, readings of the beams, their deviation from the median over five pings, and which are valid."
)
"""Captions."""


def _curves(
    name: str, time_ns: NDArray[np.int64], values: Sequence[Array], kind: Literal["line", "dots"]
) -> list[Curve]:
    """A curve per beam or closure, (n,) each."""
    return [
        Curve(f"{name} {k + 1}", BEAM_COLOURS[k % len(BEAM_COLOURS)], time_ns, one, kind=kind)
        for k, one in enumerate(values)
    ]


def plots_of(audit: Audit) -> Plots | None:
    """Curves of a log whose times rise; None for another, which the figures show by ping."""
    log, full, panels = audit.log, audit.whole, []
    if not log.beams or log.pings < FEWEST or (np.diff(log.time_ns) < 0).any():
        return None
    if audit.closures:
        closures = [1e3 * one.values_mps for one in audit.closures]
        curves = _curves("closure", log.time_ns[full], closures, "dots")
        panels.append(Panel("closure of full pings, mm/s", curves, decimals=1))
    readings = np.where(log.valid, log.velocity_mps, np.nan)
    beams = _curves("beam", log.time_ns, list(readings.T), "line")
    panels.append(Panel("velocity along the beams, m/s", beams, decimals=3))
    if full.sum() >= FEWEST:
        # The vehicle's motion hardly affects the deviation from the median of the pings about each.
        whole = log.velocity_mps[full]
        off = 1e3 * (whole - median_filter(whole, size=(FEWEST, 1), mode="nearest"))
        panels += [
            Panel(f"{curve.label} less its median of five pings, mm/s", [curve], decimals=1)
            for curve in _curves("beam", log.time_ns[full], list(off.T), "dots")
        ]
    panels.append(valid_panel(log.time_ns, log.valid))
    caption = "Closure and beams against time"
    return Plots(caption, (), {(): Figure(caption, panels, int(log.time_ns[0]))})


def audit_files(audit: Audit) -> Files:
    """The contents of audit.json, findings.parquet, the figures and audit.html.

    The same log gives the same bytes.
    """
    content, drawn, shown = numbers_of(audit), Pictures(""), list[Block]()
    closure, plots = closure_figure(audit), plots_of(audit)
    if closure is not None:
        shown.append(drawn.add(closure, "closure", CLOSURE, ""))
    if plots is not None:
        # What the reader can look into where scripts run.
        shown.append(Viewer(plots, [drawn.add(plots.first, "curves", CURVES)]))
    findings = [
        vars(one) | {"rank": rank, "fraction": one.weight, "place": one.place}
        for rank, one in enumerate(audit.findings, start=1)
    ]
    files: Files = {
        "audit.json": json_text(content),
        "findings.parquet": parquet_bytes(pl.DataFrame(findings, schema=dict(FINDINGS))),
    }
    return files | drawn.files | {"audit.html": html(explained(page_of(audit, content, shown)))}


def page_of(audit: Audit, numbers: dict[str, Any], figures: Sequence[Block] = ()) -> Page:
    """An audit laid out: findings, figures, what was estimated, from `numbers_of(audit)` and its figures."""
    parts = [findings_part([finding.to_json() for finding in audit.findings])]
    if figures:
        parts.append(Part("figures", "Figures", figures))
    estimates = list(_estimates(numbers))
    if estimates:
        table = Table(("Of", "Quantity", "Value"), estimates, _CAPTION, left=2)
        parts.append(Part("estimates", "Estimates", [table]))
    parts.append(json_part("numbers", "All numbers", "audit.json", numbers))
    return Page("Audit of the DVL", parts, "bottomlock", about=_counts(audit))


def _counts(audit: Audit) -> str:
    """How many pings there are, with how many beams."""
    log = audit.log
    counts = np.bincount(log.valid.sum(axis=1), minlength=log.beams + 1)
    told = ", ".join(f"{counts[beams]} with {beams}" for beams in range(log.beams, -1, -1) if counts[beams])
    used = f"beams valid: {told}; {audit.whole.sum()} full pings used" if log.beams else "no beams"
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
    ("mounting", "roll, pitch, yaw to the platform, °", "misalignment", "misalignment", DEG),
    ("mounting", "lever arm x, y, z, m", "lever_arm", "lever_arm", 1.0),
    ("mounting", "reference time minus DVL time, s", "clock_offset", "clock_offset", 1.0),
    ("mounting", "scale, %", "velocity_scale", "velocity_scale", HUNDRED),
    ("mounting", "explained of the velocity, %", "explained", "", HUNDRED),
)
"""Of which block of audit.json, name with unit, names of value and 1 sigma there, and the factor to the unit."""
_CAPTION = "Value, a number a beam or axis, ± 1 sigma; the matrix is the one that the instrument uses."


def _estimates(numbers: Mapping[str, Any]) -> Iterator[list[str]]:
    """A row per estimate."""
    for block, title, name, sd_name, factor in ESTIMATES:
        found = numbers[block] or []
        for one in found if isinstance(found, list) else [found]:
            pair = (one | one.get("values", {})).get(name), (one | one.get("sds", {})).get(sd_name)
            values, sds = (np.atleast_1d(np.array(of, dtype=float)) for of in pair)
            told = [f"{value:.5g}" for value in factor * values]
            spreads = ["" if np.isnan(sd) else f" ± {number(float(sd), 2)}" for sd in factor * sds]
            each = zip(told, spreads if sd_name else [""] * len(told), strict=True)
            yield [block.replace("_", " "), title, ", ".join(map("".join, each))]
