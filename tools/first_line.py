"""The first line of a replay, right or wrong: `python -m tools.first_line [--only WORD] [--out FILE]`.

Every row is what a navigator does first: `replay --init` of files, untouched, then `replay` of the case. The files are
the open recordings (folder BOTTOMLOCK_RECORDINGS, by default `shared/data` beside the checkout; what is absent is
skipped), the shipped logs, and dives of `tests/dive.py`: right ones, kinds of logs that people reported, and planted
mistakes. The answer is held against the truth, which no run is given.

A track is right where its horizontal error at the end is at most 2.5 sigma (the truth's noise included), its RMS error
no larger than that either and at most 1.25 times dead reckoning's or within 0.5 % of the distance, and its depth, where
the truth has one, within 2.5 sigma. A sigma beyond the distance travelled claims nothing, and a track of less than 85 %
of the dive is not the dive's: both are wrong. The outcome of a row:

- `right`: "yes" with a right track, "partly", and "no" or a refusal that is none of the following;
- `false alarm`: "no" to a faultless log where the filter's track is right; "no" to another that recommends a wrong
  track where the filter's is right; a refusal of a faultless log;
- `wrong yes`: "yes" with a wrong track, and the unaided `ins` recommended by whatever answer;
- `untrue`: a refusal whose reason is not true; `no replay`: a case as written that does not run;
- `traceback`: an exception that is none of the package's; `unjudged`: a log without a truth.

Columns of the table: name, kind; verdict (yes, partly, no, refused, no replay, traceback); track (the recommended
method); error_m, rms_m, sd_m (at the end), down_m, down_sd_m of that track, or of the first filter where none is
recommended; reckoned_rms_m (dead reckoning's); distance_m; covered (part of the truth's time); outcome; said (the
answer's sentence, or the error); seconds. `data/evidence/first_line.parquet` holds the table of a commit; its metadata
name commit and command.
"""

from __future__ import annotations

import os
import re
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cyclopts
import numpy as np
import polars as pl

from bottomlock.errors import BottomlockError
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.replay.case import load_case
from bottomlock.replay.init.make import make_case
from bottomlock.replay.run import replay_case
from tools.evidence import origin
from tools.first_line_rows import Floats, Row, Truth, absent, local, rows

SIGMAS, OF_RECKONED, OF_DISTANCE, COVERED = 2.5, 1.25, 0.005, 0.85
DOWN_SD_M = 0.05
"""Of a true depth: waves, and the sensor's place."""
RECKONED = "dead_reckoning"
WRONG = ("wrong yes", "traceback", "no replay", "untrue", "false alarm")
NUMBERS = ("error_m", "rms_m", "sd_m", "down_m", "down_sd_m", "reckoned_rms_m", "distance_m", "covered")
SCHEMA = (
    dict.fromkeys(("name", "kind", "verdict", "track"), pl.String)
    | dict.fromkeys(NUMBERS, pl.Float64)
    | {"outcome": pl.String, "said": pl.String, "seconds": pl.Float64}
)


def run(row: Row, *, smooth: bool = True) -> dict[str, Any]:
    """One row of the table; without smoothing in half the time, and without a heading told by the whole log."""
    began = time.perf_counter()
    found: dict[str, Any] = {"name": row.name, "kind": row.kind}
    with TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        files, truth = row.make(Path(scratch))
        fails = "refused"
        try:
            written, fails = make_case(files, Path(scratch) / "case.toml").case, "no replay"
            case = load_case(written)
            settings = case.replay.model_copy(update={"smooth": smooth})
            found |= _judged(replay_case(case.model_copy(update={"replay": settings})), truth, row)
        except Exception as error:  # noqa: BLE001 - what a user would see is what is counted
            found |= _failed(error, fails, row)
    # The scratch folder has another name each time.
    said = found["said"].replace(f"{scratch}{os.sep}", "")
    return found | {"said": said, "seconds": round(time.perf_counter() - began, 1)}


def _failed(error: Exception, verdict: str, row: Row) -> dict[str, Any]:
    """What an exception amounts to."""
    if not isinstance(error, BottomlockError):
        at = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {error} ({Path(at.filename).name}:{at.lineno})"
        return {"verdict": "traceback", "outcome": "traceback", "said": said}
    outcome, said = "false alarm" if row.faultless else "right", str(error)
    if verdict == "no replay":
        outcome = verdict
    elif row.untrue and re.search(row.untrue, said):
        outcome = "untrue"
    return {"verdict": verdict, "outcome": outcome, "said": said}


def _judged(replayed: ReplayTables, truth: Truth | None, row: Row) -> dict[str, Any]:
    """The answer of a replay beside the truth."""
    answer, samples = replayed.manifest["answer"], replayed.samples.filter(pl.col("pass") == "forward")
    methods = samples["method"].unique().to_list()
    verdict, track = answer["verdict"], answer["method"]
    first = next(one for one in ("tc", *methods) if one in methods)
    errors = {one: _errors(samples.filter(pl.col("method") == one), truth) for one in methods}
    reckoned = errors.get(RECKONED, {}).get("rms_m")
    shown = errors[track if track in errors else first]
    found = shown | {
        "verdict": verdict,
        "track": track,
        "reckoned_rms_m": reckoned,
        "said": answer["sentence"],
    }
    if track == "ins":
        return found | {"outcome": "wrong yes"}
    if shown["error_m"] is None:
        return found | {"outcome": "unjudged"}
    sd_m = 0.0 if truth is None else truth.sd_m
    right = is_right(shown, reckoned, sd_m)
    # What a "no" keeps from the navigator is the filter's track.
    kept = verdict == "no" and is_right(errors[first], reckoned, sd_m)
    if verdict == "yes" and not right:
        return found | {"outcome": "wrong yes"}
    alarm = kept and (row.faultless or (bool(track) and not right))
    return found | {"outcome": "false alarm" if alarm else "right"}


def is_right(of: dict[str, Any], reckoned_rms_m: float | None, truth_sd_m: float) -> bool:
    """Whether errors of a track are what its sigma, dead reckoning and the distance allow."""
    ends = (
        max(of["error_m"], of["rms_m"]) <= SIGMAS * np.hypot(of["sd_m"], truth_sd_m)
        and of["sd_m"] <= of["distance_m"]
    )
    most = max(OF_DISTANCE * of["distance_m"], OF_RECKONED * (reckoned_rms_m or 0.0))
    deep = of["down_m"] is None or abs(of["down_m"]) <= SIGMAS * np.hypot(of["down_sd_m"], DOWN_SD_M)
    return bool(ends and of["rms_m"] <= np.hypot(most, truth_sd_m) and deep and of["covered"] >= COVERED)


def _errors(track: pl.DataFrame, truth: Truth | None) -> dict[str, Any]:
    """Errors of a track, in metres, on the coarser of both series."""
    track = track.sort("time_ns")
    sds = track.select(f"sd_position_{axis}_m" for axis in ("north", "east", "down")).to_numpy().T
    at = track["time_ns"].to_numpy() * 1e-9
    if truth is None:
        off = track.select(f"err_position_{axis}_m" for axis in ("north", "east")).to_numpy().T
        span, grid, true = at, at, track.select("north_m", "east_m").to_numpy().T
        if not np.isfinite(off.astype(float)).any():
            return dict.fromkeys(("error_m", "rms_m", "sd_m", "down_m", "down_sd_m", "distance_m", "covered"))
    else:
        estimate = track.select("north_m", "east_m").to_numpy().T
        placed = truth.absolute and track["latitude_deg"].is_not_null().all() and truth.home != (0.0, 0.0)
        if placed:
            latitude, longitude = (track[f"{one}_deg"].to_numpy() for one in ("latitude", "longitude"))
            estimate = np.stack(local(latitude, longitude, truth.home))
        span, grid = truth.time_s, _grid(at, truth.time_s)
        true = np.stack([np.interp(grid, truth.time_s, one) for one in (truth.north_m, truth.east_m)])
        off = np.stack([np.interp(grid, at, one) for one in estimate]) - true
        if not truth.absolute:
            off -= off[:, :1]
    off = off[:, np.isfinite(off).all(axis=0)]
    north, east, down = (float(np.interp(grid[-1], at, one)) for one in sds)
    step = max(round(5.0 / max(float(np.median(np.diff(grid))), 1e-3)), 1)
    found: dict[str, Any] = {
        "error_m": float(np.hypot(*off[:, -1])),
        "rms_m": float(np.sqrt((off**2).sum(axis=0).mean())),
        "sd_m": float(np.hypot(north, east)),
        "distance_m": float(np.hypot(*np.diff(true[:, ::step])).sum()),
        "covered": float((grid[-1] - grid[0]) / (span[-1] - span[0])),
    }
    if truth is None or truth.down_m is None:
        return found | {"down_m": None, "down_sd_m": None}
    deep = np.interp(grid[-1], at, track["down_m"].to_numpy())
    return found | {
        "down_m": float(deep - np.interp(grid[-1], truth.time_s, truth.down_m)),
        "down_sd_m": down,
    }


def _grid(one: Floats, other: Floats) -> Floats:
    """Times of the coarser of two series within both."""
    begin, end = max(one[0], other[0]), min(one[-1], other[-1])
    cut = [times[(times >= begin) & (times <= end)] for times in (one, other)]
    coarser: Floats = min(cut, key=len)
    if not len(coarser):
        raise ValueError(
            f"the track is not of the truth's time: {one[0]} to {one[-1]}, {other[0]} to {other[-1]} s"
        )
    return coarser


def run_all(chosen: Iterable[Row], processes: int = 2) -> pl.DataFrame:
    """The table of rows, in their order; one of a name is made again by its name in another process."""
    names = [row.name for row in chosen]
    # A run is one process on one core.
    for variable in ("RAYON_NUM_THREADS", "POLARS_MAX_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        found = []
        for row in pool.map(_named, names):
            found.append(row)
            print(f"{len(found)} of {len(names)}: {row['name']}", file=sys.stderr)
    return pl.DataFrame(found, schema=SCHEMA)


def _named(name: str) -> dict[str, Any]:
    return run(next(row for row in rows() if row.name == name))


def counts(table: pl.DataFrame) -> dict[str, int]:
    """Rows of each outcome."""
    of = Counter(table["outcome"])
    return {one: of[one] for one in ("right", *WRONG, "unjudged")}


def compared(table: pl.DataFrame, before: pl.DataFrame) -> pl.DataFrame:
    """The rows whose outcome or verdict is another than before."""
    answers = ["name", "outcome", "verdict", "track"]
    both = before.select(answers).join(table.select(answers), on="name", suffix="_now")
    return both.filter(
        (pl.col("outcome") != pl.col("outcome_now")) | (pl.col("verdict") != pl.col("verdict_now"))
    )


def main(*, only: str = "", out: Path | None = None, against: Path | None = None, processes: int = 2) -> None:
    """The first line of a replay, right or wrong: runs the rows, prints and writes their table, the wrong ones last.

    Args:
        only: Rows with this in their names.
        out: Parquet file of the table.
        against: A table of before, to print what has changed.
        processes: Rows that run side by side.
    """
    for name in absent():
        print(f"skipped: no recording {name}; BOTTOMLOCK_RECORDINGS names their folder")
    began = time.perf_counter()
    table = run_all((row for row in rows() if only in row.name), processes)
    numbers = pl.col("error_m", "rms_m", "sd_m", "reckoned_rms_m", "distance_m").round_sig_figs(3)
    wrong_last = table.sort(pl.col("outcome").is_in(WRONG), maintain_order=True)
    pl.Config(tbl_rows=-1, tbl_cols=-1, tbl_width_chars=200, fmt_str_lengths=80)
    print(wrong_last.select("name", "verdict", "track", numbers, "outcome"))
    print(", ".join(f"{name} {count}" for name, count in counts(table).items()))
    print(f"{table.height} rows in {time.perf_counter() - began:.0f} s")
    if against is not None:
        print(compared(table, pl.read_parquet(against)))
    if out is not None:
        said = origin("python -m tools.first_line --out data/evidence/first_line.parquet")
        table.write_parquet(out, metadata=said | {name: str(count) for name, count in counts(table).items()})


if __name__ == "__main__":
    cyclopts.run(main)
