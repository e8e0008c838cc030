"""The command `bottomlock audit`."""

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.table import Table
from rich.text import Text

from bottomlock.audit.geometry_file import geometry_text
from bottomlock.audit.logs import read_depths, read_inertial, read_reference
from bottomlock.audit.page import audit_files, beams_table
from bottomlock.audit.run import Audit, audit_file
from bottomlock.cli.console import console
from bottomlock.cli.force import Force
from bottomlock.files.atomic_write import write_text
from bottomlock.files.overwriting import Result, check_free
from bottomlock.io.beam_table import sha256_of
from bottomlock.io.calibrated_file import require_toml
from bottomlock.io.formats import converted_first

_COLOURS = {"fault": "red", "warning": "yellow", "note": "dim"}


def audit(
    log: Path,
    *,
    out: Annotated[
        Path, Parameter(alias="-o", help="Directory for audit.json, tables, figures and audit.html.")
    ],
    geometry: Annotated[
        str | None,
        Parameter(help="Geometry to compare with: a packaged one or a TOML file, whose column map is used."),
    ] = None,
    attitude: Annotated[
        Path | None,
        Parameter(
            help="CSV or Parquet: time_ns, roll_rad, pitch_rad, yaw_rad, and velocity_north_mps ... if known."
        ),
    ] = None,
    imu: Annotated[
        Path | None,
        Parameter(help="CSV or Parquet: time_ns, force_x_mps2 ..., omega_x_radps ..., forward-right-down."),
    ] = None,
    depth: Annotated[Path | None, Parameter(help="CSV or Parquet: time_ns, depth_m.")] = None,
    write: Annotated[
        Path | None,
        Parameter(
            help="TOML file to which the estimated geometry is written, with mounting, scale and clock."
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Audit a DVL log: beam directions, order, signs, defects, mounting.

    Findings are ranked, each with its evidence in numbers.

    Parameters
    ----------
    log
        A beam table (`bottomlock convert` writes one), or a CSV or Parquet file whose columns the geometry maps.
    """
    read = {"log": log, "attitude": attitude, "imu": imu, "depth": depth}
    if geometry is not None:
        read["geometry"] = Path(geometry)
    files = {name: path for name, path in read.items() if path is not None and path.is_file()}
    made_from = {name: sha256_of(path) for name, path in files.items()} | {
        name: str(path) for name, path in read.items() if path is not None and name not in files
    }
    result = Result(out, "audit", "audit", made_from, list(files.values()))
    result.check(force=force)
    if write is not None:
        require_toml(write)
        check_free(write, inputs=files.values(), force=force)
    reference = None if attitude is None else read_reference(attitude)
    inertial = None if imu is None else read_inertial(imu)
    depths = None if depth is None else read_depths(depth)
    with converted_first(log):
        made = audit_file(log, geometry=geometry, reference=reference, imu=inertial, depths=depths)
    # The findings say why a log gives no geometry to write, so they are told before it is refused.
    for part in shown(made):
        console.print(part, highlight=False)
    text = None if write is None else geometry_text(made)
    result.write(audit_files(made), force=force)
    if write is not None and text is not None:
        write_text(write, text)
        console.print(f"wrote {write}", highlight=False)
    console.print(f"audit.html, audit.json, tables and figures in {out}", highlight=False)


def shown(made: Audit) -> list[str | Table | Text]:
    """The parts of the terminal output: counts, beams, closure, mounting, findings."""
    log, verdict = made.log, made.assessment
    counts = [int(np.sum(log.valid.sum(axis=1) == k)) for k in range(log.beams, -1, -1)]
    beams = ", ".join(f"{count} with {log.beams - k}" for k, count in enumerate(counts) if count)
    parts: list[str | Table | Text] = [
        f"{log.place}: {log.pings} pings in {log.time_s.max():.1f} s"
        + (
            f"; beams valid: {beams}; {int(verdict.full.sum())} full pings used"
            if log.beams
            else "; no beams"
        )
    ]
    if verdict.matrix is not None:
        parts.append(_beams(made))
    parts += [
        f"closure ({' '.join(f'{w:+.2f}' for w in one.weights)}): median |e| {1e3 * one.median_abs_mps:.1f}, "
        f"robust sigma {1e3 * one.sigma_mps:.1f}, 95 % {1e3 * one.p95_mps:.0f}, 99 % {1e3 * one.p99_mps:.0f}, "
        f"largest {1e3 * one.max_mps:.0f} mm/s"
        for one in verdict.closures
    ]
    if log.beams == 3:
        parts.append("three beams have no closure: only a reference can check them")
    if made.mounting is not None and made.mounting.follows:
        m = made.mounting
        rpy = ", ".join(
            f"{np.rad2deg(v):+.2f} ± {np.rad2deg(s):.2g}"
            for v, s in zip(m.rpy_rad, m.misalignment_sd_rad, strict=True)
        )
        lever = ", ".join(
            f"{v:+.2f} ± {s:.2g}" for v, s in zip(m.lever_arm_p_m, m.lever_arm_sd_m, strict=True)
        )
        parts.append(
            f"mounting, from {m.source}: roll, pitch, yaw {rpy} deg; lever arm {lever} m; clock offset "
            f"{m.clock_offset_s:+.3f} ± {m.clock_offset_sd_s:.2g} s; scale {100.0 * m.scale:+.2f} ± "
            f"{100.0 * m.scale_sd:.2g} %"
        )
    parts.append("" if made.findings else "no finding")
    for number, finding in enumerate(made.findings, start=1):
        colour = _COLOURS[finding.severity]
        parts.append(
            Text.assemble(
                f"{number}. ",
                (finding.severity, colour),
                " ",
                (finding.text, "bold"),
                f"\n   {finding.evidence}\n   → {finding.advice}",
            )
        )
    return parts


def _beams(made: Audit) -> Table:
    matrix = made.assessment.matrix
    assert matrix is not None
    table = Table(
        title=f"beams: {matrix.regression}, {matrix.pings} pings, residual {1e3 * matrix.residual_mps:.2g} mm/s",
        title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0),
    )  # fmt: skip
    matched = made.assessment.match is not None
    table.add_column("", no_wrap=True)
    names = [
        "tilt deg",
        "±",
        "azimuth",
        "±",
        "scale",
        "bias mm/s",
        "valid %",
        *(["is", "off deg"] if matched else []),
    ]
    for name in names:
        table.add_column(name, justify="right", no_wrap=True, style="dim" if name == "±" else None)
    for row in beams_table(made).iter_rows(named=True):
        cells = [
            str(row["beam"]),
            f"{row['tilt_deg']:.3f}", f"{row['tilt_sd_deg']:.1g}",
            f"{row['azimuth_deg'] + 0.0:.3f}", f"{row['azimuth_sd_deg']:.1g}",
            f"{row['scale']:.4f}", f"{round(1e3 * row['bias_mps'], 2) + 0.0:.2f}",
            f"{100.0 * row['valid_fraction']:.1f}",
        ]  # fmt: skip
        if matched:
            cells += [f"{'-' if row['stated_sign'] < 0 else ''}{row['stated_beam']}", f"{row['off_deg']:.2f}"]
        table.add_row(*cells)
    return table
