"""The study of masks on disk: pairs, tables, resumption."""

from collections.abc import Iterable
from pathlib import Path

import polars as pl
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import OutputError, ScenarioError
from bottomlock.pages.numbers import plain
from bottomlock.pages.page import markdown
from bottomlock.statistics import chi_squared
from bottomlock.studies import masks, masks_page, study_folder
from bottomlock.tables.check import check
from bottomlock.tables.studies import MASKS

NUMBERS = [name for name, dtype in MASKS.items() if dtype == pl.Float64()]


def short(runs: int = 2) -> Scenario:
    scenario = load_scenario("straight").with_overrides(runs=runs, methods=["ins", "lc", "tc"])
    return scenario.with_trajectory(duration_s=10.0)


def three_beams() -> Scenario:
    """An instrument of three beams, 120 degrees apart."""
    scenario = short()
    change = {
        "configuration": "angles",
        "tilts_deg": (25.0,) * 3,
        "azimuths_deg": (0.0, 120.0, 240.0),
        "beams_lost": (),
    }
    return scenario.model_copy(update={"dvl": scenario.dvl.model_copy(update=change)})


def test_every_case_has_its_rows(tmp_path: Path) -> None:
    """Fifteen masks, dropouts and slope; the reference and the INS are the same in all, bit for bit: runs are pairs."""
    table = masks.run_masks([short()], tmp_path, threads=1)
    check(pl.read_parquet(tmp_path / "masks.parquet"), MASKS, place="masks")
    assert table["case"].n_unique() == 17
    assert table.height == 17 * 3
    for method in ("ins", "lc"):
        rows = table.filter(pl.col("method") == method).select(NUMBERS)
        assert rows.n_unique() == 1
    assert table.filter(pl.col("method") == "tc").select("velocity_rms_over_runs_mps").n_unique() > 14
    assert table.filter(pl.col("method") == "ins")["rejected_fraction"].null_count() == 17


def row(**change: object) -> dict[str, object]:
    """A row of the table: a value with a narrow interval and a NEES in the middle of its band."""
    found = {
        "trajectory": "straight", "case": "beams_12", "beams": "1,2", "method": "tc", "runs": 50,
        "velocity_rms_over_runs_mps": 0.2, "velocity_rms_over_runs_lo_mps": 0.18, "velocity_rms_over_runs_hi_mps": 0.22,
        "velocity_median_mps": 0.19, "velocity_greatest_share": 0.1, "attitude_rms_over_runs_deg": 1.0,
        "position_rms_over_runs_m": 5.0, "nees_mean_over_runs_and_time": 20.0,
        "nees_velocity_attitude_mean_over_runs_and_time": 6.0, "verdict": "consistent", "rejected_fraction": 0.0,
    }  # fmt: skip
    return found | change


def page(*rows: dict[str, object]) -> str:
    return markdown(masks_page.page(pl.DataFrame(rows, schema=dict(MASKS), orient="row"), None, [], []))


@pytest.mark.parametrize(
    ("low", "high", "cell", "listed"),
    [
        (0.18, 0.22, "0.200", False),
        (0.16, 0.25, "0.200<br>0.160–0.250", False),
        (0.05, 0.31, "0.200 †<br>0.050–0.310", True),
        (0.0, 0.3, "0.200 †<br>0.000–0.300", True),
    ],
)
def test_an_interval_stands_where_its_ends_are_far_apart(
    low: float, high: float, cell: str, *, listed: bool
) -> None:
    """A value that a few runs decide is marked and listed with the median and the share of the worst run."""
    ends = {"velocity_rms_over_runs_lo_mps": low, "velocity_rms_over_runs_hi_mps": high}
    text = page(row(**ends, velocity_greatest_share=0.974))
    assert f"| 1,2 | {cell} |" in text
    line = f"| straight | 1,2 | `tc` | 0.200 | {plain(low)}–{plain(high)} | 0.190 | 97 % |"
    assert (line in text) == ("1 of 1 values rest on a few runs" in text) == listed


@pytest.mark.parametrize(
    ("nees", "verdict", "cell"),
    [
        (6.0, "consistent", "0.200"),
        (6.9, "consistent", "0.200 ▲?"),
        (7.1, "overconfident", "0.200 ▲?"),
        (7.5, "overconfident", "0.200 ▲"),
        (5.0, "conservative", "0.200 ▽?"),
        (4.5, "conservative", "0.200 ▽"),
    ],
)
def test_a_verdict_at_the_edge_says_so(nees: float, verdict: str, cell: str) -> None:
    """The band of 90 % ends at 6.83, that of 99 % at 7.34, and the verdict's own between the two."""
    low, high = (chi_squared.mean_band(6, 50, probability) for probability in (0.90, 0.99))
    assert (round(low[1], 2), round(high[1], 2)) == (6.83, 7.34)
    assert f"| 1,2 | {cell} |" in page(
        row(nees_velocity_attitude_mean_over_runs_and_time=nees, verdict=verdict)
    )


def test_the_share_of_the_worst_run(tmp_path: Path) -> None:
    """By hand from the runs: the greatest square over the sum of all, and the median."""
    table = masks.run_masks([short(runs=5)], tmp_path, wanted=["12"], threads=1)
    runs = pl.read_parquet(tmp_path / "cases" / "beams_12" / "runs.parquet").filter(pl.col("method") == "tc")
    errors = runs["velocity_final_mps"].to_numpy()
    (found,) = table.filter(pl.col("method") == "tc").to_dicts()
    assert found["runs"] == 5
    assert found["velocity_median_mps"] == pytest.approx(sorted(errors)[2])
    assert found["velocity_greatest_share"] == pytest.approx(max(errors) ** 2 / (errors**2).sum())


def test_three_beam_instruments(tmp_path: Path) -> None:
    """Their masks are one and two beams; with all three they are whole."""
    table = masks.run_masks([three_beams()], tmp_path, wanted=["123", "12", "3"], threads=1)
    assert table["beams"].unique(maintain_order=True).to_list() == ["1,2,3", "1,2", "3"]
    assert len(masks.all_cases(three_beams())) == 7 + 2


def test_a_study_resumes(tmp_path: Path) -> None:
    """A study broken off after a case keeps it, and ends in the same table."""
    whole = masks.run_masks([short()], tmp_path / "whole", wanted=["12", "dropouts"], threads=1)

    def stop(_case: str, _progress: object) -> None:
        raise KeyboardInterrupt

    out = tmp_path / "broken"
    with pytest.raises(KeyboardInterrupt):
        masks.run_masks([short()], out, wanted=["12", "dropouts"], threads=1, progress=stop)
    (chunk,) = (out / "cases" / "beams_12" / "chunks" / "straight").glob("samples-*")
    stamp = chunk.stat().st_mtime_ns
    again = masks.run_masks([short()], out, wanted=["12", "dropouts"], threads=1)
    assert chunk.stat().st_mtime_ns == stamp
    assert again.equals(whole, null_equal=True)


def test_wrong_cases_and_instruments(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"unknown case '15' \(known: 1234, 123, "):
        masks.run_masks([short()], tmp_path, wanted=["12", "15"])
    other = three_beams().model_copy(update={"name": "other"})
    with pytest.raises(ScenarioError, match="same number of beams"):
        masks.run_masks([short(), other], tmp_path)


def claim(out: Path, kind: str, configuration: str, *, parts: Iterable[str], force: bool = False) -> None:
    """Claims a directory and lets go of it."""
    with study_folder.claimed(out, kind, configuration, parts=parts, force=force):
        pass


def test_directories_are_claimed_not_taken(tmp_path: Path) -> None:
    """New, empty or the same study; a stranger's files stay, even with force; another configuration needs force."""
    claim(tmp_path / "o", "masks", "a", parts=masks.PARTS)
    (tmp_path / "o" / "masks.parquet").write_bytes(b"old")
    claim(tmp_path / "o", "masks", "a", parts=masks.PARTS)
    assert (tmp_path / "o" / "masks.parquet").exists()
    with pytest.raises(OutputError, match="holds a masks study of another configuration; choose"):
        claim(tmp_path / "o", "masks", "b", parts=masks.PARTS)
    with pytest.raises(OutputError, match="holds no consistency study"):
        claim(tmp_path / "o", "consistency", "a", parts=())
    claim(tmp_path / "o", "masks", "b", parts=masks.PARTS, force=True)
    assert not (tmp_path / "o" / "masks.parquet").exists()
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "thesis.tex").write_text("years of work", encoding="utf-8")
    for force in (False, True):
        with pytest.raises(OutputError, match="holds no masks study of ours"):
            claim(tmp_path / "s", "masks", "a", parts=("thesis.tex",), force=force)
    assert (tmp_path / "s" / "thesis.tex").exists()
