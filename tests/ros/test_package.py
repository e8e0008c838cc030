"""The package of the node: what setuptools would install of it, and its launch file with stand-ins of launch."""

from __future__ import annotations

import runpy
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from bottomlock.live.config import load_config
from bottomlock.live.ros_diagnostics import ROS_TYPE
from bottomlock.live.sections import ROS_TYPES
from bottomlock.ports.registry import PORTS
from tests.cli.calls import command

# Messages that only some drivers send: their packages come with the drivers.
OF_DRIVERS = {"marine_acoustic_msgs", "dvl_msgs"}


@pytest.fixture
def package(root: Path) -> Path:
    return root / "ros" / "bottomlock_ros"


def test_what_is_installed(package: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every file that setup.py names is there, the executable is the node's main, the version that of the workspace."""
    given: dict[str, Any] = {}
    setuptools = ModuleType("setuptools")
    setuptools.setup = lambda **settings: given.update(settings)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "setuptools", setuptools)
    monkeypatch.chdir(package)
    runpy.run_path("setup.py")
    installed = [file for _, files in given["data_files"] for file in files]
    assert all((package / file).is_file() for file in installed)
    assert {"config/rov.toml", "config/bottomlock.yaml", "launch/bottomlock.launch.py"} < set(installed)
    assert given["entry_points"] == {"console_scripts": ["bottomlock_node = bottomlock_ros.node:main"]}
    cargo = tomllib.loads((root / "Cargo.toml").read_text())
    assert given["version"] == cargo["workspace"]["package"]["version"]
    manifest = ET.parse(package / "package.xml").getroot()
    assert (manifest.findtext("name"), manifest.findtext("version")) == (given["name"], given["version"])
    assert manifest.findtext("export/build_type") == "ament_python"


def test_packages_of_messages(package: Path) -> None:
    """The manifest names every package whose messages are used, but those of drivers."""
    needed = {element.text for element in ET.parse(package / "package.xml").getroot().iter("exec_depend")}
    types = {*ROS_TYPES.values(), ROS_TYPE, *(getattr(make, "ros_type", "") for make in PORTS.values())} - {
        ""
    }
    assert {name.split("/")[0] for name in types} - OF_DRIVERS <= needed


def test_the_example_is_one_of_bottomlock_live(package: Path) -> None:
    """The file that the package ships is taken as it is; a process without ROS says that it opens no topic."""
    config = load_config(package / "config" / "rov.toml")
    assert [one.port for one in config.port] == ["ros_odometry", "ros_tf", "ros_twist"]
    done = command("live", package / "config" / "rov.toml")
    assert (done.returncode, "'ros:/dvl/data' is a topic of ROS 2" in done.stderr) == (2, True)
    text = (package / "config" / "bottomlock.yaml").read_text()
    assert text.split("\n")[2:4] == ["bottomlock:", "  ros__parameters:"]
