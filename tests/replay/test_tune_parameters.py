"""Which settings of a case can be tuned, where they begin, and the case with other values."""

from pathlib import Path

import pytest

from bottomlock.errors import ScenarioError
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.tune.parameters import noise_of, value_of, with_values
from bottomlock.replay.tune.run import tune_case
from tests.replay import synthetic_dive
from tests.statistical.tune_logs import ACCEL_KEY, BEAM_KEY, dive, write_case

WALK = "imu.errors.accel_bias_walk_mps2_per_rt_s"
SLOW = 'aids = "{aids}"\nyaw_walk_sd_deg = 1.5\n'


@pytest.fixture
def case_path(tmp_path: Path) -> Path:
    """A case with an attitude reference without slow errors."""
    return write_case(tmp_path, dive(1, seconds=20.0))


def keys(path: Path, aids: str = "attitude") -> list[str]:
    """Keys that can be tuned where the reference walks."""
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('aids = "attitude"\n', SLOW.format(aids=aids)), encoding="utf-8")
    case = load_case(path)
    return [one.key for one in noise_of(case, read_streams(case))]


def test_scatter_of_a_reference_needs_its_slow_errors(case_path: Path) -> None:
    """Without a walk or an offset as states the white noise of an attitude is not tuned."""
    case = load_case(case_path)
    assert not any("attitude" in one.key for one in noise_of(case, read_streams(case)))
    assert [key for key in keys(case_path) if "attitude" in key] == [
        "attitude.yaw_sd_deg", "attitude.yaw_walk_sd_deg"
    ]  # fmt: skip


@pytest.mark.parametrize(("aids", "count"), [("heading", 2), ("nothing", 0)])
def test_a_reference_counts_where_it_aids(case_path: Path, aids: str, count: int) -> None:
    """An attitude that aids with nothing has no noise to tune."""
    assert sum("attitude" in key for key in keys(case_path, aids)) == count


def test_what_is_zero_begins_at_an_allan_corner_or_stays(case_path: Path) -> None:
    """A bias walk that is left out begins where it overtakes the noise at 100 s; that of a beam stays zero."""
    case = load_case(case_path)
    found = {one.key: one for one in noise_of(case, read_streams(case))}
    noise = value_of(case, ACCEL_KEY)
    assert noise is not None
    # K √100 = N / √100 in m/s², N from √h to √s.
    assert found[WALK].start * 10.0 == pytest.approx(noise / 60.0 / 10.0)
    assert not found[WALK].is_given
    assert "dvl.errors.beam_bias_walk_mps_per_rt_s" not in found
    # One draw of a constant is in a recording: its sd is not tuned.
    assert not {"imu.errors.accel_bias_mg", "dvl.errors.scale_factor_percent"} & set(found)


def test_a_case_with_other_values(case_path: Path) -> None:
    """The values are in place, the rest and the old case stay."""
    case = load_case(case_path)
    other = with_values(case, {ACCEL_KEY: 0.7, BEAM_KEY: 0.05})
    assert (value_of(other, ACCEL_KEY), value_of(other, BEAM_KEY)) == (0.7, 0.05)
    assert value_of(case, ACCEL_KEY) != 0.7
    gyro = ACCEL_KEY.replace("accel", "gyro").replace("mps", "deg")
    assert value_of(other, gyro) == value_of(case, gyro)


def test_beams_made_from_a_velocity_are_refused(tmp_path: Path) -> None:
    """Four beams of three numbers close exactly: their noise would be estimated as nil."""
    with pytest.raises(ScenarioError) as caught:
        tune_case(synthetic_dive.write(tmp_path))
    assert (caught.value.key, caught.value.expected) == ("dvl.source", '"beams"')
