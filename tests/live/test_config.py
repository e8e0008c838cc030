"""Configurations: mistakes in one line with key, value and range; templates that can be read."""

from __future__ import annotations

from pathlib import Path

import pytest

from bottomlock.config.scenario_sections import Filter
from bottomlock.errors import ScenarioError
from bottomlock.live.config import load_config, parse_config
from bottomlock.live.templates import AUTOPILOTS, INSTRUMENTS, template
from tests.live.world import text_of

PLACES = {"dvl": "tcp:127.0.0.1:16171", "imu": "udpin:127.0.0.1:15000", "to": "udpout:127.0.0.1:14550"}
VELOCITY, NAVIGATION = text_of("velocity", **PLACES), text_of("navigation", **PLACES)


GPS = '[gps]\n[[source]]\nname = "gps"\naddress = "stdin"\nformat = "gps-csv"\nrate_hz = 1\n'


@pytest.mark.parametrize(
    ("text", "old", "new", "key"),
    [
        (VELOCITY, "rate_hz = 10", "rate_hz = 0", "source.0.rate_hz"),
        (VELOCITY, "address =", "adress =", "source.0.adress"),
        (VELOCITY, "tcp:", "tpc:", "tcp:HOST:PORT"),
        (VELOCITY, "16171", "99999", "source.0.address"),
        (VELOCITY, "udpout", "udpin", "port.0.to"),
        (VELOCITY, "waterlinked_a50", "a50", "geometry 'a50'"),
        (VELOCITY, '"probe"', '"prob"', "'probe'"),
        (VELOCITY, 'mode = "velocity"', 'mode = "navigation"', "[imu], [origin], [start]"),
        (VELOCITY.replace("dvl.", "#"), 'mode = "velocity"', 'mode = "navigation"', "[imu], [origin], [start]"),
        (VELOCITY, "[[port]]", "[[port]]\nsettings.geometry = 1", "settings.geometry"),
        (VELOCITY, "[[port]]", "[[port]]\nsettings.x = 1", "'x'"),
        (VELOCITY, 'port = "probe"', 'port = "pd0"', "'receiver_sd_mps'"),
        (VELOCITY, "[[port]]", "[water_track]\n[[port]]", "[water_track]"),
        (VELOCITY, 'port = "probe"\nto = "udpout', 'port = "probe"\nto = "ros:/x"#', "ros:/x"),
        (NAVIGATION, 'mode = "navigation"', 'mode = "velocity"', "[imu]"),
        (NAVIGATION, 'format = "imu-csv"', 'format = "pd0"', "(dvl, imu)"),
        (NAVIGATION, 'format = "imu-csv"', 'format = "ros-imu"', "ros:/TOPIC"),
        (NAVIGATION, 'name = "imu"', 'name = "dvl"', "'dvl'"),
        (NAVIGATION, 'format = "imu-csv"', 'format = "depth-csv"', "inertial readings"),
        (NAVIGATION, "heading_sd_deg = 2.0\n", "", "start.heading_sd_deg"),
        (NAVIGATION, "window_s = 1.0", "window_s = 1e300", "start.window_s"),
        (VELOCITY, "rate_hz = 10\n", "rate_hz = 1e-300\n", "source.0.rate_hz"),
        (NAVIGATION, 'method = "tc"', "estimate_hz = 1e-300", "navigation.estimate_hz"),
        (NAVIGATION, '14550"\nrate_hz = 10', '14550"\nrate_hz = 1e-300', "port.0.rate_hz"),
        (NAVIGATION, '"tc"', '"tcc"', "navigation.method"),
        (VELOCITY, "127.0.0.1:14550", "rov..local:14550", "'rov..local' is no name of a host"),
        (VELOCITY, "[[port]]", '[health]\nhost = "rov..local"\n[[port]]', "health.host"),
        (VELOCITY, "udpout:127.0.0.1:14550", "file:a\\u0000", "port.0.to"),
        (VELOCITY, "[[port]]", '[log]\nfolder = "\\u0000"\n[[port]]', "log.folder"),
        (VELOCITY, "[[port]]", "[port]", "expected a section [[port]] with port, to"),
        (VELOCITY, "waterlinked-json", "waterlinked_json", "did you mean 'waterlinked-json'?"),
        (VELOCITY, "beam_noise_mps = 0.01", "beam_noise_mps = 1e300", "beam_noise"),
        (NAVIGATION, "window_s = 1.0", "window_s = true", "'start.window_s' is True, expected number in s"),
        (NAVIGATION, "window_s = 1.0", "position_m = [1, 2]", "'start.position_m' is [1, 2], expected 3 numbers in m"),
        (NAVIGATION, "window_s = 1.0", "position_m = [1e300, 0, 0]", "position_t_m"),
        (NAVIGATION, "[start]", '[imu.limits]\ngap = "refuse"\n[start]', "gap"),
        (NAVIGATION, "[start]", '[start]\nlevel = "attitude"', "[attitude]"),
        (NAVIGATION, "[start]", '[attitude]\naids = "heading"\n[start]', "[attitude]"),
        (NAVIGATION, "[start]", "[thrust]\nadvance_m = 0.3\nnoise_mps = 0.1\n[start]", "[thrust]"),
        (NAVIGATION, "[start]", "[acoustic_position]\nsd_m = 1\n[start]", "[acoustic_position]"),
        (NAVIGATION.replace(PLACES["imu"], "serial:x:9600"), PLACES["to"], "serial:x", "one speed"),
        (NAVIGATION.replace(PLACES["imu"], "tcpin:9"), PLACES["to"], "tcpin:9", "another port"),
        (NAVIGATION, "[[port]]", GPS + "[[port]]", "origin.longitude_deg"),
        (NAVIGATION, "[[port]]", GPS.removeprefix("[gps]") + "[[port]]", "[gps]"),
    ],
)  # fmt: skip
def test_mistakes(text: str, old: str, new: str, key: str) -> None:
    """One line that names the place and the key or section, of values and of what sections need of one another."""
    assert old in text
    with pytest.raises(ScenarioError) as error:
        parse_config(text.replace(old, new, 1), place="rov.toml")
    assert any(line.startswith("rov.toml: ") and key in line for line in str(error.value).splitlines())


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
        ScenarioError, match=r"none.toml: no such live configuration; `bottomlock live --init` writes one"
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
    if autopilot == "dvl" and INSTRUMENTS[instrument].beams == 3:
        with pytest.raises(ScenarioError, match="has 3 beams"):
            template(instrument, autopilot)
        return
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
