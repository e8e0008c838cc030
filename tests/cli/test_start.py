"""The command starts quickly: nothing heavy is imported before a subcommand is called."""

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from bottomlock.cli.app import COMMANDS

HEAVY = {"numpy", "polars", "matplotlib", "scipy", "pydantic", "jinja2", "bottomlock._kernel"}


@pytest.mark.parametrize("arguments", [["--version"], ["--help"]])
def test_nothing_heavy_is_imported(arguments: list[str]) -> None:
    """Each of these costs more than the whole of the help."""
    code = (
        "import atexit, sys;"
        f"atexit.register(lambda: sys.stderr.write(repr(sorted(set(sys.modules) & {HEAVY!r}))));"
        "from bottomlock.cli.app import main;"
        f"sys.argv = ['bottomlock', *{arguments!r}]; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip()
    assert done.stderr == "[]"


def test_import_bottomlock_imports_nothing_heavy() -> None:
    """Every public name is imported when it is first used, and all of them are there."""
    code = f"import sys, bottomlock; print(sorted(set(sys.modules) & {HEAVY!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    package = importlib.import_module("bottomlock")
    for name in [*package.__all__, "__version__"]:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'navigate'"):
        _ = package.navigate


def test_the_names_are_said_alike_everywhere() -> None:
    """`dir` has no others, whatever was imported; the three lists, of which two are for type checkers, agree."""
    package = importlib.import_module("bottomlock")
    importlib.import_module("bottomlock.campaign.variants")
    assert [name for name in dir(package) if not name.startswith("__")] == sorted(package.__all__)
    assert {"__doc__", "__file__", "__version__"} < set(dir(package))
    assert len(set(dir(package))) == len(dir(package))
    tree = ast.parse(Path(package.__file__ or "").read_text(encoding="utf-8"))
    (typed,) = (node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in typed.body if isinstance(node, ast.ImportFrom)]
    stated = {alias.name: node.module for node in imports for alias in node.names}
    assert sorted(stated) == sorted(package.__all__)
    for name, module in stated.items():
        assert getattr(importlib.import_module(f"{module}"), name) is getattr(package, name)


def test_a_vehicles_computer_needs_numpy_and_pydantic_alone() -> None:
    """The navigator and its settings import no tables and no figures."""
    names = ("Navigator", "Model", "Options", "InitialState", "BeamGeometry", "solve_velocity")
    code = (
        f"import sys, bottomlock; [getattr(bottomlock, name) for name in {names!r}];"
        f"print(sorted(set(sys.modules) & {HEAVY!r}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['bottomlock._kernel', 'numpy', 'pydantic']"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_and_the_command_say_the_same(name: str) -> None:
    """The help line stands in the list, so that it needs no import, and in the command's docstring."""
    place, line = COMMANDS[name]
    module, _, function = place.partition(":")
    command = getattr(importlib.import_module(f"bottomlock.cli.{module}"), function or name.replace("-", "_"))
    first, *_ = (inspect.getdoc(command) or "").splitlines()
    assert first == line
