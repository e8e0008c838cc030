"""The command `bottomlock fix`: velocity fixes from recorded pings, and their errors where beams are left out."""

from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from cyclopts import Parameter
from rich.table import Table

from bottomlock.audit.defects import ADVICE, why_never_locked
from bottomlock.audit.logs import BeamLog
from bottomlock.cli.beam_noise import print_noise
from bottomlock.cli.console import console
from bottomlock.cli.force import Force
from bottomlock.cli.left_out import score
from bottomlock.cli.parameters import Robust, beside, geometry_of
from bottomlock.errors import DataError, OutputError, ScenarioError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.files.overwriting import check_free
from bottomlock.io.beams import Instrument, Pings, read_beams, read_geometry
from bottomlock.io.formats import converted_first
from bottomlock.kernel import FIX_METHODS, FixMethod, fix_method, solve_velocity
from bottomlock.replay.leave_out import VelocityWalk
from bottomlock.replay.robust_fix import RobustFixes, solve_robust

METHOD = "lc"
"""Assumes nothing of the vehicle."""


def fix(
    log: Path,
    *,
    geometry: Annotated[
        str | None,
        Parameter(
            help="Packaged geometry or TOML file of the DVL. By default what `convert` noted beside the table."
        ),
    ] = None,
    method: Annotated[
        str | None,
        Parameter(help=f"Method: {', '.join(FIX_METHODS)}; {METHOD} by default. With --leave-out each."),
    ] = None,
    out: Annotated[
        Path | None,
        Parameter(
            alias="-o",
            help="Parquet file for the fixes; LOG_fixes.parquet by default. With --leave-out for the errors of each "
            "set of beams.",
        ),
    ] = None,
    robust: Robust = True,
    leave_out: Annotated[
        int | None,
        Parameter(help="Leave so many beams out of complete pings, and print the error of each method."),
    ] = None,
    walk_mps_per_rt_s: Annotated[
        float,
        Parameter(
            help="Random walk of the velocity, m/s/√s, for methods that need a prior; with --leave-out."
        ),
    ] = 0.1,
    closure_gate: Annotated[
        float,
        Parameter(
            help="Largest closure of a reference ping, in robust standard deviations, 0 to keep all pings; "
            "with --leave-out."
        ),
    ] = 3.0,
    force: Force = False,
) -> None:
    """Solve recorded pings for velocity fixes with covariance, or score the methods on them.

    Parameters
    ----------
    log
        Beam table of `bottomlock convert`, or CSV or Parquet with the columns time_ns, beam1_mps ..., beam1_valid ...;
        the geometry file may map other names.
    """
    geometry = geometry_of(log, geometry)
    if geometry is None:
        raise ScenarioError(
            "is missing", place=log, key="--geometry",
            expected="a packaged geometry or a TOML file: no account of `bottomlock convert` names one beside the log",
        )  # fmt: skip
    if out is None and leave_out is None:
        out = beside(log, "fixes.parquet")
    if out is not None:
        if out.suffix.lower() != ".parquet":
            raise OutputError(place=out, expected="a name that ends in .parquet")
        check_free(out, inputs=(log, Path(geometry)), force=force)
    instrument = read_geometry(geometry)
    with converted_first(log, instrument.columns.time):
        pings = read_beams(log, geometry=instrument)
    if leave_out is not None:
        if method is not None:
            raise ScenarioError(
                "every method is scored", place="--method and --leave-out", hint="give one of the two"
            )
        walk = VelocityWalk(walk_mps_rts=walk_mps_per_rt_s)
        score(
            log.name,
            instrument,
            pings,
            beams=leave_out,
            walk=walk,
            closure_gate=closure_gate,
            robust=robust,
            out=out,
        )
        return
    assert out is not None  # without --leave-out it has a default
    _require_lock(pings, str(log))
    _fix(log, instrument, pings, fix_method(method or METHOD), out, robust=robust)


def _fix(
    log: Path, instrument: Instrument, pings: Pings, method: FixMethod, out: Path, *, robust: bool
) -> None:
    """Solves the pings, writes them and prints what they are."""
    frame, solved = _solve(instrument, pings, method, robust=robust)
    if (frame["status"] == "prior_required").any() and pings.prior_velocity_p_mps is None:
        raise DataError(
            (
                f"method '{method}' needs the columns prior_surge_mps, prior_sway_mps, "
                "prior_heave_mps and their standard deviations"
            ),
            place=log,
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
    console.print(f"wrote {out}", soft_wrap=True, highlight=False)


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
            (
                "no velocity is solved, because the instrument never had bottom lock in this log: "
                f"{why}. {ADVICE}"
            ),
            place=place,
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
