"""Shards: any cutting of a campaign among machines comes together to the same bits, and nothing else passes for it."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.campaign import partition, run
from bottomlock.campaign.directory import MANIFEST
from bottomlock.campaign.merge import merge_shards
from bottomlock.campaign.partition import Partition, Shard, all_chunks
from bottomlock.campaign.run import run_campaign, run_shard
from bottomlock.config.scenario import Scenario
from bottomlock.errors import DataError, OutputError, ScenarioError
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, same_bits, short
from tests.recorded import edit_record

N = 3


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    """Two trajectories, seven chunks."""
    return [short(7), short(5, "figure_eight")]


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory, scenarios: list[Scenario]) -> Path:
    """The campaign in `whole` and its shards in `1`, `2`, `3`; not to be changed."""
    folder = tmp_path_factory.mktemp("shards")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(partition, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)
        run_campaign(scenarios, folder / "whole", threads=2)
        for k in range(1, N + 1):
            run_shard(scenarios, folder / str(k), Shard(k, N), threads=1)
    return folder


@pytest.fixture
def shards(tmp_path: Path, campaigns: Path) -> list[Path]:
    """Copies of the shards' directories, to be spoilt."""
    for k in range(1, N + 1):
        shutil.copytree(campaigns / str(k), tmp_path / str(k))
    return [tmp_path / str(k) for k in range(1, N + 1)]


@given(runs=st.integers(1, 10**6), size=st.integers(1, 10**5), n=st.integers(1, 40))
def test_every_run_is_in_one_chunk_and_every_chunk_in_one_shard(runs: int, size: int, n: int) -> None:
    """In order, without gap or overlap, none longer than the others."""
    size = max(size, runs // 1000)
    chunks = Partition("s", ("tc",), runs, size, 20).chunks()
    assert [chunk.first_run for chunk in chunks] == list(range(0, runs, size))
    assert sum(chunk.runs for chunk in chunks) == runs
    assert {chunk.runs for chunk in chunks[:-1]} <= {size}
    shards = [Shard(k, n) for k in range(1, n + 1)]
    assert all(sum(shard.contains(number) for shard in shards) == 1 for number in range(len(chunks)))


@pytest.mark.parametrize("text", ["0/3", "4/3", "2", "2/", "/3", "-1/3", "a/b", "1/3/5", "2/0", ""])
def test_what_is_no_shard(text: str) -> None:
    with pytest.raises(ScenarioError, match=r"expected k/n with 1 <= k <= n"):
        Shard.parse(text)


def test_shards_share_the_work_and_leave_no_tables(scenarios: list[Scenario], campaigns: Path) -> None:
    """Chunks are counted through all scenarios, so that no shard is left without work by a short one."""
    chunks = [sorted(path.name for path in campaigns.glob(f"{k}/chunks/*/counts-*")) for k in range(1, N + 1)]
    assert [len(names) for names in chunks] == [3, 2, 2]
    assert {path.name for path in campaigns.glob("[123]/*.parquet")} == {"truth.parquet"}
    partitions = [Partition.of(scenario) for scenario in scenarios]
    shared = [chunk for k in range(1, N + 1) for chunk in all_chunks(partitions, Shard(k, N))]
    assert sum(chunk.runs for chunk in shared) == sum(chunk.runs for chunk in all_chunks(partitions)) == 12
    manifest = json.loads((campaigns / "2" / MANIFEST).read_text(encoding="utf-8"))
    assert manifest["status"] == "shard"
    assert manifest["shard"] == {"k": 2, "n": 3}


def test_merged_is_the_campaign_in_one_go(tmp_path: Path, campaigns: Path) -> None:
    """In any order of the shards, and again after an interruption; the merged directory is a campaign's."""
    shards = [campaigns / name for name in ("3", "1", "2")]
    merged = merge_shards(tmp_path / "o", shards)
    same_bits(campaigns / "whole", tmp_path / "o")
    assert merged.manifest["status"] == "complete"
    assert "shard" not in merged.manifest
    assert [part["shard"]["k"] for part in merged.manifest["shards"]] == [3, 1, 2]
    (tmp_path / "o" / "runs.parquet").unlink()
    next(tmp_path.glob("o/chunks/straight/samples-*")).unlink()
    merge_shards(tmp_path / "o", shards)
    same_bits(campaigns / "whole", tmp_path / "o")
    assert not list(tmp_path.rglob(".*"))


def test_a_merged_campaign_can_be_extended(
    tmp_path: Path, campaigns: Path, scenarios: list[Scenario], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As any other: its chunks are taken as they are."""
    monkeypatch.setattr(partition, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)
    merge_shards(tmp_path / "o", [campaigns / name for name in "123"])
    monkeypatch.setattr(run, "write_chunk", lambda *_: pytest.fail("a chunk was run again"))
    run_campaign(scenarios, tmp_path / "o", threads=1)
    same_bits(campaigns / "whole", tmp_path / "o")


def edit(directory: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Changes a manifest, which then states itself as it is."""
    edit_record(directory / MANIFEST, change)


def _of_other_runs(manifest: dict[str, Any]) -> None:
    manifest["scenarios"]["straight"]["runs"] = 8


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: m.update(configuration_hash="0"), r"2: is of another configuration than .*1"),
        (lambda m: m.update(version="0.0.1"), r"2: is of version 0\.0\.1, this is"),
        (lambda m: m.update(status="running"), "shard 2/3 is not finished"),
        (lambda m: m.update(shard={"k": 1, "n": 3}), r"shard 1/3 is there twice: .*1 and .*2"),
        (lambda m: m.update(shard={"k": 2, "n": 4}), r"is shard 2/4, but .*1 is one of 3"),
        (lambda m: m.pop("shard"), "holds a whole campaign, expected a shard"),
        (lambda m: m.pop("configuration_hash"), "holds no campaign of ours"),
        (_of_other_runs, "is of another number of runs"),
    ],
)
def test_shards_that_do_not_belong_together(
    tmp_path: Path, shards: list[Path], change: Callable[[dict[str, Any]], object], words: str
) -> None:
    """Each is rejected by name before anything is written."""
    edit(shards[1], change)
    with pytest.raises(OutputError, match=words):
        merge_shards(tmp_path / "o", shards)
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("entry", [{"k": 2}, {"k": "a", "n": 3}, 7])
def test_a_manifest_of_no_shard(tmp_path: Path, shards: list[Path], entry: object) -> None:
    edit(shards[1], lambda manifest: manifest.update(shard=entry))
    with pytest.raises(DataError, match="expected k and n"):
        merge_shards(tmp_path / "o", shards)


def test_shards_and_chunks_that_are_missing(tmp_path: Path, shards: list[Path]) -> None:
    """Every missing shard is named, and a missing chunk with the shard that makes it."""
    out = tmp_path / "o"
    with pytest.raises(OutputError, match=r"missing shards 1/3, 3/3$"):
        merge_shards(out, shards[1:2])
    with pytest.raises(OutputError, match=r"missing shard 2/3$"):
        merge_shards(out, shards[::2])
    with pytest.raises(OutputError, match="no shard is named"):
        merge_shards(out, [])
    with pytest.raises(OutputError, match="holds no campaign of ours"):
        merge_shards(out, [*shards[:2], tmp_path / "nowhere"])
    (shards[1] / "chunks" / "straight" / "samples-00000002-00000003.parquet").unlink()
    with pytest.raises(OutputError, match=r"2: chunk 00000002-00000003.parquet of straight .* shard 2/3"):
        merge_shards(out, shards)
    assert not out.exists()


def test_merging_into_something_else(tmp_path: Path, campaigns: Path, shards: list[Path]) -> None:
    """Neither a stranger's files, nor a shard, nor another campaign are written over."""
    with pytest.raises(OutputError, match="is one of the shards"):
        merge_shards(shards[0], shards)
    stranger = tmp_path / "stranger"
    stranger.mkdir()
    (stranger / "thesis.tex").write_text("years of work", encoding="utf-8")
    with pytest.raises(OutputError, match="holds no campaign of ours"):
        merge_shards(stranger, shards, force=True)
    other = tmp_path / "other"
    run_campaign([short(2)], other, threads=1)
    before = (other / "runs.parquet").read_bytes()
    with pytest.raises(OutputError, match="another configuration"):
        merge_shards(other, shards)
    assert (other / "runs.parquet").read_bytes() == before
    merge_shards(other, shards, force=True)
    same_bits(campaigns / "whole", other)


def test_a_shard_s_directory_is_that_shard_s(
    scenarios: list[Scenario], shards: list[Path], tmp_path: Path, campaigns: Path
) -> None:
    """Neither another shard nor the whole goes into it, nor a shard into the whole."""
    with pytest.raises(OutputError, match="holds shard 1/3 of this campaign"):
        run_shard(scenarios, shards[0], Shard(2, N), threads=1)
    with pytest.raises(OutputError, match="holds shard 1/3 of this campaign"):
        run_campaign(scenarios, shards[0], threads=1)
    shutil.copytree(campaigns / "whole", tmp_path / "w")
    with pytest.raises(OutputError, match="holds a whole campaign"):
        run_shard(scenarios, tmp_path / "w", Shard(1, N), threads=1)
