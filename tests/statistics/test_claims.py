"""Verdicts follow from the tables: whoever changes the data changes the verdict."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.files.columns import CLAIMS, PATHS, check
from bottomlock.statistics.claim_verdicts import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED
from bottomlock.statistics.claims import parse_paper
from bottomlock.statistics.rms import Array
from tests.recorded import add_table
from tests.report.synthetic_campaign import METHODS, edit_manifest, write_campaign
from tests.statistics.judged_claims import PAPER, in_dive, judged, one, sized

STRAIGHT = ("straight",)
LAWN_MOWER = ("lawn_mower",)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Every claim on the quiet campaign."""
    return judged(write_campaign(tmp_path_factory.mktemp("plain")))


def test_every_printed_number_is_there() -> None:
    """All numbers of Section 4.2, and no other numbers."""
    assert {one.id: one.printed for one in PAPER.claim if one.kind in {"value", "improvement"}} == {
        "t1-velocity-ins": 34.0, "t1-velocity-nsv": 0.05, "t1-velocity-plcf-improvement": 131.0,
        "t1-attitude-ins": 1.4, "t1-attitude-nsv-improvement": 33.0, "t1-attitude-vb-improvement": 33.0,
        "t2-velocity-ins": 31.8, "t2-velocity-plcf": 1.2, "t2-attitude-ins": 1.26,
        "t2-attitude-plcf-improvement": 26.0, "t3-velocity-ins": 36.5, "t3-velocity-vb": 0.5,
        "t3-attitude-ins": 1.29, "t3-attitude-nsv-improvement": 38.0, "t3-attitude-nsv-over-tc": 12.0,
    }  # fmt: skip


def test_the_table_is_as_the_schema_says(plain: pl.DataFrame) -> None:
    """A row per claim in the paper's order; each interval holds its number."""
    table = check(plain, CLAIMS, place="claims")
    assert table["claim"].to_list() == [claim.id for claim in PAPER.claim]
    tested = table.filter(pl.col("verdict") != NOT_TESTABLE)
    assert tested.height > 25
    assert (tested["lo"] <= tested["ours"] + 1e-9).all()
    assert (tested["ours"] <= tested["hi"] + 1e-9).all()


def test_not_reproduced_has_a_reason(plain: pl.DataFrame) -> None:
    """What is not borne out says what was measured instead."""
    notes = plain.filter(
        (pl.col("verdict") == NOT_REPRODUCED) & ~pl.col("quantity").str.contains("velocity_.*ratio")
    )["note"]
    assert notes.len() > 0
    assert (notes.str.len_chars() > 0).all()


INS, NSV, PLCF = ("straight", "ins"), ("straight", "nsv"), ("straight", "plcf")
JUDGED: list[tuple[str, Any, Any, dict[str, Any], float | None, str]] = [
    # 34 m/s lies in the interval of 34 and not in that of 50.
    ("t1-velocity-ins", {INS: lambda time_s: 34.0 * time_s / 250.0}, {}, {}, 34.0, REPRODUCED),
    ("t1-velocity-ins", {INS: lambda time_s: 50.0 * time_s / 250.0}, {}, {}, 50.0, NOT_REPRODUCED),
    # Without scatter the interval has no width: 33.6 rounds to the printed 34 and 33.4 does not.
    ("t1-velocity-ins", {INS: 33.6}, {}, {"scatter": 0.0}, None, REPRODUCED),
    ("t1-velocity-ins", {INS: 33.4}, {}, {"scatter": 0.0}, None, NOT_REPRODUCED),
    # 131 % cannot be a reduction; it is INS / PLCF - 1.
    ("t1-velocity-plcf-improvement", {PLCF: 34.0 / 2.31}, {}, {}, 131.0, REPRODUCED),
    ("t1-velocity-plcf-improvement", {PLCF: 17.0}, {}, {}, 100.0, NOT_REPRODUCED),
    # Paired runs: the percentage scatters with neither.
    ("t1-attitude-nsv-improvement", {}, {NSV: 1.4 * 0.67}, {"scatter": 0.5}, 33.0, REPRODUCED),
    ("t1-attitude-nsv-improvement", {}, {NSV: 1.4 * 0.8}, {"scatter": 0.5}, 20.0, NOT_REPRODUCED),
    # Below 1 it holds, above it is the other way about, astride the runs cannot tell.
    ("t1-velocity-nsv-better-than-tc", {NSV: 0.05}, {}, {"own_scatter": 0.1}, None, REPRODUCED),
    ("t1-velocity-nsv-better-than-tc", {NSV: 0.2}, {}, {"own_scatter": 0.1}, None, NOT_REPRODUCED),
    ("t1-velocity-nsv-better-than-tc", {NSV: 0.1}, {}, {"own_scatter": 0.3}, None, NOT_TESTABLE),
    # Each method against itself on trajectory 1; PLCF the same as TC within 5 %.
    *(("t2-velocity-better-than-t1", {("figure_eight", one): size for one in METHODS if one != "ins"}, {}, {}, None,
       verdict) for size, verdict in ((0.05, REPRODUCED), (0.2, NOT_REPRODUCED))),
    ("t2-attitude-plcf-as-tc", {}, {("figure_eight", "plcf"): 1.41}, {}, None, REPRODUCED),
    ("t2-attitude-plcf-as-tc", {}, {("figure_eight", "plcf"): 1.6}, {}, None, NOT_REPRODUCED),
]  # fmt: skip
"""Claim, sizes of the errors of velocity and attitude, how they scatter, our number and the verdict."""


@pytest.mark.parametrize(("claim", "velocity", "attitude", "how", "ours", "verdict"), JUDGED)
def test_a_verdict_follows_the_data(
    tmp_path: Path,
    claim: str,
    velocity: dict[tuple[str, str], Any],
    attitude: dict[tuple[str, str], Any],
    how: dict[str, Any],
    ours: float | None,
    verdict: str,
) -> None:
    where: dict[str, Any] = {"trajectories": STRAIGHT} if claim.startswith("t1") else {}
    row = one(write_campaign(tmp_path / "c", sized(velocity, attitude), **where, **how), claim)
    assert row["verdict"] == verdict
    assert ours is None or row["ours"] == pytest.approx(ours)
    assert ("do not separate" in row["note"]) == (verdict == NOT_TESTABLE)
    if "attitude-nsv" in claim:
        assert row["hi"] - row["lo"] < 1e-6


def test_a_value_that_rests_on_a_few_runs_is_not_testable(tmp_path: Path) -> None:
    """One run far off stretches the interval over the printed number: that is no reproduction."""
    size = sized({("straight", "nsv"): 0.1})
    row = one(write_campaign(tmp_path / "c", size, scatter=2.5, trajectories=STRAIGHT), "t1-velocity-nsv")
    assert row["hi"] > 2.0 * row["lo"]
    assert row["verdict"] == NOT_TESTABLE
    assert "one run of 40 makes" in row["note"]


def test_an_ordering_of_many_stands_or_falls_with_its_worst_pair(tmp_path: Path) -> None:
    """One method worse than the INS is enough, and the note names it."""
    size = sized({("figure_eight", "vhv"): 60.0})
    row = one(write_campaign(tmp_path / "c", size), "t2-velocity-all-better-than-ins")
    assert row["verdict"] == NOT_REPRODUCED
    assert row["note"].startswith("worst is vhv / ins")


def _steady(time_s: Array) -> Array:
    return 0.1 + 0.02 * np.maximum(time_s - 30.0, 0.0)


@pytest.mark.parametrize(
    ("curve", "during", "after"),
    [(in_dive, REPRODUCED, REPRODUCED), (_steady, NOT_REPRODUCED, NOT_REPRODUCED)],
)
def test_a_drift_follows_the_data(
    tmp_path: Path, curve: Callable[[Array], Array], during: str, after: str
) -> None:
    """Rising in the dive and level after it, or the other way about."""
    size = sized({("lawn_mower", "vb"): curve})
    folder = write_campaign(tmp_path / "c", size, trajectories=LAWN_MOWER)
    assert one(folder, "t3-velocity-vb-drifts-in-the-dive")["verdict"] == during
    assert one(folder, "t3-velocity-vb-level-after-the-dive")["verdict"] == after


def _in_turns(time_s: Array) -> Array:
    return np.where(np.mod(time_s - 30.0, 60.0) > 40.0, 0.2, 0.1)


@pytest.mark.parametrize(("curve", "verdict"), [(_in_turns, REPRODUCED), (0.1, NOT_REPRODUCED)])
@pytest.mark.parametrize("with_path", [False, True])
def test_turns_come_from_the_timetable_or_from_the_path(
    tmp_path: Path, curve: Callable[[Array], Array] | float, verdict: str, with_path: bool
) -> None:
    """Errors twice as large in the turns oscillate; both sources find the same turns."""
    folder = write_campaign(tmp_path / "c", sized({("lawn_mower", "nsv"): curve}), trajectories=LAWN_MOWER)
    if with_path:
        time_s = np.arange(0.0, 251.0)
        course = np.pi / 20.0 * np.cumsum((np.mod(time_s - 30.0, 60.0) > 40.0) & (time_s > 30.0))
        paths = pl.DataFrame(
            {
                "trajectory": ["lawn_mower"] * time_s.size,
                "time_ns": (time_s * 1e9).astype(np.int64),
                "north_m": np.cumsum(2.0 * np.cos(course)),
                "east_m": np.cumsum(2.0 * np.sin(course)),
                "depth_m": np.minimum(time_s, 30.0),
            }
        )
        add_table(folder, "truth.parquet", check(paths, PATHS, place="truth"))
    row = one(folder, "t3-velocity-nsv-oscillates")
    assert row["verdict"] == verdict
    assert row["ours"] == pytest.approx(2.0 if verdict == REPRODUCED else 1.0, rel=0.1)


def test_the_vehicle_keeps_no_timetable(tmp_path: Path) -> None:
    """On the vehicle the turns are where it swims them, so without its path the claim is not testable."""
    folder = write_campaign(tmp_path / "c", trajectories=LAWN_MOWER)
    edit_manifest(
        folder, lambda m: m["scenarios"]["lawn_mower"]["configuration"]["trajectory"].update(source="vehicle")
    )
    row = one(folder, "t3-velocity-nsv-oscillates")
    assert (row["verdict"], "no truth.parquet" in row["note"]) == (NOT_TESTABLE, True)


def test_what_is_not_in_the_campaign_is_not_testable(tmp_path: Path) -> None:
    """Trajectories and methods that are absent."""
    folder = write_campaign(tmp_path / "c", trajectories=["straight"], methods=["ins", "tc", "nsv"])
    assert one(folder, "t1-velocity-ins")["verdict"] == REPRODUCED
    for claim, note in (
        ("t2-velocity-ins", "the campaign has no trajectory figure_eight"),
        ("t1-velocity-plcf-worst", "the campaign does not run method vb"),
        ("t1-bias-observable", "the campaign does not run method vb"),
        ("t2-bias-observable", "the campaign has no trajectory figure_eight"),
    ):
        row = one(folder, claim)
        assert row["verdict"] == NOT_TESTABLE
        assert note in row["note"]
        assert row["ours"] is None


def leave(folder: Path, trajectory: str, method: str, biases: str, part: float) -> None:
    """Makes the errors of a method's biases, of those that match, a part of the bias itself."""
    runs = pl.read_parquet(folder / "runs.parquet")
    here = (pl.col("trajectory") == trajectory) & (pl.col("method") == method)
    unaided = runs.filter((pl.col("trajectory") == trajectory) & (pl.col("method") == "ins")).sort("run")
    for name in [name for name in runs.columns if re.fullmatch(f"err_{biases}", name)]:
        values = runs[name].to_numpy().copy()
        values[runs.select(here).to_series().to_numpy()] = part * unaided[name].to_numpy()
        runs = runs.with_columns(pl.Series(name, values))
    add_table(folder, "runs.parquet", runs)


def test_a_bias_is_observable_where_its_error_shrinks(tmp_path: Path) -> None:
    """The worst method and bias count: one that leaves all of a bias, or more, upsets the claim and is named."""
    folder = write_campaign(tmp_path / "c", trajectories=STRAIGHT)
    row = one(folder, "t1-bias-observable")
    assert (row["verdict"], row["ours"]) == (REPRODUCED, pytest.approx(0.5))
    leave(folder, "straight", "vb", "accel_bias_z.*", 1.7)
    row = one(folder, "t1-bias-observable")
    assert (row["verdict"], row["ours"]) == (NOT_REPRODUCED, pytest.approx(1.7))
    assert "worst is vb / accel_bias_z_mps2" in row["note"]


def test_a_bias_is_unobservable_where_all_of_it_is_left(tmp_path: Path) -> None:
    """Half of each is left, so none is unobservable; with all of it left each is."""
    folder = write_campaign(tmp_path / "c", trajectories=STRAIGHT)
    row = one(folder, "t1-bias-unobservable")
    assert (row["verdict"], row["ours"]) == (NOT_REPRODUCED, pytest.approx(0.5))
    for method in ("vb", "nsv", "plcf", "vhv", "tc"):
        leave(folder, "straight", method, "(accel_bias_[xy]|gyro_bias_z).*", 0.99)
    assert one(folder, "t1-bias-unobservable")["verdict"] == REPRODUCED


def test_manoeuvres_show_more_where_less_is_left(tmp_path: Path) -> None:
    """By hand: a fifth of each against a half; then one bias of six left whole, √((5·0.2² + 1)/6) against a half."""
    folder = write_campaign(tmp_path / "c")
    row = one(folder, "t2-bias-observable")
    assert (row["verdict"], row["ours"]) == (REPRODUCED, pytest.approx(0.4))
    leave(folder, "figure_eight", "plcf", "gyro_bias_z.*", 1.0)
    row = one(folder, "t2-bias-observable")
    assert (row["verdict"], row["ours"]) == (REPRODUCED, pytest.approx(np.sqrt(1.2 / 6.0) / 0.5))
    leave(folder, "figure_eight", "plcf", "gyro_bias_.*", 2.0)
    assert one(folder, "t2-bias-observable")["verdict"] == NOT_REPRODUCED


def test_another_setup_is_not_the_papers(tmp_path: Path) -> None:
    """Half the beam noise makes other numbers: no claim on that trajectory is judged."""
    folder = write_campaign(tmp_path / "c")
    edit_manifest(
        folder, lambda m: m["scenarios"]["straight"]["configuration"]["dvl"].update(beam_noise_mps=0.021)
    )
    table = judged(folder).filter(pl.col("trajectory") == "straight")
    assert table["verdict"].unique().to_list() == [NOT_TESTABLE]
    assert "dvl.beam_noise_mps is 0.021 here and 0.042 in the paper" in table["note"][0]


def test_few_runs_are_not_an_interval(tmp_path: Path) -> None:
    table = judged(write_campaign(tmp_path / "c", runs=9))
    assert table["verdict"].unique().to_list() == [NOT_TESTABLE]
    assert table["note"][0].startswith("9 runs give no useful interval")


def test_the_packaged_scenarios_are_the_papers_setup(plain: pl.DataFrame) -> None:
    """The keys under [setup] exist and agree; otherwise everything would be not testable without a sound."""
    assert plain.filter(pl.col("note").str.contains("in the paper"))["claim"].to_list() == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('id = "t1-velocity-nsv"', 'id = "t1-velocity-ins"', "two claims have the id 't1-velocity-ins'"),
        ("\nlevel = ", "\nflat = ", "rule 'level' has no words"),
        ("window_s = [125.0, 250.0]\n", "", "pattern 'level' needs window_s"),
        ('"gyro_bias_x_radps", "gyro', '"gyro_bias_x", "gyro', "unknown bias 'gyro_bias_x'"),
        ('pattern = "more"\nthan_trajectory = "straight"\n', 'pattern = "more"\n', "needs than_trajectory"),
    ],
)
def test_a_claims_file_that_contradicts_itself(root: Path, old: str, new: str, message: str) -> None:
    text = (root / "python" / "bottomlock" / "statistics" / "claims.toml").read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(DataError, match=message):
        parse_paper(text.replace(old, new, 1), place="claims.toml")
