"""Configurations: mistakes in one line with key, value and range; templates that can be read."""

from __future__ import annotations

from pathlib import Path

import pytest

from bottomlock.config.scenario_sections import Filter
from bottomlock.errors import ScenarioError
from bottomlock.live.config import load_config, parse_config
from bottomlock.live.templates import AUTOPILOTS, INSTRUMENTS, template
from tests.live.world import NAVIGATION_TOML, VELOCITY_TOML

PLACES = {
    "dvl": "tcp:127.0.0.1:16171",
    "imu": "udpin:127.0.0.1:15000",
    "to": "udpout:127.0.0.1:14550",
    "format": "waterlinked-json",
}
VELOCITY = VELOCITY_TOML.format(**PLACES)
NAVIGATION = NAVIGATION_TOML.format(**PLACES)


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (VELOCITY, 'format = "w', 'format = "v', "'source.0.format' is 'vaterlinked-json', expected 'nortek-ascii'"),
        (VELOCITY, "rate_hz = 10", "rate_hz = 0", "'source.0.rate_hz' is 0, expected > 0.0 Hz"),
        (VELOCITY, "address =", "adress =", "unknown key 'source.0.adress', did you mean 'address'?"),
        (VELOCITY, "tcp:", "tpc:", "'tpc:127.0.0.1:16171' cannot be a source, did you mean tcp:HOST:PORT (connects)?"),
        (VELOCITY, ":16171", "", "'tcp:127.0.0.1' is no address of this kind, expected tcp:HOST:PORT"),
        (VELOCITY, "16171", "99999", "has port 99999, expected 1 to 65535"),
        (VELOCITY, "udpout", "udpin", "a target, udpin:HOST:PORT (listens); did you mean udpout:HOST:PORT (sends)?"),
        (VELOCITY, "waterlinked_a50", "a50", "geometry 'a50' is neither a file nor packaged"),
        (VELOCITY, '"probe"', '"prob"', "port: unknown name 'prob', did you mean 'probe'?"),
        (VELOCITY, 'mode = "velocity"', 'mode = "speed"', "'mode' is 'speed', expected 'velocity' or 'navigation'"),
        (VELOCITY, 'mode = "velocity"', 'mode = "navigation"', "needs the sections [imu], [origin], [start]"),
        (NAVIGATION, 'mode = "navigation"', 'mode = "velocity"', 'section [imu] belongs to mode = "navigation"'),
        (NAVIGATION, 'format = "imu-csv"', 'format = "pd0"', "2 sources are a DVL (dvl, imu), expected one"),
        (NAVIGATION, 'name = "imu"', 'name = "dvl"', "two sources are named 'dvl', expected unique names"),
        (NAVIGATION, 'format = "imu-csv"', 'format = "depth-csv"', "needs a source of inertial readings"),
        (NAVIGATION, "window_s = 1.0", "window_s = -1", "'start.window_s' is -1, expected > 0.0 s"),
        (NAVIGATION, "heading_sd_deg = 2.0\n", "", "'start.heading_sd_deg' is missing, expected number in deg, > 0"),
        (NAVIGATION, "[start]", '[imu.limits]\ngap = "refuse"\n[start]', "live use bridges every gap"),
        (NAVIGATION, "[start]", '[navigation]\nmethod = "tcc"\n[start]', "'navigation.method' is 'tcc', expected"),
        (VELOCITY, "[[port]]", "[[port]]\nsettings.geometry = 1", "settings.geometry cannot be set here"),
        (VELOCITY, "[[port]]", "[[port]]\nsettings.x = 1", "port probe: unknown key 'x'"),
    ],
)  # fmt: skip
def test_mistakes(text: str, old: str, new: str, message: str) -> None:
    """One line that names the place, the key, what it is and what was expected."""
    assert old in text
    with pytest.raises(ScenarioError) as error:
        parse_config(text.replace(old, new, 1), place="rov.toml")
    lines = [line for line in str(error.value).splitlines() if message in line]
    assert len(lines) == 1, str(error.value)
    assert lines[0].startswith("rov.toml: ")


def test_files_are_meant_from_the_configurations_folder(tmp_path: Path) -> None:
    """Log, checkpoint, geometry and file sources."""
    text = NAVIGATION + '[log]\nfolder = "logs"\n[checkpoint]\nfile = "last"\n'
    file = tmp_path / "rov.toml"
    file.write_text(text.replace("udpin:127.0.0.1:15000", "file:imu.csv"))
    config = load_config(file)
    assert config.log is not None
    assert config.log.folder == str(tmp_path / "logs")
    assert config.checkpoint is not None
    assert config.checkpoint.file == str(tmp_path / "last")
    assert config.source[1].address == f"file:{tmp_path / 'imu.csv'}"
    with pytest.raises(
        ScenarioError, match=r"none.toml: no such configuration; `bottomlock live --init` writes one"
    ):
        load_config(tmp_path / "none.toml")


@pytest.mark.parametrize("instrument", INSTRUMENTS)
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_templates_can_be_read(tmp_path: Path, instrument: str, autopilot: str) -> None:
    """Every pair, with a geometry where the package has none."""
    (tmp_path / "geometry.toml").write_text(
        'configuration = "angles"\ntilts_deg = [20, 20, 20]\nazimuths_deg = [0, 120, 240]\nbeam_noise_mps = 0.01\n'
    )
    file = tmp_path / "rov.toml"
    file.write_text(template(instrument, autopilot))
    config = load_config(file)
    assert config.mode == AUTOPILOTS[autopilot].mode
    assert len(config.ports()) == 1


def test_a_template_names_the_prior_of_a_vehicle_that_hovers(tmp_path: Path) -> None:
    """Its lines without their comment signs are the section that makes it."""
    file = tmp_path / "rov.toml"
    text = template("a50", "ardusub").replace("# [filter.water]\n# vehicle", "[filter.water]\nvehicle")
    file.write_text(text)
    assert load_config(file).filter.water == Filter.model_validate({"water": {"vehicle": "hovering"}}).water


def test_unknown_names_of_templates() -> None:
    """With the nearest, and all."""
    with pytest.raises(ScenarioError, match="unknown instrument 'a5', did you mean 'a50'"):
        template("a5", "px4")
    with pytest.raises(ScenarioError, match="unknown autopilot 'px5', did you mean 'px4'"):
        template("nucleus", "px5")
