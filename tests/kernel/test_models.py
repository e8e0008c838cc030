"""Settings of the kernel: checked keys and values, and nothing that is given vanishes."""

import copy
import json
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import DEFAULT_OPTIONS, BeamGeometry, KernelError, models
from tests.property import settings

JANUS = BeamGeometry.janus(np.deg2rad(20.0))
MODEL = load_scenario("survey").kernel_model(9.8)
OPTIONS = load_scenario("survey").kernel_options()
STATE = models.InitialState(
    time_ns=0, position_t_m=[0, 0, 0], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[2, 0, 0]
)
SECTIONS = [value for value in vars(MODEL).values() if value is not None]
ALL = [MODEL, *SECTIONS, OPTIONS, OPTIONS.water, models.Robust(), STATE]


def name_of(value: models.Settings) -> str:
    return type(value).__name__


@pytest.mark.parametrize("value", ALL, ids=name_of)
def test_settings_are_values(value: models.Settings) -> None:
    """Equal after a round trip by dict, pickle and copy; frozen; and shown as the call that makes them."""
    assert type(value)(**value.as_dict()) == value
    assert pickle.loads(pickle.dumps(value)) == value == copy.deepcopy(value)
    assert hash(value) == hash(copy.copy(value))
    assert eval(repr(value), vars(models)) == value
    first = next(iter(value.as_dict()))
    with pytest.raises(ValidationError, match="frozen"):
        setattr(value, first, None)


@pytest.mark.parametrize("value", ALL, ids=name_of)
def test_an_unknown_key_names_the_nearest(value: models.Settings) -> None:
    """In Python, and in the kernel where a dict with the same keys comes in."""
    key = next(iter(value.as_dict()))
    wrong = key[:1] + key
    calls = (
        lambda: value.replace(**{wrong: 1.0}),
        lambda: kernel.check_settings(value.place, value.as_dict() | {wrong: 1.0}),
    )
    for call in calls:
        with pytest.raises(KernelError, match=wrong) as caught:
            call()
        assert f"did you mean '{key}'" in str(caught.value)
        if value is not STATE:
            path = wrong if value is MODEL else f"{value.place}.{wrong}"
            assert (caught.value.key, caught.value.hint) == (path, f"did you mean '{key}'?")


def bounds() -> Iterator[tuple[models.Settings, str, float, bool]]:
    """Of every stated bound: settings, key, the bound, and whether it is itself allowed."""
    for value in (OPTIONS, OPTIONS.water, OPTIONS.motion, OPTIONS.current_layers, OPTIONS.assumptions):
        for key, field in type(value).model_fields.items():
            for one in field.metadata:
                for name in ("gt", "ge", "lt", "le"):
                    if hasattr(one, name):
                        yield value, key, getattr(one, name), name in {"ge", "le"}


def test_stated_bounds_are_the_kernels() -> None:
    """A bound that excludes its value is refused there; one that allows it is taken, and refused a step beyond."""
    count = 0
    for value, key, bound, allowed in bounds():
        beyond = [bound] if not allowed else [bound - 1] if bound < 1e6 else []
        if allowed:
            value.replace(**{key: bound})
        for wrong in beyond:
            with pytest.raises(KernelError, match=key):
                value.replace(**{key: wrong})
        count += 1
    assert count > 15


def test_values_are_checked_by_the_kernels_rules() -> None:
    """What Python's types become; the rules by key are in settings_tests.rs."""
    for section, change, key, found, expected in (
        (MODEL.imu, {"gyro_bias_sd_radps": -1.0}, "imu.gyro_bias_sd_radps", "-1", ">= 0"),
        (MODEL.imu, {"gyro_bias_sd_radps": "3"}, "imu.gyro_bias_sd_radps", "'3'", "a number"),
        (MODEL.imu, {"gyro_bias_sd_radps": True}, "imu.gyro_bias_sd_radps", "true", "a number"),
        (MODEL.initial, {"position_sd_m": [1.0, 2.0]}, "initial.position_sd_m", "2 values", "3 numbers"),
        (MODEL.initial, {"position_sd_m": [True, 1, 1]}, "initial.position_sd_m[0]", "true", "a number"),
        (MODEL, {"imu": None}, "imu", "none", "a table"),
        (OPTIONS, {"levers": {"gps_p_m": [np.nan, 0, 0]}}, "options.levers.gps_p_m", "NaN", "metres"),
        (OPTIONS, {"water": [0.1, 600.0]}, "options.water", "a list", "a table"),
    ):
        with pytest.raises(KernelError, match=key.replace("[", r"\[")) as caught:
            section.replace(**change)
        assert caught.value.key == key
        assert f"is {found}" in str(caught.value) or f"has {found}" in str(caught.value)
        assert expected in caught.value.expected
    with pytest.raises(KernelError, match=r"time_ns is 1.5, expected an integer.*seconds"):
        STATE.replace(time_ns=1.5)
    with pytest.raises(KernelError, match="missing") as caught:
        models.GpsModel(position_sd_m=[1, 1, 1])  # type: ignore[call-arg]
    assert caught.value.key == "gps.velocity_sd_mps"


def test_defaults_are_the_kernels() -> None:
    """Every option of the kernel is an option here, with the same default."""
    assert models.Options(**DEFAULT_OPTIONS) == models.Options()
    assert json.loads(json.dumps(models.Options().as_dict())) == DEFAULT_OPTIONS
    assert repr(models.Options()) == "Options()"
    assert models.Environment(latitude_rad=0.5, gravity_mps2=9.8).earth_rate_radps == kernel.EARTH_RATE_RADPS


def test_only_what_there_is_is_stated() -> None:
    """Sensors are None, gravity is normal gravity, the start is the origin; a push names the section that it needs."""
    place = models.Environment(latitude_rad=0.57)
    assert place == models.Environment(latitude_rad=0.57, gravity_mps2=kernel.normal_gravity_mps2(0.57))
    assert place.replace(gravity_mps2=None).gravity_mps2 == place.gravity_mps2
    assert models.Environment(**place.as_dict()) == place
    for wrong, message in (
        (32.8, "32.8, expected .*radians"),
        ("a", "'a', expected"),
        (None, "none, expected"),
    ):
        with pytest.raises(KernelError, match=f"environment.latitude_rad is {message}"):
            models.Environment(latitude_rad=wrong)  # type: ignore[arg-type]
    bare = models.Model(environment=place, imu=MODEL.imu, initial=MODEL.initial)
    assert [name for name, value in vars(bare).items() if value is not None] == [
        "environment",
        "imu",
        "initial",
    ]
    for part in ("environment", "imu", "initial"):
        given = {name: value for name, value in vars(bare).items() if value is not None and name != part}
        with pytest.raises(KernelError, match=f"model.{part} is missing"):
            models.Model(**given)
    start = models.InitialState(time_ns=0, attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[0, 0, 0])
    assert start.position_t_m == (0.0, 0.0, 0.0)
    navigator = kernel.Navigator(JANUS, bare, models.Options(), start)
    navigator.push_imu(0, omega_p_radps=[0, 0, 0], force_p_mps2=[0, 0, -place.gravity_mps2])
    with pytest.raises(
        KernelError,
        match=r'options\.thrust is "off", expected .* with model\.thrust',
    ):
        navigator.push_thrust(1, [1.0, 0, 0], sd_mps=0.1)
    acoustic = models.AcousticPositionModel(sd_m=0.5)
    assert (acoustic.sd_per_range, acoustic.outlier_fraction, acoustic.outlier_factor) == (0.0, 0.0, 1.0)


def test_arrays_become_tuples_and_numbers_plain() -> None:
    state = STATE.replace(position_t_m=np.arange(3), time_ns=np.int64(5), dvl_scale_factor=np.float32(0.5))
    assert state.position_t_m == (0, 1, 2)
    assert type(state.time_ns) is int
    assert type(state.dvl_scale_factor) is float


def test_a_navigators_state_starts_another() -> None:
    first = kernel.Navigator(JANUS, MODEL, OPTIONS, STATE)
    again = kernel.Navigator(JANUS, MODEL, OPTIONS, models.InitialState(**first.state()))
    assert np.array_equal(first.covariance(), again.covariance())
    assert first.state()["attitude_t_p"].tolist() == again.state()["attitude_t_p"].tolist()


TRUTH = {
    "time_ns": np.arange(0, 3_000_000_000, 20_000_000),
    "position_t_m": np.zeros((150, 3)),
    "attitude_t_p": np.tile([1.0, 0, 0, 0], (150, 1)),
    "velocity_p_mps": np.zeros((150, 3)),
    "omega_p_radps": np.zeros((150, 3)),
    "force_p_mps2": np.tile([0.0, 0, -9.8], (150, 1)),
}
LOG = {
    "imu_time_ns": TRUTH["time_ns"],
    "force_p_mps2": TRUTH["force_p_mps2"],
    "omega_p_radps": TRUTH["omega_p_radps"],
    "dvl_time_ns": np.array([1_000_000_000]),
    "beam_velocity_mps": np.zeros((1, 4)),
    "beam_valid": np.ones((1, 4), dtype=bool),
}
AIDING = {"beams": np.ones(4, dtype=bool)}
RUN: dict[str, Any] = {"seed": 1, "trajectory_key": 1, "first_run": 0, "threads": 1}


def batch(truth: Any, schedule: Any) -> Any:  # noqa: ANN401 - dicts, wrong ones among them
    return kernel.run_batch(JANUS, truth, MODEL, MODEL, OPTIONS, schedule, ["tc"], runs=1, **RUN)


def replayed(log: Any, start: Any) -> Any:  # noqa: ANN401
    return kernel.replay_log(
        JANUS, MODEL, OPTIONS, ["tc"], log, start, sample_time_ns=np.array([2_000_000_000])
    )


def observed(aiding: Any, schedule: Any) -> Any:  # noqa: ANN401
    truth: Any = TRUTH
    return kernel.observe(JANUS, truth, MODEL, [aiding], schedule=schedule)


CALLS: dict[str, tuple[Any, Any, str]] = {
    "truth": (lambda given: batch(given, settings.schedule(2)), TRUTH, "omega_p_radps"),
    "schedule": (lambda given: batch(TRUTH, given), settings.schedule(2), "gps_time_ns"),
    "log": (lambda given: replayed(given, STATE), LOG, "beam_valid"),
    "start": (lambda given: replayed(LOG, given), STATE.as_dict(), "velocity_p_mps"),
    "aiding": (lambda given: observed(given, None), AIDING, "heading"),
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_no_key_of_a_dict_vanishes(name: str) -> None:
    """What is not read is refused by name, with the nearest key that would be."""
    call, given, key = CALLS[name]
    call(given)
    wrong = key.replace("_", "", 1) if "_" in key else key[:2] + key[1:]
    with pytest.raises(KernelError, match=f"has no key '{wrong}' .did you mean '{key}'"):
        call(given | {wrong: np.zeros(1)})


def test_a_key_in_another_s_place_is_named_with_it() -> None:
    plain: Any = {key: value for key, value in STATE.as_dict().items() if key != "velocity_p_mps"}
    with pytest.raises(KernelError, match="initial lacks the key 'velocity_p_mps', 'velocity_mps' is given"):
        kernel.Navigator(JANUS, MODEL, OPTIONS, plain | {"velocity_mps": [0.0, 0.0, 0.0]})


def test_what_is_no_mapping_is_refused() -> None:
    with pytest.raises(KernelError, match="options is 'tc', expected a table of settings"):
        kernel.Navigator(JANUS, MODEL, "tc", STATE)  # type: ignore[arg-type]


def test_readings_of_a_sensor_without_a_model_are_an_error() -> None:
    """A recording whose depths have no σ of their own, for a model without that sensor."""
    depths: Any = {"depth_time_ns": np.array([1_000_000_000]), "depth_m": np.zeros(1)}
    log: Any = LOG
    with pytest.raises(KernelError, match="depth sd_m is 0"):
        kernel.replay_log(
            JANUS, MODEL.replace(depth=None), OPTIONS, ["tc"], log | depths, STATE,
            sample_time_ns=np.array([2_000_000_000]),
        )  # fmt: skip
