"""The form of the set-up page: what it writes is what `bottomlock live` reads, and mistakes are told at their field."""

from __future__ import annotations

import json
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from bottomlock.errors import ScenarioError
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import solve_velocity
from bottomlock.live.config import load_config
from bottomlock.live.sections import AttitudeSection, ImuSection
from bottomlock.ports.estimate import Mode
from bottomlock.setup.folder import SetupFolder
from bottomlock.setup.form import FORM_AUTOPILOTS, FORM_INSTRUMENTS, HEALTH_PORT, ROUTER, SetupForm

pytest.importorskip("pymavlink", reason="needs pymavlink (extra mavlink)")


@pytest.mark.parametrize("mode", get_args(Mode))
@pytest.mark.parametrize("autopilot", FORM_AUTOPILOTS)
@pytest.mark.parametrize("instrument", FORM_INSTRUMENTS)
def test_every_choice_is_a_configuration(tmp_path: Path, instrument: str, autopilot: str, mode: Mode) -> None:
    """What the page offers is accepted, and says what the form says."""
    form = SetupForm(
        instrument=instrument, autopilot=autopilot, mode=mode, latitude_deg=-32.5, address="tcp:10.0.0.9:1234",
        name="rov_7", to="tcpin:0.0.0.0:16171" if autopilot == "dvl" else ROUTER,
    )  # fmt: skip
    folder = SetupFolder(tmp_path / "new" / "vehicle")
    folder.save(form)
    config = load_config(folder.config)
    assert (config.name, config.mode) == ("rov_7", mode)
    assert config.source[0].address == "tcp:10.0.0.9:1234"
    assert config.source[0].format == FORM_INSTRUMENTS[instrument].format
    named = {"ardusub": "vision_position_delta", "px4": "odometry", "dvl": "waterlinked_json"}[autopilot]
    assert [one.port for one in config.port] == [named, "distance_sensor"][: 1 + (autopilot != "dvl")]
    assert {one.to for one in config.port} == {form.to}
    assert config.health is not None
    assert (config.health.host, config.health.port) == ("127.0.0.1", HEALTH_PORT)
    assert config.log is not None
    assert Path(config.log.folder) == folder.folder / "logs"
    assert folder.form() == form
    assert not folder.by_hand()
    if mode == "navigation":
        assert config.origin is not None
        assert config.origin.latitude_deg == -32.5
        assert config.source[1].request_hz == 50.0
        assert isinstance(config.imu, ImuSection)
        # A heading from the autopilot's own readings must not come back to it as another's.
        assert isinstance(config.attitude, AttitudeSection)
        assert config.attitude.aids == "nothing"


def test_a_forward_looking_dvl_is_that_of_the_a50_extension(tmp_path: Path) -> None:
    """BlueOS-Water-Linked-DVL sends [vz, vy, -vx] of the instrument's axes for one that looks forward."""
    folder = SetupFolder(tmp_path)
    folder.save(SetupForm(mode="velocity", mounting_pitch_deg=90.0))
    mounted = read_geometry(load_config(folder.config).dvl.geometry).geometry
    instrument = read_geometry("waterlinked_a50").geometry
    vx, vy, vz = 0.7, -0.2, 0.4
    beams = instrument.beam_velocities([[vx, vy, vz]])
    fixes = solve_velocity(mounted, beams, np.ones((1, 4), bool), method="lc", beam_sd_mps=0.02)
    np.testing.assert_allclose(np.asarray(fixes.velocity_p_mps)[0], [vz, vy, -vx], atol=1e-12)


def test_lever_arms_are_those_of_the_transducers(tmp_path: Path) -> None:
    """Forward, starboard, down; the same for each, and the rest of the packaged geometry as it was."""
    folder = SetupFolder(tmp_path)
    folder.save(SetupForm(mode="velocity", lever_forward_m=0.3, lever_starboard_m=-0.1, lever_down_m=0.2))
    found = read_geometry(load_config(folder.config).dvl.geometry).geometry
    np.testing.assert_array_equal(found.lever_arms_p_m, [[0.3, -0.1, 0.2]] * 4)
    np.testing.assert_array_equal(found.directions_p, read_geometry("waterlinked_a50").geometry.directions_p)


def test_text_stays_text(tmp_path: Path) -> None:
    """Quotes and backslashes of an address are no syntax of TOML."""
    folder = SetupFolder(tmp_path)
    device = 'serial:/dev/dvl "one" # \\é'
    folder.save(SetupForm(mode="velocity", address=device, record=False))
    config = load_config(folder.config)
    assert config.source[0].address == device
    assert config.log is None


def test_what_is_refused_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A configuration that live would not take is not written."""
    folder = SetupFolder(tmp_path)
    folder.save(SetupForm(mode="velocity"))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr("bottomlock.setup.folder.config_text", lambda *_: 'name = "half')
    with pytest.raises(ScenarioError, match=r"live\.toml"):
        folder.save(SetupForm(mode="velocity", name="other"))
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_new_mounting_replaces_the_old_one(tmp_path: Path) -> None:
    """One geometry stays beside the configuration, that of the last form; another file of a person's stays too."""
    folder = SetupFolder(tmp_path)
    (tmp_path / "geometry.toml").write_text("mine")
    for yaw in (0.0, 45.0, 90.0):
        folder.save(SetupForm(mode="velocity", mounting_yaw_deg=yaw))
    assert len(list(tmp_path.glob("geometry-*.toml"))) == 1
    assert (tmp_path / "geometry.toml").read_text() == "mine"
    found = read_geometry(load_config(folder.config).dvl.geometry)
    np.testing.assert_allclose(found.mounting_rpy_rad, [0.0, 0.0, np.pi / 2])


def test_a_configuration_by_hand_is_known(tmp_path: Path) -> None:
    """An edit shows; so does a file that the page never wrote; damaged notes of the page are no obstacle."""
    folder = SetupFolder(tmp_path)
    assert not folder.by_hand()
    folder.save(SetupForm(mode="velocity"))
    folder.config.write_text(folder.config.read_text() + "# mine\n")
    assert folder.by_hand()
    folder.shall_run = True
    assert SetupFolder(tmp_path).shall_run
    assert json.loads((tmp_path / "setup.json").read_text())["form"]["mode"] == "velocity"
    (tmp_path / "setup.json").write_text("{")
    assert SetupFolder(tmp_path).form() is None
    assert not SetupFolder(tmp_path).shall_run
    assert SetupFolder(tmp_path).by_hand()
