"""The error norms of a campaign turned round: they come run by run, and go method by method with all runs.

They pass through a file without a name that vanishes with the process, so that memory holds one block and each chunk is
read once.
"""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.campaign.partition import Partition, RunRange
from bottomlock.errors import OutputError
from bottomlock.statistics.campaign import NORMS

VALUES_HELD = 16_000_000
"""Norms in memory at a time, 128 MB: one method of 12,800 runs of 250 samples, or part of the times of more runs."""

_BYTES = 8


@dataclass(frozen=True)
class Block:
    """All norms of all runs of one method, at some of the times."""

    method: int
    times: slice
    place: int

    @property
    def width(self) -> int:
        """Number of times."""
        return int(self.times.stop - self.times.start)


class Blocks:
    """A file of blocks; `put` the norms of every chunk, then `get` each block."""

    def __init__(self, file: IO[bytes], plan: Partition, times: int) -> None:
        """The cutting depends on the scenario alone, so that the last bit does not depend on the machine."""
        self._file = file
        self._plan = plan
        self._times = times
        width = min(times, max(1, VALUES_HELD // (len(NORMS) * plan.runs)))
        self.blocks: list[Block] = []
        place = 0
        for method in range(len(plan.methods)):
            for first in range(0, times, width):
                block = Block(method, slice(first, min(first + width, times)), place)
                self.blocks.append(block)
                place += len(NORMS) * plan.runs * block.width

    def put(self, span: RunRange, norms: pl.DataFrame) -> None:
        """The norms of a chunk, ordered by run, method and time.

        Raises:
            OutputError: on a full disk.
        """
        shape = (span.runs, len(self._plan.methods), self._times)
        columns = [norms[name].to_numpy().reshape(shape) for name in NORMS]
        try:
            for block in self.blocks:
                for k, values in enumerate(columns):
                    self._file.seek(self._at(block, k, span.first_run))
                    self._write(values[:, block.method, block.times].tobytes())
        except OSError as error:
            raise OutputError(f"the error norms cannot be kept on disk ({error.strerror})") from error

    def _write(self, content: bytes) -> None:
        if self._file.write(content) != len(content):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def get(self, block: Block) -> dict[str, NDArray[np.float64]]:
        """The norms of a block by name, (runs, times) each."""
        self._file.seek(self._at(block, 0, 0))
        shape = (len(NORMS), self._plan.runs, block.width)
        values = np.fromfile(self._file, dtype=np.float64, count=int(np.prod(shape))).reshape(shape)
        return dict(zip(NORMS, values, strict=True))

    def _at(self, block: Block, norm: int, run: int) -> int:
        return _BYTES * (block.place + (norm * self._plan.runs + run) * block.width)


@contextmanager
def open_blocks(folder: Path, plan: Partition, times: int) -> Iterator[Blocks]:
    """Blocks on the file system of a folder, which gets no file with a name.

    Raises:
        OutputError: where nothing can be written.
    """
    with ExitStack() as stack:
        try:
            file = stack.enter_context(tempfile.TemporaryFile(dir=folder, buffering=0))
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
        yield Blocks(file, plan, times)
