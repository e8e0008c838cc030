"""A batch as Python calls it: the GIL, the memory, whose arrays are read, masks and seeds."""

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock import kernel
from bottomlock.kernel import Method
from tests.analytic import batch_along

MOST_BEYOND_MB = 10.0

Floats = NDArray[np.float64]


def test_python_goes_on_meanwhile() -> None:
    """The kernel works without the GIL: a thread that wants it every millisecond gets it."""
    work, ticks, done = batch_along(100.0), 0, threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not done.is_set():
            ticks += 1
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    began = ticks
    kernel.run_batch(**work, methods=["lc", "tc", "elc"], runs=16, threads=1)
    during = ticks - began
    done.set()
    thread.join()
    assert during >= 10


def test_no_runs_and_no_methods_yield_empty_arrays() -> None:
    """Nothing to do is no error."""
    work = batch_along(10.0)
    assert kernel.run_batch(**work, methods=["tc"], runs=0, threads=2)["error"].shape == (0, 1, 10, 9)
    assert kernel.run_batch(**work, methods=[], runs=3, threads=2)["error"].shape == (3, 0, 10, 9)


@pytest.mark.parametrize("make", [np.asfortranarray, lambda values: np.repeat(values, 2, axis=0)[::2]])
def test_arrays_that_are_not_contiguous_give_the_same_bits(make: Callable[[Floats], Floats]) -> None:
    """The truth is read where it lies, or copied where it cannot be."""
    work = batch_along(10.0)
    straight: dict[str, Any] = dict(kernel.run_batch(**work, methods=["tc"], runs=2, threads=1))
    truth = {key: value if value.ndim == 1 else make(value) for key, value in work["truth"].items()}
    assert not truth["force_p_mps2"].flags.c_contiguous
    other: dict[str, Any] = dict(
        kernel.run_batch(**(work | {"truth": truth}), methods=["tc"], runs=2, threads=1)
    )
    assert all(np.array_equal(straight[key], other[key], equal_nan=True) for key in straight)


def errors(valid: NDArray[np.bool_] | None = None, seed: int = 1, method: Method = "tc") -> Floats:
    """Of three runs, with masks of one's own or beams 3 and 4 lost."""
    work = batch_along(6.0) | {"seed": seed}
    if valid is not None:
        work["schedule"] = work["schedule"] | {"beam_valid": valid}
    return np.asarray(kernel.run_batch(**work, methods=[method], runs=3, threads=1)["error"])


def test_masks_may_differ_by_run() -> None:
    """(runs, epochs, beams) masks: run k has its own, and equal masks give the bits of a shared one."""
    shared = batch_along(6.0)["schedule"]["beam_valid"]
    assert not shared.all()
    own = np.tile(shared, (3, 1, 1))
    plain = errors()
    np.testing.assert_array_equal(errors(own), plain)
    own[1] = True
    mixed = errors(own)
    np.testing.assert_array_equal(mixed[[0, 2]], plain[[0, 2]])
    assert not np.array_equal(mixed[1], plain[1])
    # The reference method ignores the masks.
    np.testing.assert_array_equal(errors(own, method="lc"), errors(method="lc"))


def test_runs_and_seeds_differ() -> None:
    first = errors()
    assert not np.array_equal(first[0], first[1])
    assert not np.array_equal(first, errors(seed=8))


@pytest.mark.skipif(sys.platform != "linux", reason="asks the kernel of Linux for the largest resident set")
def test_many_runs_need_little_memory_beyond_what_they_yield() -> None:
    """512 runs: the filters of those in flight, and no second copy of the yield."""
    work = batch_along(60.0)
    methods: list[Method] = ["ins", "lc", "tc", "elc"]
    kernel.run_batch(**work, methods=methods, runs=4, threads=2)
    before = resident_mb("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    yielded = kernel.run_batch(**work, methods=methods, runs=512, threads=2)
    grown = resident_mb("VmHWM") - before
    returned = sum(np.asarray(values).nbytes for values in yielded.values()) / 2**20
    assert returned > 15.0
    assert grown < returned + MOST_BEYOND_MB


def resident_mb(which: str) -> float:
    """A line of `/proc/self/status`."""
    for line in Path("/proc/self/status").read_text().splitlines():
        name, _, value = line.partition(":")
        if name == which:
            return float(value.split()[0]) / 1024.0
    raise AssertionError(which)
