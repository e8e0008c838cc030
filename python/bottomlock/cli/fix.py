"""The command `bottomlock fix`: velocity fixes from recorded pings."""

from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from cyclopts import Parameter
from rich.table import Table

from bottomlock.atomic_write import write_parquet
from bottomlock.audit.lock import ADVICE, why_never_locked
from bottomlock.audit.logs import BeamLog
from bottomlock.cli.beam_noise import print_noise
from bottomlock.cli.console import console
from bottomlock.cli.force import Force
from bottomlock.cli.parameters import Robust
from bottomlock.errors import DataError, OutputError
from bottomlock.io.beams import Instrument, Pings, read_beams, read_geometry
from bottomlock.io.formats import converted_first
from bottomlock.kernel import FIX_METHODS, FixMethod, fix_method, solve_velocity
from bottomlock.overwriting import check_free
from bottomlock.replay.robust_fix import RobustFixes, solve_robust


def fix(
    log: Path,
    *,
    geometry: Annotated[str, Parameter(help="Packaged geometry or TOML file of the DVL.")],
    method: Annotated[str, Parameter(help=f"Method: {', '.join(FIX_METHODS)}.")],
    out: Annotated[Path, Parameter(alias="-o", help="Parquet file for the fixes.")],
    robust: Robust = True,
    force: Force = False,
) -> None:
    """Solve recorded pings for velocity fixes with covariance.

    Parameters
    ----------
    log
        CSV or Parquet with the columns time_ns, beam1_mps ..., beam1_valid ...; the geometry file may map other names.
    """
    if out.suffix.lower() != ".parquet":
        raise OutputError(f"{out}: expected a name that ends in .parquet")
    check_free(out, inputs=(log, Path(geometry)), force=force)
    instrument = read_geometry(geometry)
    with converted_first(log, instrument.columns.time):
        pings = read_beams(log, beams=instrument.geometry.beams, columns=instrument.columns)
    _require_lock(pings, str(log))
    frame, solved = _solve(instrument, pings, fix_method(method), robust=robust)
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
    if solved is not None:
        print_noise(solved.noise, instrument.beam_sd_mps)
        _print_outliers(frame)
    console.print(f"wrote {out}")


def _require_lock(pings: Pings, place: str) -> None:
    """That the log had bottom lock somewhere.

    An instrument that lost a beam for a whole log flags its velocity invalid throughout, and the beams left are as good
    as ever: its flag counts against pings with every beam only.

    Raises:
        DataError: where it never had, with the reason.
    """
    lost = not pings.valid.all(axis=1).any()
    flag = None if lost else pings.instrument_valid
    log = BeamLog(place, pings.time_ns, pings.velocity_mps, pings.valid, instrument_valid=flag)
    why = why_never_locked(log)
    if why:
        raise DataError(
            f"{place}: no velocity is solved, because the instrument never had bottom lock in this log: {why}. {ADVICE}"
        )


def _solve(
    instrument: Instrument, pings: Pings, method: FixMethod, *, robust: bool
) -> tuple[pl.DataFrame, RobustFixes | None]:
    """The table of fixes, and what was measured and screened where `robust`."""
    cov = None if pings.prior_sd_mps is None else pings.prior_sd_mps[:, :, None] ** 2 * np.eye(3)
    if not robust:
        fixes = solve_velocity(
            instrument.geometry,
            pings.velocity_mps,
            pings.valid,
            method=method,
            beam_sd_mps=instrument.beam_sd_mps,
            prior_velocity_p_mps=pings.prior_velocity_p_mps,
            prior_cov_m2ps2=cov,
        )
        return fixes.to_frame(pings.time_ns), None
    solved = solve_robust(
        instrument.geometry,
        pings.time_ns,
        pings.velocity_mps,
        pings.valid,
        method=method,
        beam_sd_mps=instrument.beam_sd_mps,
        instrument_valid=pings.instrument_valid,
        prior_velocity_p_mps=pings.prior_velocity_p_mps,
        prior_cov_m2ps2=cov,
    )
    return solved.to_frame(pings.time_ns), solved


def _print_outliers(frame: pl.DataFrame) -> None:
    """How many pings could be tested for outliers, and with what outcome."""
    count = dict(frame.group_by("outlier_test").len().iter_rows())
    console.print(
        f"outliers: {count.get('passed', 0)} pings passed, {count.get('beam_rejected', 0)} with a beam rejected, "
        f"{count.get('down_weighted', 0)} down-weighted (no beam identified), {count.get('untested', 0)} untested "
        "(without redundant beams no outlier can be found)",
        highlight=False,
    )
