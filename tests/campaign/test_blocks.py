"""The statistics of many runs in little memory: blocks change no bit, and hold no more than they may."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.campaign import aggregate, error_blocks, partition
from bottomlock.campaign.chunk import ChunkResult
from bottomlock.campaign.error_blocks import open_blocks
from bottomlock.campaign.partition import Chunk, Partition
from bottomlock.campaign.run import run_campaign
from bottomlock.errors import DataError, OutputError
from bottomlock.statistics import rms
from bottomlock.statistics.campaign import NORMS
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, same_bits, short

TIMES = 40


def norms(cut: Partition) -> dict[str, np.ndarray[tuple[int, int, int], np.dtype[np.float64]]]:
    """Numbers that tell norm, run, method and time, as (runs, methods, times)."""
    shape = (cut.runs, len(cut.methods), TIMES)
    return {name: (k + np.arange(np.prod(shape)) / 1e6).reshape(shape) for k, name in enumerate(NORMS)}


@pytest.mark.parametrize("held", [1, 600, 10**6])
def test_what_is_put_is_got(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, held: int) -> None:
    """One time a block, some, all: every norm of every run at its place, in any order of the chunks."""
    monkeypatch.setattr(error_blocks, "VALUES_HELD", held)
    cut = Partition("s", ("a", "b"), runs=7, runs_per_chunk=3, nees_degrees=20)
    expected = norms(cut)
    with open_blocks(tmp_path, cut, TIMES) as turned:
        for chunk in reversed(cut.chunks()):
            part = slice(chunk.first_run, chunk.first_run + chunk.runs)
            turned.put(chunk, pl.DataFrame({name: expected[name][part].ravel() for name in NORMS}))
        for block in turned.blocks:
            for name, values in turned.get(block).items():
                assert np.array_equal(values, expected[name][:, block.method, block.times]), name
        widths = {1: 1, 600: 17, 10**6: TIMES}
        assert max(block.width for block in turned.blocks) == widths[held]
    assert not list(tmp_path.iterdir()), "the file has no name"


def test_memory_is_that_of_a_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty times as many values as may be held: no more than two blocks' worth at a time."""
    monkeypatch.setattr(error_blocks, "VALUES_HELD", 50_000)
    cut = Partition("s", ("a", "b"), runs=2_500, runs_per_chunk=50, nees_degrees=20)
    zeros = pl.DataFrame({name: np.zeros(50 * 2 * TIMES) for name in NORMS})
    with open_blocks(tmp_path, cut, TIMES) as turned:
        tracemalloc.start()
        for chunk in cut.chunks():
            turned.put(chunk, zeros)
        for block in turned.blocks:
            turned.get(block)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert peak < 2 * 50_000 * 8


def test_tables_do_not_depend_on_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign whose norms pass in blocks of two seconds has the same tables."""
    monkeypatch.setattr(partition, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)
    run_campaign([short()], tmp_path / "one", threads=1)
    monkeypatch.setattr(error_blocks, "VALUES_HELD", 2 * 5 * len(NORMS))
    run_campaign([short()], tmp_path / "two", threads=1)
    same_bits(tmp_path / "one", tmp_path / "two")


def test_a_chunk_with_other_sample_times_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not joined to the others, whose rows stand for other times."""
    monkeypatch.setattr(partition, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)
    add = aggregate.Aggregate.add

    def later(self: aggregate.Aggregate, chunk: Chunk, result: ChunkResult) -> None:
        moved = result.samples.with_columns(pl.col("time_ns") + (1 if chunk.first_run == 2 else 0))
        add(self, chunk, replace(result, samples=moved))

    monkeypatch.setattr(aggregate.Aggregate, "add", later)
    with pytest.raises(
        DataError, match=r"chunk 00000002-00000003\S* of straight has other sample times than the others"
    ):
        run_campaign([short()], tmp_path / "one", threads=1)


def test_the_bootstrap_draws_the_same_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """One stream of draws, however many are held; the products may round otherwise."""
    squares = np.random.default_rng(1).normal(size=(50, 4)) ** 2
    whole = rms.bootstrap_rms(squares)
    monkeypatch.setattr(rms, "WEIGHTS_HELD", 7 * 50)
    assert np.allclose(rms.bootstrap_rms(squares), whole, rtol=1e-13, atol=0.0)


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match="cannot be written"),
        open_blocks(tmp_path / "nowhere", Partition("s", ("a",), 1, 1, 20), TIMES),
    ):
        pass
