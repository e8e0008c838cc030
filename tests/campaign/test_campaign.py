"""A campaign on disk: same bits whatever the way, nothing half-written, nothing overwritten unasked."""

import json
from pathlib import Path

import polars as pl
import pytest

from bottomlock.campaign import chunk as chunks
from bottomlock.campaign.run import CampaignProgress, read_results, run_campaign
from bottomlock.errors import OutputError, ScenarioError
from bottomlock.files import atomic_write
from bottomlock.files.columns import CONSISTENCY, ENSEMBLE, RUNS, check
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, TABLES, short


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs a chunk."""
    monkeypatch.setattr(chunks, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)


def same_tables(one: Path, two: Path) -> None:
    """The tables hold the same bits, whatever the chunks."""
    for name in TABLES:
        assert (one / name).read_bytes() == (two / name).read_bytes(), name


def test_tables_and_manifest(tmp_path: Path) -> None:
    """The columns are those that are promised, and the manifest says what decided the numbers."""
    results = run_campaign([short()], tmp_path / "o", threads=1)
    for name, columns in (("runs", RUNS), ("ensemble", ENSEMBLE), ("consistency", CONSISTENCY)):
        check(pl.read_parquet(tmp_path / "o" / f"{name}.parquet"), columns, place=name)
    assert results.runs.height == 15
    assert results.ensemble.height == 30
    manifest = json.loads((tmp_path / "o" / "manifest.json").read_text(encoding="utf-8"))
    options = manifest["scenarios"]["straight"]["options"]
    assert manifest["status"] == "complete"
    assert options["assumptions"]["virtual_beam_factor"] == 1.0
    assert options["assumptions"]["nullified_sway_var_m2ps2"] == 1e-3
    assert options["gate"] == "joint"
    assert manifest["scenarios"]["straight"]["seed"] == 2017


@pytest.mark.usefixtures("small_chunks")
def test_a_campaign_in_memory_is_that_of_a_folder(tmp_path: Path) -> None:
    """Every table and every sample, with runs, seed and methods given to the call; nothing is written."""
    given = {"runs": 3, "seed": 7, "methods": ["tc", "ins"]}
    scenarios = [short(), short(name="figure_eight")]
    memory = run_campaign(scenarios, threads=1, **given)  # type: ignore[arg-type]
    folder = run_campaign(scenarios, tmp_path / "o", threads=1, **given)  # type: ignore[arg-type]
    for other in (folder, read_results(tmp_path / "o")):
        for name in ("runs", "ensemble", "consistency", "choices", "paths", "summary"):
            assert getattr(memory, name).equals(getattr(other, name)), name
        assert memory.samples.collect().equals(other.samples.collect())
    assert memory.folder is None
    assert memory.samples.collect().height == 2 * 3 * 2 * 10
    assert memory.manifest["scenarios"]["straight"]["seed"] == 7


def test_bits_do_not_depend_on_threads_chunks_or_interruption(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One thread, two threads, small chunks, broken off after the first one and resumed: the same tables."""
    run_campaign([short()], tmp_path / "one", threads=1)
    monkeypatch.setattr(chunks, "CHUNK_STEPS", 1)
    run_campaign([short()], tmp_path / "two", threads=2)
    same_tables(tmp_path / "one", tmp_path / "two")

    def stop(_: CampaignProgress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign([short()], tmp_path / "broken", threads=1, progress=stop)
    finished = sorted((tmp_path / "broken" / "chunks" / "straight").glob("samples-*"))
    stamps = [path.stat().st_mtime_ns for path in finished]
    assert len(finished) == 1
    run_campaign([short()], tmp_path / "broken", threads=2)
    assert [path.stat().st_mtime_ns for path in finished] == stamps, "a finished chunk is not run again"
    same_tables(tmp_path / "one", tmp_path / "broken")


def test_more_runs_extend_fewer(tmp_path: Path) -> None:
    """Run k is run k, however many there are."""
    few = run_campaign([short(3)], tmp_path / "o", threads=1)
    more = run_campaign([short(5)], tmp_path / "o", threads=1)
    assert more.runs.filter(pl.col("run") < 3).equals(few.runs)
    assert more.samples.collect().filter(pl.col("run") < 3).height == 3 * 3 * 10


def test_another_campaign_is_written_over_by_force_alone(tmp_path: Path) -> None:
    """Another campaign is rejected unless forced, which leaves what no record names; scenarios of one name always."""
    out = tmp_path / "o"
    run_campaign([short()], out, threads=1)
    before = (out / "runs.parquet").read_bytes()
    own = [out / "notes.txt", out / "chunks" / "mine.parquet", out / "chunks" / "straight" / "x"]
    for path in own:
        path.write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="another configuration"):
        run_campaign([short().with_overrides(seed=1)], out, threads=1)
    assert (out / "runs.parquet").read_bytes() == before
    run_campaign([short().with_overrides(seed=1)], out, threads=1, force=True)
    assert (out / "runs.parquet").read_bytes() != before
    assert all(path.read_text(encoding="utf-8") == "mine" for path in own)
    with pytest.raises(ScenarioError, match="different names"):
        run_campaign([short(), short()], tmp_path / "p", threads=1)


def test_nothing_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that fills while a table is written leaves no part of it, and the message names the file."""

    def fail(path: Path, content: bytes) -> None:
        if path.name.startswith(".samples"):
            path.write_bytes(b"half")
            raise OSError(28, "No space left on device")
        path.write_bytes(content)

    monkeypatch.setattr(atomic_write, "_write", fail)
    with pytest.raises(OutputError, match=r"samples-.*cannot be written"):
        run_campaign([short()], tmp_path / "o", threads=1)
    leftovers = [path for path in (tmp_path / "o").rglob("*") if path.is_file()]
    assert [path.name for path in leftovers] == ["manifest.json"]
