"""`replay --init` decides by evidence: units, noise, offsets, axes and mounting that the log itself tells."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from bottomlock.geodesy import Place, geodetic_from_tangent
from bottomlock.io.beams import read_geometry, read_instrument_file
from bottomlock.plant.surroundings import MagneticField
from bottomlock.recordings.attitude_fit import GyroErrors, fit_attitude, gyro_errors
from bottomlock.recordings.pings import beam_noise, better_order, ping_noise, ping_velocity, tilt_of_noise
from bottomlock.recordings.rig_fit import Recorded
from bottomlock.recordings.rig_search import fit_anyhow
from bottomlock.recordings.streams import Attitudes, Inertial
from bottomlock.recordings.track_fit import fit_track
from bottomlock.replay.case import Case, WhatIf, load_case
from bottomlock.replay.findings.attitude_checks import _signs
from bottomlock.replay.init.imu_part import wild_rows
from bottomlock.replay.init.make import make_case
from bottomlock.replay.read_tables import rate_unit
from bottomlock.replay.run import replay_case
from tests import recorded_dives
from tests.dive import Dive, drawn_dive
from tests.dive_logs import write_csv

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
EPOCH_S = 1.7e9
OFFSET_RADPS = np.array([0.002, -0.001, 0.0115])
"""Of cheap gyros: 2,400 deg/h about the vertical."""


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(5, seconds=600.0, beam_sd=0.06, dvl_hz=2.0, geometry="sontek_argonaut")


def ns(seconds: NDArray[np.floating[Any]]) -> Integers:
    return np.asarray(np.round(seconds * 1e9), dtype=np.int64)


def epoch(time_ns: Integers) -> Floats:
    return np.asarray(time_ns * 1e-9 + EPOCH_S)


def attitude(dive: Dive, every: int = 5) -> tuple[Integers, Rotation]:
    rows = slice(0, None, every)
    return ns(dive.imu_s[rows]), Rotation.from_euler("ZYX", dive.rpy[rows][:, ::-1])


def errors_of(dive: Dive, omega: Floats, attitudes: Attitudes | None = None) -> GyroErrors | None:
    """Of rates against the dive's attitude at 10 Hz, or another."""
    inertial = Inertial(ns(dive.imu_s), dive.force, omega)
    return gyro_errors(inertial, attitudes or Attitudes(*attitude(dive)), 0.5)


def velocities(dive: Dive) -> tuple[Integers, Floats]:
    B = np.asarray(read_geometry(dive.geometry).geometry.directions_p)
    return ping_velocity(B, ns(dive.ping_s), np.nan_to_num(dive.beams), np.isfinite(dive.beams))


def noisy(dive: Dive, accel: float, gyro: float) -> tuple[Floats, Floats]:
    """Readings with further white noise, m/s/√s and rad/√s."""
    rng, rt_hz = np.random.default_rng(8), np.sqrt(50.0)
    shape = dive.omega.shape
    return dive.force + accel * rt_hz * rng.normal(size=shape), (
        dive.omega + OFFSET_RADPS + gyro * rt_hz * rng.normal(size=shape)
    )


def tables(folder: Path, dive: Dive, *, quarter: int = 0, yaw_deg: float = 0.0) -> dict[str, Path]:
    """A slow vehicle's log: cheap IMU with AHRS turned by quarters, DVL velocity turned by an angle, ranges, GPS."""
    Q = Rotation.from_euler("Z", 90.0 * quarter, degrees=True)
    force, omega = (Q.inv().apply(x) for x in noisy(dive, 0.08, 0.002))
    times, platform = attitude(dive)
    roll, pitch, yaw = np.rad2deg((platform * Q).as_euler("ZYX")[:, ::-1]).T
    axes = "xyz"
    imu = {f"gyr_{a}": omega[:, k] for k, a in enumerate(axes)} | {
        f"acc_{a}": force[:, k] for k, a in enumerate(axes)
    }
    stamps, velocity = velocities(dive)
    instrument = Rotation.from_euler("Z", yaw_deg, degrees=True).inv().apply(velocity)
    dvl = {f"v{a}": instrument[:, k] for k, a in enumerate(axes)} | {
        f"range_{k}": np.full(len(stamps), 4.0) for k in (1, 2, 3)
    }
    each = slice(0, None, 50)
    rng = np.random.default_rng(4)
    place = dive.position[each] + [0.2, 0.2, 0.0] * rng.normal(size=(len(dive.imu_s[each]), 3))
    latitude, longitude, _ = geodetic_from_tangent(place, Place(np.deg2rad(45.0), 0.1, 0.0))
    return {
        "imu": write_csv(folder / "imu.csv", {"time": dive.imu_s + EPOCH_S} | imu),
        "ahrs": write_csv(
            folder / "ahrs.csv", {"time": epoch(times), "roll": roll, "pitch": pitch, "yaw": yaw}
        ),
        "dvl": write_csv(folder / "dvl.csv", {"time": epoch(stamps)} | dvl),
        "gps": write_csv(
            folder / "gps.csv",
            {
                "time": dive.imu_s[each] + EPOCH_S,
                "latitude": np.rad2deg(latitude),
                "longitude": np.rad2deg(longitude),
            },
        ),
    }


def made(folder: Path, files: dict[str, Path]) -> tuple[Case, str]:
    make_case(list(files.values()), folder / "case.toml")
    return load_case(folder / "case.toml"), (folder / "case.toml").read_text(encoding="utf-8")


DEG = 180.0 / np.pi


@pytest.mark.parametrize("factor", [1.0, DEG, 3600.0 * DEG])
def test_slope_of_turns_tells_the_unit(dive: Dive, factor: float) -> None:
    """A slope of 1 is rad/s; an offset of 2,400 deg/h and noise do not change it."""
    rates = factor * noisy(dive, 0.0, 0.002)[1]
    found = fit_attitude(Inertial(ns(dive.imu_s), dive.force, rates), Attitudes(*attitude(dive)))
    assert found is not None
    assert found.scale == pytest.approx(factor, rel=0.03)
    assert abs(found.scale - factor) < 5.0 * found.scale_sd < 0.1 * factor
    assert found.alike > 0.9
    told = rate_unit(found.scale, "rad/s")
    assert told is not None
    assert told[0] == {1.0: "rad/s", DEG: "deg/s", 3600.0 * DEG: "deg/h"}[factor]
    assert told[1] == pytest.approx(1.0, rel=0.03)


def test_a_beam_of_the_other_sign_is_told_by_the_closure() -> None:
    made = drawn_dive(3, seconds=60.0)
    directions = np.asarray(read_geometry(made.geometry).geometry.directions_p)
    for sign, words in (([1, 1, 1, 1], None), ([1, -1, 1, 1], "beam 2 flipped in sign")):
        found = better_order(directions, made.beams * sign, np.isfinite(made.beams), 0.008)
        assert (None if found is None else found.words) == words


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_axis_about_which_gyros_and_attitude_turn_opposite_ways_is_named(dive: Dive, axis: int) -> None:
    rates = noisy(dive, 0.0, 0.002)[1] * np.where(np.arange(3) == axis, -1.0, 1.0)
    found = fit_attitude(Inertial(ns(dive.imu_s), dive.force, rates), Attitudes(*attitude(dive)))
    assert found is not None
    (named,) = _signs(found)
    assert f"About {'xyz'[axis]} the gyros" in named.text


@pytest.mark.parametrize(("accel", "gyro"), [(0.01, 0.001), (0.07, 0.005), (0.15, 0.01)])
def test_noise_put_in_is_found(dive: Dive, accel: float, gyro: float) -> None:
    """Each within a third of what was put in, the offsets within four of their sigmas, and the beams' tilt."""
    force, omega = noisy(dive, accel, gyro)
    gyros = errors_of(dive, omega)
    assert gyros is not None
    assert gyros.noise is not None
    assert gyros.noise.density()[0] == pytest.approx(gyro, rel=0.33)
    # The Earth's rate is in the gyros and the offsets alike.
    assert (np.abs(gyros.offset_radps - OFFSET_RADPS) < 4.0 * gyros.offset_sd_radps + 2e-4).all()
    # Gyros as poor as these are left for the attitude's own rates.
    found = ping_noise(Recorded(Inertial(ns(dive.imu_s), force, dive.omega), *velocities(dive)))
    assert found is not None
    value, most = found.force.density()
    if accel > 0.02:
        assert value == pytest.approx(accel, rel=0.33)
    else:
        # Pings of 0.12 m/s hardly show it: it is at most what they would.
        assert accel < most < 0.05
    B = np.asarray(read_geometry(dive.geometry).geometry.directions_p)
    assert beam_noise(B, found.velocity_sd_mps) == pytest.approx(0.06, rel=0.1)
    assert np.rad2deg(tilt_of_noise(found.velocity_sd_mps)) == pytest.approx(25.0, abs=2.0)


@pytest.mark.parametrize("every", [5, 50, 100])
def test_a_slow_or_noisy_attitude_is_not_taken_for_gyro_noise(dive: Dive, every: int) -> None:
    """Readings 0.1 to 2 s apart with white noise of a degree: the offset and that noise stand out, none of gyros."""
    times, platform = attitude(dive, every)
    rng = np.random.default_rng(9)
    platform = platform * Rotation.from_rotvec(np.deg2rad(1.0) * rng.normal(size=(len(times), 3)))
    found = errors_of(dive, dive.omega + OFFSET_RADPS, Attitudes(times, platform))
    assert found is not None
    assert found.noise is not None
    assert found.noise.square < 2.0 * found.noise.sd
    # Gyros that scatter by 1e-5 from one reading to the next are hardly ten times worse.
    assert found.noise.density(1e-5)[1] < 5e-4
    assert np.rad2deg(found.white_rad) == pytest.approx([1.0, 1.0, 1.0], rel=0.25)
    assert (np.abs(found.offset_radps - OFFSET_RADPS) < 4.0 * found.offset_sd_radps + 2e-4).all()


def test_jitter_of_the_pings_is_no_noise_of_the_accelerometers(dive: Dive) -> None:
    """Gravity times 20 ms is 0.2 m/s, which a difference of uneven pings must not leave."""
    stamps, _ = velocities(dive)
    late = stamps + ns(np.random.default_rng(6).uniform(0.0, 0.04, len(stamps)))
    true = dive.at(np.asarray(late * 1e-9), dive.velocity)
    found = ping_noise(Recorded(Inertial(ns(dive.imu_s), dive.force, dive.omega), late, true))
    assert found is not None
    assert found.force.density()[0] < 0.01
    assert found.velocity_sd_mps.max() < 0.005


def test_noise_of_two_files_of_a_dive_is_the_same() -> None:
    """Beams and the velocity by them, in sections where the walk is hidden and where it is not; and no step between."""
    for seconds, accel in ((120.0, 0.03), (300.0, 0.05)):
        short = drawn_dive(6, seconds=seconds, beam_sd=0.06, dvl_hz=1.5, geometry="sontek_argonaut")
        force, _ = noisy(short, accel, 0.0)
        inertial, (stamps, velocity) = Inertial(ns(short.imu_s), force, short.omega), velocities(short)
        # What an instrument rounds to, and a mounting that is a little off.
        own = Rotation.from_euler("Z", 2.0, degrees=True).apply(velocity).round(2)
        both = [ping_noise(Recorded(inertial, stamps, one)) for one in (velocity, own)]
        beams, instrument = (one.force.density(0.002)[1] for one in both if one is not None)
        assert max(beams, instrument) < 1.3 * min(beams, instrument)
        assert accel / 2.0 < beams < 3.0 * accel


def test_a_steady_offset_is_no_wander(dive: Dive) -> None:
    steady = errors_of(dive, noisy(dive, 0.0, 0.002)[1])
    walk = 2e-4 * np.cumsum(np.random.default_rng(2).normal(size=dive.omega.shape), axis=0) / np.sqrt(50.0)
    wandering = errors_of(dive, noisy(dive, 0.0, 0.002)[1] + walk)
    assert steady is not None
    assert wandering is not None
    assert steady.wander_radps_rts < 3e-5
    assert wandering.wander_radps_rts == pytest.approx(2e-4, rel=0.6)


@pytest.mark.parametrize("yaw_deg", [-120.0, 0.0, 33.0, 90.0])
def test_mounting_by_accelerations_and_by_the_track(dive: Dive, yaw_deg: float) -> None:
    """Two measurements that share only the velocity, each within four of its own sigmas; one sees a DVL on its side."""
    stamps, velocity = velocities(dive)
    inertial = Inertial(ns(dive.imu_s), dive.force, dive.omega)
    mounted = Rotation.from_euler("Z", yaw_deg, degrees=True)
    own = Rotation.from_euler("ZYX", dive.at(np.asarray(stamps * 1e-9), np.unwrap(dive.rpy, axis=0))[:, ::-1])
    velocity_t = own.apply(mounted.inv().apply(velocity))
    way = cumulative_trapezoid(velocity_t, stamps * 1e-9, axis=0, initial=0.0)
    track = fit_track("gps", stamps, way, ns(dive.imu_s[::50]), dive.position[::50])
    assert track is not None
    assert track.agreement > 0.9
    off = np.rad2deg(np.angle(np.exp(1j * (track.angle_rad - np.deg2rad(yaw_deg)))))
    assert abs(off) < 4.0 * np.rad2deg(track.sd_rad)
    assert np.rad2deg(track.sd_rad) < 10.0
    for tilted in (mounted, mounted * Rotation.from_euler("X", -90.0, degrees=True)):
        felt = fit_anyhow(Recorded(inertial, stamps, tilted.inv().apply(velocity)))
        assert felt is not None
        assert felt.explained > 0.6
        departs = (Rotation.from_matrix(felt.turned) * tilted.inv()).as_rotvec()
        assert (np.abs(departs) < np.maximum(4.0 * felt.part_sd("rotation"), np.deg2rad(0.5))).all()


@pytest.mark.long
def test_a_cheap_log_gives_a_sane_case_untouched(dive: Dive, tmp_path: Path) -> None:
    """rad/s by the slope, the AHRS aids, three beams with their noise, GPS as the reference, and the end is near it."""
    case, text = made(tmp_path, tables(tmp_path, dive))
    assert case.readings.omega_unit == "rad/s"
    assert "times as far as the recorded attitude" in text
    assert case.attitude is not None
    assert case.attitude.aids == "attitude"
    assert 'aids = "attitude"  # assumed:' in text
    assert case.gps is None
    assert case.reference is not None
    assert case.start.position == "reference"
    geometry = read_geometry(case.dvl.geometry).geometry
    assert geometry.beams == 3
    assert case.dvl.beam_noise_mps == pytest.approx(0.06, rel=0.1)
    errors = case.readings.errors
    assert errors.grade == "mti"
    assert errors.gyro_bias_deg_per_h == pytest.approx(2400.0, rel=0.1)
    assert errors.gyro_noise_deg_per_rt_h == pytest.approx(np.rad2deg(0.002) * 60.0, rel=0.33)
    assert errors.accel_noise_mps_per_rt_h == pytest.approx(0.08 * 60.0, rel=0.33)
    runs = replay_case(case.with_methods(["tc", "dead_reckoning"])).runs
    rows = runs.filter(pl.col("pass") == "forward")
    tc = rows.filter(pl.col("method") == "tc").row(0, named=True)
    assert tc["position_final_percent"] < 2.0
    assert tc["fixes_rejected"] < 10
    assert 0.3 < tc["nis_mean_over_fixes"] / tc["nis_degrees_mean_over_fixes"] < 1.3


@pytest.mark.long
@pytest.mark.parametrize("quarter", [1, 2, -1])
def test_imu_and_ahrs_turned_by_a_quarter_are_turned_back(dive: Dive, tmp_path: Path, quarter: int) -> None:
    """An instrument mounted by quarters on the vehicle whose axes the DVL's velocity has."""
    case, _ = made(tmp_path, tables(tmp_path, dive, quarter=quarter))
    expected = {1: ("-y", "x", "z"), 2: ("-x", "-y", "z"), -1: ("y", "-x", "z")}[quarter]
    assert case.readings.axes == expected
    assert case.attitude is not None
    assert np.cos(np.deg2rad(case.attitude.mounting_yaw_deg - 90.0 * quarter)) == pytest.approx(1.0)
    row = replay_case(case.with_methods(["tc"])).runs.row(0, named=True)
    assert row["position_final_percent"] < 2.0


@pytest.fixture
def no_declination(monkeypatch: pytest.MonkeyPatch) -> None:
    """A DVL at an angle of its own cannot be told from a declination that was added to a true yaw."""
    monkeypatch.setitem(sys.modules, "pygeomag", None)


@pytest.mark.usefixtures("no_declination")
def test_the_track_mounts_a_dvl_without_inertial_readings(dive: Dive, tmp_path: Path) -> None:
    """Attitude once in 4 s, as a glider records it: the track against GPS tells the yaw, no question is left of it."""
    files = tables(tmp_path, dive, yaw_deg=33.0)
    del files["imu"]
    slow = pl.read_csv(files["ahrs"]).gather_every(40)
    slow.write_csv(files["ahrs"])
    case, text = made(tmp_path, files)
    assert read_instrument_file(case.dvl.geometry).mounting_yaw_deg == pytest.approx(33.0, abs=3.0)
    assert "by its track against the recorded positions" in text
    assert "no inertial readings: clock" not in text
    del files["gps"]
    (tmp_path / "without").mkdir()
    case, text = made(tmp_path / "without", files)
    assert "no inertial readings: clock and axes of the DVL are those of the attitude" in text


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("geometry", ["teledyne_30", "x_janus_20"])
def test_the_closure_tells_the_order_of_four_beams(tmp_path: Path, geometry: str) -> None:
    """Beams of no known instrument: a first case takes the packaged order that closes, and asks for the tilt."""
    four = drawn_dive(5, seconds=300.0, beam_sd=0.02, dvl_hz=2.0, geometry=geometry)
    files = tables(tmp_path, four)
    files["dvl"] = write_csv(
        tmp_path / "dvl_beams.csv",
        {"time": four.ping_s + EPOCH_S} | {f"beam{k + 1}_mps": four.beams[:, k] for k in range(4)},
    )
    case, text = made(tmp_path, files)
    assert case.dvl.geometry == geometry
    assert "exchanged" not in text
    assert "dvl.geometry" in case.assumed


@pytest.mark.long
def test_the_attitude_of_the_reference_does_not_aid(dive: Dive, tmp_path: Path) -> None:
    """A truth that judges the estimate must not make it."""
    files = tables(tmp_path, dive)
    times, platform = attitude(dive)
    roll, pitch, yaw = platform.as_euler("ZYX")[:, ::-1].T
    files["gps"] = write_csv(
        tmp_path / "truth.csv",
        {"time": epoch(times), "north": dive.position[::5, 0], "east": dive.position[::5, 1],
         "roll": roll, "pitch": pitch, "yaw": yaw},
    )  # fmt: skip
    del files["ahrs"]
    case, _ = made(tmp_path, files)
    assert case.reference is not None
    assert case.attitude is not None
    assert case.attitude.aids == "nothing"


@pytest.mark.long
@pytest.mark.recordings
@pytest.mark.parametrize("names", [("imu", "ahrs", "dvl", "gps"), ("mti", "dvl", "gps")])
def test_a_recorded_dive_untouched_ends_near_dgps(
    recordings: Path, tmp_path: Path, names: tuple[str, ...]
) -> None:
    """MTi AHRS, three-beam DVL, DGPS: 1 % of the DVL's 430 m, where an untouched case once ended 912 m off."""
    if not (recordings / "stpere_ictineu").is_dir():
        pytest.skip(f"no recording {recordings / 'stpere_ictineu'}")
    recorded_dives.stpere(recordings, tmp_path)
    case, _ = made(tmp_path, {name: tmp_path / f"{name}.csv" for name in names})
    assert case.readings.omega_unit == "rad/s"
    assert case.readings.errors.gyro_bias_deg_per_h == pytest.approx(2450.0, rel=0.1)
    assert case.dvl.beam_noise_mps == pytest.approx(0.065, rel=0.1)
    two_beams = WhatIf(name="two_beams", beams_lost=(3,))
    case = case.model_copy(update={"what_if": (two_beams, WhatIf(name="one_beam", beams_lost=(2, 3)))})
    rows = replay_case(case.with_methods(["tc", "dead_reckoning"])).runs.filter(pl.col("pass") == "forward")
    errors = rows.rows_by_key(("what_if", "method"), named=True, unique=True)
    tc, floor = (errors["recorded", method] for method in ("tc", "dead_reckoning"))
    assert tc["position_final_m"] < 4.3
    assert tc["position_rms_over_time_m"] < 1.05 * floor["position_rms_over_time_m"]
    for fewer in ("two_beams", "one_beam"):
        tc, floor = (errors[fewer, method] for method in ("tc", "dead_reckoning"))
        assert tc["position_rms_over_time_m"] < floor["position_rms_over_time_m"]


@pytest.mark.long
@pytest.mark.parametrize(("reads_deg", "offset_deg"), [(-8.0, 8.0), (0.0, 0.0)])
def test_declination_turns_a_magnetic_yaw_alone(
    dive: Dive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reads_deg: float, offset_deg: float
) -> None:
    """In a declination of 8 deg a compass that reads 8 deg too little is no yaw of the DVL; a true yaw stays."""
    asked = []

    def model(latitude_rad: float, longitude_rad: float, year: float) -> MagneticField:
        asked.append((latitude_rad, longitude_rad, year))
        return MagneticField(np.deg2rad(8.0), 1.0, 48_000.0)

    monkeypatch.setattr("bottomlock.replay.init.make.world_magnetic_model", model)
    files = tables(tmp_path, dive)
    ahrs = pl.read_csv(files["ahrs"]).with_columns(pl.col("yaw") + reads_deg)
    ahrs.write_csv(files["ahrs"])
    case, text = made(tmp_path, files)
    assert case.attitude is not None
    assert case.attitude.yaw_offset_deg == pytest.approx(offset_deg)
    assert ("declination of 2023.9" in text) == (offset_deg != 0.0)
    assert ("the yaw is true:" in text) == (offset_deg == 0.0)
    assert asked[0] == pytest.approx((np.deg2rad(45.0), 0.1, 2023.87), abs=0.01)
    row = replay_case(case.with_methods(["tc"])).runs.row(0, named=True)
    assert row["position_final_percent"] < 2.0


def test_the_first_rows_of_a_turn_are_readings() -> None:
    """After a long rest, nine seconds of a turn at a thousand times the noise; so is a rest without any noise."""
    rng = np.random.default_rng(3)
    omega = 1e-4 * rng.normal(size=(60_000, 3))
    omega[30_000:30_450, 2] += 0.2
    assert not wild_rows(omega).any()
    omega[:30_000] = omega[30_450:] = 0.0
    assert not wild_rows(omega).any()
    omega += 1e-4
    omega[100, 1] = 50.0
    assert np.flatnonzero(wild_rows(omega)).tolist() == [100]
