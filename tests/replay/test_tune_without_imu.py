"""`bottomlock tune` of a vehicle without inertial readings: no outage may know the pings that it withholds."""

from pathlib import Path

import numpy as np

from bottomlock.replay.case import load_case
from bottomlock.replay.tune.passes import Recording, horizons_of
from bottomlock.replay.tune.run import tune_case
from tests.statistical.tune_logs import ACCEL_KEY, BEAM_KEY, dive, write_case


def without_imu(folder: Path, seconds: float) -> Path:
    """The case of a simulated dive whose attitudes alone were recorded."""
    path = write_case(folder, dive(7, seconds=seconds, attitude_hz=10.0))
    text = path.read_text(encoding="utf-8")
    start, end = text.index("[imu]"), text.index("[dvl]")
    text = text[:start] + '[imu]\nsource = "attitude"\n\n' + text[end:]
    path.write_text(text.replace('aids = "attitude"', 'aids = "nothing"'), encoding="utf-8")
    return path


def test_withheld_pings_are_in_no_reading(tmp_path: Path) -> None:
    """A velocity that is withheld may be anything: the readings made for the pass with outages stay the same."""
    recording = Recording.read(load_case(without_imu(tmp_path, 200.0)))
    one = recording.passes(horizons_of(200.0))[1]
    used = one.log["dvl_time_ns"][~one.log["dvl_withheld"]]
    beams, pings = recording.prepared.streams.beams, recording.prepared.pings
    lost = ~np.isin(beams.time_ns[pings], used)
    assert lost.sum() > 50
    beams.velocity_mps[pings][lost] += 5.0
    again = recording.passes(horizons_of(200.0))[:2]
    np.testing.assert_array_equal(one.log["force_p_mps2"], again[1].log["force_p_mps2"])
    assert not np.array_equal(one.log["force_p_mps2"], again[0].log["force_p_mps2"])


def test_turns_and_beams_are_tuned(tmp_path: Path) -> None:
    """Accelerations are the prior of the motion, which the pings show, and no bias is there."""
    tuned = tune_case(without_imu(tmp_path, 500.0))
    keys = [one.key for one in tuned.parameters]
    assert keys[:2] == [ACCEL_KEY.replace("accel", "gyro").replace("mps", "deg"), BEAM_KEY]
    assert not any("bias_walk" in key for key in keys if key.startswith("imu."))
    assert tuned.parameters[0].old > 0.1
    outages = [term for term in tuned.terms if term["horizon_s"] > 0.0 and term["values"] == "new"]
    assert outages
    assert all(0.4 < term["error_over_sd"] < 2.0 for term in outages)
