"""requirements.lock: what pyproject.toml asks for, one version each, with hashes, from nowhere in particular."""

import re
import tomllib
from pathlib import Path

import pytest

_ENTRY = re.compile(r"^([\w.-]+)==([^ \\;]+)", re.MULTILINE)


def name_of(requirement: str) -> str:
    """The name in a requirement, as registries write it."""
    return re.split(r"[<>=!~ \[;]", requirement, maxsplit=1)[0].lower().replace("_", "-")


@pytest.fixture(scope="module")
def lock(root: Path) -> str:
    return (root / "requirements.lock").read_text(encoding="utf-8")


def test_the_lock_has_what_is_asked_for(root: Path, lock: str) -> None:
    """`make lock` after every change of the dependencies."""
    written = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    groups = written["dependency-groups"]
    assert sorted(groups) == ["build", "dev", "docs", "others", "vehicle"]
    locked: dict[str, set[str]] = {}
    for name, version in _ENTRY.findall(lock):
        locked.setdefault(name, set()).add(version)
    named = [one for group in groups.values() for one in group if isinstance(one, str)]
    asked = [*written["project"]["dependencies"], *named]
    assert [one for one in asked if name_of(one) not in locked] == []
    pinned = [one.split("==") for one in asked if "==" in one]
    assert len(pinned) > 8
    assert [name for name, version in pinned if locked[name_of(name)] != {version}] == []


def test_every_entry_has_hashes_and_no_place(lock: str) -> None:
    """A package that was changed at its source, or comes from another one, is not installed."""
    entries = re.split(
        r"\n(?=[a-z])", "\n".join(line for line in lock.splitlines() if not line.startswith("#"))
    )
    assert len(entries) > 40
    assert [entry.split()[0] for entry in entries if "--hash=sha256:" not in entry] == []
    assert "://" not in lock


def test_compiled_packages_are_locked_for_every_platform(lock: str) -> None:
    """The lock is of no one machine: numpy alone has wheels for some thirty platforms and versions of Python."""
    (numpy, *_) = re.findall(r"^numpy==.*?(?=^\w)", lock, re.MULTILINE | re.DOTALL)
    assert numpy.count("--hash=sha256:") > 20


def test_what_a_vehicle_installs_is_a_part_of_the_lock(root: Path, lock: str) -> None:
    """requirements-live.txt has entries of the lock, with their hashes, and nothing of tables, figures and pages."""
    entry = re.compile(r"^[\w.-]+==[^ ]+.*?(?=^\w|\Z)", re.MULTILINE | re.DOTALL)
    own = (root / "requirements-live.txt").read_text(encoding="utf-8")
    entries = set(entry.findall(own))
    assert len(entries) > 15
    assert entries <= set(entry.findall(lock))
    groups = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
    names = {name for name, _ in _ENTRY.findall(own)}
    assert {name_of(one) for one in groups["vehicle"]} <= names
    assert not names & {"polars", "scipy", "matplotlib", "jinja2", "threadpoolctl"}
