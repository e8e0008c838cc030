"""Variants: the values of a command line, folders, refusals before anything runs, pairing, resuming."""

from pathlib import Path
from typing import Any

import polars as pl
import pytest

from bottomlock.campaign.run import CampaignProgress
from bottomlock.campaign.variants import make_variants, parse_set, run_variants
from bottomlock.errors import DataError, OutputError, ScenarioError
from bottomlock.files.campaign_tables import campaign_folders
from bottomlock.report.compare import compare
from tests.campaign.small_campaign import same_bits, short

GYRO = "imu.gyro_bias_deg_per_h"


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=0.01,3,5e1", [0.01, 3, 50.0]),
        ("a.b = 1 , 2", [1, 2]),
        ("a.b=[[1.0, 0.0], [2.0, 0.5]],[[0.0, 1.0]]", [[[1.0, 0.0], [2.0, 0.5]], [[0.0, 1.0]]]),
        ("a.b=true,false", [True, False]),
        ("a.b=joint,'off'", ["joint", "off"]),
        ("a.b=inf", [float("inf")]),
        ("a.b=[{ beams = [1, 2], to_s = 1.0 }],[]", [[{"beams": [1, 2], "to_s": 1.0}], []]),
    ],
)  # fmt: skip
def test_values_are_those_of_toml(text: str, values: list[Any]) -> None:
    """Commas in brackets belong to a value; a bare word is a text."""
    assert parse_set(text)[1] == values


@pytest.mark.parametrize("text", ["a.b", "a.b=", "=3", "a.b=1,,2"])
def test_a_text_without_key_or_value_is_refused(text: str) -> None:
    """With an example."""
    with pytest.raises(ScenarioError, match="expected a key and its values, such as --set imu"):
        parse_set(text)


def test_variants_are_the_product_and_keep_name_and_seed() -> None:
    """In the order of the values; whatever is not set is that of the scenario."""
    base = short()
    made = make_variants([base], {GYRO: [0.01, 50.0], "dvl.tilt_deg": [20.0, 30.0]})
    assert [variant.folder for variant in made] == [
        "gyro_bias_deg_per_h=0.01,tilt_deg=20",
        "gyro_bias_deg_per_h=0.01,tilt_deg=30",
        "gyro_bias_deg_per_h=50,tilt_deg=20",
        "gyro_bias_deg_per_h=50,tilt_deg=30",
    ]
    last = made[-1].scenarios[0]
    assert (last.imu.gyro_bias_deg_per_h, last.dvl.tilt_deg) == (50.0, 30.0)
    assert (last.name, last.campaign) == (base.name, base.campaign)
    assert last.replace({GYRO: 3.0, "dvl.tilt_deg": 20.0}).content_hash() == base.content_hash()
    assert sum(variant.runs for variant in made) == 20


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        ({GYRO: [1.0, 1.0]}, "the value 1.0 is given twice"),
        ({"name": ["a", "b"]}, "it is no setting"),
        ({GYRO: [float(k) for k in range(201)]}, "201 variants are asked for, expected 200 at most"),
    ],
)
def test_a_bad_key_or_value_is_refused(sets: dict[str, list[Any]], message: str) -> None:
    """Before anything runs, with the nearest key."""
    with pytest.raises(ScenarioError, match=message):
        make_variants([short()], sets)


def test_nothing_runs_where_one_variant_cannot(tmp_path: Path) -> None:
    """Of a vehicle that is not there, and of a folder that holds something else, no folder is left behind."""
    variants = make_variants([short()], {"trajectory.vehicle": ["tauv", "tauvv"]})
    with pytest.raises(ScenarioError, match="vehicle 'tauvv'"):
        run_variants(variants, tmp_path / "a")
    assert not (tmp_path / "a").exists()
    variants = make_variants([short()], {GYRO: [1.0, 2.0]})
    foreign = tmp_path / "b" / variants[1].folder / "mine.txt"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("mine")
    with pytest.raises(OutputError, match="is not empty and holds no variants"):
        run_variants(variants, tmp_path / "b")
    assert foreign.read_text() == "mine"


def test_variants_run_resume_and_are_paired(tmp_path: Path) -> None:
    """A repeat and another value keep what is there; what a setting does not touch is the same run by run."""
    out = tmp_path / "v"
    calls: list[CampaignProgress] = []
    two = make_variants([short(runs=3)], {GYRO: [0.01, 50.0]})
    first = run_variants(two, out, progress=calls.append)
    assert {call.trajectory for call in calls} == {"1/2 straight", "2/2 straight"}
    again = run_variants(make_variants([short(runs=3)], {GYRO: [50.0, 7.0]}), out)
    assert list(campaign_folders([out])) == [f"gyro_bias_deg_per_h={value}" for value in ("0.01", "50", "7")]
    assert again[0].runs.equals(first[1].runs)
    one = run_variants(make_variants([short(runs=3)], {GYRO: [50.0]}), tmp_path / "alone")
    assert one[0].runs.equals(first[1].runs)
    same_bits(tmp_path / "alone" / "gyro_bias_deg_per_h=50", out / "gyro_bias_deg_per_h=50")
    made = compare([out], out, against="gyro_bias_deg_per_h=50")
    assert not made.unpaired
    rows = made.table.filter(made.table["difference"].is_not_null())
    assert rows["paired"].all()
    # The accelerometers' errors are the same, and they are most of it: of independent runs the interval of the
    # difference is wider than that of either error.
    ins = rows.filter((pl.col("method") == "ins") & (pl.col("quantity") == "velocity at the end"))
    widths = [
        ins[high].to_numpy() - ins[low].to_numpy()
        for low, high in (("difference_lo", "difference_hi"), ("lo", "hi"))
    ]
    assert (widths[0] < 0.5 * widths[1]).all()


def test_folders_that_are_no_campaigns_are_named(tmp_path: Path) -> None:
    """A missing directory, one campaign alone, one named twice."""
    with pytest.raises(DataError, match="no such directory"):
        campaign_folders([tmp_path / "none"])
    (tmp_path / "a").mkdir()
    with pytest.raises(DataError, match="is named twice"):
        campaign_folders([tmp_path / "a", tmp_path / "a"])
    with pytest.raises(DataError, match="1 campaign is named, expected two or more"):
        compare([tmp_path / "a"], tmp_path / "out")
