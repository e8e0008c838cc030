"""From scores of methods on missions to the leaderboard: means, intervals over missions, paired differences, ranks."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from bottomlock import DataError
from bottomlock.files.table_file import read_parquet
from bottomlock.statistics.compare import difference_of, estimate_of
from bottomlock.support.nearest import did_you_mean
from partialdvl_bench.load import load_mission
from partialdvl_bench.mission_list import MissionSpec
from partialdvl_bench.submission import check_submission, estimates_of
from partialdvl_bench.tables import LEADERBOARD, SCORES
from partialdvl_bench.tasks import RANKED, TASKS, scores_of

OVERALL = "overall"


def score_submissions(
    frames: Mapping[str, pl.DataFrame],
    data: str | Path,
    specs: Sequence[MissionSpec],
    progress: Callable[[str, float], None] = lambda _words, _fraction: None,
) -> pl.DataFrame:
    """The scores of submissions, by method, on the missions that they answer (`tables.SCORES`).

    Raises:
        DataError: for a mission that is not there or has no truth.
    """
    data = Path(data)
    parts = [pl.DataFrame(schema=dict(SCORES))]
    for k, spec in enumerate(specs):
        progress(spec.name, k / len(specs))
        mission = None
        for method, frame in frames.items():
            rows = frame.filter(pl.col("mission") == spec.name).sort("time_ns")
            if rows.height:
                mission = mission or load_mission(data / spec.split / spec.name)
                parts.append(scores_of(mission, estimates_of(rows), method))
    progress("", 1.0)
    return pl.concat(parts)


def read_submissions(
    paths: Sequence[str | Path], asked: Sequence[MissionSpec] | None = None
) -> dict[str, pl.DataFrame]:
    """Submissions by method, which is the name of the file; each has answers for the missions `asked`, or all.

    Raises:
        DataError: for a submission that breaks the rules or answers no mission that is asked, and two of one name.
    """
    frames: dict[str, pl.DataFrame] = {}
    for path in map(Path, paths):
        if path.stem in frames:
            raise DataError(
                f"{path}: another submission is called '{path.stem}', expected a name for each method"
            )
        frame = check_submission(read_parquet(path), str(path), asked=asked)
        if asked is not None and not frame["mission"].is_in([spec.name for spec in asked]).any():
            raise DataError(f"{path}: answers none of the {len(asked)} missions that are scored here")
        frames[path.stem] = frame
    return frames


def check_reference(reference: str | None, methods: Collection[str]) -> None:
    """Rejects a method to take differences to that is not among those scored.

    Raises:
        DataError: naming those there are.
    """
    if reference is not None and reference not in methods:
        hint = did_you_mean(reference, methods) or ","
        raise DataError(f"--reference is '{reference}'{hint} expected one of {', '.join(sorted(methods))}")


def leaderboard(scores: pl.DataFrame, reference: str | None = None) -> pl.DataFrame:
    """The leaderboard (`tables.LEADERBOARD`), best method first in each task and score.

    A row's value is the mean over missions, each mission alike, with a bootstrap interval over missions; the task
    "overall" is the mean over the tasks of the ranking score. The reference of the paired differences is the method
    that leads overall, or in a task that it does not answer the one that leads there, unless one is named.

    Raises:
        DataError: for a reference that has no scores.
    """
    check_reference(reference, set(scores["method"]))
    scores = pl.concat([scores, _overall(scores)])
    means = _means(scores, OVERALL, RANKED)
    leader = reference or (means[0][0] if means else None)
    rows = []
    for task, score in scores.select("task", "score").unique(maintain_order=True).iter_rows():
        part = scores.filter((pl.col("task") == task) & (pl.col("score") == score))
        ranked = _means(scores, task, score)
        own_leader = leader if leader in part["method"] else _means(scores, task, RANKED)[0][0]
        base = dict(part.filter(pl.col("method") == own_leader).select("mission", "value").iter_rows())
        for method, _ in ranked:
            own = part.filter(pl.col("method") == method).sort("mission")
            values = own["value"].to_numpy()
            common = [mission in base for mission in own["mission"]]
            difference: tuple[float | None, float | None, float | None] = (None, None, None)
            if method != own_leader and any(common):
                theirs = np.array([base[mission] for mission in own["mission"] if mission in base])
                difference = difference_of(values[np.array(common)], theirs, is_rms=False, paired=True)
            rows.append(
                (
                    task,
                    score,
                    method,
                    len(values),
                    *estimate_of(values, is_rms=False),
                    *difference,
                    own_leader,
                )
            )
    return pl.DataFrame(rows, schema=dict(LEADERBOARD), orient="row")


def _overall(scores: pl.DataFrame) -> pl.DataFrame:
    """Mean over the tasks of the ranking score, a row per method and mission, over the tasks that it has."""
    return (
        scores.filter((pl.col("score") == RANKED) & pl.col("task").is_in(TASKS))
        .group_by("method", "mission", maintain_order=True)
        .agg(pl.col("value").mean(), pl.col("rows").sum())
        .with_columns(task=pl.lit(OVERALL), score=pl.lit(RANKED))
        .select(list(SCORES))
    )


def _means(scores: pl.DataFrame, task: str, score: str) -> list[tuple[str, float]]:
    """Methods and their means over missions, best first; of equal ones the name decides."""
    part = scores.filter((pl.col("task") == task) & (pl.col("score") == score))
    means = part.group_by("method").agg(pl.col("value").mean())
    order = means.sort(pl.col("value") * (-1.0 if "availability" in score else 1.0), "method")
    return [(str(method), float(value)) for method, value in order.iter_rows()]
