"""A campaign that stops at a narrow interval: chunks keep the bits of the whole, it resumes, the manifest states it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from bottomlock.campaign import partition, until
from bottomlock.campaign.run import run_campaign
from bottomlock.campaign.until import Until, next_runs, run_until
from bottomlock.errors import ScenarioError
from bottomlock.files.records import read_record
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, same_bits, short

RUNS = 12


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(partition, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)


def _runs(folder: Path) -> int:
    return int(pl.read_parquet(folder / "runs.parquet")["run"].n_unique())


@pytest.fixture
def stopped(tmp_path: Path) -> tuple[Path, Until]:
    """A campaign with a condition that its own first four runs just fulfil, and those of two do not."""
    widths = []
    probe = Until("tc", "velocity_rms", 1.0)
    for runs in (2, 4):
        results = run_campaign([short(runs)], tmp_path / "probe")
        widths.append(probe.half_width_percent(results.ensemble, "straight"))
    assert widths[1] < widths[0]
    condition = Until("tc", "velocity_rms", 0.5 * (widths[0] + widths[1]))
    run_until([short(RUNS)], tmp_path / "o", condition)
    return tmp_path / "o", condition


def test_it_stops_at_the_first_chunk_that_is_narrow_enough(stopped: tuple[Path, Until]) -> None:
    """After four runs of twelve; the manifest says so, and its own digest holds."""
    out, condition = stopped
    assert _runs(out) == 4
    manifest = read_record(out / "manifest.json")
    assert manifest is not None
    assert manifest["status"] == "complete"
    assert manifest["until"]["condition"] == str(condition)
    stated = manifest["until"]["scenarios"]["straight"]
    assert stated["runs_at_most"] == RUNS
    assert stated["reached"] is True
    assert stated["half_width_percent"] < condition.percent


def test_its_chunks_are_those_of_the_whole(stopped: tuple[Path, Until], tmp_path: Path) -> None:
    """Bit for bit; and the whole campaign goes on with them to the same tables."""
    out, _ = stopped
    run_campaign([short(RUNS)], tmp_path / "whole")
    chunks = sorted(out.glob("chunks/straight/*.parquet"))
    assert len(chunks) >= 2 * 3
    for path in chunks:
        assert path.read_bytes() == (tmp_path / "whole" / path.relative_to(out)).read_bytes(), path.name
    before = {path: path.stat().st_mtime_ns for path in chunks}
    run_campaign([short(RUNS)], out)
    same_bits(out, tmp_path / "whole")
    assert {path: path.stat().st_mtime_ns for path in chunks} == before


def test_an_interrupted_one_resumes(
    stopped: tuple[Path, Until], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ended after its first chunk, the same call ends with the same tables, and keeps that chunk."""
    out, condition = stopped
    calls = []

    def interrupted(*arguments: Any, **more: Any) -> Any:  # noqa: ANN401 - as `run_campaign`
        calls.append(arguments)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return run_campaign(*arguments, **more)

    monkeypatch.setattr(until, "run_campaign", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_until([short(RUNS)], tmp_path / "again", condition)
    assert _runs(tmp_path / "again") == 2
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "again").glob("chunks/straight/*.parquet")}
    assert kept
    run_until([short(RUNS)], tmp_path / "again", condition)
    same_bits(tmp_path / "again", out)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept


def test_what_is_never_narrow_ends_with_all_runs(tmp_path: Path) -> None:
    """Stated as not reached; another scenario that is narrow stays at its first chunk."""
    condition = Until("tc", "attitude_rms", 1e-6)
    results = run_until([short(4)], tmp_path / "o", condition)
    assert _runs(tmp_path / "o") == 4
    assert results.manifest["until"]["scenarios"]["straight"]["reached"] is False
    assert (
        json.loads((tmp_path / "o" / "manifest.json").read_text())["until"]["scenarios"]["straight"][
            "reached"
        ]
        is False
    )


@pytest.mark.parametrize(
    "text",
    [
        "tc",
        "tc.velocity_rms",
        "tc.velocity_rms<2",
        "tc.speed<2%",
        "tc.velocity_rms<0%",
        "tc.velocity_rms>2%",
        "",
    ],
)
def test_another_form_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(
        ScenarioError, match=r"expected METHOD.QUANTITY<PERCENT%, such as 'tc.velocity_rms<2%'"
    ):
        Until.parse(text)


def test_a_method_that_does_not_fly_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="'vb', straight is run with ins, lc, tc"):
        run_until([short(4)], tmp_path / "o", Until("vb", "velocity_rms", 2.0))
    assert not (tmp_path / "o").exists()


def test_a_wide_interval_at_most_doubles_the_runs() -> None:
    """Whole chunks, at least one more, never beyond the most."""
    for ratio in (1.0, 1.01, 1.3, 2.0, 50.0, float("inf")):
        wanted = next_runs(600, 300, 2000, ratio)
        assert 900 <= wanted <= 1200
        assert wanted % 300 == 0
    assert next_runs(1800, 300, 2000, 5.0) == 2000
