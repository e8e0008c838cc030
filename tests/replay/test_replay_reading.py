"""Streams of a case into SI: increments, frames, gaps, empty rows, and what each fault is told with."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.config.sensors import AcousticPositionErrors
from bottomlock.errors import DataError
from bottomlock.recordings.axes import (
    from_angles,
    from_quaternions,
    handedness,
    platform_attitude,
    quaternions,
    to_angles,
)
from bottomlock.recordings.readings import AcousticPositionReading
from bottomlock.recordings.rotation import permute_axes
from bottomlock.recordings.stream_sections import Clock, SensorStream
from bottomlock.replay import rerun
from bottomlock.replay.case import parse_case
from bottomlock.replay.model import kernel_options
from bottomlock.replay.read_tables import stream_of
from bottomlock.replay.reading import read_streams
from tests.oracle import geodesy
from tests.oracle.rotations import matrix_from_euler
from tests.replay.test_replay_case import LEAST

CASE = (
    LEAST[: LEAST.index("[start]")].replace(
        "[imu]", "[origin]\nlatitude_deg = 32.8\nlongitude_deg = 35.0\n[imu]", 1
    )
    + """[start]
heading = "given"
heading_deg = 0.0
heading_sd_deg = 1.0
position_sd_m = [0.0, 0.0, 0.0]
level = "given"
level_sd_deg = 1.0
[replay]
smooth = false
methods = ["tc"]
"""
)


def tables(folder: Path, times: list[float] | None = None, **columns: list[float]) -> None:
    """An IMU at rest at 10 Hz and pings of a vehicle at rest at 1 Hz."""
    t = np.arange(51) / 10.0 if times is None else np.array(times)
    rest = {"ax": 0.0, "ay": 0.0, "az": -9.8, "wx": 0.0, "wy": 0.0, "wz": 0.0}
    pl.DataFrame(
        {"t": t, "dt": np.full(len(t), 0.1)}
        | {key: np.full(len(t), value) for key, value in rest.items()}
        | columns
    ).write_csv(folder / "imu.csv")
    pings = {"time_ns": np.arange(5, dtype=np.int64) * 1_000_000_000}
    beams = {
        f"beam{k + 1}_{what}": [value] * 5
        for k in range(4)
        for what, value in (("mps", 0.0), ("valid", True))
    }
    pl.DataFrame(pings | beams).write_parquet(folder / "beams.parquet")


def changed(*pairs: tuple[str, str], extra: str = "") -> str:
    text = CASE + extra
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def test_increments_are_divided_by_their_interval(tmp_path: Path) -> None:
    tables(tmp_path, az=[-0.98] * 51, wz=[0.02] * 51)
    units = 'force_unit = "m/s"\nomega_unit = "rad"\ninterval = "dt"\nomega ='
    streams = read_streams(parse_case(changed(("omega =", units)), place="case", folder=tmp_path))
    np.testing.assert_allclose(streams.inertial.force_p_mps2[:, 2], -9.8)
    np.testing.assert_allclose(streams.inertial.omega_p_radps[:, 2], 0.2)
    case = parse_case(changed(("omega =", units)), place="case", folder=tmp_path)
    assert kernel_options(case, streams.instrument).imu_sampling == "averaged"


def test_gap_of_the_imu_is_refused_unless_declared(tmp_path: Path) -> None:
    times = [k / 10.0 for k in range(30)] + [4.0 + k / 10.0 for k in range(21)]
    tables(tmp_path, times)
    with pytest.raises(DataError, match=r"longest gap is 1.1 s .* first at row 30, 4.000 s"):
        read_streams(parse_case(CASE, place="case", folder=tmp_path))
    streams = read_streams(
        parse_case(changed(("omega =", "bridge_gaps_s = 1.5\nomega =")), place="case", folder=tmp_path)
    )
    assert any("bridged by linear interpolation: 1, first at row 30" in note for note in streams.notes)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"ay": [0.0] * 7 + [float("nan")] + [0.0] * 43}, "row 7: column 'ay' is empty"),
        ({"t": [0.1 * k for k in range(50)] + [1.0]}, "row 50: 1.000000 s, goes back"),
    ],
)
def test_faults_name_file_row_and_column(
    tmp_path: Path, columns: dict[str, list[float]], message: str
) -> None:
    tables(tmp_path, **columns)
    with pytest.raises(DataError, match=message):
        read_streams(parse_case(CASE, place="case", folder=tmp_path))


def test_a_geometry_of_three_beams_does_not_fit_four(tmp_path: Path) -> None:
    """Replay and `tune` read the table here; one beam more is no beam to leave out."""
    tables(tmp_path)
    with pytest.raises(DataError, match="has 4 beams, expected 3"):
        read_streams(parse_case(changed(("x_janus_20", "sontek_argonaut")), place="case", folder=tmp_path))
    three = pl.read_parquet(tmp_path / "beams.parquet").drop("beam4_mps", "beam4_valid")
    three.write_parquet(tmp_path / "beams.parquet")
    with pytest.raises(DataError, match="has 3 beams, expected 4"):
        read_streams(parse_case(CASE, place="case", folder=tmp_path))


@pytest.mark.parametrize("code", [(0.0, 0.0, 0.0), (-32.768, -32.768, -32.768), (0.5, 9.97e36, 0.1)])
def test_codes_for_no_velocity_are_left_out_and_counted(
    code: tuple[float, float, float], tmp_path: Path
) -> None:
    """A velocity along one axis may be 0; on every axis at once it is a code."""
    tables(tmp_path)
    rows = [(0.5, 0.1, 0.0), code, (0.5, 0.0, 0.0)]
    pl.DataFrame({"t": [0.0, 1.0, 2.0]} | dict(zip("xyz", zip(*rows, strict=True), strict=True))).write_csv(
        tmp_path / "dvl.csv"
    )
    velocity = 'file = "dvl.csv"\nsource = "velocity"\nvelocity = ["x", "y", "z"]\nclock = { column = "t" }'
    case = parse_case(changed(('file = "beams.parquet"', velocity)), place="case", folder=tmp_path)
    streams = read_streams(case)
    assert streams.beams.time_ns.tolist() == [0, 2_000_000_000]
    assert streams.clocks["dvl"].empty.count == 1
    assert any("1 rows without a velocity" in note for note in streams.notes)


def test_empty_rows_of_an_aid_are_left_out_and_counted(tmp_path: Path) -> None:
    tables(tmp_path)
    pl.DataFrame({"t": [0.0, 1.0, 2.0, 3.0], "p": [100.0, None, 300.0, None]}).write_csv(
        tmp_path / "depth.csv"
    )
    depth = '[depth]\nfile = "depth.csv"\nclock = { column = "t" }\ncolumn = "p"\nunit = "kPa"\nsd_m = 0.1\n'
    streams = read_streams(parse_case(CASE + depth, place="case", folder=tmp_path))
    assert streams.depths is not None
    np.testing.assert_allclose(streams.depths.depth_m, np.array([100e3, 300e3]) / (1025.0 * 9.80665))
    report = streams.clocks["depth"]
    assert (report.rows, report.kept, report.empty.count, report.empty.row) == (4, 2, 2, 1)


def test_gps_and_attitude_aid_as_they_are_told(tmp_path: Path) -> None:
    """Latitudes by the book become tangent metres; heading alone or the whole attitude reaches the filter."""
    tables(tmp_path)
    home = geodesy.ecef(np.deg2rad(32.8), np.deg2rad(35.0), 0.0)
    places = [geodesy.geodetic_of_ned(np.array([10.0 * k, -5.0, 0.0]), home, 32.8, 35.0) for k in range(3)]
    lat, lon, height = np.array(places).T
    table = {"t": [0.5, 1.5, 2.5], "lat": np.rad2deg(lat), "lon": np.rad2deg(lon), "h": height}
    pl.DataFrame(table).write_csv(tmp_path / "gps.csv", float_precision=14)
    pl.DataFrame({"t": [0.2, 1.2], "r": [1.0, 2.0], "p": [3.0, 4.0], "y": [50.0, 60.0]}).write_csv(
        tmp_path / "ahrs.csv"
    )
    extra = """
[gps]
file = "gps.csv"
clock = { column = "t" }
latitude = "lat"
longitude = "lon"
height = "h"
lever_arm_m = [0.0, 0.0, -1.0]
[attitude]
file = "ahrs.csv"
clock = { column = "t" }
roll = "r"
pitch = "p"
yaw = "y"
unit = "deg"
yaw_offset_deg = 4.0
aids = "heading"
"""
    for aids in ("heading", "attitude"):
        case = parse_case(
            changed(('aids = "heading"', f'aids = "{aids}"'), extra=extra), place="case", folder=tmp_path
        )
        prepared = rerun.prepare(case, read_streams(case))
        log = rerun.kernel_log(case, prepared, prepared.streams.beams.valid[prepared.pings])
        np.testing.assert_allclose(log["gps_position_t_m"], [[0, -5, 0], [10, -5, 0], [20, -5, 0]], atol=1e-6)
        assert prepared.options.levers.gps_p_m == (0.0, 0.0, -1.0)
        if aids == "heading":
            np.testing.assert_allclose(log["heading_rad"], np.deg2rad([54.0, 64.0]))
            assert "attitude_time_ns" not in log
        else:
            np.testing.assert_allclose(
                to_angles(from_quaternions(log["attitude_t_p"])),
                np.deg2rad([[1, 3, 54], [2, 4, 64]]),
                atol=1e-12,
            )
        assert (rerun.run_methods(case, prepared, None).result["fix_status"] == 1).any()


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_attitudes_go_there_and_back(roll: float, pitch: float, yaw: float) -> None:
    """Angles to rotation as the literal matrix has it, and back; ENU and FLU angles name the same attitude."""
    attitude = from_angles(roll, pitch, yaw)
    np.testing.assert_allclose(attitude.as_matrix(), matrix_from_euler(roll, pitch, yaw), atol=1e-12)
    np.testing.assert_allclose(to_angles(attitude), [roll, pitch, yaw], atol=1e-9)
    assert quaternions(attitude)[0] == pytest.approx(attitude.as_quat()[3])
    # Yaw from east, counter-clockwise; pitch positive bow down: the same vehicle in the other convention.
    other = from_angles(roll, -pitch, 0.5 * np.pi - yaw)
    turned = platform_attitude(other, "enu_flu", [0.0, 0.0, 0.0], 0.0)
    np.testing.assert_allclose(turned.as_matrix(), attitude.as_matrix(), atol=1e-12)


def test_axes_that_are_left_handed_are_noticed() -> None:
    assert handedness(("x", "-y", "z")) == -1
    assert handedness(("y", "x", "-z")) == 1
    np.testing.assert_array_equal(
        permute_axes(np.array([[1.0, 2.0, 3.0]]), ("-z", "x", "y")), [[-3.0, 1.0, 2.0]]
    )


def test_columns_in_si_are_the_fields_of_a_reading() -> None:
    """Of a sensor that needs nothing else: three numbers of a position stay together, and so do those of its noise."""

    class Fixes(AcousticPositionErrors, SensorStream):
        column_keys = ("columns_read",)
        columns_read: tuple[str, ...]

    section = Fixes(file=Path("fixes.csv"), clock=Clock(column="t"), columns_read=tuple("nedabc"))
    stream = stream_of(section, np.array([1, 2]), np.arange(12.0).reshape(2, 6))
    assert isinstance(stream, AcousticPositionReading)
    assert np.asarray(stream.time_ns).tolist() == [1, 2]
    assert np.asarray(stream.position_t_m).tolist() == [[0, 1, 2], [6, 7, 8]]
    assert np.asarray(stream.sd_m).tolist() == [[3, 4, 5], [9, 10, 11]]
