"""Engines: what runs a list of chunks. The numbers do not depend on the engine."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from importlib.util import find_spec
from typing import Literal, get_args
from urllib.parse import urlsplit

from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.chunk import Chunk, ChunkResults, RunChunks, run_chunk
from bottomlock.errors import EngineError
from bottomlock.libraries import install
from bottomlock.text import did_you_mean

Engine = Literal["local", "dask"]
ENGINES: tuple[Engine, ...] = get_args(Engine)


def run_here(
    scenarios: Sequence[BuiltScenario],
    threads: int,
    chunks: Sequence[Chunk],
    progress: Callable[[Chunk, float], None],
) -> ChunkResults:
    """Runs chunks in this process, in order."""
    of = {built.scenario.name: built for built in scenarios}
    for chunk in chunks:
        yield (
            chunk,
            run_chunk(of[chunk.scenario], chunk, threads=threads, progress=partial(progress, chunk)),
        )


def check_engine(name: str, *, threads: int = 0, scheduler: str | None = None) -> None:
    """Rejects what `open_engine` would reject, as far as that is known without a connection.

    Raises:
        EngineError: for an unknown name, settings that have no effect, and a package that is not installed.
    """
    if name not in ENGINES:
        raise EngineError(
            f"engine '{name}' is not known{did_you_mean(name, ENGINES)} (known: {', '.join(ENGINES)})"
        )
    if scheduler is not None and name != "dask":
        raise EngineError(f"scheduler {scheduler} is given with engine '{name}': only dask has schedulers")
    if scheduler is not None and not _is_address(scheduler):
        raise EngineError(place=f"scheduler '{scheduler}'", expected="an address such as tcp://host:8786")
    if scheduler is not None and threads:
        raise EngineError(f"threads are given with scheduler {scheduler}, whose workers bring their own")
    if name == "dask" and find_spec("distributed") is None:
        raise EngineError(f"engine 'dask' needs the package distributed: {install('dask')}")


def _is_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        return parts.scheme in {"tcp", "tls"} and bool(parts.hostname) and parts.port is not None
    except ValueError:
        return False


def open_engine(
    name: str, scenarios: Sequence[BuiltScenario], *, threads: int = 0, scheduler: str | None = None
) -> AbstractContextManager[RunChunks]:
    """What runs the chunks of some scenarios, as a context manager.

    Args:
        name: "local", or "dask" for a cluster of processes or machines.
        scenarios: the scenarios.
        threads: local: threads of the kernel; dask: worker processes on this machine; 0 for as many as there are cores.
        scheduler: dask: address of a scheduler whose workers run the chunks, such as "tcp://10.0.0.5:8786".

    Raises:
        EngineError: for a cluster that is not there or breaks down.
    """
    if name == "local":
        return nullcontext(partial(run_here, scenarios, threads))
    from bottomlock.campaign.dask_engine import open_cluster  # noqa: PLC0415 - an extra, imported only on request

    return open_cluster(scheduler, scenarios, workers=threads)
