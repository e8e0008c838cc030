"""The engine that sends chunks to a Dask cluster. Imported only where it is asked for.

Chunks go out as they are, with all that they need; their tables come back to the client, which alone writes. Workers
need neither a shared file system nor the scenario's files. A worker that dies takes nothing with it but its chunks'
time: the scheduler gives them to another one.
"""

import logging
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from dask.system import CPU_COUNT
from distributed import Client, LocalCluster, Worker, WorkerPlugin, wait

from bottomlock import kernel
from bottomlock.campaign.chunk import Chunk, ChunkResult, run_chunk
from bottomlock.errors import BottomlockError, EngineError
from bottomlock.tables.versions import library_versions

CONNECT_S = 10.0
"""How long a scheduler may take to answer."""

PATIENCE_S = 60.0
"""How long there may be no worker at all."""

POLL_S = 2.0
CHUNKS_PER_THREAD = 2
"""Chunks under way per worker thread: one flown, one waiting; what is under way bounds the memory of the cluster."""


@dataclass(frozen=True)
class _Answer:
    """What a worker sends back: its versions, and the tables or what the kernel refused."""

    versions: dict[str, str]
    flown: ChunkResult | None = None
    refused: str | None = None


def _versions() -> dict[str, str]:
    """Versions that have to be the same for the same bits."""
    ours = library_versions()
    return {"bottomlock": kernel.kernel_version(), "numpy": ours["numpy"], "polars": ours["polars"]}


def _work(chunk: Chunk) -> _Answer:
    """On the worker, which runs one of these per thread."""
    try:
        return _Answer(_versions(), flown=run_chunk(chunk, threads=1))
    except kernel.KernelError as error:
        # The kernel's exception does not travel: its class lives in the compiled module.
        return _Answer(_versions(), refused=str(error))


class DaskEngine:
    """Chunks to the workers of a scheduler."""

    def __init__(self, client: Client, address: str) -> None:
        """`address` is for messages."""
        self._client = client
        self._address = address
        self._last_seen_s = time.monotonic()

    def fly(
        self, chunks: Sequence[Chunk], _tell: Callable[[Chunk, float], None]
    ) -> Iterator[tuple[Chunk, ChunkResult]]:
        """In the order in which they are finished.

        Raises:
            KernelError: for what the kernel refuses.
            EngineError: when the scheduler is lost, no worker is left, or a worker has other versions.
        """
        waiting = list(reversed(chunks))
        running: dict[Any, Chunk] = {}
        self._last_seen_s = time.monotonic()
        try:
            while waiting or running:
                while waiting and len(running) < self._room():
                    chunk = waiting.pop()
                    running[self._client.submit(_work, chunk, pure=False)] = chunk
                for future in self._done(list(running)):
                    flown = self._flown(future, running[future])
                    if flown is not None:
                        # Forgetting the future frees the worker's memory.
                        yield running.pop(future), flown
        finally:
            if running and self._client.status == "running":
                self._client.cancel(list(running), force=True)

    def _room(self) -> int:
        """How many chunks may be under way; workers come and go."""
        return CHUNKS_PER_THREAD * max(1, sum(self._threads().values()))

    def _threads(self) -> dict[str, int]:
        if self._client.status != "running":
            raise EngineError(
                f"the scheduler {self._address} is lost; finished chunks are kept: the same command resumes"
            )
        threads: dict[str, int] = self._client.nthreads()
        return threads

    def _done(self, futures: list[Any]) -> Iterator[Any]:
        try:
            with self._client.as_current():
                done = wait(futures, timeout=POLL_S, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            self._look_after()
        else:
            yield from done

    def _look_after(self) -> None:
        """Gives up when there has been no worker for long."""
        now = time.monotonic()
        if self._threads():
            self._last_seen_s = now
        elif now - self._last_seen_s > PATIENCE_S:
            raise EngineError(
                f"{self._address} has had no worker for {PATIENCE_S:.0f} s; "
                "finished chunks are kept: the same command resumes"
            )

    def _flown(self, future: Any, chunk: Chunk) -> ChunkResult | None:  # noqa: ANN401 - distributed is untyped
        """The tables; None when the worker died before they could be fetched, and the chunk is flown again."""
        try:
            answer: _Answer = future.result(timeout=PATIENCE_S)
        except TimeoutError:
            self._look_after()
            return None
        except BottomlockError:
            raise
        except Exception as error:
            words = (str(error) or "no reason given").splitlines()[0]
            raise EngineError(
                f"{chunk.name}, chunk {chunk.span.stem}: {self._address} failed ({type(error).__name__}: {words})"
            ) from error
        if answer.versions != _versions():
            raise EngineError(
                f"a worker of {self._address} has {_words(answer.versions)}, expected {_words(_versions())}: "
                "the bits would differ"
            )
        if answer.refused is not None:
            raise kernel.KernelError(answer.refused)
        assert answer.flown is not None
        return answer.flown


class _Deaf(WorkerPlugin):  # type: ignore[misc] # distributed is untyped
    """A worker that leaves Ctrl-C to the client, which then closes it, instead of dying aloud."""

    def setup(self, worker: Worker) -> None:  # noqa: ARG002 - as distributed calls it
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _words(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in versions.items())


@contextmanager
def open_cluster(scheduler: str | None, *, workers: int) -> Iterator[DaskEngine]:
    """The workers of a scheduler, or, without one, as many processes on this machine (0: as there are cores).

    Raises:
        EngineError: for a scheduler that does not answer or has no worker.
    """
    if scheduler is None:
        with (
            LocalCluster(
                n_workers=workers or CPU_COUNT,
                threads_per_worker=1,
                processes=True,
                # Any free port, for this machine alone: campaigns side by side do not quarrel over one.
                dashboard_address="127.0.0.1:0",
                memory_limit=0,
                # What matters comes back as an exception.
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
            client.register_plugin(_Deaf())
            yield DaskEngine(client, "the local cluster")
        return
    try:
        client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except OSError as error:
        raise EngineError(f"scheduler {scheduler}: does not answer ({str(error).splitlines()[0]})") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError as error:
            raise EngineError(f"scheduler {scheduler}: no worker in {PATIENCE_S:.0f} s") from error
        yield DaskEngine(client, f"scheduler {scheduler}")
