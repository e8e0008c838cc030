"""The error norms of a campaign, transposed: they arrive run by run and leave method by method, with all runs.

They pass through a file without a name that vanishes with the process. Memory holds one block, and each chunk is read
once.
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

from bottomlock.campaign.partition import Chunk, Partition
from bottomlock.errors import OutputError
from bottomlock.statistics.campaign import NORMS

VALUES_HELD = 16_000_000
"""Norms in memory at a time, 128 MB: one method of 12,800 runs of 250 samples, or part of the times of more runs."""

_BYTES = 8


@dataclass(frozen=True)
class Block:
    """All norms of all runs of one method, at some of the sample times."""

    method: int
    times: slice
    place: int

    @property
    def width(self) -> int:
        """Number of times."""
        return int(self.times.stop - self.times.start)


class ErrorBlocks:
    """A file of blocks: `put` the norms of every chunk, then `get` each block."""

    def __init__(self, file: IO[bytes], partition: Partition, times: int) -> None:
        """Block boundaries depend on the scenario only, so that the last bit does not depend on the machine."""
        self._file = file
        self._partition = partition
        self._times = times
        width = min(times, max(1, VALUES_HELD // (len(NORMS) * partition.runs)))
        self.blocks: list[Block] = []
        place = 0
        for method in range(len(partition.methods)):
            for first in range(0, times, width):
                block = Block(method, slice(first, min(first + width, times)), place)
                self.blocks.append(block)
                place += len(NORMS) * partition.runs * block.width

    def put(self, chunk: Chunk, norms: pl.DataFrame) -> None:
        """The norms of a chunk, ordered by run, method and time.

        Raises:
            OutputError: on a full disk.
        """
        shape = (chunk.runs, len(self._partition.methods), self._times)
        columns = [norms[name].to_numpy().reshape(shape) for name in NORMS]
        try:
            for block in self.blocks:
                for k, values in enumerate(columns):
                    self._file.seek(self._at(block, k, chunk.first_run))
                    self._write(values[:, block.method, block.times].tobytes())
        except OSError as error:
            raise OutputError(f"the error norms cannot be kept on disk ({error.strerror})") from error

    def _write(self, content: bytes) -> None:
        if self._file.write(content) != len(content):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def get(self, block: Block) -> dict[str, NDArray[np.float64]]:
        """The norms of a block by name, (runs, times) each."""
        self._file.seek(self._at(block, 0, 0))
        shape = (len(NORMS), self._partition.runs, block.width)
        values = np.fromfile(self._file, dtype=np.float64, count=int(np.prod(shape))).reshape(shape)
        return dict(zip(NORMS, values, strict=True))

    def _at(self, block: Block, norm: int, run: int) -> int:
        return _BYTES * (block.place + (norm * self._partition.runs + run) * block.width)


@contextmanager
def open_blocks(folder: Path, partition: Partition, times: int) -> Iterator[ErrorBlocks]:
    """Blocks on the file system of a folder, which gets no file with a name.

    Raises:
        OutputError: where nothing can be written.
    """
    with ExitStack() as stack:
        try:
            file = stack.enter_context(tempfile.TemporaryFile(dir=folder, buffering=0))
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
        yield ErrorBlocks(file, partition, times)
