"""A share of `tools.first_line`: the answers that a navigator is given first, beside the truth."""

import re
from pathlib import Path
from typing import Any

import pytest

from bottomlock.replay.case import load_case
from bottomlock.replay.init.make import make_case
from bottomlock.replay.run import replay_case
from tests import dive as dives
from tests.dive_logs import write
from tools.first_line import is_right, run
from tools.first_line_rows import rows

DOUBTFUL = {
    "case: 07 depth jumps", "case: 07 depth drifts, gps", "case: 07 depth drifts, no IMU",
    "case: 22 clock set after 40 s", "mistake: beams 1 and 2 dead, gps",
}  # fmt: skip
"""Nothing tells which part is right; a part of the dive, or two beams, are missing."""
ROWS = {row.name: row for row in rows()}


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("right: velocity, dive 3", "partly"),
        ("right: velocity, gps, dive 4", "yes"),
        ("right: beams of json, gps", "yes"),
        # Units and clocks: tests/replay/test_first_case.py.
        pytest.param("mistake: deg/s named rad/s", "partly", marks=pytest.mark.long),
        pytest.param("mistake: DVL clock 1.5 s late", "partly", marks=pytest.mark.long),
        ("case: 04 zeros when lost", "partly"),
        pytest.param("case: 05 code -32.768", "partly", marks=pytest.mark.long),
        ("mistake: gyro z reversed", "no"),
        ("mistake: DVL turned by 30 deg", "partly"),
        pytest.param("case: 29 DVL looks forward", "partly", marks=pytest.mark.long),
        ("mistake: beams 2 and 3 exchanged", "no"),
        ("mistake: pressure named depth", "no"),
        ("mistake: velocities in feet a second", "no"),
        ("mistake: velocity forward, left, down", "partly"),
        ("right: q0 to q3, scalar last", "partly"),
        ("right: q1 to q4, scalar first", "partly"),
        ("mistake: beam 1 dead, table", "partly"),
        ("mistake: beams 1 and 2 dead, gps", "partly"),
        ("case: 07 depth drifts, gps", "partly"),
        ("case: 07 depth drifts, no IMU", "partly"),
        ("mistake: velocity forward, left, down, gps", "yes"),
        ("case: 07 frozen depth", "partly"),
        ("case: 08 compass jumps", "partly"),
        ("case: 22 clock set after 40 s", "partly"),
        pytest.param("case: 07 depth jumps", "partly", marks=pytest.mark.long),
        pytest.param("case: 01 one table with blanks", "partly", marks=pytest.mark.long),
        pytest.param("case: 01 one table with blanks, beams", "partly", marks=pytest.mark.long),
        pytest.param("case: 17 True and False", "partly", marks=pytest.mark.long),
        pytest.param("case: 23 topics as columns", "partly", marks=pytest.mark.long),
    ],
)
def test_answers(name: str, verdict: str) -> None:
    """Right logs are trusted, units, clocks and codes put right, and what cannot be put right is called wrong."""
    found = run(ROWS[name], smooth=False)
    assert (found["verdict"], found["outcome"]) == (verdict, "right")
    if verdict != "no" and name not in DOUBTFUL:
        assert is_right(found, found["reckoned_rms_m"], 0.0)
    # A declination that is added to a true heading leaves 1 m and more.
    assert "gps" not in name or name in DOUBTFUL or found["rms_m"] < 0.5


@pytest.mark.parametrize("words", ["imu waterlinked-json depth ahrs gps", "imu velocity depth ahrs gps"])
@pytest.mark.parametrize("fault", ["nothing", "DVL begins 60 s late"])
def test_a_third_of_the_dive_without_aiding_is_no_yes(words: str, fault: str, tmp_path: Path) -> None:
    """A track that begins with the dive is trusted where pings cover 85 % of it, and "partly" where they do not."""
    dive = dives.drawn_dive(3, seconds=180.0, imu_hz=25.0, geometry="waterlinked_a50")
    files = write(dives.FAULTS[fault](dives.tables(dive)), tmp_path, words)
    text = make_case(files, tmp_path / "case.toml").case.read_text(encoding="utf-8")
    text = re.sub(r"at_s = [\d.]+", "at_s = 0.5", text)
    text = text.replace('velocity = "beams"', "velocity_mps = [1.0, 0.0, 0.0]")
    text = text.replace("velocity_sd_mps = [0.1, 0.1, 0.1]", "velocity_sd_mps = [1.0, 0.5, 0.5]")
    (tmp_path / "early.toml").write_text(text, encoding="utf-8")
    for name in ("case.toml", "early.toml"):
        case = load_case(tmp_path / name)
        settings = case.replay.model_copy(update={"smooth": False})
        manifest = replay_case(case.model_copy(update={"replay": settings})).manifest
        told = [one for one in manifest["findings"] if one["kind"] == "beyond_track"]
        assert (manifest["answer"]["verdict"], bool(told)) == (
            ("yes", False) if fault == "nothing" else ("partly", True)
        )
        assert not told or told[0]["score"] == pytest.approx(1.0 / 3.0, abs=0.03)


@pytest.mark.parametrize("name", ["case: 02 a column of intervals", "case: 15 stamps of 0"])
def test_times_that_are_none_are_refused(name: str) -> None:
    """Neither a traceback nor a case of one ping: the refusal says that the times do not rise."""
    found = run(ROWS[name])
    assert (found["verdict"], found["outcome"]) == ("refused", "right")
    assert "clock of the DVL has a time that rises in" in found["said"]


def test_rows_are_all_there() -> None:
    """Names are unique; every kind of `shared/cases`, 18 mistakes and more; each fault can be put into a dive."""
    assert len(ROWS) == len(rows())
    cases = {name.split()[1] for name in ROWS if name.startswith("case: ")}
    kinds = (1, 2, 4, 5, 6, 7, 8, 9, 10, 13, 14, 15, 16, 17, 18, 20, 22, 23, 29)
    assert cases == {f"{kind:02d}" for kind in kinds}
    assert sum(row.kind == "mistake" for row in ROWS.values()) >= 18
    held = dives.tables(dives.drawn_dive(1, seconds=20.0))
    for spoil in dives.FAULTS.values():
        assert spoil(held)["imu"].height


@pytest.mark.parametrize(
    ("change", "right"),
    [
        ({}, True),
        ({"error_m": 2.6}, False),
        ({"rms_m": 1.3}, False),
        ({"rms_m": 1.3, "distance_m": 300.0}, True),
        ({"sd_m": 101.0}, False),
        ({"down_m": -1.0}, False),
        ({"covered": 0.8}, False),
    ],
)
def test_the_rule(change: dict[str, Any], right: bool) -> None:
    """A track of 100 m with 1 m of sigma, beside a dead reckoning of 1 m RMS."""
    errors = {
        "error_m": 2.4, "rms_m": 1.2, "sd_m": 1.0, "distance_m": 100.0, "down_m": 0.1, "down_sd_m": 0.1, "covered": 1.0,
    }  # fmt: skip
    assert is_right(errors | change, 1.0, 0.0) == right


def test_without_dead_reckoning() -> None:
    """The distance alone allows an RMS error."""
    errors = {"error_m": 1.0, "rms_m": 0.6, "sd_m": 1.0, "distance_m": 100.0, "down_m": None, "covered": 1.0}
    assert not is_right(errors, None, 0.0)
    assert is_right(errors | {"rms_m": 0.4}, None, 0.0)
