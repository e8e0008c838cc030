"""Missions simulated by a process of their own while the first runs are under way."""

import contextlib
import os
import pickle
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from bottomlock.errors import BottomlockError
from bottomlock.plant.cache import is_stored
from bottomlock.simulation.build import Simulation
from bottomlock.support.other_process import other_process, send_all


@contextmanager
def flights_ahead(simulations: Sequence[Simulation], *, threads: int = 0) -> Iterator[None]:
    """Simulates the missions that the cache lacks, the last first, and puts them there; the caller begins at the first.

    A mission takes the interpreter a second, in which runs can fly. Where the process fails, or the cache cannot
    be written, the caller simulates what it needs; the numbers are the same.

    Args:
        simulations: in the order in which they are needed; of equal missions the first counts.
        threads: as for the campaign; with one core, or with one mission, there is no other process.
    """
    missing: dict[str, Simulation] = {}
    for simulation in simulations:
        key = simulation.flight_key()
        if key is not None and not is_stored(key):
            missing.setdefault(key, simulation)
    if (threads or os.cpu_count() or 1) == 1 or len(missing) < 2:
        yield
        return
    with other_process(_serve) as process:
        send_all(process, pickle.dumps([*missing.values()][:0:-1]))
        yield


def _serve() -> None:
    """Reads simulations and flies each that is not in the cache by then."""
    for simulation in pickle.load(sys.stdin.buffer):  # noqa: S301 - the caller's
        with contextlib.suppress(BottomlockError):
            key = simulation.flight_key()
            if key is not None and not is_stored(key):
                simulation.flight()
