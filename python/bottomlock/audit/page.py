"""Output of an audit: tables, figures and one page."""

import json

import numpy as np
import polars as pl
from markupsafe import Markup
from matplotlib.figure import Figure

from bottomlock.audit import figures
from bottomlock.audit.findings import findings_table
from bottomlock.audit.run import Audit, numbers_of
from bottomlock.figures.inline_svg import inline_svg
from bottomlock.figures.palette import png_bytes, svg_text
from bottomlock.files.atomic_write import json_text, parquet_bytes
from bottomlock.files.overwriting import Files
from bottomlock.pages.render import render

CAPTIONS = {
    "closure": "Closure of the full pings, and a Gaussian of its robust sigma.",
    "residuals": "Closure against time, and the deviation of each beam from its median over five pings.",
    "validity": "Validity of the beams; each column shows the worst of its pings.",
    "geometry": "Beam directions estimated from the log.",
}
"""Caption of each figure, by its file's name."""


def drawings(audit: Audit) -> dict[str, Figure]:
    """The figures of an audit, by name."""
    made = {
        "closure": figures.closure_figure(audit),
        "residuals": figures.residual_figure(audit),
        "validity": figures.validity_figure(audit),
        "geometry": figures.geometry_figure(audit),
    }
    return {name: figure for name, figure in made.items() if figure is not None}


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
    inline = []
    for name, figure in drawings(audit).items():
        svg = svg_text(figure)
        files |= {f"{name}.png": png_bytes(figure), f"{name}.svg": svg}
        inline.append((name, Markup(inline_svg(svg, f"audit_{name}", CAPTIONS[name])), CAPTIONS[name]))  # noqa: S704
    content = {
        "audit": audit,
        "figures": inline,
        "beams": beams_table(audit).to_dicts(),
        "numbers": content,
        "dump": json.dumps(content, indent=2, sort_keys=True),
        "deg": lambda value: float(np.rad2deg(value)),
    }
    return files | {"audit.html": render("audit.html.j2", content)}
