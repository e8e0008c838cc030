"""Restarts: from a young checkpoint the estimate goes on with the next reset counter; else a fresh alignment."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bottomlock.io.beams import geometry_text
from bottomlock.live.checkpoint import begin, pack
from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine
from bottomlock.live.navigator_config import NavigatorConfig
from bottomlock.ports.estimate import SILENT
from tests.live.world import START_NS, VELOCITY, World, config, fly, lines, text_of

S = 1_000_000_000


def until(seconds: float) -> tuple[Engine, bytes]:
    """An engine after some seconds, and its checkpoint."""
    engine = Engine(config("navigation"))
    fly(engine, World(seconds).arrivals(imu=True))
    content = pack(engine, engine.now_ns)
    assert content is not None
    return engine, content


def with_file(path: Path) -> LiveConfig:
    """The configuration with a checkpoint file."""
    return config("navigation", extra=f'[checkpoint]\nfile = "{path}"\n')


def test_goes_on_within_two_seconds(tmp_path: Path) -> None:
    """A kill at 4 s and a start at 5 s: estimates again within 1 s, not aligned anew, one reset more."""
    file = tmp_path / "checkpoint"
    file.write_bytes(until(4.0)[1])
    engine, used, words = begin(with_file(file), START_NS + 5 * S)
    assert used is not None
    assert words == "goes on from the checkpoint of 1.0 s ago"
    sent = fly(engine, [one for one in World(9.0).arrivals(imu=True) if one[0] >= START_NS + 5 * S])
    assert sent[0][0] < START_NS + 6 * S
    assert not {state for _, _, state in sent} & set(SILENT)
    for one in lines(sent):
        assert one.resets == 1
        assert (np.abs(one.velocity - VELOCITY) < 5.0 * one.sd).all()
    assert engine.state == "OK"


@pytest.mark.parametrize(
    ("change", "age_s", "words"),
    [
        (lambda content: content, 6.0, "6.0 s old"),
        (lambda content: content, -1.0, "-1.0 s old"),
        (lambda content: content[:-1], 1.0, "cannot be used"),
        (lambda _: b"", 1.0, "no checkpoint"),
        (lambda _: b"{}\n", 1.0, "no checkpoint"),
        (
            lambda content: content.replace(b'"saved_ns": ', b'"saved_ns": ' + b"9" * 400),
            1.0,
            "no checkpoint",
        ),
        (lambda content: content.replace(b'"settings": "', b'"settings": "x'), 1.0, "other settings"),
    ],
)
def test_old_or_damaged_ones_are_not_used(
    tmp_path: Path, change: Callable[[bytes], bytes], age_s: float, words: str
) -> None:
    """A fresh alignment, and the reason."""
    engine, content = until(3.0)
    file = tmp_path / "checkpoint"
    file.write_bytes(change(content))
    fresh, used, said = begin(with_file(file), engine.now_ns + round(age_s * S))
    assert used is None
    assert words in said
    assert fresh.reset_counter == 0
    assert fresh.estimator.waiting_for == "inertial readings"


def test_nothing_to_save_before_the_alignment() -> None:
    """Nor in mode velocity."""
    assert pack(Engine(config("navigation")), START_NS) is None
    assert pack(Engine(config()), START_NS) is None


GEOMETRY = """configuration = "x"
tilt_deg = 22.5
mounting_yaw_deg = 45.0
beam_noise_mps = 0.01
"""
SENSORS = """
[attitude]
aids = "heading"
[depth]
[gps]
[acoustic_position]
[water_track]
[thrust]
advance_m = 0.1
"""
EFFORT = """[effort]
mass_kg = [20.0, 20.0, 20.0]
linear_drag_kg_per_s = [5.0, 5.0, 5.0]
"""


def with_sensors(folder: Path, *changes: tuple[str, str]) -> LiveConfig:
    """A configuration with every sensor, its geometry in a file, and texts of both files that are others."""
    text, geometry = text_of("navigation") + SENSORS, GEOMETRY
    text = text.replace("waterlinked_a50", str(folder / "dvl.toml")).replace(
        "origin.latitude_deg = 32.8", "origin.latitude_deg = 32.8\norigin.longitude_deg = 0.0"
    )
    for kind in ("attitude", "gps", "acoustic", "thrust"):
        text += f'[[source]]\nname = "{kind}"\naddress = "udpin:127.0.0.1:9"\nformat = "{kind}-csv"\nrate_hz = 1\n'
    for old, new in changes:
        assert old in text or old in geometry
        text, geometry = text.replace(old, new), geometry.replace(old, new)
    (folder / "dvl.toml").write_text(geometry)
    return parse_config(text, place="test")


BEAMS = "beam_noise_mps = 0.01\n"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (f"[{section}]\n", f"[{section}]\n{line}\n")
        for section, line in (
            ("imu", "gyro_bias_walk_deg_per_s_per_rt_s = 0.5"),
            ("attitude", "yaw_sd_deg = 3.0"),
            ("depth", "bias_m = 0.2"),
            ("gps", "position_sd_m = [1.0, 1.0, 1.0]"),
            ("acoustic_position", "transceiver_m = [1.0, 0.0, 0.0]"),
            ("water_track", "cells = [2]"),
            ("thrust", "slip_mps = 0.03"),
            ("start", "level_sd_deg = 3.0"),
        )
    ]
    + [
        ("[states]\n", f"[{section}]\n{line}\n[states]\n")
        for section, line in (("filter", "gate_probability = 0.9"), ("robust", "enabled = false"))
    ]
    + [('"tc"', '"sway_current"')]
    + [
        ("origin.longitude_deg", "origin.height_m = 1.0\norigin.longitude_deg"),
        ("dvl.geometry", "dvl.errors.beam_bias_mps = 0.01\ndvl.geometry"),
        ("tilt_deg = 22.5", "tilt_deg = 23.0"),
        ("mounting_yaw_deg = 45.0", "mounting_yaw_deg = 44.0"),
        (f"45.0\n{BEAMS}", "45.0\nbeam_noise_mps = 0.02\n"),
        (f"45.0\n{BEAMS}", f"45.0\nlever_arms_m = {[[0.1, 0.0, 0.0]] * 4}\n{BEAMS}"),
        (f"45.0\n{BEAMS}", f"45.0\n{BEAMS}[calibration]\nscale_sd_percent = 0.3\n"),
    ],
)
def test_an_edit_of_any_setting_or_of_the_geometry_begins_anew(tmp_path: Path, old: str, new: str) -> None:
    """Each section of a navigator, and each part of the geometry, which is the same file by name."""
    before = with_sensors(tmp_path).content_hash()
    assert with_sensors(tmp_path).content_hash() == before
    assert with_sensors(tmp_path, (old, new)).content_hash() != before


def test_an_edit_of_the_hull_begins_anew(tmp_path: Path) -> None:
    """Forces, in place of revolutions, with the mass that the kernel does not see."""
    instead = ("[thrust]\nadvance_m = 0.1\n", EFFORT), ('"thrust-csv"', '"effort-csv"')
    before = with_sensors(tmp_path, *instead).content_hash()
    assert with_sensors(tmp_path, *instead, ("[20.0, 20.0,", "[20.0, 21.0,")).content_hash() != before


def test_every_section_of_a_navigator_was_edited(tmp_path: Path) -> None:
    """The sections above are all that there are, but for the other of the two drives."""
    missing = [name for name in NavigatorConfig.model_fields if getattr(with_sensors(tmp_path), name) is None]
    assert missing == ["effort"]


def test_the_geometry_of_the_start_counts(tmp_path: Path) -> None:
    """A file that is edited while the program runs: what it saves is of the geometry that it read."""
    geometry, file, own = tmp_path / "dvl.toml", tmp_path / "checkpoint", geometry_text("waterlinked_a50")
    geometry.write_text(own)
    text = f'[checkpoint]\nfile = "{file}"\n'

    def configured() -> LiveConfig:
        return config("navigation", extra=text, geometry=str(geometry))

    engine = Engine(configured())
    fly(engine, World(3.0).arrivals(imu=True))
    geometry.write_text(own.replace("22.5", "23.0"))
    content = pack(engine, engine.now_ns)
    assert content is not None
    file.write_bytes(content)
    _, used, said = begin(configured(), engine.now_ns + S)
    assert used is None
    assert "another geometry" in said
    geometry.write_text("# The same.\n" + own)
    assert begin(configured(), engine.now_ns + S)[1] is not None
