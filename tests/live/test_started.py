"""`Navigator.start`: names in place of settings, a start that is found by itself, readings one at a time."""

import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock import DepthReading, ImuReading, Navigator, Ping, own_method
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


def test_a_vehicle_that_dives_while_it_is_levelled() -> None:
    """The tutorial's four rejected pings, and none where the level is said to be good to 2 degrees."""
    log = bottomlock.open_log(DIVE)
    readings = [one for one in log if one.time_ns < log.streams.inertial.time_ns[0] + 60_000 * MS]

    def rejected(**sections: Any) -> list[str]:  # noqa: ANN401 - of any section
        nav = Navigator.start(
            dvl=log.instrument,
            imu="fibre_optic",
            latitude_deg=log.latitude_deg,
            heading_deg=-10.1,
            method="tc",
            **sections,
        )
        reports = (report for reading in readings for report in nav.push(reading))
        begins_ns = log.streams.inertial.time_ns[0]
        return [
            f"{report.sensor} {(report.time_ns - begins_ns) / 1e9:.0f} s"
            for report in reports
            if report.verdict == "rejected"
        ]

    assert rejected() == ["beams 10 s", "beams 11 s", "beams 12 s", "beams 13 s"]
    assert rejected(start={"level_sd_deg": 2.0}) == []


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


def test_a_model_and_a_name_are_the_same_bits() -> None:
    by_name, by_model = begun(imu="mti"), begun(imu=imu("mti"))
    assert by_name.navigator is not None
    assert by_model.navigator is not None
    assert by_name.navigator.save() == by_model.navigator.save()


def test_the_dvl_by_its_instrument_or_its_keys() -> None:
    nav = begun(dvl={"geometry": "waterlinked_a50", "beam_noise_mps": 0.5})
    assert (nav.velocity_sd_mps > begun(dvl=read_geometry("waterlinked_a50")).velocity_sd_mps).all()


def test_what_it_waits_for() -> None:
    """In words, in place of an estimate."""
    nav = Navigator.start(**A50)
    assert repr(nav) == "<Navigator that waits for inertial readings>"
    with pytest.raises(
        bottomlock.KernelError, match="no estimate yet: the start waits for inertial readings"
    ):
        _ = nav.velocity_p_mps
    for k in range(501):
        assert nav.push(still(k)) == []
    assert nav.waiting_for == "a ping that determines the whole velocity"
    nav.push(ping(5000 * MS))
    nav.push(still(501))
    assert nav.waiting_for == ""
    assert "position" in repr(nav)


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
    assert sensors == {"attitude", "gps_position", "acoustic_position", "thrust", "water_track"}
    assert not nav.unused


def test_a_refused_reading_changes_nothing() -> None:
    """During the alignment and after it."""
    for readings in (300, 600):
        nav, other = begun(readings), begun(readings)
        refused: list[tuple[Any, str]] = [
            (still(readings - 1), f"its time does not rise: {(readings - 1) * 10 * MS} ns"),
            (ImuReading(readings * 10 * MS, (float("nan"),) * 3, (0.0, 0.0, -GRAVITY)), "finite"),
        ]
        if readings == 600:
            refused.append((Ping.of_beams(5900 * MS, [1.0, 2.0]), "shape"))
        for reading, why in refused:
            with pytest.raises(bottomlock.KernelError, match=why):
                nav.push(reading)
        for one in (nav, other):
            for k in range(readings, readings + 300):
                one.push(still(k))
                if k % 50 == 49:
                    one.push(ping(k * 10 * MS))
        assert nav.navigator is not None
        assert other.navigator is not None
        assert nav.navigator.save() == other.navigator.save()


@pytest.mark.parametrize(
    ("given", "shown"),
    [({"time_ns": 0}, "a dict"), (None, "a NoneType"), (ImuReading, "the class ImuReading")],
)
def test_what_is_no_reading_is_named(given: object, shown: str) -> None:
    with pytest.raises(
        TypeError, match=f"push is given {shown}, expected a reading such as ImuReading or Ping"
    ):
        ANY.Navigator.start(**A50).push(given)


ALL: dict[str, Any] = {
    "attitude": {"grade": "mti_ahrs", "aids": "heading"},
    "gps": {},
    "origin": {"longitude_deg": 10.0},
    "acoustic_position": {},
    "thrust": {"advance_m": 0.3},
}
AT, HALF = 6000 * MS, float(np.sqrt(0.5))
NONE, FORCE = (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY)
ANY: Any = bottomlock
"""Whose classes take what a type checker refuses."""
FAULTY: list[tuple[Any, str]] = [
    (
        ANY.ImuReading(6.0, NONE, FORCE),
        r"ImuReading.time_ns is 6.0, expected whole nanoseconds: of seconds, round",
    ),
    (ANY.ImuReading(float(AT), NONE, FORCE), "expected whole nanoseconds"),
    (ANY.ImuReading(np.datetime64("2026-01-01"), NONE, FORCE), "datetime64.*expected whole nanoseconds$"),
    (ANY.ImuReading(None, NONE, FORCE), "time_ns is None"),
    (ANY.ImuReading(10**19, NONE, FORCE), "expected nanoseconds in 64 bits"),
    (ANY.ImuReading(AT, (0.0, 0.0), FORCE), r"omega_radps is \(0.0, 0.0\), expected 3 numbers, rad/s"),
    (ANY.ImuReading(AT, NONE, None), "force_mps2 is None, expected 3 numbers"),
    (ANY.ImuReading(AT, np.zeros((3, 1)), FORCE), r"omega_radps is array\(\[\[0.\], \[0.\], \[0.\]\]\)"),
    (ANY.ImuReading(AT, ("1", "2", "3"), FORCE), "expected 3 numbers"),
    (ANY.ImuReading(AT, NONE, (0.0, 0.0, float("inf"))), "expected finite numbers, m/s²"),
    (ANY.Ping.of_beams(AT, [0.0, 0.0, 0.0]), r"velocity_mps has shape \(3,\), expected \(4,\)"),
    (ANY.Ping.of_beams(6.0, [0.0] * 4), "Ping.time_ns is 6.0"),
    (ANY.DepthReading(AT, float("nan")), "depth_m is nan, expected finite"),
    (ANY.DepthReading(AT, "30"), "depth_m is '30', expected a number, m"),
    (ANY.DepthReading(AT, np.array([30.0])), "expected a number, m"),
    (ANY.AttitudeReading(AT, NONE), "expected 4 numbers, a quaternion"),
    (ANY.AttitudeReading(AT, (0.0, 0.0, 0.0, 0.0)), "expected a quaternion of unit length"),
    (
        ANY.GpsReading(AT, 154.0, 10.0, 0.0),
        "latitude 154.0, longitude 10.0, expected degrees, latitude first",
    ),
    (ANY.GpsReading(AT, 54.0, 10.0, None), "height_m is None"),
    (
        ANY.AcousticPositionReading(AT, NONE, 1.0),
        "sd_m is 1.0, expected 3 numbers, m of each axis, or None",
    ),
    (ANY.ThrustReading(AT, "x"), "revolutions_hz is 'x', expected a number, 1/s"),
]


@pytest.mark.parametrize("readings", [300, 600])
@pytest.mark.parametrize(("faulty", "why"), FAULTY)
def test_a_faulty_reading_is_named_and_changes_nothing(readings: int, faulty: Any, why: str) -> None:  # noqa: ANN401
    """Of our own errors, during the alignment and after it; the navigation goes on as without it."""
    nav, other = begun(readings, **ALL), begun(readings, **ALL)
    with pytest.raises(bottomlock.KernelError, match=why):
        nav.push(faulty)
    for one in (nav, other):
        for k in range(readings, 610):
            one.push(still(k))
            if k % 50 == 49:
                one.push(ping(k * 10 * MS))
    assert nav.navigator is not None
    assert other.navigator is not None
    assert nav.navigator.save() == other.navigator.save()
    assert nav.unused == other.unused


def test_numbers_of_numpy_are_numbers() -> None:
    """Times, scalars and arrays as a program has them: the same bits."""
    plain, of_numpy = begun(600), begun(600)
    for k in range(600, 700):
        reading = still(k)
        plain.push(reading)
        of_numpy.push(ANY.ImuReading(np.int64(reading.time_ns), np.zeros(3), list(reading.force_mps2)))
    plain.push(DepthReading(6990 * MS, 30.5))
    of_numpy.push(ANY.DepthReading(np.int64(6990 * MS), np.float32(30.5)))
    assert plain.navigator is not None
    assert of_numpy.navigator is not None
    assert plain.navigator.save() == of_numpy.navigator.save()


def test_what_no_section_uses_is_counted_as_it_is() -> None:
    """A height that a log does not have is no fault where positions are not used."""
    nav = Navigator.start(**A50)
    assert nav.push(bottomlock.GpsReading(0, 54.0, 10.0, float("nan"))) == []
    assert nav.unused == {"GpsReading without section gps": 1}


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
    np.testing.assert_allclose(sd_mps, begun(method="ins").velocity_sd_mps, rtol=1e-8)
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


def test_times_in_ms_are_asked_about() -> None:
    """100 Hz in ms: after 10 s the window is still that of a microsecond."""
    nav = Navigator.start(**A50)
    for k in range(1000):
        nav.push(ImuReading(k * 10, NONE, FORCE))
    assert nav.waiting_for == "the alignment, 0 of 5 s after 1000 inertial readings: are their times in ns?"


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


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"dvl": "waterlinked_a5"}, "did you mean 'waterlinked_a50'"),
        ({"imu": "tacticle"}, "Navigator.start: imu: grade is 'tacticle', did you mean 'tactical'"),
        ({"method": "tcc"}, "method is 'tcc', did you mean 'tc'"),
        ({"method": "dead_reckoning"}, "method is 'dead_reckoning' \\(known"),
        ({"method": "nothing.py:None_"}, "Navigator.start: method 'nothing.py:None_'"),
        ({"dvl": None}, "dvl is None, expected a packaged geometry's name"),
        ({"dvl": bottomlock.BeamGeometry.janus(0.5)}, "dvl is of type BeamGeometry, expected"),
        ({"dvl": Path(__file__).parent}, "is a folder, expected a TOML file"),
        ({"imu": None}, "imu is None, expected a grade's name"),
        ({"imu": bottomlock.ImuModel}, "imu is the class ImuModel, expected"),
        ({"heading_sd_deg": 0.0}, "'start.heading_sd_deg' is 0.0, expected > 0.0 deg"),
        (
            {"start": {"heading_deg": 10.0}},
            "'start.heading_deg' is given, expected the argument heading_deg alone",
        ),
        (
            {"start": {"heading_sd_deg": 1.0}, "heading_sd_deg": 2.0},
            "expected the argument heading_sd_deg alone",
        ),
        ({"origin": {"latitude_deg": 10.0}}, "expected the argument latitude_deg alone"),
        ({"navigation": {"method": "lc"}}, "expected the argument method alone"),
        ({"start": 5.0}, "start is 5.0, expected keys of \\[start\\]"),
        ({"horizon_s": 3.0}, "'horizon_s' is a key of \\[navigation\\]"),
        ({"latitude_deg": 91.0}, "'origin.latitude_deg' is 91.0, expected <= 90.0 deg"),
        ({"heading_deg": None}, "'start.heading_deg' is missing"),
        ({"heading_sd_deg": -1.0}, "'start.heading_sd_deg' is -1.0"),
        ({"depht": {}}, "unknown key 'depht', did you mean 'depth'"),
        ({"depth": {"sd": 0.1}}, "unknown key 'depth.sd', did you mean 'sd_m'"),
        ({"gps": {"position_sd_m": (1.0, 1.0, 1.0)}}, "'origin.longitude_deg' is missing"),
        (
            {"imu": {"source": "attitude", "accel_noise_mps_per_rt_h": 1.0}},
            "needs the section \\[attitude\\]",
        ),
    ],
)
def test_a_mistake_is_named(settings: dict[str, Any], why: str) -> None:
    with pytest.raises(bottomlock.ScenarioError, match=why):
        Navigator.start(**A50 | settings)
