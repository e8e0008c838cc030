"""The same readings replayed as a case and given to a live navigator one at a time: the same bits, sensor by sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.config.toml_file import toml_value
from bottomlock.errors import ScenarioError
from bottomlock.io.account import Account
from bottomlock.io.rows import make_table
from bottomlock.kernel import Navigator, replay_log
from bottomlock.live.aligned import AlignedNavigator
from bottomlock.live.config import load_config
from bottomlock.live.navigator_config import NavigatorConfig, kernel_settings
from bottomlock.recordings.readings import Ping
from bottomlock.recordings.sensors import SENSORS
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.open_log import Log
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import kernel_log, kernel_start, prepare
from bottomlock.units import ns_from_s
from tests.dive import LATITUDE_DEG, LONGITUDE_DEG, METRES_PER_DEG, Dive, drawn_dive
from tests.replay.test_water_track import water_of

Table = dict[str, Any]
SECONDS, STARTS_S = 30.0, 2.0


@dataclass(frozen=True)
class Flown:
    """A sensor of the dive: what the filter takes of it, its columns in a case, and its table."""

    errors: Table
    columns: Table
    table: Mapping[str, Any]


def every(dive: Dive) -> dict[str, Flown]:
    """Every sensor; some readings are at the times of pings and of inertial readings, and of one another."""
    rng, seconds = np.random.default_rng(5), dive.imu_s[::15]
    count, place = len(seconds), dive.at(seconds, dive.position)
    clock = {"column": "time"}
    rpy = np.rad2deg(dive.at(seconds, np.unwrap(dive.rpy, axis=0)) + 0.01 * rng.normal(size=(count, 3)))
    angles = dict(zip(("roll", "pitch", "yaw"), rpy.T, strict=True))
    turned = {"roll": "roll", "pitch": "pitch", "yaw": "yaw", "unit": "deg"}
    noisy = place + rng.normal(size=place.shape)
    body = dive.at(seconds, dive.velocity)
    found = {
        "depth": Flown(
            {"sd_m": 0.07, "bias_m": 0.2, "lever_arm_m": [0.3, -0.1, 0.2]},
            {"column": "depth"},
            {"depth": place[:, 2] + 0.07 * rng.normal(size=count)},
        ),
        "gps": Flown(
            {"position_sd_m": [1.0, 1.5, 2.5], "lever_arm_m": [0.1, 0.2, -0.5]},
            {"latitude": "latitude", "longitude": "longitude", "height": "height"},
            {
                "latitude": LATITUDE_DEG + noisy[:, 0] / METRES_PER_DEG[0],
                "longitude": LONGITUDE_DEG + noisy[:, 1] / METRES_PER_DEG[1],
                "height": -noisy[:, 2],
            },
        ),
        "acoustic_position": Flown(
            {"sd_m": 0.6, "sd_percent_of_range": 2.0, "transceiver_m": [5.0, 0.0, 0.0]},
            {"north": "north", "east": "east", "down": "down"},
            dict(zip(("north", "east", "down"), noisy.T, strict=True)),
        ),
        "thrust": Flown(
            {"advance_m": 0.1, "noise_mps": 0.02, "corrects": "all"},
            {"column": "turns", "unit": "Hz"},
            {"turns": 10.0 * body[:, 0] + 0.1 * rng.normal(size=count)},
        ),
        "effort": Flown(
            {
                "mass_kg": [20.0, 21.0, 32.0],
                "linear_drag_kg_per_s": [14.0, 5.0, 33.0],
                "noise_mps": 0.03,
                "corrects": "all",
            },
            {"force": ["x", "y", "z"]},
            dict(zip("xyz", (body * [14.0, 5.0, 33.0] + rng.normal(size=body.shape)).T, strict=True)),
        ),
        "water_track": Flown({"noise_mps": 0.03, "cells": [1]}, {}, {}),
    }
    for aids in ("attitude", "heading"):
        errors = {"aids": aids, "yaw_sd_deg": 3.0, "roll_pitch_sd_deg": 0.8, "yaw_offset_sd_deg": 2.0}
        found[aids] = Flown(errors, turned, angles)
    return {
        name: Flown(
            one.errors,
            one.columns | ({"clock": clock} if one.table else {}),
            {"time": seconds} | dict(one.table),
        )
        for name, one in found.items()
    }


COMMON: Table = {
    "filter": {
        "gate_probability": 0.999,
        "motion": {
            "mean_sd_mps": [0.2] * 3,
            "change_sd_mps": [0.11, 0.02, 0.01],
            "change_time_s": [43.0, 10.0, 10.0],
        },
    },
    "robust": {"student_t_degrees": 5.0},
    "calibration": {"mounting_sd_deg": 0.5, "clock_sd_s": 0.01},
}
IMU_ERRORS = {
    "accel_bias_mg": 1.0,
    "gyro_bias_deg_per_h": 20.0,
    "accel_noise_mps_per_rt_h": 0.05,
    "gyro_noise_deg_per_rt_h": 0.1,
}
PRIORS: Table = {"level_sd_deg": 1.0, "heading_sd_deg": 2.0, "position_sd_m": [0.5, 0.5, 0.1]}
ORIGIN = {"latitude_deg": LATITUDE_DEG, "longitude_deg": LONGITUDE_DEG}
AXES = tuple("xyz")


def section_of(name: str) -> str:
    """The section of a sensor; a heading is of [attitude]."""
    return "attitude" if name == "heading" else name


def written(dive: Dive, names: tuple[str, ...], folder: Path, dvl: Table) -> Path:
    """The dive as tables and a case with some of its sensors."""
    pl.DataFrame(
        {"time": dive.imu_s}
        | {f"f{axis}": dive.force[:, k] for k, axis in enumerate(AXES)}
        | {f"w{axis}": dive.omega[:, k] for k, axis in enumerate(AXES)}
    ).write_parquet(folder / "imu.parquet")
    beams, times_ns = np.nan_to_num(dive.beams), np.round(dive.ping_s * 1e9).astype(np.int64)
    stated = np.random.default_rng(8).uniform(0.005, 0.02, beams.shape)
    account = Account("line")
    valid = np.isfinite(dive.beams)
    table = make_table(
        account, 4, np.arange(len(beams)), times_ns, beams, valid, sd=stated, range_m=2e3 * stated
    )
    table.to_frame().write_parquet(folder / "beams.parquet")
    water_of(dive).to_frame().write_parquet(folder / "beams_water.parquet")
    at = int(np.searchsorted(dive.imu_s, STARTS_S))
    roll, pitch, yaw = np.rad2deg(dive.rpy[at]).tolist()
    content: Table = {
        "name": "dive",
        "origin": ORIGIN,
        "imu": {
            "file": "imu.parquet",
            "clock": {"column": "time"},
            "force": [f"f{axis}" for axis in AXES],
            "omega": [f"w{axis}" for axis in AXES],
            "limits": {"gap": "inflate"},
            "errors": IMU_ERRORS,
        },
        "dvl": {"file": "beams.parquet"} | dvl,
        "start": PRIORS
        | {"at_s": STARTS_S, "level": "given", "roll_deg": roll, "pitch_deg": pitch, "heading": "given"}
        | {"heading_deg": yaw, "position_m": dive.position[at].tolist()}
        | {"velocity_mps": dive.velocity[at].tolist(), "velocity_sd_mps": [0.1, 0.1, 0.1]},
        "replay": {"methods": ["tc"], "smooth": False},
    } | COMMON
    for name in names:
        flown = every(dive)[name]
        content[section_of(name)] = flown.errors | flown.columns
        if len(flown.table) > 1:
            pl.DataFrame(flown.table).write_parquet(folder / f"{name}.parquet")
            content[section_of(name)]["file"] = f"{name}.parquet"
    path = folder / "case.toml"
    path.write_text(
        f"name = {toml_value(content.pop('name'))}\n"
        + "".join(
            f"[{key}]\n" + "".join(f"{one} = {toml_value(value)}\n" for one, value in table.items())
            for key, table in content.items()
        ),
        encoding="utf-8",
    )
    return path


def configured(dive: Dive, names: tuple[str, ...], dvl: Table) -> NavigatorConfig:
    """The same sections live."""
    return NavigatorConfig.model_validate(
        {
            "dvl": dvl,
            "imu": IMU_ERRORS,
            "origin": ORIGIN,
            "start": PRIORS | {"heading_deg": 0.0},
            **COMMON,
            **{section_of(name): every(dive)[name].errors for name in names},
        }
    )


def replayed(case: Case, method: str) -> tuple[Table, np.ndarray, Any]:
    """State and covariance (20, 20) at the last reading, and the run."""
    prepared = prepare(case, read_streams(case))
    log = kernel_log(case, prepared, prepared.streams.beams.valid[prepared.pings])
    result: Any = replay_log(
        prepared.streams.instrument.geometry, prepared.model, prepared.options, [method], log,
        kernel_start(prepared.alignment), sample_time_ns=log["imu_time_ns"][-1:], covariances=True,
    )  # fmt: skip
    return result, result["covariance"][0, -1], prepared


def live(config: NavigatorConfig, case: Case, prepared: Any, method: str) -> Navigator:  # noqa: ANN401
    """The navigator after the readings of the case, in order of their times, from the same start."""
    instrument = config.instrument()
    settings = kernel_settings(config, instrument)
    aligned = AlignedNavigator(config, instrument, settings)
    start = kernel_start(prepared.alignment)
    navigator = Navigator(
        instrument.geometry, settings.model, settings.options, start, method=method,
        horizon_ns=ns_from_s(config.navigation.horizon_s),
    )  # fmt: skip
    aligned.continue_from(navigator)
    for reading in Log(case, (), prepared.streams, ()):
        time_ns = reading.time_ns
        if time_ns < start.time_ns:
            continue
        if isinstance(reading, Ping):
            aligned.beams(time_ns, config.with_noise(reading, instrument))
        else:
            aligned.push(time_ns, reading)
    return navigator


NAMES = (*(sensor.name for sensor in SENSORS), "heading")
GEOMETRY = {"geometry": "waterlinked_a50"}


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(3, seconds=SECONDS)


@pytest.mark.parametrize(
    ("names", "dvl"),
    [
        ((), GEOMETRY),
        ((), GEOMETRY | {"beam_noise_from": "recording"}),
        ((), GEOMETRY | {"beam_noise_mps_per_m": 1e-3}),
    ]
    + [((name,), GEOMETRY) for name in NAMES]
    + [
        (tuple(name for name in NAMES if name not in others), GEOMETRY | {"beam_noise_mps": 0.006})
        for others in (("attitude", "thrust"), ("heading", "effort"))
    ],
    ids=lambda value: "+".join(value) or "dvl" if isinstance(value, tuple) else "",
)
def test_the_bits_are_the_same(dive: Dive, tmp_path: Path, names: tuple[str, ...], dvl: Table) -> None:
    """Of model, options, state and covariance, with the horizon of a live navigator."""
    case = load_case(written(dive, names, tmp_path, dvl))
    state, covariance, prepared = replayed(case, "tc")
    config = configured(dive, names, dvl)
    settings = kernel_settings(config, config.instrument())
    assert settings.model == prepared.model
    assert settings.options == prepared.options
    navigator = live(config, case, prepared, "tc")
    found = navigator.state()
    for key in ("position_t_m", "attitude_t_p", "velocity_p_mps", "accel_bias_p_mps2", "dvl_bias_mps"):
        expected = np.asarray(state[key])[0, -1]
        np.testing.assert_array_equal(found[key], expected, err_msg=key)
    np.testing.assert_array_equal(navigator.covariance()[:20, :20], covariance)


def test_every_sensor_changes_the_result(dive: Dive, tmp_path: Path) -> None:
    """Readings that neither of the two takes would be equal, too."""
    ends = []
    for names in ((), *((name,) for name in NAMES)):
        state, _, _ = replayed(load_case(written(dive, names, tmp_path, GEOMETRY)), "tc")
        ends.append(tuple(np.asarray(state["velocity_p_mps"])[0, -1].tolist()))
    assert len(set(ends)) == len(NAMES) + 1


LIVE = """name = "rov"
mode = "navigation"
case = "case.toml"
[start]
heading_deg = 10.0
[[source]]
name = "dvl"
address = "tcp:127.0.0.1:16171"
format = "waterlinked-json"
rate_hz = 4
"""


def live_file(folder: Path, names: tuple[str, ...], extra: str = "") -> Path:
    """A live configuration of the case beside it: sources, the start's heading, and no other section."""
    lines = ("imu-csv", *(one.line for one in SENSORS if one.line and one.name in names))
    sources = "".join(
        f'[[source]]\nname = "{line}"\naddress = "udpin:127.0.0.1:9"\nformat = "{line}"\nrate_hz = 10\n'
        for line in lines
    )
    file = folder / "rov.toml"
    file.write_text(LIVE + sources + extra, encoding="utf-8")
    return file


ALL = tuple(name for name in NAMES if name not in {"heading", "effort"})


def test_a_case_is_live_as_it_is(dive: Dive, tmp_path: Path) -> None:
    """Every section of it reaches the kernel's model and options as a replay of it gives them."""
    written(dive, ALL, tmp_path, GEOMETRY | {"beam_noise_mps": 0.006, "errors": {"beam_bias_mps": 0.01}})
    prepared = prepare(load_case(tmp_path / "case.toml"), read_streams(load_case(tmp_path / "case.toml")))
    config = load_config(live_file(tmp_path, ALL))
    settings = kernel_settings(config, config.instrument())
    assert settings.model == prepared.model
    assert settings.options == prepared.options
    assert config.start is not None
    assert config.start.heading_deg == 10.0
    for sensor in SENSORS:
        if sensor.name not in ALL:
            continue
        assert isinstance(getattr(config, sensor.name), sensor.settings)
        assert isinstance(getattr(load_case(tmp_path / "case.toml"), sensor.name), sensor.settings)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("gate_probability = 0.999", "gate_probability = 0.99"),
        ("student_t_degrees = 5.0", "student_t_degrees = 6.0"),
        ("clock_sd_s = 0.01", "clock_sd_s = 0.02"),
        ("accel_bias_mg = 1.0", "accel_bias_mg = 2.0"),
        ('limits = { gap = "inflate" }', 'limits = { gap = "inflate", max_rate_deg_per_s = 500.0 }'),
        ('limits = { gap = "inflate" }', 'limits = { gap = "inflate" }\nbridge_gaps_s = 7.0'),
        ('force_unit = "m/s2"', 'force_unit = "m/s"\ninterval = "step"'),
        ("earth = ", 'earth = "tangent_plane"\ngravity = 9.81 #'),
        ("beam_bias_mps = 0.01", "beam_bias_mps = 0.02"),
        ("level_sd_deg = 1.0", "level_sd_deg = 2.0"),
    ],
)
def test_a_key_of_the_case_arrives(dive: Dive, tmp_path: Path, old: str, new: str) -> None:
    """It changes the kernel's settings here as it does in a replay."""
    path = written(dive, (), tmp_path, GEOMETRY | {"errors": {"beam_bias_mps": 0.01}})
    plain = path.read_text().replace("omega =", 'force_unit = "m/s2"\nomega =', 1)
    plain = plain.replace("[origin]\n", '[origin]\nearth = "ellipsoid"\n', 1)
    pl.read_parquet(tmp_path / "imu.parquet").with_columns(step=pl.lit(1.0)).write_parquet(
        tmp_path / "imu.parquet"
    )
    found = []
    for text in (plain, plain.replace(old, new, 1)):
        assert old in plain
        path.write_text(text)
        case = load_case(path)
        prepared = prepare(case, read_streams(case))
        config = load_config(live_file(tmp_path, ()))
        settings = kernel_settings(config, config.instrument())
        assert settings.model == prepared.model
        assert settings.options == prepared.options
        found.append((settings.model, settings.options))
    assert found[0] != found[1]


def test_axes_mounting_and_geometry_of_the_case(dive: Dive, tmp_path: Path) -> None:
    """An inertial reading is turned as a replay turns it; the geometry is found from the case's folder."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "dvl.toml").write_text(
        'configuration = "x"\ntilt_deg = 25.0\nbeam_noise_mps = 0.01\n'
    )
    path = written(dive, (), tmp_path / "sub", {"geometry": "dvl.toml"})
    turned = 'axes = ["y", "-x", "z"]\nmounting_roll_deg = 10.0\nmounting_yaw_deg = 40.0\n'
    path.write_text(path.read_text().replace("[imu]\n", f"[imu]\n{turned}"))
    file = live_file(tmp_path, ())
    file.write_text(file.read_text().replace("case.toml", "sub/case.toml"))
    config = load_config(file)
    assert config.instrument().geometry.directions_p[0, 2] == pytest.approx(np.cos(np.deg2rad(25.0)))
    axes = kernel_settings(config, config.instrument()).imu_axes
    inertial = read_streams(load_case(path)).inertial
    np.testing.assert_allclose(dive.force @ axes.T, inertial.force_p_mps2, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("extra", "key"),
    [
        ("[imu]\naccel_bias_mg = 1.0\n", r"\[imu\]"),
        ('[dvl]\ngeometry = "x_janus_20"\n', r"\[dvl\]"),
        ("[filter]\n", r"\[filter\]"),
    ],
)
def test_a_section_stands_in_one_file(dive: Dive, tmp_path: Path, extra: str, key: str) -> None:
    """Of [start] a key: neither file has the last word."""
    written(dive, (), tmp_path, GEOMETRY)
    file = live_file(tmp_path, (), extra)
    with pytest.raises(ScenarioError, match=rf"rov\.toml: {key}.* in the case"):
        load_config(file)
    file.write_text(LIVE.replace("heading_deg = 10.0", "heading_deg = 10.0\nlevel_sd_deg = 2.0"))
    with pytest.raises(ScenarioError, match=r"start\.level_sd_deg"):
        load_config(file)


def test_a_case_that_is_not_there(tmp_path: Path) -> None:
    """It is named, with the configuration."""
    with pytest.raises(ScenarioError, match=r"rov\.toml: .*case\.toml: no such replay case"):
        load_config(live_file(tmp_path, ()))


def test_mode_velocity_takes_the_dvl_of_a_case(dive: Dive, tmp_path: Path) -> None:
    """And nothing else of it."""
    written(dive, ("depth",), tmp_path, GEOMETRY | {"beam_noise_mps": 0.006})
    file = live_file(tmp_path, ())
    text = LIVE.replace("navigation", "velocity").replace("[start]\nheading_deg = 10.0\n", "")
    file.write_text(text)
    config = load_config(file)
    assert config.instrument().beam_sd_mps.tolist() == [0.006] * 4
    assert config.imu is None
