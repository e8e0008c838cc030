"""Runs estimators over missions: a file a mission and method, which is skipped when it is there, and submissions."""

import hashlib
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from pathlib import Path

import polars as pl

from bottomlock import METHODS, DataError, EngineError, OutputError, ScenarioError
from bottomlock.campaign.engine import check_engine
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Result, digests_of
from bottomlock.files.records import read_record, read_recorded_table, record_of, write_recorded_table
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.tables.versions import bit_versions
from partialdvl_bench.load import load_mission
from partialdvl_bench.make import RECORD
from partialdvl_bench.methods import Estimator
from partialdvl_bench.mission import Mission
from partialdvl_bench.mission_list import MissionSpec
from partialdvl_bench.submission import check_submission, join, table_of

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


@dataclass(frozen=True)
class Part:
    """One method on one mission, and what its estimates depend on."""

    spec: MissionSpec
    method: str
    key: str


Tables = Iterator[tuple[Part, pl.DataFrame]]


def run_missions(
    specs: Sequence[MissionSpec],
    data: str | Path,
    estimators: Mapping[str, Estimator],
    out: str | Path,
    *,
    shard: Shard | None = None,
    engine: str = "local",
    scheduler: str | None = None,
    threads: int = 0,
    force: bool = False,
    progress: Callable[[str, float], None] = lambda _words, _fraction: None,
) -> int:
    """Runs every estimator on every mission of a shard; what is there from the same data and version is kept.

    Args:
        specs: the missions.
        data: folder of `bottomlock bench make`.
        estimators: by the name of the method; on a cluster they travel by the name of their module.
        out: folder of the results.
        shard: which missions; all by default.
        engine: "local", one after another in this process, or "dask", see `campaign.engine.open_engine`. The estimates
            do not depend on it, their wall times do.
        scheduler: dask: address of a scheduler.
        threads: dask: worker processes on this machine; 0 for as many as there are cores.
        force: replace estimates of other data, another version or another source of a rival.
        progress: called with the mission's name and the fraction done.

    Returns:
        The number of missions times methods that were run, not kept.

    Raises:
        DataError: for a mission that is not there or has changed, or estimates that break the rules of a submission.
        OutputError: for estimates of other data, another version or source without `force`, before anything is run.
        EngineError: for engines, schedulers and threads that do not go together, and a cluster that breaks down.
    """
    data, out = Path(data), Path(out)
    check_engine(engine, threads=threads, scheduler=scheduler)
    if engine == "local" and threads:
        raise EngineError(
            "threads are given with engine 'local', which runs one mission at a time on one thread, so that its times "
            "can be compared; --engine dask has as many workers, --shard as many processes"
        )
    shard = shard or Shard()
    due = [
        part
        for k, spec in enumerate(specs)
        if shard.holds(k)
        for part in _parts_of(spec, data, estimators)
        if not _is_done(part_path(out, part.method, spec), part.key, force=force)
    ]
    with _engine(engine, scheduler, threads) if due else nullcontext(_here) as run:
        for k, (part, table) in enumerate(run(due, data, estimators)):
            check_submission(table, f"{part.method} on {part.spec.name}", [part.spec])
            write_recorded_table(
                part_path(out, part.method, part.spec), table, {"kind": "bench estimates", "key": part.key}
            )
            progress(part.spec.name, (k + 1) / len(due))
    progress("", 1.0)
    return len(due)


def _parts_of(spec: MissionSpec, data: Path, estimators: Mapping[str, Estimator]) -> Iterator[Part]:
    """Every method on a mission.

    Raises:
        DataError: where the mission is not there.
    """
    record = read_record(folder_of(spec, data) / RECORD)
    if record is None:
        raise DataError(
            f"{folder_of(spec, data)}: holds no mission; make it with `bottomlock bench make --out {data}`"
        )
    for name, call in estimators.items():
        yield Part(spec, name, key_of(name, call, record["data"]))


def folder_of(spec: MissionSpec, data: Path) -> Path:
    """The folder of a mission."""
    return data / spec.split / spec.name


def fly(mission: Mission, call: Estimator) -> pl.DataFrame:
    """The estimates of a mission as rows of a submission."""
    return table_of(mission.name, call(mission))


def _here(parts: Sequence[Part], data: Path, estimators: Mapping[str, Estimator]) -> Tables:
    """One part after another."""
    for spec, of_mission in groupby(parts, key=lambda part: part.spec):
        mission = load_mission(folder_of(spec, data), truth=False)
        for part in of_mission:
            yield part, fly(mission, estimators[part.method])


@contextmanager
def _engine(
    engine: str, scheduler: str | None, threads: int
) -> Iterator[Callable[[Sequence[Part], Path, Mapping[str, Estimator]], Tables]]:
    """What runs the parts."""
    if engine == "local":
        yield _here
        return
    from bottomlock.campaign.dask_engine import open_workers  # noqa: PLC0415 - an extra, imported only on request

    with open_workers(scheduler, workers=threads) as workers:

        def run(parts: Sequence[Part], data: Path, estimators: Mapping[str, Estimator]) -> Tables:
            """A mission goes out once, and stays with the workers while a method has yet to fly it."""

            @lru_cache(maxsize=1)
            def held(spec: MissionSpec) -> object:
                return workers.hold(load_mission(folder_of(spec, data), truth=False))

            yield from workers.run(
                parts,
                fly,
                lambda part: (held(part.spec), estimators[part.method]),
                lambda part: f"{part.method} on {part.spec.name}",
            )

        yield run


def part_path(out: Path, method: str, spec: MissionSpec) -> Path:
    """The file of one method's estimates on one mission."""
    return out / PARTS / method / f"{spec.name}.parquet"


def key_of(name: str, call: Estimator, data_digest: str) -> str:
    """What estimates depend on: the mission's data, versions and build, and of a rival all sources in its folder."""
    source = "".join(f"{library} {version}\0" for library, version in bit_versions().items())
    if name not in (*METHODS, DEAD_RECKONING):
        folder = Path(inspect.getfile(call)).parent
        source += "".join(path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.py")))
    return hashlib.sha256(f"{name}\0{data_digest}\0{source}".encode()).hexdigest()


def _is_done(path: Path, key: str, *, force: bool) -> bool:
    """Whether the estimates are there and of this key.

    Raises:
        OutputError: for estimates of another one without `force`.
    """
    try:
        record = read_record(record_of(path))
    except DataError:
        return False
    if record is None or not path.is_file():
        return False
    if record.get("key") != key and not force:
        raise OutputError(
            f"{path}: holds estimates of other data, another version or another source; choose another directory or "
            "use --force to replace them"
        )
    return bool(record.get("key") == key)


def write_submissions(
    specs: Sequence[MissionSpec], methods: Sequence[str], out: Path, *, force: bool = False
) -> list[Path]:
    """Joins the estimates of each method that has every mission to a submission `METHOD.parquet`.

    Returns:
        The files of the methods that are whole; those of which other shards are missing are left out.

    Raises:
        DataError: for a file that has changed since it was written.
        OutputError: for a submission that is not of ours, or has changed since it was written without `force`.
    """
    written: list[Path] = []
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
        made_from = digests_of(out, map(record_of, paths))
        result = Result(out, method, "bench run", made_from, beside=True)
        written += result.write({f"{method}.parquet": parquet_bytes(join(tables))}, force=force)
    return written
