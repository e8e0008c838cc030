"""The command `bottomlock audit`."""

from pathlib import Path

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, say
from bottomlock.cli.parameters import Out, beside, geometry_of


def audit(
    log: Path,
    *,
    out: Out = None,
    geometry: str | None = None,
    attitude: Path | None = None,
    write: Path | None = None,
    force: Force = False,
) -> None:
    """Audit a DVL log: beam directions, order, signs, defects, mounting.

    Findings are ranked, each with its evidence in numbers.

    Args:
        log: A beam table (`bottomlock convert` writes one), or a CSV or Parquet file whose columns the geometry maps.
        out: Directory for audit.json, tables, figures and audit.html; LOG_audit by default.
        geometry: Geometry to compare with: a packaged one or a TOML file, whose column map is used. By default what
            `convert` noted beside the table.
        attitude: CSV or Parquet: time_ns, roll_rad, pitch_rad, yaw_rad, velocity_north_mps ..., for the mounting.
        write: TOML file to which the estimated geometry is written, with mounting, scale and clock.
    """
    from bottomlock.audit.geometry_file import geometry_text
    from bottomlock.audit.logs import read_reference
    from bottomlock.audit.page import audit_files, page_of
    from bottomlock.audit.run import audit_file, numbers_of
    from bottomlock.cli.page_output import print_part
    from bottomlock.files.atomic_write import write_text
    from bottomlock.files.overwriting import Result, check_free
    from bottomlock.files.records import sha256_of
    from bottomlock.io.calibrated_file import require_toml
    from bottomlock.io.formats import converted_first

    out, geometry = out or beside(log, "audit"), geometry_of(log, geometry)
    read = {"log": log, "attitude": attitude}
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
    with converted_first(log):
        report = audit_file(log, geometry=geometry, reference=reference)
    # The findings say why a log gives no geometry to write, so they are printed before it is refused.
    page = page_of(report, numbers_of(report))
    console.print(page.about, highlight=False)
    for part in (*page.parts[1:-1], page.parts[0]):
        print_part(part)
    text = None if write is None else geometry_text(report)
    result.write(audit_files(report), force=force)
    if write is not None and text is not None:
        write_text(write, text)
        say(f"wrote {write}")
    say(f"audit.html, audit.json, tables and figures in {out}")
