"""Output of an audit: tables, figures and one page."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure
from scipy.ndimage import median_filter
from scipy.stats import norm

from bottomlock.audit.findings import findings_table
from bottomlock.audit.robust import Array
from bottomlock.audit.run import Audit, numbers_of
from bottomlock.figures.images import images_of
from bottomlock.figures.palette import FAINT, INK, STYLE
from bottomlock.figures.series import Curve, Panel, View, valid_panel
from bottomlock.figures.timeline import timeline_figure
from bottomlock.files.atomic_write import json_text, parquet_bytes
from bottomlock.files.overwriting import Files
from bottomlock.pages.page import Block, Looked, Page, Part, Picture, Table, html
from bottomlock.pages.pieces import explained, findings_part, json_part, number
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


CAPTIONS = {
    "closure": "Closure of the full pings, and a Gaussian of its robust sigma.",
    "curves": "Closure, readings of the beams, their deviation from the median over five pings, and which are valid.",
    "geometry": "Beam directions estimated from the log.",
}
"""Caption of each figure, by its file's name."""
HALF = ("closure", "geometry")
"""Figures that stand beside each other where the page is wide."""


def drawings(audit: Audit, plots: Plots | None) -> dict[str, Figure]:
    """The figures of an audit, by name; `plots` are its curves against time."""
    made = {
        "closure": closure_figure(audit),
        "curves": None if plots is None else _curves(plots),
        "geometry": geometry_figure(audit),
    }
    return {name: figure for name, figure in made.items() if figure is not None}


def _curves(plots: Plots) -> Figure:
    return timeline_figure(plots.views[()].panels, plots.start_ns, utc=plots.is_utc, title=plots.caption)


def beams_table(audit: Audit) -> pl.DataFrame:
    """A row per beam: tilt, azimuth, scale and bias with standard deviations, stated beam, fraction of valid pings."""
    log, matrix, matched = audit.log, audit.assessment.matrix, audit.assessment.match
    rows = []
    for k in range(log.beams):
        row: dict[str, float | int | None] = {"beam": k + 1, "valid_fraction": float(log.valid[:, k].mean())}
        for name in ("tilt", "azimuth"):
            row[f"{name}_deg"] = (
                None if matrix is None else float(np.rad2deg(getattr(matrix, f"{name}_rad")[k]))
            )
            row[f"{name}_sd_deg"] = (
                None if matrix is None else float(np.rad2deg(getattr(matrix, f"{name}_sd_rad")[k]))
            )
        row["scale"] = None if matrix is None else float(matrix.scale[k])
        row["scale_sd"] = None if matrix is None else float(matrix.scale_sd[k])
        row["bias_mps"] = None if matrix is None else float(matrix.bias_mps[k])
        row["bias_sd_mps"] = None if matrix is None else float(matrix.bias_sd_mps[k])
        row["observable"] = None if matrix is None else int(matrix.observable[k])
        row["stated_beam"] = None if matched is None else int(matched.beam[k]) + 1
        row["stated_sign"] = None if matched is None else int(matched.sign[k])
        row["off_deg"] = None if matched is None else float(np.rad2deg(matched.off_rad[k]))
        rows.append(row)
    integers = {"beam", "observable", "stated_beam", "stated_sign"}
    names = list(rows[0]) if rows else ["beam", "valid_fraction"]
    return pl.DataFrame(rows, schema={n: pl.Int64() if n in integers else pl.Float64() for n in names})


def closure_table(audit: Audit) -> pl.DataFrame:
    """A row per full ping and closure: time and value, m/s."""
    assessment = audit.assessment
    times = audit.log.time_ns[assessment.full]
    frames = [
        pl.DataFrame({"time_ns": times, "closure": np.full(len(times), k + 1), "closure_mps": one.values_mps})
        for k, one in enumerate(assessment.closures)
        if len(one.values_mps) == len(times)
    ]
    empty = pl.DataFrame(schema={"time_ns": pl.Int64(), "closure": pl.Int64(), "closure_mps": pl.Float64()})
    return pl.concat([empty, *frames])


def audit_files(audit: Audit) -> Files:
    """The contents of audit.json, findings.parquet, beams.parquet, closure.parquet, the figures and audit.html.

    The same log gives the same bytes.
    """
    content = numbers_of(audit)
    files: Files = {
        "audit.json": json_text(content),
        "findings.parquet": parquet_bytes(findings_table(audit.findings)),
        "beams.parquet": parquet_bytes(beams_table(audit)),
        "closure.parquet": parquet_bytes(closure_table(audit)),
    }
    pictures, plots = {}, plots_of(audit)
    for name, figure in drawings(audit, plots).items():
        images = images_of(figure)
        own = images.files(name)
        files |= own
        kind = "" if name in HALF else "wide"
        pictures[name] = Picture.of_svg(
            images.svg, f"audit_{name}", CAPTIONS[name], kind=kind, files=list(own)
        )
    return files | {"audit.html": html(explained(page_of(audit, content, pictures, plots)))}


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
    parts = [
        findings_part([finding.to_json() for finding in audit.findings]),
        *([Part("figures", "Figures", _figures(pictures, plots))] if pictures else []),
        *([_beams_part(audit)] if numbers["matrix"] else []),
        *([_closure_part(numbers["closure"])] if numbers["closure"] else []),
        *([_mounting_part(audit, numbers["mounting"])] if numbers["mounting"] else []),
        *([_water_part(numbers["water"])] if numbers["water"] else []),
    ]
    parts.append(json_part("numbers", "All numbers", "audit.json", numbers))
    return Page("Audit of the DVL", [], parts, "bottomlock", about=_counts(audit))


def _figures(pictures: Mapping[str, Picture], plots: Plots | None) -> list[Block]:
    """The figures, and in place of the curves what the reader can look into where scripts run."""
    if plots is None:
        return list(pictures.values())
    return [*(one for name, one in pictures.items() if name != "curves"), Looked(plots, [pictures["curves"]])]


def _counts(audit: Audit) -> str:
    """How many pings there are, with how many beams."""
    log = audit.log
    valid = log.valid.sum(axis=1)
    counts = {beams: int(np.sum(valid == beams)) for beams in range(log.beams, -1, -1)}
    beams = ", ".join(f"{count} with {beams}" for beams, count in counts.items() if count)
    used = (
        f"beams valid: {beams}; {int(audit.assessment.full.sum())} full pings used"
        if log.beams
        else "no beams"
    )
    compared = f"; compared with {audit.geometry_name}" if audit.geometry_name else ""
    three = "\n\nThree beams have no closure: only a reference can check them." if log.beams == 3 else ""
    return f"{log.place}: {log.pings} pings in {log.time_s.max():.1f} s; {used}{compared}{three}"


def _stated(row: dict[str, Any]) -> list[str]:
    """The beam of the stated geometry that a channel is, and the angle between."""
    return [f"{'−' if row['stated_sign'] < 0 else ''}{row['stated_beam']}", f"{row['off_deg']:.3f}"]


def _beams_part(audit: Audit) -> Part:
    matrix, matched = audit.assessment.matrix, audit.assessment.match is not None
    assert matrix is not None
    columns = ["Beam", "Tilt, °", "Azimuth, °", "Scale", "Bias, mm/s", "Valid, %"]
    rows = [
        [
            str(row["beam"]),
            f"{row['tilt_deg']:.3f} ± {row['tilt_sd_deg']:.1g}",
            f"{row['azimuth_deg'] + 0.0:.3f} ± {row['azimuth_sd_deg']:.1g}",
            f"{row['scale']:.4f} ± {row['scale_sd']:.1g}",
            f"{round(1e3 * row['bias_mps'], 2) + 0.0:.2f} ± {1e3 * row['bias_sd_mps']:.1g}",
            f"{100.0 * row['valid_fraction']:.1f}",
            *(_stated(row) if matched else []),
        ]
        for row in beams_table(audit).iter_rows(named=True)
    ]
    caption = (
        f"{matrix.regression.capitalize()}, {matrix.pings} pings, residual {1e3 * matrix.residual_mps:.3g} mm/s. This "
        "is the matrix that the instrument uses; ± is one standard deviation from resampled blocks of pings."
    )
    return Part(
        "beams", "Beams", [Table([*columns, *(["Is beam", "Off, °"] if matched else [])], rows, caption)]
    )


_CLOSURE = {
    "median_mps": "Median",
    "median_abs_mps": "Median |e|",
    "sigma_mps": "Robust sigma",
    "white_sigma_mps": "From ping to ping",
    "p95_mps": "95 %",
    "p99_mps": "99 %",
    "max_mps": "Largest",
}
"""Columns, by the name of the number in audit.json."""


def _closure_part(closures: Sequence[dict[str, Any]]) -> Part:
    rows = [
        [
            " ".join(f"{weight:+.3f}" for weight in one["weights"]),
            str(one["pings"]),
            *(f"{1e3 * one[name]:.1f}" for name in _CLOSURE),
            f"{100.0 * one['beyond_3_sigma']:.2f} %",
        ]
        for one in closures
    ]
    caption = "The combinations of the beams to which no velocity contributes, mm/s."
    columns = ["Weights", "Pings", *_CLOSURE.values(), "Beyond 3 sigma"]
    return Part("closure", "Closure", [Table(columns, rows, caption)])


def _water_part(found: dict[str, Any]) -> Part:
    """The current that bottom and water differ by."""
    rows = [
        [
            axis,
            *(f"{found[name][k]:+.3f}" for name in ("current_mps", "drift_mps_per_h")),
            f"{found['ping_sd_mps'][k]:.3f}",
        ]
        for k, axis in enumerate(("North", "East"))
    ]
    caption = (
        f"Current: bottom less water in cell {found['cell']}, {found['range_m']:.1f} m along the beam, "
        f"{found['pings']} pings. A beam of both scatters by {1e3 * found['beam_sd_mps']:.0f} mm/s from ping to ping: "
        f"what water_track.noise_mps of a case should be. Factor of the water's readings {found['scale']:.2f} ± "
        f"{number(found['scale_sd'], 2)}."
    )
    columns = ["Axis", "Current, m/s", "Drift, m/s in an hour", "One ping, 1 sigma, m/s"]
    return Part("water", "Water against the bottom", [Table(columns, rows, caption)])


def _mounting_part(audit: Audit, found: dict[str, Any]) -> Part:
    def row(quantity: str, value: float, sd: float, decimals: int = 3) -> list[str]:
        return [quantity, f"{value:.{decimals}f}", number(sd, 2)]

    turned = zip(("roll", "pitch", "yaw"), found["rpy_rad"], found["misalignment_sd_rad"], strict=True)
    moved = zip("xyz", found["lever_arm_p_m"], found["lever_arm_sd_m"], strict=True)
    rows = [
        *(
            row(f"{name} of the DVL against the platform, °", np.rad2deg(v), np.rad2deg(sd))
            for name, v, sd in turned
        ),
        *(row(f"lever arm {name}, m", value, sd) for name, value, sd in moved),
        row("reference time minus DVL time, s", found["clock_offset_s"], found["clock_offset_sd_s"]),
        row("scale, %", 100.0 * found["scale"], 100.0 * found["scale_sd"], 2),
    ]
    follows = audit.mounting is not None and audit.mounting.follows
    lost = "" if follows else "; the velocity does not follow it, and nothing below is observable"
    caption = f"From {found['source']}, {found['instants']} instants{lost}."
    return Part("mounting", "Mounting", [Table(["Quantity", "Estimate", "±"], rows, caption)])
