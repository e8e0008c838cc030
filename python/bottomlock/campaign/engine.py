"""Engines: what works off a list of chunks. Which one does it changes no bit."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from threading import Lock
from typing import Protocol
from urllib.parse import urlsplit

from bottomlock.campaign.chunk import Chunk, ChunkResult, run_chunk
from bottomlock.errors import EngineError

ENGINES = ("local", "dask")


class Engine(Protocol):
    """A way to fly chunks."""

    def fly(
        self, chunks: Sequence[Chunk], progress: Callable[[Chunk, float], None]
    ) -> Iterator[tuple[Chunk, ChunkResult]]:
        """Yields every chunk with its tables, in any order; `tell` may hear of parts (0 to 1) of a chunk."""


class LocalEngine:
    """Chunks in this process, one after another, each with the kernel's threads.

    While the tables of one are made and written, the next is in the kernel.
    """

    def __init__(self, threads: int) -> None:
        """`threads`: 0 for as many as there are cores."""
        self._threads = threads

    def fly(
        self, chunks: Sequence[Chunk], progress: Callable[[Chunk, float], None]
    ) -> Iterator[tuple[Chunk, ChunkResult]]:
        """In order."""
        pool, kernel_lock = ThreadPoolExecutor(max_workers=2), Lock()
        ahead: deque[tuple[Chunk, Future[ChunkResult]]] = deque()
        try:
            for chunk in chunks:
                if chunk.on_estimate:
                    # Long, and much of it in Python: it stays where an interruption reaches it.
                    yield from _landed(ahead, 0)
                    yield chunk, run_chunk(chunk, threads=self._threads, progress=partial(progress, chunk))
                    continue
                ahead.append(
                    (chunk, pool.submit(run_chunk, chunk, threads=self._threads, kernel_lock=kernel_lock))
                )
                yield from _landed(ahead, 1)
            yield from _landed(ahead, 0)
        finally:
            pool.shutdown(cancel_futures=True)


def _landed(ahead: deque[tuple[Chunk, Future[ChunkResult]]], but: int) -> Iterator[tuple[Chunk, ChunkResult]]:
    """Waits for the chunks that are first in the queue, all but some."""
    while len(ahead) > but:
        chunk, flown = ahead.popleft()
        yield chunk, flown.result()


def check_engine(name: str, *, threads: int = 0, scheduler: str | None = None) -> None:
    """Refuses what `open_engine` would, as far as can be said without connecting to anything.

    Raises:
        EngineError: for an unknown name, settings that have no effect, and a package that is not installed.
    """
    if name not in ENGINES:
        raise EngineError(f"engine '{name}' is not known, expected {' or '.join(ENGINES)}")
    if scheduler is not None and name != "dask":
        raise EngineError(f"scheduler {scheduler} is given with engine '{name}': only dask has schedulers")
    if scheduler is not None and not _is_address(scheduler):
        raise EngineError(f"scheduler '{scheduler}': expected an address such as tcp://host:8786")
    if scheduler is not None and threads:
        raise EngineError(f"threads are given with scheduler {scheduler}, whose workers bring their own")
    if name == "dask" and find_spec("distributed") is None:
        raise EngineError("engine 'dask' needs the package distributed: pip install 'bottomlock[dask]'")


def _is_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        return parts.scheme in {"tcp", "tls"} and bool(parts.hostname) and parts.port is not None
    except ValueError:
        return False


@contextmanager
def open_engine(name: str, *, threads: int = 0, scheduler: str | None = None) -> Iterator[Engine]:
    """An engine for as long as it is needed.

    Args:
        name: "local", or "dask" for a cluster of processes or machines.
        threads: local: threads of the kernel; dask: worker processes on this machine; 0 for as many as there are cores.
        scheduler: dask: address of a scheduler whose workers do it, such as "tcp://10.0.0.5:8786".

    Raises:
        EngineError: for what `check_engine` refuses, and a cluster that is not there or breaks down.
    """
    check_engine(name, threads=threads, scheduler=scheduler)
    if name == "local":
        yield LocalEngine(threads)
        return
    from bottomlock.campaign.dask_engine import open_cluster  # noqa: PLC0415 - an extra, imported only when asked for

    with open_cluster(scheduler, workers=threads) as cluster:
        yield cluster
