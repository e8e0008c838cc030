"""`Navigator.start`: names in place of settings, a start that is found by itself, readings one at a time."""

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock import AttitudeReading, DepthReading, ImuReading, Navigator, Ping, own_method
from bottomlock.config.instrument_grades import imu
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import models, normal_gravity_mps2
from bottomlock.units import rad_from_deg
from tests.kernel.report_bits import report_bits

DIVE = Path(__file__).parents[2] / "data" / "logs" / "survey_dive" / "case.toml"
A50: dict[str, Any] = {"dvl": "waterlinked_a50", "imu": "tactical", "latitude_deg": 54.0, "heading_deg": 90.0}
GRAVITY = normal_gravity_mps2(rad_from_deg(54.0))
MS = 1_000_000
VELOCITY = np.array([1.0, 0.1, 0.0])
A50_GEOMETRY = read_geometry("waterlinked_a50").geometry


def still(k: int) -> ImuReading:
    """The k-th of a level vehicle that is pushed by nothing, 100 Hz."""
    return ImuReading(k * 10 * MS, (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY))


def ping(time_ns: int, lost: tuple[int, ...] = ()) -> Ping:
    velocity = A50_GEOMETRY.directions_p @ VELOCITY
    velocity[list(lost)] = np.nan
    return Ping.of_beams(time_ns, velocity)


def begun(readings: int = 600, **settings: Any) -> bottomlock.StartedNavigator:  # noqa: ANN401 - of any section
    """Six seconds: five of levelling, a ping each, a depth at the beginning."""
    nav = Navigator.start(**A50 | settings)
    nav.push(DepthReading(0, 30.0))
    for k in range(readings):
        nav.push(still(k))
        if k % 50 == 49:
            nav.push(ping(k * 10 * MS))
    return nav


def test_ten_lines_navigate_a_recorded_dive() -> None:
    """Against the simulated truth of the dive: the position by which it ends is within three of its sigmas."""
    log = bottomlock.open_log(DIVE)
    truth = log.streams.reference
    assert truth is not None
    assert truth.attitude is not None
    assert truth.position_t_m is not None
    assert truth.velocity_p_mps is not None
    nav = Navigator.start(
        dvl=log.instrument,
        imu="fibre_optic",
        latitude_deg=log.latitude_deg,
        heading_deg=float(np.rad2deg(truth.attitude.as_euler("ZYX")[0, 0])),
        method="sway_current",
        start={"heading_sd_deg": 0.5},
    )
    heard: Counter[str] = Counter()
    begins_ns: int | None = None
    for reading in log:
        heard.update(report.verdict for report in nav.push(reading))
        if begins_ns is None and nav.navigator is not None:
            begins_ns = nav.time_ns
    assert begins_ns is not None
    begins = truth.position_t_m[np.searchsorted(truth.time_ns, begins_ns)]
    row = np.searchsorted(truth.time_ns, nav.time_ns)
    moved = nav.position_t_m - (truth.position_t_m[row] - begins * [1.0, 1.0, 0.0])
    assert (np.abs(moved) < 3.0 * nav.position_sd_m + 1.0).all(), moved
    assert (np.abs(nav.velocity_p_mps - truth.velocity_p_mps[row]) < 4.0 * nav.velocity_sd_mps + 0.01).all()
    assert heard["accepted"] > 0.99 * sum(heard.values())
    assert set(nav.unused) == {
        "AttitudeReading without section attitude",
        "AcousticPositionReading without section acoustic_position",
    }


def test_it_is_the_navigator_that_one_makes_by_hand() -> None:
    """Level, heading, velocity and depth as found, the models by name; from there on the same bits."""
    nav = begun(501)
    assert nav.navigator is not None
    started = nav.state()
    np.testing.assert_array_equal(nav.covariance(), nav.navigator.covariance())
    assert started["time_ns"] == 5000 * MS
    instrument = read_geometry("waterlinked_a50")
    settings = bottomlock.live.started.kernel_settings(nav._config, instrument)
    assert settings.model.imu == imu("tactical")
    assert settings.model.initial.attitude_sd_rad[2] == rad_from_deg(2.0)
    half = np.sqrt(0.5)
    state = models.InitialState(
        time_ns=5000 * MS,
        position_t_m=(0.0, 0.0, 30.0),
        attitude_t_p=(half, 0.0, 0.0, half),
        velocity_p_mps=tuple(VELOCITY.tolist()),
    )
    np.testing.assert_allclose(started["attitude_t_p"], state.attitude_t_p, atol=1e-12)
    np.testing.assert_allclose(started["velocity_p_mps"], VELOCITY, atol=1e-9)
    np.testing.assert_array_equal(started["position_t_m"], state.position_t_m)
    by_hand = Navigator.load(nav.navigator.save())
    for k in range(501, 800):
        reading = still(k)
        ours = nav.push(reading)
        theirs = by_hand.push_imu(
            reading.time_ns, omega_p_radps=reading.omega_radps, force_p_mps2=reading.force_mps2
        )
        if k % 50 == 0:
            one = ping(reading.time_ns, lost=(2, 3))
            ours += nav.push(one)
            theirs += by_hand.push_beams(
                one.time_ns, one.velocity_mps, one.valid, sd_mps=instrument.beam_sd_mps
            )
        assert [report_bits(report) for report in ours] == [report_bits(report) for report in theirs]
    assert nav.navigator.save() == by_hand.save()


def test_the_dvl_by_its_instrument_or_its_keys() -> None:
    nav = begun(dvl={"geometry": "waterlinked_a50", "beam_noise_mps": 0.5})
    assert (nav.velocity_sd_mps > begun(dvl=read_geometry("waterlinked_a50")).velocity_sd_mps).all()


def test_a_depth_says_where_it_begins_unless_the_section_does() -> None:
    """A vehicle at 30 m is not at the surface; where the start says where it is, the depths are measurements."""
    assert begun().position_t_m[2] == pytest.approx(30.0, abs=0.2)
    given = begun(501, start={"position_m": (5.0, 6.0, 7.0)})
    np.testing.assert_array_equal(given.position_t_m, [5.0, 6.0, 7.0])
    assert begun(501, depth=None).position_t_m[2] == 0.0


def test_nothing_is_ignored_silently() -> None:
    nav = begun(depth=None, thrust={"advance_m": 0.3, "noise_mps": 0.05})
    assert nav.unused == {"DepthReading without section depth": 1}
    early = Navigator.start(**A50, acoustic_position={})
    early.push(bottomlock.AcousticPositionReading(0, (0.0, 0.0, 0.0), None))
    assert early.unused == {"AcousticPositionReading before the start": 1}


def test_every_kind_of_reading_is_taken() -> None:
    nav = begun(
        attitude={"grade": "mti_ahrs", "aids": "attitude"},
        gps={"position_sd_m": (1.0, 1.0, 2.0)},
        acoustic_position={"sd_m": 1.0},
        origin={"longitude_deg": 10.0, "height_m": 0.0},
        thrust={"advance_m": 0.3, "noise_mps": 0.05},
        water_track={},
        start={"position_m": (0.0, 0.0, 30.0)},
    )
    at_ns, half = nav.time_ns, float(np.sqrt(0.5))
    valid, sd = np.ones(4, bool), np.full(4, 0.05)
    readings: list[Any] = [
        bottomlock.AttitudeReading(at_ns, (half, 0.0, 0.0, half)),
        bottomlock.GpsReading(at_ns, 54.0, 10.0, -30.0),
        bottomlock.AcousticPositionReading(at_ns, (0.0, 1.0, 30.0), None),
        bottomlock.ThrustReading(at_ns, 3.3),
        bottomlock.WaterReading(at_ns, A50_GEOMETRY.directions_p @ VELOCITY, valid, sd, 3.0),
    ]
    sensors = {report.sensor for reading in readings for report in nav.push(reading)}
    assert sensors == {"attitude", "gps_position", "acoustic_position", "thrust_surge", "water_track"}
    assert not nav.unused


HALF = float(np.sqrt(0.5))
NONE, FORCE = (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY)


class NoBeams:
    """Inertial navigation by another name."""

    name = "started_no_beams"

    def ping(self, beams: own_method.Beams, prior: own_method.Prior) -> None:  # noqa: ARG002, D102
        return None


def test_a_method_of_ones_own() -> None:
    """The class itself or its registered name; it flies as the built-in method does that it repeats."""
    sd_mps = begun(method=NoBeams).velocity_sd_mps
    by_name = begun(method=own_method.register(NoBeams)).velocity_sd_mps
    np.testing.assert_array_equal(by_name, sd_mps)
    # But for the heave, which pings that a method may use find widened (docs/linear_range.md).
    ins_mps = begun(method="ins").velocity_sd_mps
    np.testing.assert_allclose(sd_mps[:2], ins_mps[:2], rtol=1e-8)
    assert ins_mps[2] < sd_mps[2] < 1.002 * ins_mps[2]
    assert (sd_mps > begun(method="tc").velocity_sd_mps).all()


def test_a_refused_ping_gives_no_velocity_between_attitudes() -> None:
    """Attitudes in place of inertial readings are held at the velocity of the last ping that was taken."""
    by_attitude: dict[str, Any] = A50 | {
        "imu": {"source": "attitude", "accel_noise_mps_per_rt_h": 1.0},
        "attitude": {"grade": "mti_ahrs"},
        "heading_deg": None,
    }
    nav, other = Navigator.start(**by_attitude), Navigator.start(**by_attitude)
    for k in range(60):
        for one in (nav, other):
            one.push(bottomlock.AttitudeReading(k * 100 * MS, (1.0, 0.0, 0.0, 0.0)))
            if k % 5 == 0:
                one.push(ping(k * 100 * MS))
        if k == 52:
            with pytest.raises(bottomlock.KernelError, match="behind the navigator"):
                nav.push(Ping.of_beams(1000 * MS, A50_GEOMETRY.directions_p @ [3.0, -3.0, 1.0]))
    # The count of late measurements is all that differs.
    np.testing.assert_array_equal(nav.position_t_m, other.position_t_m)
    np.testing.assert_array_equal(nav.velocity_p_mps, other.velocity_p_mps)
    np.testing.assert_array_equal(nav.position_sd_m, other.position_sd_m)


@pytest.mark.parametrize(
    ("omega_radps", "force_mps2", "why"),
    [
        (
            NONE,
            (0.0, 0.0, GRAVITY),
            r"\+9.8\) m/s² .*z of the IMU is up \(ROS\): imu.mounting_roll_deg = 180\?",
        ),
        (NONE, (0.0, -GRAVITY, 0.0), r"\+0.0, -9.8, \+0.0\) m/s² .*imu.mounting_roll_deg"),
        (NONE, (0.0, 0.0, 1.0), r"that measure gravity: they read .*\+1.0\) m/s².*are they in g"),
        ((0.0, 0.0, -GRAVITY), NONE, "are they in g, without gravity, or swapped with the rates"),
    ],
)
def test_wrong_axes_and_units_are_no_start(omega_radps: Any, force_mps2: Any, why: str) -> None:  # noqa: ANN401
    nav = Navigator.start(**A50)
    for k in range(600):
        nav.push(ImuReading(k * 10 * MS, omega_radps, force_mps2))
        if k % 50 == 49:
            nav.push(ping(k * 10 * MS))
    assert nav.navigator is None
    assert re.search(why, nav.waiting_for), nav.waiting_for


def test_the_level_is_that_of_the_window_alone() -> None:
    """A vehicle that waits a minute for a ping: what was read before the last five seconds is gone."""
    nav = Navigator.start(**A50)
    tilted = (0.5 * GRAVITY, 0.0, -float(np.sqrt(0.75)) * GRAVITY)
    for k in range(6000):
        nav.push(ImuReading(k * 10 * MS, NONE, tilted if k < 5400 else FORCE))
    nav.push(ping(59_990 * MS))
    nav.push(still(6000))
    np.testing.assert_allclose(nav.attitude_t_p, (HALF, 0.0, 0.0, HALF), atol=1e-9)


def test_the_level_begins_anew_after_a_gap() -> None:
    nav = Navigator.start(**A50)
    tilted = (0.5 * GRAVITY, 0.0, -float(np.sqrt(0.75)) * GRAVITY)
    for k in range(300):
        nav.push(ImuReading(k * 10 * MS, NONE, tilted))
    for k in range(3000, 3501):
        nav.push(still(k))
        if k == 3499:
            nav.push(ping(k * 10 * MS))
    np.testing.assert_allclose(nav.attitude_t_p, (HALF, 0.0, 0.0, HALF), atol=1e-9)


RAGGED: Any = [[1.0], [1.0, 2.0], 3.0, 4.0]


@pytest.mark.parametrize("key", ["velocity_mps", "valid", "sd_mps", "range_m", "instrument_mps"])
@pytest.mark.parametrize("wrong", [RAGGED, ["a"] * 4, [0.5] * 2])
def test_a_ping_of_another_shape_is_refused_by_its_field(key: str, wrong: Any) -> None:  # noqa: ANN401
    expected = "x, y, z" if key == "instrument_mps" else "the DVL has 4 beams"
    with pytest.raises(bottomlock.KernelError, match=rf"Ping\.{key} .*{expected}"):
        Navigator.start(**A50).push(replace(ping(0), **{key: wrong}))
    with pytest.raises(bottomlock.KernelError, match=r"Ping\.of_beams"):
        Ping.of_beams(0, RAGGED)


def test_what_a_live_process_would_not_navigate_with_is_said() -> None:
    """Beams of 20 mm/s where the packaged instrument claims 4; pings of another clock than the IMU's."""
    noise, nav = np.random.default_rng(4), begun()
    assert nav.warnings == []
    for k in range(600, 1400):
        nav.push(still(k))
        if k % 10 == 9:
            one = ping(k * 10 * MS)
            nav.push(replace(one, velocity_mps=one.velocity_mps + 0.02 * noise.standard_normal(4)))
    assert any("times their claimed noise: raise dvl.beam_noise_mps" in words for words in nav.warnings)
    apart = Navigator.start(**A50)
    for k in range(501):
        apart.push(still(k))
    apart.push(ping(1_790_000_000_000_000_000))
    assert "+1.79e+09 s from the IMU's readings" in apart.waiting_for


def test_a_compass_that_jumps_is_said_while_it_lasts() -> None:
    """90 deg for three seconds after some that agreed: a warning from the first on, none once it agrees again."""
    nav = Navigator.start(**A50, attitude={"grade": "mti_ahrs", "aids": "attitude"})
    said = []
    for k in range(2000):
        nav.push(still(k))
        if k % 10 == 9:
            nav.push(ping(k * 10 * MS))
            half_rad = np.deg2rad(90.0 if 1400 <= k < 1700 else 45.0)
            nav.push(AttitudeReading(k * 10 * MS, (np.cos(half_rad), 0.0, 0.0, np.sin(half_rad))))
            said += [(k // 100, words) for words in nav.warnings]
    assert dict(said) == {
        15: "attitude has contradicted the estimate for 2 s",
        16: "attitude has contradicted the estimate for 3 s",
    }
