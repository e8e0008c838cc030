"""The command `bottomlock fix`: velocity fixes from recorded pings."""

from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from cyclopts import Parameter
from rich.table import Table

from bottomlock.atomic_write import write_parquet
from bottomlock.cli.console import console
from bottomlock.errors import DataError, OutputError
from bottomlock.io.beams import read_beams, read_geometry
from bottomlock.kernel import FIX_METHODS, solve_velocity


def fix(
    log: Path,
    *,
    geometry: Annotated[str, Parameter(help="Packaged geometry or TOML file of the DVL.")],
    method: Annotated[str, Parameter(help=f"Method: {', '.join(FIX_METHODS)}.")],
    out: Annotated[Path, Parameter(help="Parquet file for the fixes.")],
) -> None:
    """Solve recorded pings for velocity fixes with covariance.

    Parameters
    ----------
    log
        CSV or Parquet with the columns time_ns, beam1_mps ..., beam1_valid ...; the geometry file may map other names.
    """
    if out.suffix.lower() != ".parquet":
        raise OutputError(f"{out}: expected a name that ends in .parquet")
    instrument = read_geometry(geometry)
    pings = read_beams(log, beams=instrument.geometry.beams, columns=instrument.columns)
    cov = None if pings.prior_sd_mps is None else pings.prior_sd_mps[:, :, None] ** 2 * np.eye(3)
    fixes = solve_velocity(
        instrument.geometry,
        pings.velocity_mps,
        pings.valid,
        method=method,
        beam_sd_mps=instrument.beam_sd_mps,
        prior_velocity_p_mps=pings.prior_velocity_p_mps,
        prior_cov_m2ps2=cov,
    )
    frame = fixes.to_frame(pings.time_ns)
    if (frame["status"] == "prior_required").any() and pings.prior_velocity_p_mps is None:
        raise DataError(
            f"{log}: method '{method}' needs the columns prior_surge_mps, prior_sway_mps, prior_heave_mps and "
            "their standard deviations"
        )
    write_parquet(out, frame)
    table = Table(title=f"{frame.height} pings, method {method}", title_justify="left")
    for name in ("beams", "status", "pings"):
        table.add_column(name, justify="right" if name == "pings" else "left")
    count = pl.sum_horizontal(pl.col("^beam[0-9]+_used$").cast(pl.Int64)).alias("beams")
    for row in (
        frame.group_by(count, "status").len().sort("beams", "status", descending=[True, False]).iter_rows()
    ):
        table.add_row(*(str(value) for value in row))
    console.print(table)
    console.print(f"wrote {out}")
