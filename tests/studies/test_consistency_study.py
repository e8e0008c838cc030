"""The consistency study's arithmetic and words, from means set by hand."""

from pathlib import Path

import polars as pl
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.errors import DataError, ScenarioError
from bottomlock.pages.page import markdown
from bottomlock.statistics import chi_squared
from bottomlock.studies import consistency
from bottomlock.studies.consistency_page import page
from bottomlock.studies.consistency_table import decisive, methods_summary
from bottomlock.studies.expected_verdicts import departures, read_expectations
from bottomlock.tables.studies import CONSISTENCY_CELL

RUNS = 100


def means(**velocity_attitude: tuple[float, float]) -> pl.DataFrame:
    """Two times of one cell per method; the whole state and NIS at their expectations."""
    rows: list[tuple[object, ...]] = []
    for method, values in velocity_attitude.items():
        place = ("straight", "1,2", method)
        for time_s, value in zip((125.0, 250.0), values, strict=True):
            rows.append((*place, "nees_velocity_attitude", time_s, 6.0, RUNS, RUNS, value))
            rows.append((*place, "nees", time_s, 20.0, RUNS, RUNS, 20.0))
        rows.append((*place, "nis", None, 2.0, RUNS, RUNS * 250, 2.0))
    return pl.DataFrame(rows, schema=dict(CONSISTENCY_CELL), orient="row")


def expect(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "expected.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_bands_count_every_mean() -> None:
    """Three methods, two times of two quantities and one NIS: 15 means, so each band holds 1 − 0.01/15."""
    table = consistency.judge(means(tc=(6.0, 6.1), vb=(5.9, 9.0), nsv=(6.0, 3.0)))
    low, high = chi_squared.mean_band(6, RUNS, 1 - 0.01 / 15)
    rows = {
        row["method"]: row for row in table.filter(pl.col("quantity") == "nees_velocity_attitude").to_dicts()
    }
    assert (rows["tc"]["band_lo"], rows["tc"]["band_hi"]) == pytest.approx((low, high))
    assert [rows[method]["verdict"] for method in ("tc", "vb", "nsv")] == [
        "consistent",
        "overconfident",
        "conservative",
    ]
    assert [decisive(rows[method]) for method in ("tc", "vb", "nsv")] == [6.05, 9.0, 3.0]
    (nis,) = table.filter(pl.col("method") == "tc", pl.col("quantity") == "nis").to_dicts()
    assert (nis["band_lo"], nis["band_hi"]) == pytest.approx(
        chi_squared.mean_band(2, RUNS * 250, 1 - 0.01 / 15)
    )


def test_consistent_is_not_overconfident_and_consistent_in_velocity_and_attitude() -> None:
    """Caution in NIS does not count against a method, overconfidence anywhere does."""
    table = means(tc=(6.0, 6.1), weak_sway=(6.0, 6.0), info=(6.0, 6.0))
    nis = (pl.col("method") == "weak_sway") & (pl.col("quantity") == "nis")
    whole = (pl.col("method") == "info") & (pl.col("quantity") == "nees")
    table = table.with_columns(pl.when(nis).then(1.0).when(whole).then(30.0).otherwise("mean").alias("mean"))
    rows = {row["method"]: row for row in methods_summary(consistency.judge(table)).to_dicts()}
    assert [rows[method]["consistent"] for method in ("tc", "weak_sway", "info")] == [1, 1, 0]
    assert rows["weak_sway"]["nis_conservative"] == 1
    assert rows["info"]["nees_overconfident"] == 1


def test_the_text_says_what_was_run_and_found() -> None:
    """Seed, versions, band, false-alarm rate, verdicts and limits: whoever reads it needs nothing else."""
    found = means(tc=(6.0, 6.1), vb=(5.9, 9.0))
    facts = {
        "trajectories": ["straight"], "methods": ["tc", "vb"], "beams": ["1,2"], "seed": 7,
        "versions": {"bottomlock": "0.1.0"}, "configuration_hash": "f" * 64, "command": "bottomlock consistency",
        "degrees": 20, "times_s": ["125", "250"], "tests": 10, "each_probability": 0.999, "false_alarm": 0.01,
        "settings": ["Further sensors: none."], "limits": ["The water is still."],
    }  # fmt: skip
    text = markdown(page(consistency.judge(found), facts))
    for words in (
        "100 runs of each cell, seed 7", "bottomlock 0.1.0", "at most 1 %", "99.90000 %", "9.0 ▲",
        "- `tc`: straight: everywhere.", "- `vb`: straight: nowhere.", "## Limits\n\n- The water is still.\n",
        "- Further sensors: none.\n",
    ):  # fmt: skip
        assert words in text
    assert "{" not in text
    # NIS is shown over its number of rows, large ones too.
    nis = (pl.col("method") == "vb") & (pl.col("quantity") == "nis")
    large = consistency.judge(found.with_columns(pl.when(nis).then(500.0).otherwise("mean").alias("mean")))
    assert "| 1,2 | 1.000 | 250 ▲ |" in markdown(page(large, facts))
    assert "\n\n\n" not in text


def test_departures_name_the_cell(tmp_path: Path) -> None:
    table = consistency.judge(means(tc=(6.0, 9.0), vb=(5.9, 9.0)))
    wanted = read_expectations(
        expect(
            tmp_path,
            '[[expect]]\nmethods = ["tc"]\nverdict = "consistent"\n'
            '[[expect]]\nmethods = ["vb"]\nverdict = "overconfident"\n',
        )
    )
    (line,) = departures(table, wanted)
    assert line.startswith(
        "straight, beams 1,2, tc, nees_velocity_attitude: overconfident (6.00 to 9.00, band "
    )
    assert line.endswith("expected consistent")
    milder = expect(tmp_path, '[[expect]]\nmethods = ["tc"]\nverdict = "not overconfident"\n')
    assert len(departures(table, read_expectations(milder))) == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            '[[expect]]\nmethods = ["tcc"]\nverdict = "consistent"\n',
            "method 'tcc' is not in the consistency study",
        ),
        ('[[expect]]\nmethods = ["tc"]\nbeams = ["12"]\nverdict = "consistent"\n', "beams '12' is not in"),
        ('[[expect]]\nmethods = ["tc"]\nverdict = "fine"\n', "verdict"),
        ('[[expect]]\nmethod = ["tc"]\nverdict = "consistent"\n', "method"),
        ("expect = []\n", "expects nothing"),
        ("expect = [", "not valid TOML"),
    ],
)
def test_wrong_expectations(text: str, words: str, tmp_path: Path) -> None:
    """An expectation that meets no cell would pass unseen, so it is a fault."""
    table = consistency.judge(means(tc=(6.0, 6.0)))
    with pytest.raises(DataError, match=words):
        departures(table, read_expectations(expect(tmp_path, text)))


def test_a_small_matrix_resumes(tmp_path: Path) -> None:
    """Cells are kept; `ins` stands once, without NIS; the text names its command."""
    scenario = (
        load_scenario("straight")
        .with_trajectory(duration_s=10.0)
        .with_overrides(runs=3, methods=["ins", "tc"])
    )
    masks = consistency.parse_masks("1234,1", 4)
    table = consistency.run_consistency([scenario], masks, tmp_path, command="again", threads=1)
    assert table.height == 2 + 3 + 3
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "cells").iterdir()}
    assert sorted(path.name for path in stamps) == [
        f"straight-beams_{beams}.{ending}" for beams in ("1", "1234") for ending in ("parquet", "record.json")
    ]
    assert consistency.run_consistency([scenario], masks, tmp_path, threads=1).equals(table)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "cells").iterdir()} == stamps
    for text in ("15", "21", ",", "1 2"):
        with pytest.raises(ScenarioError):
            consistency.parse_masks(text, 4)
