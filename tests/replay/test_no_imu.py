"""Dives of vehicles without inertial readings: attitude, DVL and depth alone, simulated and recorded."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.files.replay_tables import RECORDED, ReplayTables
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.replay import rerun
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.init.make import make_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.run import replay_case
from tests.dive import Dive, drawn_dive
from tests.dive_logs import beam_table, write_csv
from tests.replay.test_water_track import CASE as WITH_IMU
from tests.replay.undiagnosed import replay_undiagnosed, unsmoothed
from tests.toml_text import toml

CASE = toml({
    "": {"name": "no_imu"},
    "origin": {"latitude_deg": 45.0},
    "imu": {"source": "attitude"},
    "dvl": {"file": "beams.csv", "geometry": "waterlinked_a50", "clock": {"column": "time_ns", "unit": "ns"}},
    "dvl.errors": {"beam_bias_mps": 0.0, "scale_factor_percent": 0.0},
    "depth": {"file": "depth.csv", "clock": {"column": "time"}, "column": "depth", "sd_m": 0.02},
    "attitude": {
        "file": "ahrs.csv", "clock": {"column": "time"}, "roll": "roll", "pitch": "pitch", "yaw": "yaw",
        "roll_pitch_sd_deg": 0.3, "yaw_sd_deg": 0.5,
    },
})  # fmt: skip
CASE += WITH_IMU[WITH_IMU.index("[reference]") : WITH_IMU.index("[start]")]
CASE += toml({
    "start": {
        "at_s": 1.0, "level": "attitude", "heading": "attitude", "velocity": "beams", "position": "reference",
        "position_sd_m": [0.05] * 3,
    },
    "replay": {"methods": ["lc", "tc", "weak_sway", "sway_current"], "smooth": False},
})  # fmt: skip
WHAT_IFS = """
[[what_if]]
name = "lost_4"
beams_lost = [4]
[[what_if]]
name = "lost_34"
outages = [{ beams = [3, 4], from_s = 60.0, to_s = 120.0 }]
[[what_if]]
name = "outage"
outages = [{ beams = [1, 2, 3, 4], from_s = 60.0, to_s = 120.0 }]
"""


def write(dive: Dive, folder: Path, extra: str = "", attitude_hz: float = 10.0) -> Path:
    """The tables of a dive without those of the IMU; its attitude has an offset of 0.3 deg in yaw."""
    every = round((len(dive.imu_s) - 1) / dive.imu_s[-1] / attitude_hz)
    t, rpy = dive.imu_s[::every], dive.rpy[::every]
    write_csv(
        folder / "ahrs.csv",
        {"time": t, "roll": rpy[:, 0], "pitch": rpy[:, 1], "yaw": rpy[:, 2] + np.deg2rad(0.3)},
    )
    write_csv(folder / "depth.csv", {"time": t, "depth": dive.position[::every, 2]})
    columns = dict(zip(("north", "east", "down"), dive.position[::every].T, strict=True))
    columns |= dict(zip(("u", "v", "w"), dive.velocity[::every].T, strict=True))
    columns |= dict(zip(("roll", "pitch", "yaw"), rpy.T, strict=True))
    write_csv(folder / "truth.csv", {"time": t} | columns)
    beam_table(dive).with_columns(pl.col("^beam._valid$").cast(pl.Int8)).write_csv(folder / "beams.csv")
    path = folder / "case.toml"
    path.write_text(CASE + extra, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return load_case(write(drawn_dive(5), tmp_path_factory.mktemp("rov"), WHAT_IFS))


@pytest.fixture(scope="module")
def replayed(case: Case) -> ReplayTables:
    return replay_case(case)


def row(replayed: ReplayTables, what_if: str, method: str) -> dict[str, float]:
    return replayed.runs.filter((pl.col("what_if") == what_if) & (pl.col("method") == method)).row(
        0, named=True
    )


@pytest.mark.parametrize("method", ["lc", "tc", "weak_sway"])
def test_all_beams(replayed: ReplayTables, method: str) -> None:
    """110 m at half a metre per second: within 1 % of the way, and honest about it."""
    found = row(replayed, RECORDED, method)
    assert found["position_rms_over_time_m"] < 0.01 * found["distance_m"]
    assert 0.2 < found["position_normalised_rms_over_time"] < 1.5
    assert found["fixes_rejected"] == 0


def test_partial_beams_are_used(replayed: ReplayTables) -> None:
    """A minute of two beams is better than one of none, with every method; three are as good as four."""
    for method in ("tc", "weak_sway", "sway_current"):
        whole, three, two, none = (
            row(replayed, name, method)["position_final_m"]
            for name in (RECORDED, "lost_4", "lost_34", "outage")
        )
        assert three < whole + 0.5
        assert two < none
    assert row(replayed, "outage", "tc")["position_normalised_rms_over_time"] < 1.5


def test_no_finding_compares_the_dvl_with_itself(replayed: ReplayTables) -> None:
    kinds = {one["kind"] for one in replayed.manifest["findings"]}
    assert not kinds & {"gyro_offset", "gyro_unit", "mounting", "axes", "clock", "lever_arm", "scale"}


def test_gaps_have_to_be_declared(tmp_path: Path) -> None:
    path = write(drawn_dive(5, seconds=60.0), tmp_path)
    table = pl.read_csv(tmp_path / "ahrs.csv")
    table.filter(~pl.col("time").is_between(30.0, 33.0)).write_csv(tmp_path / "ahrs.csv")
    with pytest.raises(DataError, match=r"\[attitude\]: the longest gap is 3.* set it to bridge the gap"):
        read_streams(load_case(path))
    path.write_text(
        CASE.replace('source = "attitude"', 'source = "attitude"\nbridge_gaps_s = 4.0'), encoding="utf-8"
    )
    streams = read_streams(load_case(path))
    assert np.diff(streams.inertial.time_ns).max() <= 100_000_001
    assert any("gaps of the attitude bridged" in note for note in streams.notes)


def test_a_slow_attitude_is_divided(tmp_path: Path) -> None:
    """One attitude in two seconds: the filter steps at a tenth of a second, and the way is still that of the truth."""
    path = write(drawn_dive(5, seconds=120.0, lively=0.3), tmp_path, attitude_hz=0.5)
    found = row(replay_case(load_case(path)), RECORDED, "tc")
    assert found["position_rms_over_time_m"] < 0.03 * found["distance_m"]


def test_the_motion_is_the_prior_of_the_filter(case: Case) -> None:
    """Measured on the pings: the speed as the mean of each axis, its changes; and five times their noise beside it."""
    streams = read_streams(case)
    motion = streams.vehicle_motion
    assert motion is not None
    prepared = rerun.prepare(case, streams)
    prior = prepared.options.motion
    assert prior.change_sd_mps == tuple(motion.fluctuation_sd_mps)
    assert 0.4 < prior.mean_sd_mps[0] == prior.mean_sd_mps[2] < 0.8
    assert prepared.model.imu.accel_noise_mps_rts == pytest.approx(5.0 * motion.accel_noise_mps_per_rt_s)
    # The attitude's error changes by its own size in an hour: 0.5 deg/√h; there are no biases.
    assert np.rad2deg(prepared.model.imu.gyro_noise_rad_rts) == pytest.approx(0.5 / 60.0)
    assert prepared.model.imu.accel_bias_sd_mps2 == prepared.model.imu.gyro_bias_sd_radps == 0.0


def test_a_stated_motion_counts(tmp_path: Path) -> None:
    """Also that there is none; then, and with a stated noise, no ping is needed for it."""
    stated = "[imu.errors]\naccel_noise_mps_per_rt_h = 6.0\n[filter.motion]\nchange_sd_mps = [0.0, 0.0, 0.0]\n[dvl]"
    path = write(drawn_dive(5, seconds=30.0), tmp_path)
    path.write_text(CASE.replace("[dvl]", stated, 1), encoding="utf-8")
    case = load_case(path)
    streams = read_streams(case)
    assert streams.vehicle_motion is None
    prepared = rerun.prepare(case, streams)
    assert prepared.options.motion.change_sd_mps == (0.0, 0.0, 0.0)
    assert prepared.model.imu.accel_noise_mps_rts == pytest.approx(0.1)


def test_a_first_case_without_an_imu(tmp_path: Path) -> None:
    """Attitude, velocity and depth in CSV files: the case that is written runs as it is."""
    dive = drawn_dive(5)
    t, rpy = dive.imu_s[::5], np.rad2deg(dive.rpy[::5])
    ahrs = write_csv(
        tmp_path / "ahrs.csv", {"time": t, "roll": rpy[:, 0], "pitch": rpy[:, 1], "yaw": rpy[:, 2]}
    )
    depth = write_csv(tmp_path / "depth.csv", {"time": t, "depth": dive.position[::5, 2]})
    noise = 0.01 * np.random.default_rng(1).normal(size=(len(dive.ping_s), 3))
    velocity = dive.at(dive.ping_s, dive.velocity) + noise
    dvl = write_csv(
        tmp_path / "dvl.csv", {"time": dive.ping_s} | dict(zip(("vx", "vy", "vz"), velocity.T, strict=True))
    )
    made = make_case([ahrs, depth, dvl], tmp_path / "case.toml")
    case = load_case(made.case)
    assert isinstance(case.imu, ImuFromAttitude)
    assert case.attitude is not None
    assert case.attitude.aids == "nothing"
    assert "the yaw is clockwise" in made.case.read_text(encoding="utf-8")
    tables = replay_undiagnosed(unsmoothed(case.with_methods(["tc"])))
    last = tables.samples.row(-1, named=True)
    moved = dive.position[-1] - dive.position[0]
    assert np.hypot(last["north_m"] - moved[0], last["east_m"] - moved[1]) < 0.02 * last_way(dive)
    with pytest.raises(
        DataError, match=r"no file holds specific force and angular rate .* or an attitude with times"
    ):
        make_case([depth, dvl], tmp_path / "other.toml")


def last_way(dive: Dive) -> float:
    """Length of the way, m."""
    return float(np.linalg.norm(np.diff(dive.position, axis=0), axis=1).sum())
