"""The workers of a Dask cluster, and the engine that sends chunks to them. Imported only on request.

Built scenarios go to the workers once, with the content of every file that they name; chunks name their runs. The
tables come back to the client, which alone writes. Workers need neither a shared file system nor the scenario's files.
When a worker dies, the scheduler gives its chunks to another one.
"""

import logging
import signal
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import dask
from dask.system import CPU_COUNT
from distributed import Client, LocalCluster, Worker, WorkerPlugin, wait
from distributed.comm import CommClosedError

from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.chunk import ChunkResult, ChunkResults, run_chunk
from bottomlock.campaign.partition import Chunk
from bottomlock.errors import BottomlockError, EngineError, note
from bottomlock.tables.versions import bit_versions, versions_in_words

CONNECT_S = 10.0
"""How long a scheduler may take to answer, s."""

PATIENCE_S = 60.0
"""How long a client waits without any worker, s."""

SILENCE_S = 5.0
"""After how long it says so, s."""

POLL_S = 2.0
CHUNKS_PER_THREAD = 2
"""Parts in progress per worker thread: one runs, one waits. They bound the memory of the cluster."""


P = TypeVar("P")
R = TypeVar("R")
V = TypeVar("V")


@dataclass(frozen=True)
class _Answer(Generic[R]):
    """Answer of a worker: its versions and the result."""

    versions: dict[str, str]
    result: R


def _hold(value: V) -> V:
    """Keeps a value on the workers: a result that the scheduler can make again when its worker dies."""
    return value


def _answer(call: Callable[..., R], *given: object) -> _Answer[R]:
    """Calls on a worker, one per thread."""
    return _Answer(bit_versions(), call(*given))


def _work(built: BuiltScenario, chunk: Chunk) -> ChunkResult:
    """Runs a chunk on a worker."""
    return run_chunk(built, chunk, threads=1)


class Workers:
    """The workers of a scheduler, to which parts of a piece of work go."""

    def __init__(self, client: Client, address: str) -> None:
        """`address` is for messages."""
        self._client = client
        self._address = address
        self._last_seen_s = time.monotonic()
        self._has_said = False

    def await_first(self) -> None:
        """Waits for a worker, and says so after `SILENCE_S`.

        Raises:
            EngineError: when the scheduler is lost, or none has come after `PATIENCE_S`.
        """
        end_s = time.monotonic() + PATIENCE_S
        wait_s = min(SILENCE_S, PATIENCE_S)
        # Never a wait of 0 s, which would have no end.
        while wait_s > 0.0:
            with suppress(TimeoutError), self._told():
                self._client.wait_for_workers(1, timeout=wait_s)
                return
            wait_s = end_s - time.monotonic()
            if wait_s > 0.0:
                self._say_waiting()
        raise EngineError(f"{self._address}: no worker in {PATIENCE_S:.0f} s")

    def _say_waiting(self) -> None:
        if not self._has_said:
            note(f"{self._address} has no worker: waiting for workers, at most {PATIENCE_S:.0f} s")
        self._has_said = True

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Whatever the client raises when its scheduler goes becomes one error.

        Raises:
            EngineError: naming the scheduler.
        """
        try:
            yield
        except (BottomlockError, TimeoutError):
            raise
        except Exception as error:
            # Which of many it is depends on what the client is doing at that moment.
            if not isinstance(error, CommClosedError | CancelledError) and self._client.status == "running":
                raise
            raise self._lost() from error

    def _lost(self) -> EngineError:
        return EngineError(f"{self._address} is lost; finished parts are kept: the same command resumes")

    def hold(self, value: object) -> Any:  # noqa: ANN401 - distributed is untyped
        """A future of a value that stands for it in calls; the workers fetch it from one another."""
        # A truth of ten minutes is more than Dask expects in a task, and goes out once.
        with self._told(), dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 GiB"}):
            return self._client.submit(_hold, value, pure=False)

    def run(
        self,
        parts: Sequence[P],
        call: Callable[..., R],
        given: Callable[[P], tuple[object, ...]],
        words: Callable[[P], str],
    ) -> Generator[tuple[P, R], None, None]:
        """Yields each part with what `call` of its arguments returns, in the order in which they are finished.

        Args:
            parts: they start in this order.
            call: what the workers call; it is found by its name there.
            given: the arguments of a part, or what `hold` has returned for them; called when the part is sent.
            words: what a part is called in errors.

        Raises:
            BottomlockError: as raised by the call.
            EngineError: when the scheduler is lost, no worker is left, or a worker has other versions.
        """
        waiting = list(reversed(parts))
        running: dict[Any, P] = {}
        self._last_seen_s = time.monotonic()
        try:
            while waiting or running:
                while waiting and len(running) < self._room():
                    # The remaining number as priority: parts start in order.
                    priority, part = len(waiting), waiting.pop()
                    arguments = given(part)
                    with self._told():
                        future = self._client.submit(_answer, call, *arguments, pure=False, priority=priority)
                    running[future] = part
                for future in self._done(list(running)):
                    answer: _Answer[R] | None = self._result(future, words(running[future]))
                    if answer is not None:
                        # Forgetting the future frees the worker's memory.
                        yield running.pop(future), answer.result
        finally:
            if running and self._client.status == "running":
                with suppress(CommClosedError, CancelledError):
                    self._client.cancel(list(running), force=True)

    def _room(self) -> int:
        """Largest number of parts in progress; the number of workers may change."""
        return CHUNKS_PER_THREAD * max(1, sum(self._threads().values()))

    def _threads(self) -> dict[str, int]:
        if self._client.status != "running":
            raise self._lost()
        with self._told():
            threads: dict[str, int] = self._client.nthreads()
            return threads

    def _done(self, futures: list[Any]) -> Iterator[Any]:
        try:
            with self._told(), self._client.as_current():
                done = wait(futures, timeout=POLL_S, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            self._check_workers()
        else:
            yield from done

    def _check_workers(self) -> None:
        """Says so after `SILENCE_S` without a worker, and gives up after `PATIENCE_S`."""
        now = time.monotonic()
        if self._threads():
            self._last_seen_s, self._has_said = now, False
        elif now - self._last_seen_s > PATIENCE_S:
            raise EngineError(
                f"{self._address} has had no worker for {PATIENCE_S:.0f} s; "
                "finished parts are kept: the same command resumes"
            )
        elif now - self._last_seen_s > SILENCE_S:
            self._say_waiting()

    def _result(self, future: Any, words: str) -> Any:  # noqa: ANN401 - distributed is untyped
        """The answer; None when the worker died before it could be fetched, and the part is run again."""
        try:
            with self._told():
                answer = future.result(timeout=PATIENCE_S)
        except TimeoutError:
            self._check_workers()
            return None
        except BottomlockError:
            raise
        except Exception as error:
            reason = (str(error) or "no reason given").splitlines()[0]
            raise EngineError(
                f"{words}: {self._address} failed ({type(error).__name__}: {reason})"
            ) from error
        other = versions_in_words(answer.versions, bit_versions())
        if other:
            raise EngineError(f"a worker of {self._address} has {other}: the bits would differ")
        return answer


class DaskEngine:
    """Chunks to the workers of a scheduler."""

    def __init__(self, workers: Workers, scenarios: Sequence[BuiltScenario]) -> None:
        """`scenarios` are those of the chunks."""
        self._workers = workers
        self._scenarios = {built.scenario.name: built for built in scenarios}

    def run(self, chunks: Sequence[Chunk], progress: Callable[[Chunk, float], None]) -> ChunkResults:  # noqa: ARG002
        """Yields the chunks in the order in which they are finished.

        Raises:
            KernelError: for input that the kernel rejects.
            EngineError: when the scheduler is lost, no worker is left, or a worker has other versions.
        """
        held = {name: self._workers.hold(self._scenarios[name]) for name in {one.scenario for one in chunks}}
        yield from self._workers.run(
            chunks,
            _work,
            lambda chunk: (held[chunk.scenario], chunk),
            lambda chunk: f"{chunk.scenario}, chunk {chunk.file_ending}",
        )


class _IgnoreInterrupt(WorkerPlugin):  # type: ignore[misc] # distributed is untyped
    """Leaves Ctrl-C to the client, which then closes the workers in order."""

    def setup(self, worker: Worker) -> None:  # noqa: ARG002 - as distributed calls it
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def open_cluster(
    scheduler: str | None, scenarios: Sequence[BuiltScenario], *, workers: int
) -> Iterator[DaskEngine]:
    """An engine on the workers of `open_workers`."""
    with open_workers(scheduler, workers=workers) as opened:
        yield DaskEngine(opened, scenarios)


@contextmanager
def open_workers(scheduler: str | None, *, workers: int) -> Iterator[Workers]:
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
                # Any free port, for this machine alone: campaigns side by side do not compete for one.
                dashboard_address="127.0.0.1:0",
                memory_limit=0,
                # Failures come back as exceptions.
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
            client.register_plugin(_IgnoreInterrupt())
            yield Workers(client, "the local cluster")
        return
    try:
        client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except OSError as error:
        raise EngineError(f"scheduler {scheduler}: does not answer ({str(error).splitlines()[0]})") from error
    with _without_traces(), client:
        workers_there = Workers(client, f"scheduler {scheduler}")
        workers_there.await_first()
        yield workers_there


@contextmanager
def _without_traces() -> Iterator[None]:
    """Without the traces that a client logs when its scheduler goes: that comes back as an error."""
    levels = {
        logger: logger.level for logger in map(logging.getLogger, ("distributed", "distributed.client"))
    }
    for logger in levels:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)
