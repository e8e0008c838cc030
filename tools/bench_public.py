"""The public tables of docs/bench.md: every method and rival on the train and validation missions of both versions.

    pip install gtsam==4.3a0        # for the factor graph
    python tools/bench_public.py DIR

makes the missions in DIR and compares their digests, flies them with two processes of one thread each, scores them,
writes `benches/rivals/public_scores.csv`, a row per method and mission, and the tables from it. What has been flown is
kept: the same command resumes. `--without factor_graph` leaves one out, and with it its rows of the table.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from multiprocessing import get_context
from pathlib import Path

import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.files.atomic_write import write_text
from bottomlock.kernel import METHODS
from bottomlock.own_method import DEAD_RECKONING
from partialdvl_bench.leaderboard import read_submissions, score_submissions
from partialdvl_bench.mission_list import MissionSpec, missions_of
from tools.publish_bench import PUBLIC_SCORES, ROOT, SCORES_KEPT, publish_public

RIVALS = (
    "error_state", "robust", "adaptive", "invariant", "iterated", "unscented", "held_velocity", "model_aided",
    "factor_graph",
)  # fmt: skip
VERSIONS = ("1", "1.1")
PROCESSES = 2
DIGITS = 6


def public(version: str) -> tuple[MissionSpec, ...]:
    """The missions that anyone can make."""
    return missions_of(("train", "validation"), version=version)


def bench(*words: str) -> list[str]:
    """The command `bottomlock bench`."""
    return [sys.executable, "-m", "bottomlock", "bench", *words]


def one_thread() -> dict[str, str]:
    """The environment of a process whose linear algebra has one thread."""
    path = os.pathsep.join([str(ROOT / "python"), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path}


def finish(commands: list[list[str]]) -> None:
    """Runs commands beside each other to their ends.

    Raises:
        SystemExit: where one fails; it has said why.
    """
    running = [subprocess.Popen(words, env=one_thread()) for words in commands]  # noqa: S603 - itself
    ended = [process.wait() for process in running]
    if any(ended):
        raise SystemExit(max(ended))


def fly(folder: Path, version: str, rivals: list[str]) -> list[Path]:
    """Makes and flies a version's missions; the submissions."""
    own = ("--version", version, "--split", "train,validation")
    finish([bench("make", "--out", str(folder / "data"), *own)])
    out = folder / f"run-{version}"
    words = bench("run", "--data", str(folder / "data"), "--out", str(out), *own)
    words += ["--methods", ",".join((*METHODS, DEAD_RECKONING))]
    for name in rivals:
        words += ["--rival", f"{name}=benches.rivals.{name}:estimate"]
    finish([[*words, "--shard", f"{k + 1}/{PROCESSES}"] for k in range(PROCESSES)])
    finish([words])
    return [out / f"{name}.parquet" for name in (*METHODS, DEAD_RECKONING, *rivals)]


def scored(job: tuple[list[Path], Path, MissionSpec]) -> pl.DataFrame:
    """The scores that the table keeps, of every submission on one mission."""
    submissions, data, spec = job
    frames = {path.stem: pl.read_parquet(path) for path in submissions}
    return score_submissions(frames, data, [spec]).with_columns(version=pl.lit(spec.version))


def wide(scores: pl.DataFrame) -> pl.DataFrame:
    """A row per mission and method, a column per score that is kept."""
    kept = pl.DataFrame(
        [(task, score, column) for column, (task, score) in SCORES_KEPT.items()],
        schema=["task", "score", "column"],
        orient="row",
    )
    table = scores.join(kept, on=["task", "score"], maintain_order="left").pivot(
        "column", index=["version", "mission", "method"], values="value", maintain_order=True
    )
    return table.select(
        "version", "mission", "method", *(pl.col(c).round_sig_figs(DIGITS) for c in SCORES_KEPT)
    )


def main() -> None:
    """Makes, flies, scores, publishes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--without", default="", help="rivals that are left out, separated by commas")
    words = parser.parse_args()
    rivals = [name for name in RIVALS if name not in words.without.split(",")]
    jobs = []
    for version in VERSIONS:
        submissions = fly(words.folder, version, rivals)
        read_submissions(submissions, public(version))  # their rules, once
        jobs += [(submissions, words.folder / "data", spec) for spec in public(version)]
    os.environ.update(one_thread())
    with get_context("spawn").Pool(PROCESSES) as pool:
        scores = pl.concat(pool.map(scored, jobs, chunksize=1))
    write_text(PUBLIC_SCORES, wide(scores).write_csv())
    publish_public()


if __name__ == "__main__":
    main()
