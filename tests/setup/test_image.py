"""The files that run the set-up page on a vehicle: labels as BlueOS reads them, and what they start."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

from bottomlock.cli.app import app


@pytest.fixture
def dockerfile(root: Path) -> str:
    """The Dockerfile with its continued lines joined."""
    return (root / "blueos" / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", "")


def label(dockerfile: str, name: str) -> str:
    (words,) = re.findall(rf"^LABEL {name}=(.*)$", dockerfile, re.MULTILINE)
    (text,) = shlex.split(words)
    return text


def test_labels_are_what_blueos_reads(dockerfile: str, root: Path) -> None:
    """Permissions are the body of Docker's request for a container; the others are JSON or text of BlueOS' own."""
    permissions: dict[str, Any] = json.loads(label(dockerfile, "permissions"))
    assert permissions["HostConfig"] == {
        "Binds": ["/usr/blueos/extensions/bottomlock:/data"],
        "NetworkMode": "host",
    }
    assert list(permissions["ExposedPorts"]) == ["8770/tcp"]
    page = (root / "docs" / "howto" / "blueos.md").read_text(encoding="utf-8")
    assert f"`{label(dockerfile, 'permissions')}`" in page
    assert {"name", "email"} <= set(json.loads(label(dockerfile, "authors"))[0])
    assert {"about", "name", "email"} == set(json.loads(label(dockerfile, "company")))
    assert {"website", "support"} <= set(json.loads(label(dockerfile, "links")))
    assert all(isinstance(tag, str) for tag in json.loads(label(dockerfile, "tags")))
    assert label(dockerfile, "type") == "device-integration"
    assert "{tag}" in label(dockerfile, "readme")
    workspace = tomllib.loads((root / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    assert label(dockerfile, "version") == workspace["package"]["version"]


def test_image_and_unit_start_the_command(dockerfile: str, root: Path) -> None:
    """Their words are ones that the command line takes; the container's folder is the one that is bound."""
    (words,) = re.findall(r"^ENTRYPOINT (.*)$", dockerfile, re.MULTILINE)
    unit = (root / "blueos" / "bottomlock.service").read_text(encoding="utf-8")
    (started,) = re.findall(r"^ExecStart=(.+)$", unit, re.MULTILINE)
    for command, folder in ((json.loads(words), "/data"), (started.split(), "/var/lib/bottomlock")):
        assert command[0] == "/opt/bottomlock/bin/bottomlock"
        _, bound, _ = app.parse_args(command[1:], exit_on_error=False, print_error=False)
        assert bound.arguments["folder"] == Path(folder)
        assert bound.arguments.get("host") == ("0.0.0.0" if folder == "/data" else None)
        assert bound.arguments.get("names") == ((".local",) if folder == "/data" else None)
        assert len(bound.arguments.get("networks", ())) == (2 if folder == "/data" else 0)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not there")
def test_systemd_reads_the_unit(root: Path, tmp_path: Path) -> None:
    """Every key is known, and the program is there, in whose place `true` stands here."""
    unit = (root / "blueos" / "bottomlock.service").read_text(encoding="utf-8")
    (tmp_path / "bottomlock.service").write_text(unit.replace("/opt/bottomlock/bin/bottomlock", "/bin/true"))
    done = subprocess.run(
        ["systemd-analyze", "verify", str(tmp_path / "bottomlock.service")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
