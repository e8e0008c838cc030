"""Submissions: estimates as one table of all missions, held against its rules, and back; also as TUM files."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock import DataError
from bottomlock.files.atomic_write import write_text
from bottomlock.tables.check import check
from partialdvl_bench.mission import Estimates
from partialdvl_bench.mission_list import MissionSpec, mission_list
from partialdvl_bench.tables import ATTITUDE, BLOCKS, SUBMISSION

Floats = NDArray[np.float64]

SECOND_NS = 1_000_000_000
UNIT = 1e-3
"""A quaternion's norm may differ by this from 1."""
POSITIVE = 1e-12
"""The least eigenvalue of the matrix of correlations must exceed this: a singular one claims certainty."""


def grid_ns(spec: MissionSpec) -> NDArray[np.int64]:
    """The times at which an estimate is asked: every whole second after the start, to the end."""
    return SECOND_NS * np.arange(1, round(spec.duration_s) + 1, dtype=np.int64)


def table_of(mission: str, estimates: Estimates) -> pl.DataFrame:
    """The rows of a submission (`tables.SUBMISSION`) of one mission; a row with a NaN in a block has it null."""
    count = len(estimates.time_ns)
    columns: dict[str, object] = {"mission": [mission] * count, "time_ns": estimates.time_ns}
    answers = {
        "velocity": (estimates.velocity_p_mps, estimates.velocity_cov),
        "position": (estimates.position_t_m, estimates.position_cov),
        "current": (estimates.current_t_mps, estimates.current_cov),
    }
    for block, (names, cov_names) in BLOCKS.items():
        value, cov = answers[block]
        size = len(names)
        flat = np.full((count, size + len(cov_names)), np.nan)
        if value is not None and cov is not None:
            upper = np.asarray(cov)[:, *np.triu_indices(size)]
            flat = np.hstack([value, upper])
            flat[~np.isfinite(flat).all(axis=1)] = np.nan
        columns |= dict(zip((*names, *cov_names), flat.T, strict=True))
    attitude = np.full((count, 4), np.nan) if estimates.attitude_t_p is None else estimates.attitude_t_p
    columns |= dict(zip(ATTITUDE, np.asarray(attitude).T, strict=True))
    columns["wall_s"] = np.full(count, np.nan if estimates.wall_s is None else estimates.wall_s)
    return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None)).select(list(SUBMISSION))


def estimates_of(rows: pl.DataFrame) -> Estimates:
    """The estimates of one mission from its rows; nulls are NaN, and a block without any answer is None."""

    def block(name: str) -> tuple[Floats | None, Floats | None]:
        names, cov_names = BLOCKS[name]
        value, upper = (
            rows.select(part).cast(pl.Float64).fill_null(np.nan).to_numpy() for part in (names, cov_names)
        )
        if not np.isfinite(value).any():
            return None, None
        cov = np.empty((len(value), len(names), len(names)))
        row, column = np.triu_indices(len(names))
        cov[:, row, column] = cov[:, column, row] = upper
        return value, cov

    velocity, velocity_cov = block("velocity")
    position, position_cov = block("position")
    current, current_cov = block("current")
    attitude = rows.select(ATTITUDE).fill_null(np.nan).to_numpy()
    wall = rows["wall_s"].drop_nulls()
    count = rows.height
    return Estimates(
        time_ns=rows["time_ns"].to_numpy(),
        velocity_p_mps=np.full((count, 3), np.nan) if velocity is None else velocity,
        velocity_cov=np.full((count, 3, 3), np.nan) if velocity_cov is None else velocity_cov,
        position_t_m=position,
        position_cov=position_cov,
        attitude_t_p=attitude if np.isfinite(attitude).any() else None,
        current_t_mps=current,
        current_cov=current_cov,
        wall_s=float(wall[0]) if len(wall) else None,
    )


def check_submission(
    frame: pl.DataFrame,
    place: str,
    specs: Sequence[MissionSpec] | None = None,
    asked: Sequence[MissionSpec] | None = None,
) -> pl.DataFrame:
    """The submission itself, if it keeps the rules; of a split of a version it answers every mission or none.

    Args:
        frame: the table.
        place: its name in errors.
        specs: the missions that there are; those of the list by default.
        asked: those of them that a submission must answer; all by default.

    Raises:
        DataError: naming row (from 1) and column, what was expected, and the likely mistake.
    """
    check(frame, SUBMISSION, place=place)
    specs = mission_list() if specs is None else specs
    _check_missions(frame, place, specs, specs if asked is None else asked)
    _check_times(frame, place, specs)
    for name in (one for one, kind in SUBMISSION.items() if kind == pl.Float64()):
        bad = frame.select(
            (pl.col(name).is_nan() | pl.col(name).is_infinite()).fill_null(value=False)
        ).to_series()
        if bad.any():
            _fail(
                place,
                int(bad.arg_max() or 0),
                name,
                "is not finite, expected a number, or null where there is no answer",
            )
    for names, cov_names in BLOCKS.values():
        _check_block(frame, place, names, cov_names)
    _check_attitude(frame, place)
    negative = (frame["wall_s"] < 0.0).fill_null(value=False)
    if negative.any():
        _fail(place, int(negative.arg_max() or 0), "wall_s", "is negative, expected seconds")
    return frame


def _fail(place: str, row: int, column: str, words: str) -> NoReturn:
    raise DataError(f"{place}: row {row + 1}, column '{column}': {words}")


def _check_missions(
    frame: pl.DataFrame, place: str, specs: Sequence[MissionSpec], asked: Sequence[MissionSpec]
) -> None:
    names = frame["mission"]
    known = {spec.name: spec for spec in specs}
    strange = ~names.is_in(list(known)) | names.is_null()
    if strange.any():
        row = int(strange.arg_max() or 0)
        _fail(place, row, "mission", f"'{names[row]}' is no mission; `bottomlock bench list` lists them")
    given = set(names.unique())
    if not given:
        raise DataError(f"{place}: has no rows, expected a row for each time of each mission of a split")
    for split, version in {(known[name].split, known[name].version) for name in given}:
        lacking = [
            spec.name
            for spec in asked
            if (spec.split, spec.version) == (split, version) and spec.name not in given
        ]
        if lacking:
            raise DataError(
                f"{place}: lacks {len(lacking)} missions of the split {split}, the first is '{lacking[0]}'; expected "
                "every mission, with null where there is no answer; `bottomlock bench score --missions` scores a few"
            )


def _check_times(frame: pl.DataFrame, place: str, specs: Sequence[MissionSpec]) -> None:
    grids = {spec.name: grid_ns(spec) for spec in specs}
    numbered = frame.select("mission", "time_ns").with_row_index("row")
    for (mission,), rows in numbered.group_by("mission", maintain_order=True):
        grid, times = grids[str(mission)], rows["time_ns"]
        off = ~times.is_in(grid.tolist()) | times.is_null()
        if off.any():
            at = int(off.arg_max() or 0)
            hint = ", which looks like other units than ns" if (times[at] or 0) < SECOND_NS else ""
            _fail(
                place, rows["row"][at], "time_ns",
                f"{times[at]} is not on the grid of '{mission}', expected whole seconds in ns from {grid[0]} to "
                f"{grid[-1]}{hint}",
            )  # fmt: skip
        again = ~times.is_first_distinct()
        if again.any():
            at = int(again.arg_max() or 0)
            _fail(
                place, rows["row"][at], "time_ns", f"{times[at]} stands twice for '{mission}', expected once"
            )
        if len(times) != len(grid):
            lacking = np.setdiff1d(grid, times.to_numpy())
            raise DataError(
                f"{place}: '{mission}' lacks {len(lacking)} of {len(grid)} times, the first is time_ns {lacking[0]}"
            )


def _check_block(frame: pl.DataFrame, place: str, names: Sequence[str], cov_names: Sequence[str]) -> None:
    every = [*names, *cov_names]
    empty = frame.select(pl.sum_horizontal(pl.col(every).is_null().cast(pl.Int64))).to_series()
    partly = (empty > 0) & (empty < len(every))
    if partly.any():
        row = int(partly.arg_max() or 0)
        lacking = next(name for name in every if frame[name][row] is None)
        _fail(
            place,
            row,
            lacking,
            f"is null beside values of {names[0]} and the like, expected all of them or none",
        )
    rows = np.flatnonzero((empty == 0).to_numpy())
    size = len(names)
    cov = np.empty((len(rows), size, size))
    one, other = np.triu_indices(size)
    cov[:, one, other] = cov[:, other, one] = frame.select(cov_names).to_numpy()[rows]
    variance = np.diagonal(cov, axis1=1, axis2=2)
    known = np.asarray((variance > 0.0).all(axis=1))
    sd = np.sqrt(np.where(known[:, None], variance, 1.0))
    correlated = np.linalg.eigvalsh(cov / (sd[:, :, None] * sd[:, None, :]))[:, 0]
    bad = np.flatnonzero(~(known & (correlated > POSITIVE)))
    if bad.size:
        least, greatest = np.linalg.eigvalsh(cov[bad[0]])[[0, -1]]
        hint = "" if least <= 0.0 else "; a covariance that is nearly singular claims what no sensor measures"
        _fail(
            place, int(rows[bad[0]]), cov_names[0],
            f"the covariance with it is not positive definite (eigenvalues {least:.3g} to {greatest:.3g}), expected "
            f"the upper triangle of a covariance, not standard deviations{hint}",
        )  # fmt: skip


def _check_attitude(frame: pl.DataFrame, place: str) -> None:
    norm = frame.select(pl.sum_horizontal(pl.col(ATTITUDE) ** 2, ignore_nulls=False)).to_series()
    bad = ((norm.sqrt() - 1.0).abs() > UNIT).fill_null(value=False)
    if bad.any():
        row = int(bad.arg_max() or 0)
        _fail(
            place,
            row,
            ATTITUDE[0],
            f"the quaternion has the norm {norm[row] ** 0.5:.4g}, expected 1, scalar first",
        )
    lacking = frame.select(pl.sum_horizontal(pl.col(ATTITUDE).is_null().cast(pl.Int64))).to_series()
    partly = (lacking > 0) & (lacking < len(ATTITUDE))
    if partly.any():
        _fail(
            place,
            int(partly.arg_max() or 0),
            ATTITUDE[0],
            "the quaternion has nulls, expected four numbers or none",
        )


def write_tum(frame: pl.DataFrame, out: Path) -> list[Path]:
    """A TUM file per mission with position and attitude: time in s, x y z north east down, qx qy qz qw.

    Returns:
        The files; rows and missions without position or attitude are left out.

    Raises:
        OutputError: where the folder cannot be written.
    """
    written = []
    names = [*BLOCKS["position"][0], *(f"attitude_{part}" for part in "xyzw")]
    for (mission,), rows in frame.group_by("mission", maintain_order=True):
        whole = rows.sort("time_ns").drop_nulls(names)
        if whole.height:
            lines = [
                f"{time_ns // SECOND_NS}.{time_ns % SECOND_NS:09d} "
                + " ".join(f"{value:.9f}" for value in values)
                for time_ns, *values in whole.select("time_ns", *names).iter_rows()
            ]
            written.append(out / f"{mission}.tum")
            write_text(written[-1], "\n".join(lines) + "\n")
    return written


def join(parts: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """A submission from the tables of its missions, in the order of mission and time."""
    return pl.concat(list(parts)).sort("mission", "time_ns")
