"""Python's garbage collector runs between readings, not while one is on its way to the ports."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager

YOUNG = 1000
"""Container objects since the last collection from which the young ones are looked at; a ping makes some tens."""
WHOLE_EVERY = 200
"""Collections of young objects from one of all objects to the next."""


@contextmanager
def collected_between_readings() -> Iterator[Callable[[], None]]:
    """Ends automatic collection, and gives the function that collects, to be called where nothing waits.

    What exists at the beginning is never looked at again. At the end all is as before.
    """
    automatic = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    collections = 0

    def collect() -> None:
        nonlocal collections
        if gc.get_count()[0] >= YOUNG:
            collections += 1
            gc.collect(2 if collections % WHOLE_EVERY == 0 else 1)

    try:
        yield collect
    finally:
        gc.unfreeze()
        if automatic:
            gc.enable()
