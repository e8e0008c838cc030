"""The engine that sends chunks to the workers of a Dask cluster. Imported only on request.

Built scenarios go to the workers once, with the content of every file that they name, so workers need neither a shared
file system nor these files. The tables come back to the client, which alone writes. When a worker dies, the scheduler
gives its chunks to another one.
"""

import logging
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import Any

import dask
from dask.system import CPU_COUNT
from distributed import Client, LocalCluster, Worker, WorkerPlugin, wait
from distributed.comm import CommClosedError
from distributed.utils import silence_logging_cmgr

from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.chunk import Chunk, ChunkResults, ChunkTables, RunChunks, run_chunk
from bottomlock.errors import BottomlockError, EngineError, note
from bottomlock.files.versions import bit_versions, versions_in_words

CONNECT_S, PATIENCE_S, POLL_S = 10.0, 60.0, 2.0
"""How long a scheduler may take to answer, and a client waits without any worker; how often it looks, s."""


def _work(built: BuiltScenario, chunk: Chunk) -> tuple[dict[str, str], ChunkTables]:
    """Runs a chunk on a worker: its versions, and the tables."""
    return bit_versions(), run_chunk(built, chunk, threads=1)


def _run(
    client: Client,
    place: str,
    scenarios: Sequence[BuiltScenario],
    chunks: Sequence[Chunk],
    progress: Callable[[Chunk, float], None],  # noqa: ARG001 - a chunk on a worker reports nothing
) -> ChunkResults:
    """Yields the chunks in the order in which they are finished; see `chunk.RunChunks`.

    Raises:
        KernelError: for input that the kernel rejects.
        EngineError: when the scheduler is lost, no worker is left, or a worker has other versions.
    """
    waiting, running, last_seen_s = list(reversed(chunks)), dict[Any, Chunk](), time.monotonic()
    try:
        with _one_error(client, place):
            # A truth of ten minutes is more than Dask expects in a task, and goes out once.
            with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 GiB"}):
                # Results, not data: the scheduler makes them again when the worker that holds them dies.
                held = {b.scenario.name: client.submit(lambda it: it, b, pure=False) for b in scenarios}
            while waiting or running:
                threads = sum(client.nthreads().values())
                last_seen_s = time.monotonic() if threads else last_seen_s
                if time.monotonic() - last_seen_s > PATIENCE_S:
                    hint = "finished chunks are kept: the same command resumes"
                    raise EngineError(f"{place} has had no worker for {PATIENCE_S:.0f} s", hint=hint)
                # Two for each thread, of which one waits: more would fill the memory of the cluster.
                while waiting and len(running) < 2 * max(1, threads):
                    # The remaining number as priority: chunks start in order.
                    priority, chunk = len(waiting), waiting.pop()
                    future = client.submit(_work, held[chunk.scenario], chunk, pure=False, priority=priority)
                    running[future] = chunk
                # A worker that dies before its result is fetched costs a time-out; its chunk is run again.
                with suppress(TimeoutError), client.as_current():
                    for future in wait(list(running), timeout=POLL_S, return_when="FIRST_COMPLETED").done:
                        tables = _tables(future, running[future], place)
                        # Forgetting the future frees the worker's memory.
                        yield running.pop(future), tables
    finally:
        if running and client.status == "running":
            with suppress(Exception):
                client.cancel(list(running), force=True)


def _tables(future: Any, chunk: Chunk, place: str) -> ChunkTables:  # noqa: ANN401 - distributed is untyped
    fault = future.exception(timeout=PATIENCE_S) if future.status == "error" else None
    if isinstance(fault, BottomlockError):
        raise fault
    if fault is not None:
        reason = f"{type(fault).__name__}: {(str(fault) or 'no reason given').splitlines()[0]}"
        raise EngineError(f"{chunk.scenario}, run {chunk.first_run}: {place} failed ({reason})") from fault
    versions, tables = future.result(timeout=PATIENCE_S)
    other = versions_in_words(versions, bit_versions())
    if other:
        raise EngineError(f"a worker of {place} has {other}: the bits would differ")
    return tables  # type: ignore[no-any-return] # as `_work` returns it


@contextmanager
def _one_error(client: Client, place: str) -> Iterator[None]:
    """Whatever a client raises when its scheduler goes becomes an EngineError: which of many, depends on the moment."""
    try:
        yield
    except Exception as error:
        lost = client.status != "running" or isinstance(error, CommClosedError | CancelledError)
        if isinstance(error, BottomlockError) or not lost:
            raise
        raise EngineError(
            f"{place} is lost", hint="finished chunks are kept: the same command resumes"
        ) from error


class _IgnoreInterrupt(WorkerPlugin):  # type: ignore[misc] # distributed is untyped
    """Leaves Ctrl-C to the client, which then closes the workers in order."""

    def setup(self, worker: Worker) -> None:  # noqa: ARG002 - as distributed calls it
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def open_cluster(
    scheduler: str | None, scenarios: Sequence[BuiltScenario], *, workers: int
) -> Iterator[RunChunks]:
    """What runs chunks on a scheduler's workers; without one, on as many processes here (0: as there are cores).

    Raises:
        EngineError: for a scheduler that does not answer or has no worker.
    """
    with ExitStack() as opened:
        place, target = f"scheduler {scheduler}", scheduler
        if scheduler is None:
            # Any free port, for this machine alone: campaigns side by side do not compete for one.
            target = opened.enter_context(
                LocalCluster(
                    workers or CPU_COUNT, threads_per_worker=1, memory_limit=0, silence_logs=logging.CRITICAL,
                    dashboard_address="127.0.0.1:0",
                )
            )  # fmt: skip
            place = "the local cluster"
        opened.enter_context(silence_logging_cmgr(logging.CRITICAL))
        try:
            client = opened.enter_context(Client(target, timeout=CONNECT_S, set_as_default=False))
        except OSError as error:
            raise EngineError(f"does not answer ({str(error).splitlines()[0]})", place=place) from error
        with _one_error(client, place):
            if scheduler is None:
                client.register_plugin(_IgnoreInterrupt())
            elif not client.nthreads():
                note(f"{place} has no worker: waiting for one, at most {PATIENCE_S:.0f} s")
                try:
                    client.wait_for_workers(1, timeout=PATIENCE_S)
                except TimeoutError as error:
                    raise EngineError(f"no worker in {PATIENCE_S:.0f} s", place=place) from error
        yield partial(_run, client, place, scenarios)
