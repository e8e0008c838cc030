"""Runs estimators over missions: a file a mission and method, which is skipped when it is there, and submissions."""

import hashlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from bottomlock.atomic_write import write_parquet
from bottomlock.bench.load import load_mission
from bottomlock.bench.make import RECORD
from bottomlock.bench.methods import Estimator
from bottomlock.bench.mission_list import MissionSpec
from bottomlock.bench.submission import check_submission, join, table_of
from bottomlock.errors import DataError, ScenarioError
from bottomlock.kernel import METHODS, kernel_version
from bottomlock.records import read_record, read_recorded_table, record_of, write_recorded_table

PARTS = "missions"


@dataclass(frozen=True)
class Shard:
    """Every n-th mission from the k-th on, k from 1 to n.

    Examples:
        >>> [one for one in "abcde" if Shard(2, 2).holds("abcde".index(one))]
        ['b', 'd']
    """

    k: int = 1
    n: int = 1

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """The shard of the text "k/n".

        Raises:
            ScenarioError: for anything else.
        """
        k, _, n = text.partition("/")
        if not (k.isdecimal() and n.isdecimal() and 1 <= int(k) <= int(n)):
            raise ScenarioError(f"--shard is '{text}', expected k/n with k from 1 to n, for instance 1/4")
        return cls(int(k), int(n))

    def holds(self, index: int) -> bool:
        """Whether the mission of this index is in the shard."""
        return index % self.n == self.k - 1


def run_missions(
    specs: Sequence[MissionSpec],
    data: Path,
    estimators: Mapping[str, Estimator],
    out: Path,
    *,
    shard: Shard | None = None,
    progress: Callable[[str, float], None] = lambda _words, _fraction: None,
) -> int:
    """Runs every estimator on every mission of a shard; what is there from the same data and version is kept.

    Args:
        specs: the missions.
        data: folder of `bottomlock bench make`.
        estimators: by the name of the method.
        out: folder of the results.
        shard: which missions; all by default.
        progress: called with the mission's name and the fraction done.

    Returns:
        The number of missions times methods that were run, not kept.

    Raises:
        DataError: for a mission that is not there or has changed, or estimates that break the rules of a submission.
    """
    shard = shard or Shard()
    mine = [spec for k, spec in enumerate(specs) if shard.holds(k)]
    ran = 0
    for k, spec in enumerate(mine):
        progress(spec.name, k / len(mine))
        folder = data / spec.split / spec.name
        record = read_record(folder / RECORD)
        if record is None:
            raise DataError(f"{folder}: holds no mission; make it with `bottomlock bench make --out {data}`")
        keys = {name: key_of(name, call, record["data"]) for name, call in estimators.items()}
        due = [name for name in estimators if not _is_done(part_path(out, name, spec), keys[name])]
        if not due:
            continue
        mission = load_mission(folder, truth=False)
        for name in due:
            table = table_of(spec.name, estimators[name](mission))
            check_submission(table, f"{name} on {spec.name}", [spec])
            write_recorded_table(
                part_path(out, name, spec), table, {"kind": "bench estimates", "key": keys[name]}
            )
            ran += 1
    progress("", 1.0)
    return ran


def part_path(out: Path, method: str, spec: MissionSpec) -> Path:
    """The file of one method's estimates on one mission."""
    return out / PARTS / method / f"{spec.name}.parquet"


def key_of(name: str, call: Estimator, data_digest: str) -> str:
    """What estimates depend on: the mission's data, the kernel's version, and of a rival all sources in its folder."""
    source = kernel_version()
    if name not in METHODS:
        folder = Path(inspect.getfile(call)).parent
        source += "".join(path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.py")))
    return hashlib.sha256(f"{name}\0{data_digest}\0{source}".encode()).hexdigest()


def _is_done(path: Path, key: str) -> bool:
    """Whether the estimates are there and of this key."""
    try:
        record = read_record(record_of(path))
    except DataError:
        return False
    return record is not None and record.get("key") == key and path.is_file()


def write_submissions(specs: Sequence[MissionSpec], methods: Sequence[str], out: Path) -> list[Path]:
    """Joins the estimates of each method that has every mission to a submission `METHOD.parquet`.

    Returns:
        The files of the methods that are whole; those of which other shards are missing are left out.

    Raises:
        DataError: for a file that has changed since it was written.
    """
    written = []
    for method in methods:
        paths = [part_path(out, method, spec) for spec in specs]
        if not all(path.is_file() for path in paths):
            continue
        tables: list[pl.DataFrame] = []
        for path in paths:
            record = read_record(record_of(path))
            if record is None:
                raise DataError(f"{path}: has no record; remove it and run again")
            tables.append(read_recorded_table(path, record, remedy="remove it and run again"))
        written.append(out / f"{method}.parquet")
        write_parquet(written[-1], join(tables))
    return written
