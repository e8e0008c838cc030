"""Submissions of T1 and T5: answers as a table with a row a ping and mask, held against the rules, and back."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock import DataError
from bottomlock.tables.check import check
from partialdvl_bench.beam_tasks import (
    PING_ENTRANTS,
    RECORDING,
    VELOCITY_ENTRANTS,
    Answer,
    left_out,
    masked_pings,
    ping_scores,
    recorded_pings,
    velocity_scores,
)
from partialdvl_bench.load import load_mission
from partialdvl_bench.mission import Mission
from partialdvl_bench.mission_list import MissionSpec
from partialdvl_bench.tables import BEAM_SUBMISSION, PING_SUBMISSION, SCORES, VELOCITY, VELOCITY_COV

BEAMS, PINGS = "beams", "pings"
"""Endings of the names of these submissions: METHOD.beams.parquet and METHOD.pings.parquet."""


def velocity_table(mission: Mission, answer: Answer) -> pl.DataFrame:
    """The rows of T1 (`tables.BEAM_SUBMISSION`) of one mission."""
    pings, _ = masked_pings(mission)
    upper = answer[1][:, *np.triu_indices(3)]
    flat = np.hstack([answer[0], upper])
    flat[~np.isfinite(flat).all(axis=1)] = np.nan
    columns = {"mission": [mission.name] * len(pings.time_ns), "time_ns": pings.time_ns, "mask": pings.masks}
    columns |= dict(zip((*VELOCITY, *VELOCITY_COV), flat.T, strict=True))
    return pl.DataFrame(columns, schema=dict(BEAM_SUBMISSION)).with_columns(pl.col(pl.Float64).fill_nan(None))


def ping_table(answer: Answer) -> pl.DataFrame:
    """The rows of T5 (`tables.PING_SUBMISSION`)."""
    _, time_ns, readings = recorded_pings()
    rows = left_out(len(readings))
    known = np.isfinite(answer[0][:, 0]) & np.isfinite(answer[1][:, 0, 0])
    columns = {
        "recording": [RECORDING] * len(rows.ping),
        "time_ns": time_ns[rows.ping],
        "mask": ["".join("1" if one else "0" for one in mask) for mask in rows.mask],
        "beam": rows.beam + 1,
        "reading_mps": np.where(known, answer[0][:, 0], np.nan),
        "sd_mps": np.where(known, np.sqrt(np.where(known, answer[1][:, 0, 0], 1.0)), np.nan),
    }
    return pl.DataFrame(columns, schema=dict(PING_SUBMISSION)).with_columns(pl.col(pl.Float64).fill_nan(None))


def beam_table_names() -> list[str]:
    """The stems of the files of our submissions of T1 and T5."""
    return [f"{name}.{BEAMS}" for name in VELOCITY_ENTRANTS] + [f"{name}.{PINGS}" for name in PING_ENTRANTS]


def our_beam_tables(missions: Sequence[Mission]) -> dict[str, pl.DataFrame]:
    """Our submissions of T1 over these missions, and of T5, by the stem of the file."""
    tables: dict[str, pl.DataFrame] = {}
    for name, call in VELOCITY_ENTRANTS.items():
        parts = [velocity_table(mission, call(masked_pings(mission)[0])) for mission in missions]
        tables[f"{name}.{BEAMS}"] = pl.concat([pl.DataFrame(schema=dict(BEAM_SUBMISSION)), *parts])
    rows = left_out(len(recorded_pings()[1]))
    return tables | {f"{name}.{PINGS}": ping_table(call(rows)) for name, call in PING_ENTRANTS.items()}


def velocity_answer(frame: pl.DataFrame, mission: Mission, place: str) -> Answer:
    """The answers of T1 of one mission, in the order of its pings and masks.

    Raises:
        DataError: naming the row that is missing, or whose covariance is none.
    """
    pings, _ = masked_pings(mission)
    asked = pl.DataFrame({"time_ns": pings.time_ns, "mask": pings.masks})
    found = _joined(
        asked, frame.filter(pl.col("mission") == mission.name), ["time_ns", "mask"], place, mission.name
    )
    value, upper = (found.select(part).fill_null(np.nan).to_numpy() for part in (VELOCITY, VELOCITY_COV))
    cov = np.empty((len(value), 3, 3))
    row, column = np.triu_indices(3)
    cov[:, row, column] = cov[:, column, row] = upper
    known = np.isfinite(upper).all(axis=1)
    least = np.linalg.eigvalsh(np.where(known[:, None, None], cov, np.eye(3)))[:, 0]
    _refuse(
        found, ~known & np.isfinite(value).any(axis=1), VELOCITY_COV[0], "is null beside a velocity", place
    )
    _refuse(found, least <= 0.0, VELOCITY_COV[0], "the covariance with it is not positive definite", place)
    return value, cov


def ping_answer(frame: pl.DataFrame, place: str) -> Answer:
    """The answers of T5, in the order of its rows.

    Raises:
        DataError: naming the row that is missing, or whose standard deviation is none.
    """
    _, time_ns, readings = recorded_pings()
    rows = left_out(len(readings))
    asked = pl.DataFrame(
        {
            "time_ns": time_ns[rows.ping],
            "mask": ["".join("1" if one else "0" for one in mask) for mask in rows.mask],
            "beam": rows.beam + 1,
        }
    )
    found = _joined(asked, frame, ["time_ns", "mask", "beam"], place, RECORDING)
    value, sd = (found[name].fill_null(np.nan).to_numpy() for name in ("reading_mps", "sd_mps"))
    bad = np.isfinite(value) & ~(sd > 0.0)
    _refuse(found, bad, "sd_mps", "is not above 0 beside a reading", place)
    return value[:, None], (sd**2)[:, None, None]


def score_beam_submissions(paths: Sequence[Path], frames: Sequence[pl.DataFrame], data: Path,
                           specs: Sequence[MissionSpec]) -> pl.DataFrame:  # fmt: skip
    """The scores of submissions of T1 and T5 (`tables.SCORES`); the name before the first dot is the method's.

    Raises:
        DataError: for a submission that breaks the rules.
    """
    parts = [pl.DataFrame(schema=dict(SCORES))]
    velocity = []
    for path, frame in zip(paths, frames, strict=True):
        method = path.name.split(".")[0]
        if "beam" in frame.columns:
            parts.append(
                ping_scores(ping_answer(check(frame, PING_SUBMISSION, place=str(path)), str(path)), method)
            )
        else:
            velocity.append((path, method, check(frame, BEAM_SUBMISSION, place=str(path))))
    names = set().union(*(frame["mission"].unique() for _, _, frame in velocity))
    answered = {(spec.split, spec.version) for spec in specs if spec.name in names}
    for spec in specs:
        if (spec.split, spec.version) in answered:
            mission = load_mission(data / spec.split / spec.name)
            for path, method, frame in velocity:
                parts.append(velocity_scores(mission, velocity_answer(frame, mission, str(path)), method))
    return pl.concat(parts)


def _joined(asked: pl.DataFrame, frame: pl.DataFrame, keys: list[str], place: str, what: str) -> pl.DataFrame:
    """The rows of a submission in the order in which they are asked, with the number of each in the file."""
    numbered = frame.with_row_index("row")
    again = ~numbered.select(pl.struct(keys).is_first_distinct()).to_series()
    if again.any():
        raise DataError(
            f"{place}: '{what}' has a row twice, {numbered.filter(again).select(keys).row(0, named=True)}"
        )
    found = asked.join(numbered, on=keys, how="left", maintain_order="left")
    lacking = found.filter(pl.col("row").is_null())
    if lacking.height:
        raise DataError(
            f"{place}: '{what}' lacks {lacking.height} of {asked.height} rows, the first is "
            f"{lacking.select(keys).row(0, named=True)}; expected a row for every ping and mask, null without an answer"
        )
    return found


def _refuse(found: pl.DataFrame, bad: NDArray[np.bool_], column: str, words: str, place: str) -> None:
    rows = np.flatnonzero(bad)
    if rows.size:
        raise DataError(f"{place}: row {found['row'][int(rows[0])] + 1}, column '{column}': {words}")
