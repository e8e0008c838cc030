"""Faults of the inertial sensors: readings out of range, clipped and stuck, gaps; and pushes that are refused."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import bottomlock
from bottomlock.replay import rerun
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.run import replay_case
from tests.kernel.test_late_data import AT_REST, LEVEL, MS, arrivals, push
from tests.kernel.test_replay_log import LOG, START
from tests.property import settings
from tests.replay import synthetic_dive

JANUS = bottomlock.BeamGeometry.janus(np.deg2rad(30.0))


def options(**changed: Any) -> Any:  # noqa: ANN401 - a value of any option
    """The tests' options with limits of the inertial readings."""
    return settings.options(gate="joint") | {"imu_limits": changed}


def navigator(**changed: Any) -> bottomlock.Navigator:  # noqa: ANN401
    made = bottomlock.Navigator(JANUS, settings.table_2(), options(**changed), AT_REST, method="tc")
    made.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=LEVEL)
    return made


def test_a_bad_reading_is_a_report_and_a_count() -> None:
    """The report has the keys of any other, no rows, and the reason; the state does not move."""
    nav = navigator()
    before = nav.state()
    (report,) = nav.push_imu(10 * MS, omega_p_radps=np.zeros(3), force_p_mps2=np.array([1000.0, 0.0, -9.8]))
    assert (report.sensor, report.time_ns, report.verdict) == ("imu", 10 * MS, "rejected")
    assert (
        report.reason
        == "specific force x is 1000 m/s², beyond the full scale of 100 m/s²: is it in mg or cm/s²?"
    )
    assert report.covariance.shape == (0, 0)
    assert nav.state()["time_ns"] == before["time_ns"]
    assert nav.imu_faults() == {"out_of_range": 1, "clipped": 0, "stuck": 0, "jumped": 0, "inflated_gaps": 0}
    nav.push_imu(20 * MS, omega_p_radps=np.zeros(3), force_p_mps2=LEVEL)
    (ping,) = nav.push_beams(20 * MS, np.zeros(4), np.ones(4, bool), sd_mps=np.full(4, 0.042))
    assert type(ping) is type(report)
    assert ping.reason is None


def test_a_block_says_what_it_took() -> None:
    """Three readings and a ping are taken, the fourth is refused: its error has their number and reports."""
    nav = navigator()
    nav.push_beams(15 * MS, np.zeros(4), np.ones(4, bool), sd_mps=np.full(4, 0.042))
    time_ns = np.array([10, 20, 30, 30, 40]) * MS
    force = np.tile(LEVEL, (5, 1))
    force[2:4, 0] = 1000.0
    with pytest.raises(bottomlock.KernelError, match="imu time 30000000 ns") as caught:
        nav.push_imu_block(time_ns, omega_p_radps=np.zeros((5, 3)), force_p_mps2=force)
    assert caught.value.taken == 3
    assert [report.sensor for report in caught.value.reports] == ["beams", "imu"]
    assert nav.state()["time_ns"] == 20 * MS
    nav.push_imu_block(time_ns[4:], omega_p_radps=np.zeros((1, 3)), force_p_mps2=force[4:])
    assert nav.state()["time_ns"] == 40 * MS
    assert (bottomlock.KernelError("x").taken, list(bottomlock.KernelError("x").reports)) == (0, [])


def faulty_log(*, gap: bool = False) -> Any:  # noqa: ANN401 - the kernel's dict
    """The log of the tests with two bad readings in a row and one at the very end, or with a gap."""
    log: dict[str, Any] = dict(LOG)
    force = np.array(log["force_p_mps2"])
    count = len(force)
    if gap:
        kept = np.r_[0 : count // 2, count // 2 + 3 * count // 10 : count]
        for key in ("imu_time_ns", "force_p_mps2", "omega_p_radps"):
            log[key] = np.asarray(log[key])[kept]
        return log
    force[[count // 3, count // 3 + 1, count - 1], 1] = [1000.0, -100.0, 2000.0]
    return log | {"force_p_mps2": force}


@pytest.mark.parametrize("method", ["ins", "tc", "sway_current"])
@pytest.mark.parametrize("gap", [False, True])
def test_a_faulty_log_is_the_streaming_navigator(
    method: Any,  # noqa: ANN401
    *,
    gap: bool,
) -> None:
    """Rejected readings and inflated gaps: the replay ends in the bits of a live navigator, and says what it found."""
    log = faulty_log(gap=gap)
    limits = options(gap="inflate", max_gap_s=0.5)
    nav = bottomlock.Navigator(JANUS, settings.table_2(), limits, START, method=method)
    for event in arrivals(0.0, 0, log):
        push(nav, *event, log)
    end_ns = int(nav.state()["time_ns"])
    arguments: Any = (JANUS, settings.table_2(), limits, [method], log, START)
    for threads in (1, 2):
        out = bottomlock.replay_log(*arguments, sample_time_ns=np.array([end_ns]), threads=threads)
        assert int(out["sample_time_ns"][0]) == end_ns
        np.testing.assert_array_equal(out["position_t_m"][0, 0], nav.state()["position_t_m"])
        np.testing.assert_array_equal(out["sd"][0, 0], np.sqrt(np.diag(nav.covariance())))
        assert out["imu_faults"] == nav.imu_faults()
    count = len(LOG["imu_time_ns"])
    rows = [] if gap else [count // 3, count // 3 + 1, count - 1]
    assert out["rejected_imu"]["row"].tolist() == rows
    assert out["unused"]["rejected"]["imu"] == len(rows)
    assert len(out["inflated_imu"]["gap_s"]) == 1
    assert out["imu_faults"]["inflated_gaps"] == int(gap)
    assert out["imu_faults"]["clipped"] == int(not gap)


QUICK = '[replay]\nmethods = ["tc", "sway_current"]\nsmooth = false\nduration_s = 40.0\n'


def write_dive(folder: Path) -> Path:
    """The synthetic dive with one reading of 980 m/s² 30 s after the start, for two methods."""
    path = synthetic_dive.write(folder, QUICK)
    table = pl.read_csv(folder / "imu.csv")
    bad = pl.int_range(pl.len()) == 1500
    table.with_columns(pl.when(bad).then(1e5).otherwise(pl.col("fa")).alias("fa")).write_csv(
        folder / "imu.csv"
    )
    return path


def test_a_recorded_dive_survives_a_bad_reading(tmp_path: Path) -> None:
    """The table counts it, and the position at the end is that without it to a centimetre; it was kilometres."""
    bad = replay_case(load_case(write_dive(tmp_path)))
    good = replay_case(load_case(synthetic_dive.write(tmp_path, QUICK)))
    assert bad.runs["imu_rejected"].to_list() == [1] * bad.runs.height
    assert good.runs["imu_rejected"].to_list() == [0] * good.runs.height
    difference = (bad.runs["position_final_m"] - good.runs["position_final_m"]).abs()
    assert difference.max() < 0.01  # type: ignore[operator]
    # The estimate that was due at the bad reading is compared at the time of the next one.
    errors = ["err_position_north_m", "err_position_east_m"]
    apart = bad.samples.select(errors).to_numpy() - good.samples.select(errors).to_numpy()
    assert np.abs(apart).max() < 0.01
    assert (
        bad.manifest["imu_faults"][0]
        == "imu: readings rejected: 1 (1 out of range, 0 clipped, 0 stuck, 0 jumped)"
    )
    assert "30.000 s after the start" in bad.manifest["imu_faults"][1]


def test_the_alignment_leaves_a_bad_reading_out(tmp_path: Path) -> None:
    """980 m/s² for one reading in 501 would tilt the levelling by 11°; without it by less than a millidegree."""
    levels = []
    for folder, write in (("bad", write_dive), ("clean", lambda place: synthetic_dive.write(place, QUICK))):
        (tmp_path / folder).mkdir()
        path = write(tmp_path / folder)
        synthetic_dive.replace(path, 'level = "reference"', 'level = "levelling"\nat_s = 35.0')
        case = load_case(path)
        levels.append(rerun.prepare(case, read_streams(case)).alignment.attitude)
    assert np.rad2deg((levels[0] * levels[1].inv()).magnitude()) < 0.01
