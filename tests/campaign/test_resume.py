"""Interruptions of the hard kind, and directories that somebody has spoilt."""

import json
import shutil
from pathlib import Path

import pytest

from bottomlock.campaign import chunk as chunks
from bottomlock.campaign.build import build_simulations
from bottomlock.campaign.folder import MANIFEST, identity_of
from bottomlock.campaign.run import CampaignProgress, run_campaign
from bottomlock.errors import DataError, Note, OutputError
from bottomlock.files.output_folder import LOCK
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, same_bits, short
from tests.recorded import edit_record


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs a chunk."""
    monkeypatch.setattr(chunks, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)


def finished(out: Path) -> dict[Path, int]:
    """The files of finished chunks, with the time of their writing."""
    records = out.glob("chunks/straight/record-*")
    return {
        path: path.stat().st_mtime_ns
        for record in records
        for path in (record, record.with_name(f"{record.stem.replace('record', 'samples')}.parquet"))
    }


def test_ended_before_the_manifest_was_there(tmp_path: Path) -> None:
    """All that is left is a manifest that was never finished: the directory is as good as empty."""
    out = tmp_path / "o"
    out.mkdir()
    (out / f".{MANIFEST}.4711.part").write_text("{", encoding="utf-8")
    (out / LOCK).write_text("", encoding="utf-8")
    run_campaign([short()], out, threads=1)
    assert [path.name for path in out.glob(".*")] == []


def test_what_is_found_is_told_apart(tmp_path: Path) -> None:
    """A bar has to know which runs were there before, or it promises too much."""
    heard: list[CampaignProgress] = []
    run_campaign([short(4)], tmp_path / "o", threads=1)
    (tmp_path / "o" / "chunks" / "straight" / "counts-00000000-00000001.parquet").unlink()
    run_campaign([short(4)], tmp_path / "o", threads=1, progress=heard.append)
    assert heard == [
        CampaignProgress("straight", 2, 4, 4, resumed=True),
        CampaignProgress("straight", 4, 4, 4),
    ]


CHUNK = "00000002-00000003"


@pytest.mark.parametrize("which", ["samples", "choices", "counts", "record"])
def test_a_chunk_that_has_changed_is_run_again(tmp_path: Path, which: str) -> None:
    """A note names the file; the tables are those of the campaign as it was."""
    run_campaign([short()], tmp_path / "whole", threads=1)
    shutil.copytree(tmp_path / "whole", tmp_path / "o")
    (path,) = (tmp_path / "o" / "chunks" / "straight").glob(f"{which}-{CHUNK}.*")
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.warns(Note, match=rf"{path.name}: .*; the chunk is run again"):
        run_campaign([short()], tmp_path / "o", threads=1)
    same_bits(tmp_path / "whole", tmp_path / "o")


def test_whole_files_in_the_wrong_place(tmp_path: Path) -> None:
    """Tables of other runs, of another seed and of another scenario are whole, and yet not this chunk's."""
    run_campaign([short()], tmp_path / "whole", threads=1)
    out, other = tmp_path / "o", tmp_path / "other"
    shutil.copytree(tmp_path / "whole", out)
    run_campaign([short().with_overrides(seed=7)], other, threads=1)
    folder, theirs = out / "chunks" / "straight", other / "chunks" / "straight"
    before = [
        # Counts of another chunk; a chunk of other runs with its record; a chunk of another seed with its record.
        [(folder / "counts-00000000-00000001.parquet", folder / "counts-00000002-00000003.parquet")],
        [
            (path, Path(str(path).replace("0-00000001", "2-00000003")))
            for path in folder.glob("*0-00000001.*")
        ],
        [(path, folder / path.name) for path in theirs.glob(f"*{CHUNK}.*")],
    ]
    for pairs, words in zip(
        before, ("has changed", "of other runs than its name", "another config"), strict=True
    ):
        for source, target in pairs:
            shutil.copyfile(source, target)
        with pytest.warns(Note, match=words):
            run_campaign([short()], out, threads=1)
        same_bits(tmp_path / "whole", out)


def state_versions(out: Path, versions: dict[str, str]) -> None:
    """Makes a manifest state other versions."""
    edit_record(out / MANIFEST, lambda manifest: manifest["versions"].update(versions))


def test_other_versions_are_named(tmp_path: Path) -> None:
    """Bits depend on them: the campaign is not continued, and not written over."""
    out = tmp_path / "o"
    run_campaign([short()], out, threads=1)
    before = (out / "runs.parquet").read_bytes()
    held = json.loads((out / MANIFEST).read_bytes())["versions"]
    for name in ("bottomlock", "numpy", "polars", "kernel_build"):
        state_versions(out, {name: "9"})
        with pytest.raises(OutputError, match=r" 9 \(here"):
            run_campaign([short()], out, threads=1)
        state_versions(out, held)
    assert (out / "runs.parquet").read_bytes() == before
    run_campaign([short()], out, threads=1)


def test_a_manifest_that_is_damaged_or_gone(tmp_path: Path) -> None:
    """Damaged, it is named with the remedy; removed, the chunks of this campaign are kept."""
    out = tmp_path / "o"
    run_campaign([short()], out, threads=1)
    before, content = finished(out), (out / MANIFEST).read_bytes()
    (out / MANIFEST).write_bytes(content[:100])
    for force in (False, True):
        with pytest.raises(DataError, match=r"manifest.json.*; remove it, and every chunk that is whole"):
            run_campaign([short()], out, threads=1, force=force)
    (out / MANIFEST).unlink()
    with pytest.raises(OutputError, match="holds no campaign of ours"):
        run_campaign([short().with_overrides(seed=7)], out, threads=1, force=True)
    run_campaign([short()], out, threads=1)
    assert finished(out) == before
    assert json.loads((out / MANIFEST).read_bytes())["digests"] == json.loads(content)["digests"]


def test_what_decides_the_numbers_decides_the_identity() -> None:
    """Name, settings, seed and methods, in their order; not the number of runs, nor words."""
    given = short()
    others = {
        "name": short(name="figure_eight"),
        "settings": given.with_trajectory(duration_s=11.0),
        "seed": given.with_overrides(seed=given.campaign.seed + 1),
        "methods": given.with_overrides(methods=["ins", "lc"]),
        "order": given.with_overrides(methods=["lc", "ins", "tc"]),
    }
    hashes = {
        name: identity_of(build_simulations([one]))["configuration_hash"] for name, one in others.items()
    }
    words = given.model_copy(update={"description": "words"})
    same = [identity_of(build_simulations([one]))["configuration_hash"] for one in (given, short(6), words)]
    assert same[0] == same[1] == same[2]
    assert len({same[0], *hashes.values()}) == 6
