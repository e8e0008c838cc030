"""Recorded files as readings one at a time: those of `read_streams`, in the order of their times."""

import shutil
from collections import Counter
from pathlib import Path

import numpy as np

import bottomlock
from bottomlock import AcousticPositionReading, AttitudeReading, DepthReading, ImuReading, Ping
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams

DIVE = Path(__file__).parents[2] / "data" / "logs" / "survey_dive"


def test_every_row_of_every_stream_comes_once_and_in_order() -> None:
    log = bottomlock.open_log(DIVE / "case.toml")
    streams = read_streams(load_case(DIVE / "case.toml"))
    readings = list(log)
    times = [reading.time_ns for reading in readings]
    assert times == sorted(times)
    assert streams.depths is not None
    assert streams.attitudes is not None
    assert Counter(type(reading).__name__ for reading in readings) == {
        "ImuReading": len(streams.inertial.time_ns),
        "Ping": len(streams.beams.time_ns),
        "DepthReading": len(streams.depths.time_ns),
        "AttitudeReading": len(streams.attitudes.time_ns),
        "AcousticPositionReading": len(streams.aiding["acoustic_position"].time_ns),
    }
    imu = [reading for reading in readings if isinstance(reading, ImuReading)]
    np.testing.assert_array_equal([reading.omega_radps for reading in imu], streams.inertial.omega_p_radps)
    np.testing.assert_array_equal([reading.force_mps2 for reading in imu], streams.inertial.force_p_mps2)
    pings = [reading for reading in readings if isinstance(reading, Ping)]
    np.testing.assert_array_equal([reading.velocity_mps for reading in pings], streams.beams.velocity_mps)
    np.testing.assert_array_equal([reading.valid for reading in pings], streams.beams.valid)
    depths = [reading.depth_m for reading in readings if isinstance(reading, DepthReading)]
    np.testing.assert_array_equal(depths, streams.depths.depth_m)
    attitudes = [reading.attitude_t_s for reading in readings if isinstance(reading, AttitudeReading)]
    np.testing.assert_array_equal(attitudes, streams.attitudes.attitude.as_quat(scalar_first=True))
    fixes = [reading for reading in readings if isinstance(reading, AcousticPositionReading)]
    np.testing.assert_array_equal(
        [fix.position_t_m for fix in fixes], streams.aiding["acoustic_position"].position_t_m
    )
    assert (log.left_out, log.guesses) == (("reference",), ())


def test_of_equal_times_the_inertial_reading_comes_first() -> None:
    readings = list(bottomlock.open_log(DIVE / "case.toml"))
    at = [k for k, reading in enumerate(readings) if isinstance(reading, Ping)]
    equal = [k for k in at if readings[k - 1].time_ns == readings[k].time_ns]
    assert equal
    assert all(isinstance(readings[k - 1], ImuReading) for k in equal)


def test_files_are_guessed_as_by_init(tmp_path: Path) -> None:
    """The same streams as those of the case that `--init` writes; nothing stays beside the files."""
    for name in ("imu.parquet", "dvl.pd0", "depth.csv", "compass.csv"):
        shutil.copy(DIVE / name, tmp_path)
    files = sorted(tmp_path.iterdir())
    log = bottomlock.open_log(*files)
    assert sorted(tmp_path.iterdir()) == files
    case = bottomlock.replay.init.make.make_case(files, tmp_path / "case.toml").case
    streams = read_streams(load_case(case))
    np.testing.assert_array_equal(log.streams.inertial.force_p_mps2, streams.inertial.force_p_mps2)
    np.testing.assert_array_equal(log.streams.beams.velocity_mps, streams.beams.velocity_mps)
    np.testing.assert_array_equal(log.instrument.beam_sd_mps, streams.instrument.beam_sd_mps)
    counts = [case.read_text("utf-8").count(f"# {mark}") for mark in ("guessed:", "assumed:", "?")]
    assert (len(log.guesses), counts[-1]) == (sum(counts), 3)
    assert any(isinstance(reading, Ping) and reading.valid.all() for reading in log)


def test_a_place_on_the_earth_is_that_of_the_file(tmp_path: Path) -> None:
    """Latitude, longitude and height as recorded, to a tenth of a micrometre."""
    rows = [(1_767_225_600_000_000_000 + k * 10**9, 32.8 + 1e-5 * k, 10.0 - 1e-5 * k, 2.0) for k in range(5)]
    lines = ["time_ns,lat,lon,height", *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "gps.csv").write_text("\n".join(lines), encoding="utf-8")
    case = (DIVE / "case.toml").read_text(encoding="utf-8").replace('file = "', f'file = "{DIVE}/')
    case = case.replace(
        "[acoustic_position]",
        '[gps]\nfile = "gps.csv"\nclock = { column = "time_ns", unit = "ns" }\nlatitude = "lat"\nlongitude = "lon"\n'
        'height = "height"\nposition_sd_m = [1.0, 1.0, 1.0]\n[acoustic_position]',
        1,
    )
    case = case.replace("latitude_deg = 32.8", "latitude_deg = 32.8\nlongitude_deg = 10.0")
    (tmp_path / "case.toml").write_text(case, encoding="utf-8")
    found = [
        (one.time_ns, one.latitude_deg, one.longitude_deg, one.height_m)
        for one in bottomlock.open_log(tmp_path / "case.toml")
        if isinstance(one, bottomlock.GpsReading)
    ]
    assert [one[0] for one in found] == [row[0] for row in rows]
    np.testing.assert_allclose([one[1:3] for one in found], [row[1:3] for row in rows], rtol=0, atol=1e-12)
    np.testing.assert_allclose([one[3] for one in found], 2.0, atol=1e-7)
