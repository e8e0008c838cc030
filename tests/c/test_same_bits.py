"""What Python pushes and what C pushes ends in the same bits: reports, estimate, covariance, all that is saved."""

import ctypes
import json
import threading
from typing import Any, cast

import numpy as np
import pytest

from bottomlock import imu, kernel, solve_velocity
from bottomlock.config.instrument_grades import grades
from bottomlock.io.beams import packaged_geometries, read_geometry
from bottomlock.kernel import BeamGeometry, Navigator, Report, models
from bottomlock.kernel.models import InitialState, Model, Options
from tests.c.navigator import CError, CLibrary, CNavigator, floats
from tests.property import settings

VERDICTS = ("accepted", "accepted_in_part", "rejected", "no_information", "withheld")
JANUS_20 = read_geometry("x_janus_20").geometry


def same_report(ours: Any, theirs: Report) -> None:  # noqa: ANN401 - a structure of the header
    """A report of C is that of Python, to the last bit."""
    rows = ours.rows
    assert ours.sensor.decode() == theirs.sensor
    assert (ours.time_ns, VERDICTS[ours.verdict]) == (theirs.time_ns, theirs.verdict)
    assert bool(ours.revised) == theirs.revised
    assert (ours.nis, ours.threshold, ours.degrees) == (theirs.nis, theirs.threshold, theirs.degrees)
    np.testing.assert_array_equal(ours.residual[:rows], theirs.residual)
    np.testing.assert_array_equal(np.array(ours.covariance)[:rows, :rows], theirs.covariance)
    np.testing.assert_array_equal(np.array(ours.rejected_rows[:rows], dtype=bool), theirs.rejected_rows)
    assert (ours.inflation, ours.charged_to_sensor) == (theirs.inflation or 1.0, theirs.charged_to_sensor)
    assert bool(ours.beyond_linear_range) == theirs.beyond_linear_range
    assert ours.reason.decode() == (theirs.reason or "")
    weight = theirs.beam_weight
    assert bool(ours.has_beam_weight) == (weight is not None)
    if weight is not None:
        np.testing.assert_array_equal(ours.beam_weight[: len(weight)], weight)
    choice = theirs.choice or {}
    assert list(ours.component_source) == [choice.get(axis, 0) for axis in ("surge", "sway", "heave")]


def same(ours: CNavigator, theirs: Navigator) -> None:
    """Estimates and all that is saved are the same bits."""
    expected = theirs.state()
    for name, value in ours.state().items():
        given = value if isinstance(value, int | float) else list(value)
        np.testing.assert_array_equal(given, expected[name])  # type: ignore[literal-required]
    assert ours.covariance().tobytes() == np.ascontiguousarray(theirs.covariance()).tobytes()
    assert ours.save() == theirs.save()


class Both:
    """Pushes into both; the same reports, or the same error in the same words."""

    def __init__(self, ours: CNavigator, theirs: Navigator) -> None:
        self._ours, self._theirs = ours, theirs
        self.errors = 0

    def __call__(self, name: str, *arguments: Any, **keywords: Any) -> None:  # noqa: ANN401 - as the push takes them
        """One push."""
        told, words = self._of_python(name, *arguments, **keywords)
        push_c = getattr(self._ours, f"push_{name}")
        if words is not None:
            self.errors += 1
            with pytest.raises(CError) as caught:
                push_c(*arguments, **keywords)
            assert str(caught.value) == words
            return
        for one, other in zip(push_c(*arguments, **keywords), told, strict=True):
            same_report(one, other)

    def _of_python(self, name: str, *arguments: Any, **keywords: Any) -> tuple[Any, str | None]:  # noqa: ANN401
        try:
            return getattr(self._theirs, f"push_{name}")(*arguments, **keywords), None
        except kernel.KernelError as error:
            return None, str(error)


def _push_all(both: Both, step: int, random: np.random.Generator) -> None:
    """A reading of the IMU, and in turn of every other sensor; a dozen of fifty steps push what is late or bad."""
    t = step * 10_000_000
    late = t - 120_000_000
    omega, force = random.normal(0, 1e-3, 3), random.normal(0, 1e-2, 3) - (0, 0, settings.GRAVITY)
    reading: Any = {"omega_p_radps": omega, "force_p_mps2": force}
    noisy = JANUS_20.directions_p @ (1.0, 0.1, 0.0) + random.normal(0, 0.02, 4)
    valid, sd = random.random(4) < 0.7, np.full(4, 0.02)
    depth, yaw = random.normal(0, 0.02), random.normal(0, 0.05)
    both("imu", t, omega_p_radps=omega, force_p_mps2=force if step % 400 else force * 1e4)
    pushes: dict[int, tuple[str, tuple[Any, ...], dict[str, Any]]] = {
        1: ("beams", (late, noisy, valid), {"sd_mps": sd}),
        5: ("water_track", (t, noisy - 0.1, valid), {"sd_mps": sd, "range_m": 5.0}),
        9: ("depth", (t, depth), {"sd_m": 0.02}),
        11: ("thrust", (late, 3.0 * omega + (1.0 + depth, 0.1, 0.0)), {"sd_mps": 0.05}),
        13: ("heading", (late, yaw), {"sd_rad": 0.1}),
        17: ("attitude", (t, (1, 0, 0, 0)), {"roll_pitch_sd_rad": 0.02, "yaw_sd_rad": 0.1}),
        21: ("gps", (t, (0, 0, 0), (1, 0, 0)), {"position_sd_m": (2, 2, 2), "velocity_sd_mps": (1, 1, 1)}),
        25: ("position", (t + 1, (1, 0, 0)), {"position_sd_m": (2, 2, 2)}),
        29: ("acoustic_position", (), {"time_ns": t, "position_t_m": (1, 1, 0), "sd_m": (3, 3, 3)}),
        33: ("velocity", (t, (1, 0.1, 0)), {"cov_m2ps2": np.eye(3) * 0.01}),
        36: ("beams", (t, noisy * np.nan, [True] * 4), {"sd_mps": sd}),
        37: ("depth", (t - 5_000_000_000, 0.0), {"sd_m": 0.02}),
        38: ("depth", (t, 0.0), {"sd_m": -1.0}),
        39: ("imu", (t,), reading),
        40: ("heading", (t + 10**13, 0.0), {"sd_rad": 0.1}),
        41: ("attitude", (t, (1, 1, 0, 0)), {"roll_pitch_sd_rad": 0.02, "yaw_sd_rad": 0.1}),
        42: ("acoustic_position", (), {"time_ns": t, "position_t_m": (1, 1, 0)}),
    }
    if step % 50 in pushes:
        name, arguments, keywords = pushes[step % 50]
        both(name, *arguments, **keywords)


def test_every_sensor(c: CLibrary) -> None:
    """Pushes of every kind, late and bad ones among them; the same errors in the same words."""
    layers = models.CurrentLayers(sd_mps=0.1, time_s=3600.0, way_m=500.0)
    calibration = models.Calibration(mounting_sd_rad=(0.01, 0.01, 0.02), clock_sd_s=0.02)
    errors = settings.table_2()
    errors["magnetometer"] |= {"yaw_offset_sd_rad": 0.05, "roll_pitch_walk_sd_rad": 0.01}
    errors["heading"] |= {"offset_sd_rad": 0.05, "walk_sd_rad": 0.02, "walk_time_s": 100.0}
    errors["thrust"] = models.ThrustModel(scale_sd=(0.1, 0.1, 0.0), slip_sd_mps=(0.02, 0.03, 0.0))
    model = Model(**errors)
    options = Options(water_track=True, thrust="velocity", current_layers=layers, calibration=calibration)
    start = InitialState(
        time_ns=0, position_t_m=(0, 0, 0), attitude_t_p=(1, 0, 0, 0), velocity_p_mps=(1.0, 0.1, 0.0)
    )
    theirs = Navigator(JANUS_20, model, options, start, method="sway_current")
    ours = CNavigator(c, JANUS_20.directions_p, model, options, start, "sway_current")
    random = np.random.default_rng(7)
    both = Both(ours, theirs)
    for step in range(1, 1500):
        _push_all(both, step, random)
    assert both.errors > 100
    same(ours, theirs)
    _same_estimates(c, ours, theirs)
    ours.free()


def _same_estimates(c: CLibrary, ours: CNavigator, theirs: Navigator) -> None:
    """What is estimated beside the state, and the counts."""
    count = ctypes.c_size_t()
    for kind in ("water", "thrust", "calibration"):
        one, expected = c.structure(kind), cast(Any, getattr(theirs, kind)())
        c(f"navigator_{kind}", ours.pointer, one)
        for name, *_ in one._fields_:
            np.testing.assert_array_equal(np.array(getattr(one, name)), expected[name], err_msg=name)
    expected = cast(Any, theirs.water())
    layers = (c.header.structures["bl_layer"] * 64)()
    c("navigator_layers", ours.pointer, ctypes.addressof(layers), 64, ctypes.addressof(count))
    assert count.value == len(expected["layers"]["depth_m"]) > 0
    for name, *_ in layers[0]._fields_:
        found = [np.array(getattr(layer, name)) for layer in layers[: count.value]]
        np.testing.assert_array_equal(found, expected["layers"][name], err_msg=name)
    for name, size in (("attitude_error", 3), ("heading_error", 1)):
        error, sd = np.zeros(size), np.zeros(size)
        c(f"navigator_{name}", ours.pointer, error, sd)
        expected = getattr(theirs, name)()
        np.testing.assert_array_equal([error, sd], [expected["error_rad"], expected["sd_rad"]])
        assert error.any()
    for name, names in (("late_events", "stream_name"), ("imu_faults", "imu_fault_name")):
        counts: dict[str, int] = getattr(theirs, name)()
        numbers = np.zeros(32, dtype=np.uint64)
        c(f"navigator_{name}", ours.pointer, numbers, 32, ctypes.addressof(count))
        assert dict(zip(c.names(names), numbers[: count.value].tolist(), strict=True)) == counts
        assert sum(counts.values()) > 0


@pytest.mark.parametrize("name", packaged_geometries())
def test_packaged_geometries(c: CLibrary, name: str) -> None:
    """The same names and beams; the one of a log's own signs is for that log alone."""
    if name == "linkquest_caves":
        with pytest.raises(CError, match="unknown geometry"):
            c("geometry_from_json", json.dumps({"preset": name}))
        return
    assert name in c.names("geometry_preset_name")
    expected = read_geometry(name).geometry.directions_p
    geometry = c("geometry_from_json", json.dumps({"preset": name}))
    for beam, direction in enumerate(expected):
        found = np.zeros(3)
        c("geometry_direction", geometry, beam, found)
        np.testing.assert_array_equal(found, direction)
    assert c("geometry_beams", geometry) == len(expected)
    c("geometry_free", geometry)


def test_names_are_those_of_the_package(c: CLibrary) -> None:
    assert sorted(c.names("geometry_preset_name")) == sorted(set(packaged_geometries()) - {"linkquest_caves"})
    assert c.names("method_name") == list(kernel.METHODS)


def test_packaged_grades(c: CLibrary) -> None:
    """A preset has the IMU of its grade, to the last bit; normal gravity; and what all presets share for the rest."""
    names = c.names("model_preset_name")
    assert names == [*grades("imu"), "table_2"]
    paper = c("model_from_json", '{"preset": "table_2", "latitude_rad": 0.7}')
    for name in names:
        model = c("model_from_json", json.dumps({"preset": name, "latitude_rad": 0.7}))
        expected = c.json("model", paper)
        if name != "table_2":
            expected["imu"] = imu(name).as_dict()
        assert c.json("model", model) == expected
        assert expected["environment"]["gravity_mps2"] == kernel.normal_gravity_mps2(0.7)
        c("model_free", model)
    c("model_free", paper)


def test_json_keeps_every_value(c: CLibrary) -> None:
    """What Python writes C reads and writes again to the last bit, sensors that are left out too."""
    options = c("options_from_json", "{}")
    assert c.json("options", options) == kernel.DEFAULT_OPTIONS
    c("options_set", options, '{"water": {"slip_time_s": 0.1234567890123456789}}')
    assert c.json("options", options)["water"]["slip_time_s"] == 0.1234567890123456789
    c("options_free", options)
    given = json.loads(json.dumps(Model(**settings.table_2()).as_dict()))
    model = c("model_from_json", json.dumps(given))
    assert c.json("model", model) == given
    c("model_free", model)


def test_geometries_are_those_of_the_package(c: CLibrary) -> None:
    """Every way to state beams, with a mounting and lever arms, to the last bit."""
    mounting, scale = [0.1, -0.2, 0.3], 1.01
    directions = JANUS_20.directions_p
    angles: Any = ([0.4, 0.5, 0.6], [0.0, 2.0, 4.0])
    further: Any = {"mounting_rpy_rad": mounting, "sound_speed_scale": scale}
    for beams, ways in (
        ({"configuration": "+", "tilt_rad": 0.4}, BeamGeometry.janus(0.4, configuration="+", **further)),
        ({"configuration": "x", "tilt_rad": 0.4}, BeamGeometry.janus(0.4, **further)),
        ({"tilts_rad": angles[0], "azimuths_rad": angles[1]}, BeamGeometry.from_angles(*angles, **further)),
        ({"directions_d": directions.tolist()}, BeamGeometry(directions, **further)),
    ):
        given = beams | {"roll_pitch_yaw_rad": mounting, "sound_speed_scale": scale}
        geometry = c("geometry_from_json", json.dumps(given))
        for beam, direction in enumerate(ways.directions_p):
            found = np.zeros(3)
            c("geometry_direction", geometry, beam, found)
            np.testing.assert_array_equal(found, direction)
        c("geometry_free", geometry)


def test_a_navigator_in_one_call(c: CLibrary) -> None:
    """From one text of JSON: the saved bytes are Python's, with every part of it and with the defaults."""
    geometry = {"directions_d": JANUS_20.directions_p.tolist()}
    levers = np.arange(12.0).reshape(4, 3) / 10
    model, options = Model(**settings.table_2()), Options(water_track=True)
    start: Any = {
        "time_ns": 7,
        "position_t_m": (1, 2, 3),
        "attitude_t_p": (1, 0, 0, 0),
        "velocity_p_mps": (1, 0, 0),
    }
    given = {
        "geometry": geometry | {"lever_arms_p_m": levers.tolist(), "sound_speed_scale": 1.01},
        "model": model.as_dict(),
        "options": {"water_track": True},
        "start": start,
        "method": "sway_current",
        "horizon_ns": 10**9,
    }
    at_rest = {"time_ns": 0, "position_t_m": (0, 0, 0), "velocity_p_mps": (0, 0, 0)}
    mounted = BeamGeometry(JANUS_20.directions_p, lever_arms_p_m=levers, sound_speed_scale=1.01)
    expected = Navigator(mounted, model, options, start, method="sway_current", horizon_ns=10**9)
    for text, theirs in (
        (given, expected),
        (
            {"geometry": geometry, "model": model.as_dict()},
            Navigator(JANUS_20, model, Options(), start | at_rest),
        ),
    ):
        ours = CNavigator.of(c, c("navigator_from_json", json.dumps(text)))
        same(ours, theirs)
        ours.free()


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"modle": {}}, "navigator.modle", "did you mean 'model'"),
        ({"model": None}, "model", "expected a table"),
        ({"model": {"preset": "tactical"}}, "latitude_rad", "expected a number"),
        ({"model": {"preset": "tactcal", "latitude_rad": 0.5}}, "model.preset", "did you mean 'tactical'"),
        ({"model": {"preset": "mti", "latitude_rad": 0.5, "dvl": {"nois": 1}}}, "dvl.nois", "unknown"),
        ({"options": {"water": {"slip_tme_s": 5.0}}}, "options.water.slip_tme_s", "slip_time_s"),
        ({"geometry": {"preset": "a50"}}, "geometry.preset", "waterlinked_a50"),
        ({"geometry": {"preset": "teledyne_20", "tilt_rad": 0.4}}, "geometry", "expected once"),
        ({"geometry": {"configuration": "y", "tilt_rad": 0.4}}, "geometry.configuration", "'x' or '+'"),
        ({"geometry": {"directions_d": [[1, 0]]}}, "geometry.directions_d[0]", "expected 3 numbers"),
        (
            {"geometry": {"preset": "teledyne_20", "roll_pitch_yaw_rad": [0, 0, 45]}},
            "geometry.roll_pitch_yaw_rad",
            "degrees",
        ),
        ({"start": {"attitude_t_p": [1, 1, 0, 0]}}, "start.attitude_t_p", "norm"),
        ({"start": {"velocity_mps": [1, 1, 0]}}, "start.velocity_mps", "did you mean 'velocity_p_mps'"),
        ({"start": []}, "start", "a table of settings"),
        ({"method": "tight"}, "method", "unknown"),
        ({"horizon_ns": -1}, "horizon_ns", ""),
        ({"horizon_ns": 0.5}, "navigator.horizon_ns", "a whole number"),
    ],
)
def test_a_navigator_that_is_refused(c: CLibrary, change: dict[str, Any], key: str, words: str) -> None:
    """The key of what is wrong, and what was expected."""
    given = {"geometry": {"preset": "x_janus_20"}, "model": {"preset": "tactical", "latitude_rad": 0.5}}
    ours = c("navigator_from_json", json.dumps(given))
    c("navigator_free", ours)
    with pytest.raises(CError) as caught:
        c("navigator_from_json", json.dumps(given | change))
    assert c("last_error_key").decode() == key
    assert words in str(caught.value)


def test_one_ping(c: CLibrary) -> None:
    """Every method and mask of beams, with and without a prior."""
    random = np.random.default_rng(3)
    geometry = c.geometry(JANUS_20.directions_p)
    methods = (
        "least_squares virtual_beam nullified_sway partial_loose virtual_heave selector information weak_sway"
    )
    for method in methods.split():
        for mask in range(16):
            velocity, valid = (
                random.normal(0, 1, 4),
                np.array([mask >> k & 1 for k in range(4)], dtype=np.uint8),
            )
            prior = (np.array([1.0, 0.0, 0.0]), np.eye(3) * 0.1) if mask % 2 else (None, None)
            found = c.structure("velocity")
            sd_mps = floats([0.02] * 4)
            c("solve_velocity", geometry, method, 4, velocity, valid, sd_mps, *prior, None, None, found)
            of_ping: Any = {
                "prior_velocity_p_mps": None if prior[0] is None else prior[0][None],
                "prior_cov_m2ps2": None if prior[1] is None else prior[1][None],
            }
            flags: Any = valid[None].astype(bool)
            expected = solve_velocity(
                JANUS_20, velocity[None], flags, method=method, beam_sd_mps=sd_mps, **of_ping,  # type: ignore[arg-type]
            )  # fmt: skip
            for name in (
                "velocity_p_mps", "cov_m2ps2", "observed_velocity_p_mps", "information_s2pm2", "component", "source",
            ):  # fmt: skip
                np.testing.assert_array_equal(
                    np.array(getattr(found, name)), getattr(expected, name)[0], err_msg=name
                )
            assert (found.fix, found.rank) == (expected.status[0], expected.rank[0])
    c("geometry_free", geometry)


def test_threads_read_while_one_pushes(c: CLibrary) -> None:
    """Readers take turns with the pushes and change nothing."""
    start = InitialState(
        time_ns=0, position_t_m=(0, 0, 0), attitude_t_p=(1, 0, 0, 0), velocity_p_mps=(0.0, 0.0, 0.0)
    )
    model, options = Model(**settings.table_2()), Options()
    theirs = Navigator(JANUS_20, model, options, start, method="tc")
    ours = CNavigator(c, JANUS_20.directions_p, model, options, start, "tc")
    done, reads = threading.Event(), [0, 0]

    def read(number: int) -> None:
        while not done.is_set():
            assert np.isfinite(ours.covariance()).all()
            assert ours.state()["time_ns"] >= 0
            reads[number] += 1

    readers = [threading.Thread(target=read, args=(number,)) for number in range(2)]
    for reader in readers:
        reader.start()
    reading: Any = {"omega_p_radps": (0.0, 0, 0), "force_p_mps2": (0, 0, -settings.GRAVITY)}
    for step in range(1, 2000):
        ours.push_imu(step * 10_000_000, **reading)
        theirs.push_imu(step * 10_000_000, **reading)
    done.set()
    for reader in readers:
        reader.join()
    assert min(reads) > 0
    same(ours, theirs)
    ours.free()
