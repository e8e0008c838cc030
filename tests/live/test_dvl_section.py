"""The DVL's own figures of merit and its calibration in a live configuration, with the meaning of a case."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bottomlock import Navigator
from bottomlock.errors import KernelError, ScenarioError
from bottomlock.kernel.models import DvlModel
from bottomlock.live.engine import Engine
from bottomlock.live.navigator_config import kernel_settings
from bottomlock.ports.estimate import Mode
from bottomlock.recordings.readings import LOST_SD_MPS, Ping
from tests.live.world import START_NS, World, config, fly

STATED_MPS = float(np.float32(0.01))
"""Figure of merit in the world's records of Nortek."""
GEOMETRY = 'configuration = "x"\ntilt_deg = 22.5\nmounting_yaw_deg = 45.0\nbeam_noise_mps = 0.01\n'
CALIBRATION = """[calibration]
mounting_sd_deg = [1.0, 2.0, 3.0]
scale_sd_percent = 0.2
clock_offset_s = 0.02
clock_sd_s = 0.05
"""
AS_RECORDED = ("dvl.beam_noise_mps = 0.01", 'dvl.beam_noise_from = "recording"')


@pytest.mark.parametrize("mode", ["velocity", "navigation"])
def test_the_figure_of_merit_is_the_noise_of_a_beam(mode: Mode) -> None:
    """Records that state 0.01 m/s give the bytes that 0.01 m/s for all beams gives, whatever the geometry says."""
    world = World(4.0, form="nortek-dvl")
    of_section, of_record = (
        fly(
            Engine(config(mode, format="nortek-dvl", change=change)), world.arrivals(imu=mode == "navigation")
        )
        for change in (("noise_mps = 0.01", f"noise_mps = {STATED_MPS!r}"), AS_RECORDED)
    )
    assert [message for _, message, _ in of_record] == [message for _, message, _ in of_section]
    other = ("noise_mps = 0.01", "noise_mps = 0.02")
    doubled = fly(
        Engine(config(mode, format="nortek-dvl", change=other)), world.arrivals(imu=mode == "navigation")
    )
    assert [message for _, message, _ in doubled] != [message for _, message, _ in of_section]


@pytest.mark.parametrize("mode", ["velocity", "navigation"])
def test_a_valid_beam_without_a_figure_is_counted(mode: Mode) -> None:
    """It is a refused ping, not one with another noise; a lost beam needs none."""
    engine = Engine(config(mode, format="nortek-dvl", change=AS_RECORDED))
    reader = engine.sources[0].reader
    for k, sd_mps in enumerate(([0.01, 0.01, np.nan, 0.01], [0.01, 0.0, np.nan, 0.01], [0.01] * 4)):
        ping = Ping.of_beams(START_NS + k * 100_000_000, [0.1, 0.1, np.nan, 0.1])
        object.__setattr__(ping, "sd_mps", np.array(sd_mps))
        object.__setattr__(reader, "feed", lambda _, ping=ping: [ping])
        engine.arrive(0, ping.time_ns + 50_000_000, b"")
    assert engine.sources[0].used == 2
    ((why, count),) = engine.sources[0].refused.items()
    assert count == 1
    assert "figure of merit" in why


def test_readings_of_a_program_need_it_too() -> None:
    """`Navigator.start` has the same section."""
    dvl = {"geometry": "waterlinked_a50", "beam_noise_from": "recording"}
    nav = Navigator.start(dvl=dvl, imu="tactical", latitude_deg=54.0, heading_deg=90.0)
    with pytest.raises(KernelError, match="beam 1 is valid and its figure of merit is nan"):
        nav.push(Ping.of_beams(0, [0.1, 0.1, 0.1, 0.1]))


def test_noise_that_grows_with_the_range(tmp_path: Path) -> None:
    """The root of the sum of both squares, by the geometry's file or the section; a beam has to have a range."""
    file = tmp_path / "dvl.toml"
    file.write_text(GEOMETRY.replace("= 0.01", "= 0.03") + "beam_noise_mps_per_m = 1e-3\n")
    of_file = config(geometry=str(file), change=("dvl.beam_noise_mps = 0.01\n", ""))
    noise = "dvl.beam_noise_mps = 0.03\ndvl.beam_noise_mps_per_m = 1e-3"
    of_section = config(change=("dvl.beam_noise_mps = 0.01", noise))
    ping = Ping.of_beams(0, [0.1, 0.1, np.nan, 0.1])
    ranged = dataclasses.replace(ping, range_m=np.array([40.0, 0.0, np.nan, 0.0]))
    for one in (of_file, of_section):
        assert one.with_noise(ranged, one.instrument()).sd_mps.tolist() == [0.05, 0.03, LOST_SD_MPS, 0.03]
        with pytest.raises(KernelError, match="beam 1 is valid and its range is nan"):
            one.with_noise(ping, one.instrument())


@pytest.mark.parametrize("form", ["waterlinked-json", "pd0", "nortek-ad2cp", "cerulean-dvkfc"])
def test_a_format_without_figures_is_refused(form: str) -> None:
    """Naming the key, the format and those that have them."""
    with pytest.raises(ScenarioError, match=rf"dvl\.beam_noise_from .*'{form}'.* nortek-dvl"):
        config(format=form, change=AS_RECORDED)


def calibrated(folder: Path, calibration: str = CALIBRATION) -> str:
    """Path of a geometry with a calibration."""
    file = folder / "dvl.toml"
    file.write_text(GEOMETRY + calibration)
    return str(file)


@pytest.mark.parametrize(
    ("section", "mounting_deg", "clock_s"),
    [
        ("", (1.0, 2.0, 3.0), 0.05),
        ("[calibration]\nmounting_sd_deg = 0.5\n", (0.5, 0.5, 0.5), 0.05),
        ("[calibration]\nclock_sd_s = 0.1\n", (1.0, 2.0, 3.0), 0.1),
        ("[calibration]\nenabled = false\n", (0.0, 0.0, 0.0), 0.0),
    ],
)
def test_the_calibration_is_a_cases(
    tmp_path: Path, section: str, mounting_deg: tuple[float, ...], clock_s: float
) -> None:
    """What the section leaves out is that of the DVL's file."""
    made = config("navigation", geometry=calibrated(tmp_path), extra=section)
    settings = kernel_settings(made, made.instrument())
    np.testing.assert_allclose(np.rad2deg(settings.options.calibration.mounting_sd_rad), mounting_deg)
    assert settings.options.calibration.clock_sd_s == clock_s
    assert settings.model.of(DvlModel).scale_factor_sd == pytest.approx(0.002)


def test_the_scale_of_the_section_comes_first(tmp_path: Path) -> None:
    """As in a case."""
    errors = ("dvl.beam_noise_mps", "dvl.errors.scale_factor_percent = 0.9\ndvl.beam_noise_mps")
    made = config("navigation", geometry=calibrated(tmp_path), change=errors)
    assert kernel_settings(made, made.instrument()).model.of(DvlModel).scale_factor_sd == pytest.approx(0.009)


@pytest.mark.parametrize(("clock", "late_ns"), [("host", 20_000_000), ("arrival", 0)])
def test_the_offset_counts_for_stamps_that_are_taken_as_they_are(
    tmp_path: Path, clock: str, late_ns: int
) -> None:
    """A clock that is mapped to the host's has no offset left that a log could have measured."""
    times = []
    for text in (CALIBRATION, CALIBRATION.replace("clock_offset_s = 0.02\n", "")):
        change = ('format = "waterlinked-json"', f'format = "waterlinked-json"\nclock = "{clock}"')
        engine = Engine(config(geometry=calibrated(tmp_path, text), change=change))
        fly(engine, World(1.0, offset_ns=lambda _: 0).arrivals())
        times.append(engine.estimator.time_ns)
    assert times[0] is not None
    assert times[1] is not None
    assert times[0] - times[1] == late_ns


def test_mode_velocity_has_no_calibration() -> None:
    """It has no states; the section is refused, not ignored."""
    with pytest.raises(ScenarioError, match=r"\[calibration\]"):
        config(extra="[calibration]\nclock_sd_s = 0.1\n")
