"""A mistake put into a case: the first cause that the replay names is that mistake, and a right case has none."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.replay.case import load_case
from bottomlock.replay.findings.motion_findings import TEMPLATES
from bottomlock.replay.run import replay_case
from tests.dive import drawn_dive
from tests.dive_logs import write_case
from tests.replay.mistaken_case import DEGREES, MISTAKES, mistaken, table

SEEDS = (11, pytest.param(12, marks=pytest.mark.long), pytest.param(13, marks=pytest.mark.long))


@pytest.mark.first_cases(4)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", list(MISTAKES))
def test_the_first_cause_is_the_mistake(name: str, seed: int, tmp_path: Path) -> None:
    replayed = replay_case(mistaken(drawn_dive(seed), tmp_path, name))
    manifest = replayed.manifest
    findings = manifest["findings"]
    _, kind, key = MISTAKES[name]
    assert findings[0]["kind"] == kind
    assert findings[0]["severity"] in {"fault", "warning"}
    assert key in findings[0]["key"]
    verdict = manifest["answer"]["verdict"]
    assert verdict in {"no", "partly"}
    if verdict == "partly":
        # A mistake is a doubt where the track that is named is right: the reference is the truth.
        (track,) = replayed.samples.filter(
            (pl.col("pass") == "forward") & (pl.col("method") == manifest["answer"]["method"])
        )[-1].iter_rows(named=True)
        error, sd = (
            np.hypot(track[f"{of}_north_m"], track[f"{of}_east_m"]) for of in ("err_position", "sd_position")
        )
        assert error < 2.5 * sd
    assert manifest["answer"]["sentence"] == findings[0]["text"]
    assert manifest["answer"]["change"] == findings[0]["hint"]


def test_gyros_beyond_their_range_name_the_unit(tmp_path: Path) -> None:
    """Readings in deg/s taken for rad/s are beyond any gyro: the error of the log says which key is wrong."""
    path = write_case(drawn_dive(11), tmp_path)
    table("imu", **DEGREES)(tmp_path)
    with pytest.raises(DataError, match=r'Set imu.omega_unit = "deg/s" \(now "rad/s"\)'):
        replay_case(load_case(path))


@pytest.mark.parametrize("seed", [21, 22, pytest.param(23, marks=pytest.mark.long)])
def test_a_right_case_has_no_cause(seed: int, tmp_path: Path) -> None:
    replayed = replay_case(load_case(write_case(drawn_dive(seed), tmp_path)))
    assert replayed.manifest["findings"] == []
    assert any("Closure" in line for line in replayed.manifest["answers"])
    answer = replayed.manifest["answer"]
    assert (answer["verdict"], answer["method"]) == ("yes", "tc")
    assert "NIS" in answer["numbers"][0]
    assert "dead reckoning" in answer["numbers"][1]


@pytest.mark.parametrize("stuck", [False, True])
def test_a_dive_that_hardly_sinks_and_a_depth_that_stands_still(tmp_path: Path, stuck: bool) -> None:
    """Noisy beams, and 0.1 m sunk in a segment: a right depth follows, a stuck one does not, whatever way was gone."""
    dive = drawn_dive(31, lively=0.1, beam_sd=0.03)
    path = write_case(dive, tmp_path)
    path.write_text(
        path.read_text().replace("beam_noise_mps = 0.008", "beam_noise_mps = 0.03"), encoding="utf-8"
    )
    if stuck:
        noise = pl.Series(0.02 * np.random.default_rng(1).normal(size=len(dive.slow_s)))
        table("depth", depth_m=pl.lit(3.0 + noise))(tmp_path)
    kinds = {one["kind"] for one in replay_case(load_case(path)).manifest["findings"]}
    assert kinds & {"depth_scale", "depth_sign", "depth_drift"} == ({"depth_scale"} if stuck else set())


PAIRS = (
    ("DVL clock 0.3 s", "mounting yaw 3 deg"),
    ("gyro z reversed", "DVL clock 0.3 s"),
    ("sound speed 2.5 %", "gyro z reversed"),
    ("mounting yaw 3 deg", "tenfold gyro bias"),
    ("DVL turned by 90 deg", "gyro z reversed"),
    ("IMU axis reversed", "gyro x reversed"),
    ("gyro z reversed", "beams reversed"),
)


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("pair", PAIRS)
def test_of_two_mistakes_none_is_named_that_is_not_there(pair: tuple[str, str], tmp_path: Path) -> None:
    """Causes of the motion are mistakes that were made, or there is none that explains it."""
    dive = drawn_dive(11)
    for name in pair:
        mistaken(dive, tmp_path, name) if name == pair[0] else MISTAKES[name][0](tmp_path)
    kinds = [one["kind"] for one in replay_case(load_case(tmp_path / "case.toml")).manifest["findings"]]
    made = {MISTAKES[name][1] for name in pair}
    motion = {template.kind for template in TEMPLATES.values()} | {"unexplained"}
    assert motion & set(kinds) <= made | {"unexplained"}, kinds
    assert motion & set(kinds)
