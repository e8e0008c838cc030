"""Engines: a cluster whose workers die gives the bits of one thread, and what is not there is said in a line."""

import logging
import os
import signal
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from bottomlock.campaign import chunk as chunks
from bottomlock.campaign import engine
from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.chunk import Chunk, run_chunk
from bottomlock.campaign.engine import check_engine
from bottomlock.campaign.run import CampaignProgress, run_campaign
from bottomlock.config.scenario import load_scenario
from bottomlock.errors import EngineError, Note
from bottomlock.kernel import KernelError
from bottomlock.simulation.build import build_simulation
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, same_bits, short

needs_dask = pytest.mark.skipif(
    find_spec("distributed") is None, reason="the package distributed is not installed: pip install '.[dask]'"
)
pytestmark = [
    # Sockets of processes that are killed on purpose.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

RUNS = 40


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs a chunk."""
    monkeypatch.setattr(chunks, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign of one thread."""
    out = tmp_path_factory.mktemp("engines") / "whole"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunks, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)
        run_campaign([short(RUNS)], out, threads=1)
    return out


@pytest.fixture(scope="module")
def processes() -> Iterator[Any]:
    """A cluster of two processes on this machine."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address="127.0.0.1:0",
        memory_limit=0,
        silence_logs=logging.CRITICAL,
    ) as cluster:
        yield cluster


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A cluster of one thread in this very process, in which anything can be replaced."""
    distributed = pytest.importorskip("distributed")
    from bottomlock.campaign import dask_engine

    # So long a client looks for a scheduler that is gone, too.
    monkeypatch.setattr(dask_engine, "CONNECT_S", 3.0)
    monkeypatch.setattr(dask_engine, "PATIENCE_S", 0.5)
    monkeypatch.setattr(dask_engine, "POLL_S", 0.1)
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        silence_logs=logging.CRITICAL,
    ) as small:
        yield small


@pytest.mark.long
@needs_dask
@pytest.mark.slow
def test_a_worker_that_is_killed_changes_no_bit(tmp_path: Path, processes: Any, whole: Path) -> None:  # noqa: ANN401
    """Two workers, one ended by SIGKILL after the third chunk: the other one, and its successor, run all."""
    victim = next(iter(processes.workers.values())).pid
    heard: list[float] = []

    def kill(state: CampaignProgress) -> None:
        heard.append(state.runs_done)
        if len(heard) == 3:
            os.kill(victim, signal.SIGKILL)

    out = tmp_path / "o"
    results = run_campaign(
        [short(RUNS)], out, engine="dask", scheduler=processes.scheduler_address, progress=kill
    )
    same_bits(whole, out)
    assert len(heard) == RUNS // 2
    assert results.manifest["engine"] == "dask"
    with pytest.raises(ProcessLookupError):
        os.kill(victim, 0)


@needs_dask
def test_what_the_kernel_refuses_comes_back(
    tmp_path: Path,
    threads: Any,  # noqa: ANN401
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As the kernel's own error; chunks that were finished before are kept."""
    from bottomlock.campaign import dask_engine

    def refuse(built: BuiltScenario, chunk: Chunk, **settings: Any) -> object:  # noqa: ANN401
        if chunk.first_run == 2:
            raise KernelError("run 2, method tc: not finite")
        return run_chunk(built, chunk, **settings)

    monkeypatch.setattr(dask_engine, "run_chunk", refuse)
    with pytest.raises(KernelError, match="run 2, method tc: not finite"):
        run_campaign([short()], tmp_path, engine="dask", scheduler=threads.scheduler_address)
    assert [path.name for path in tmp_path.glob("chunks/*/counts-*")] == ["counts-00000000-00000001.parquet"]


@needs_dask
def test_a_fault_on_the_cluster_names_the_chunk(
    tmp_path: Path,
    threads: Any,  # noqa: ANN401
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from bottomlock.campaign import dask_engine

    # Of two chunks that fail either may be the first.
    monkeypatch.setattr(dask_engine, "run_chunk", lambda *_, **__: 1 / 0)
    with pytest.raises(EngineError, match=r"straight, run [02]: .*ZeroDivisionError"):
        run_campaign([short()], tmp_path, engine="dask", scheduler=threads.scheduler_address)


@needs_dask
def test_workers_of_another_version_are_refused(
    tmp_path: Path,
    threads: Any,  # noqa: ANN401
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Their bits would differ, and nobody would know."""
    from bottomlock.campaign import dask_engine
    from bottomlock.files.versions import bit_versions

    ours = bit_versions()
    answers = iter([ours | {"kernel_build": "f" * 64}])
    monkeypatch.setattr(dask_engine, "bit_versions", lambda: next(answers, ours))
    with pytest.raises(EngineError, match="the bits would differ"):
        run_campaign([short(2)], tmp_path, engine="dask", scheduler=threads.scheduler_address)
    assert not list(tmp_path.glob("chunks/*/*"))


@needs_dask
def test_a_cluster_without_workers(tmp_path: Path, threads: Any) -> None:  # noqa: ANN401
    """Said after a while, before anything is written; and when the last one leaves in mid-campaign."""

    def leave(_: CampaignProgress) -> None:
        threads.scale(0)

    with pytest.raises(EngineError, match=r"has had no worker for .* the same command resumes"):
        run_campaign(
            [short()], tmp_path / "o", engine="dask", scheduler=threads.scheduler_address, progress=leave
        )
    with (
        pytest.warns(Note, match="has no worker: waiting for one, at most"),
        pytest.raises(EngineError, match="no worker in"),
    ):
        run_campaign([short()], tmp_path / "p", engine="dask", scheduler=threads.scheduler_address)
    assert not (tmp_path / "p").exists()


@needs_dask
def test_a_scheduler_that_goes_away(tmp_path: Path, threads: Any) -> None:  # noqa: ANN401
    """The message says that the same command resumes, and so it does."""

    def leave(_: CampaignProgress) -> None:
        threads.close()

    with pytest.raises(EngineError, match="the same command resumes"):
        run_campaign([short()], tmp_path, engine="dask", scheduler=threads.scheduler_address, progress=leave)
    assert run_campaign([short()], tmp_path, threads=1).runs.height == 15


@needs_dask
def test_a_scheduler_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is written before the engine is there."""
    from bottomlock.campaign import dask_engine

    monkeypatch.setattr(dask_engine, "CONNECT_S", 0.2)
    with pytest.raises(EngineError, match="does not answer"):
        run_campaign([short()], tmp_path / "o", engine="dask", scheduler="tcp://127.0.0.1:9")
    assert not (tmp_path / "o").exists()


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bottomlock.campaign.engine.find_spec", lambda _: None)
    with pytest.raises(EngineError, match=r"pip install '\.\[dask\]'"):
        check_engine("dask")


def test_an_engine_may_finish_in_any_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path
) -> None:
    """The tables are those of the runs in order."""
    here = engine.run_here
    monkeypatch.setattr(
        engine, "run_here", lambda built, threads, chunks, report: here(built, threads, chunks[::-1], report)
    )
    run_campaign([short(RUNS)], tmp_path / "o", threads=1)
    same_bits(whole, tmp_path / "o")


@pytest.mark.parametrize("name", ["straight", "slope"])
def test_a_simulation_is_pickled_without_its_beams(name: str) -> None:
    """The kernel's geometry cannot be pickled, and is made again; the content is the same."""
    import pickle

    simulation = build_simulation(load_scenario(name))
    copy = pickle.loads(pickle.dumps(simulation))
    assert copy.fingerprint() == simulation.fingerprint()
    assert copy.geometry.directions_p.tolist() == simulation.geometry.directions_p.tolist()
    assert len(pickle.dumps(simulation)) < 100_000, "it goes to every worker"
