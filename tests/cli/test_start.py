"""The command starts quickly: nothing heavy is imported before a subcommand is called."""

import ast
import importlib
import inspect
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bottomlock.cli.app import COMMANDS, app

HEAVY = {"numpy", "polars", "matplotlib", "scipy", "pydantic", "jinja2", "bottomlock._kernel"}


def function_of(name: str) -> Callable[..., None]:
    """What a command runs."""
    module, _, function = COMMANDS[name][0].partition(":")
    found: Callable[..., None] = getattr(
        importlib.import_module(f"bottomlock.cli.{module}"), function or name.replace("-", "_")
    )
    return found


ALLOWED = {"numpy", "bottomlock._kernel"}
"""For helps that list what the kernel knows: a tenth of a second."""


def test_no_help_imports_what_the_command_works_with() -> None:
    """Each of these costs more than the whole of the help."""
    code = (
        "import contextlib, io, sys\n"
        "from bottomlock.cli.app import main\n"
        f"for words in [['--version'], ['--help'], *([name, '--help'] for name in {list(COMMANDS)!r})]:\n"
        "    sys.argv = ['bottomlock', *words]\n"
        "    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n"
        "        main()\n"
        f"    heavy = set(sys.modules) & {HEAVY!r} - ({ALLOWED!r} if len(words) == 2 else set())\n"
        "    assert not heavy, (words, heavy)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("name", "place", "stated"),
    [
        ("run", "bottomlock.kernel:METHODS", None),
        ("run", "bottomlock.own_method:DEAD_RECKONING", None),
        ("run", "bottomlock.campaign.engine:ENGINES", None),
        ("convert", "bottomlock.io.formats:NAMES", None),
        ("replay", "bottomlock.export.formats:FORMATS", None),
        ("study", "bottomlock.studies.cases:SENSORS", None),
        ("simulate-dvl", "bottomlock.instruments.play:EXPECTED", None),
        ("reproduce", "bottomlock.studies.reproduce:RUNS", "runs"),
        ("live-setup", "bottomlock.setup.server:PORT", "port"),
    ],
)
def test_a_help_says_what_there_is(
    name: str, place: str, stated: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is written out, since it imports nothing: names in their order, and defaults."""
    module, _, constant = place.partition(":")
    value = getattr(importlib.import_module(module), constant)
    command = function_of(name)
    text = value if isinstance(value, str | int) else ", ".join(value)
    if stated is not None:
        assert str(inspect.signature(command).parameters[stated].default) == str(text)
        return
    with pytest.raises(SystemExit) as ended:
        app([name, "--help"])
    assert ended.value.code in {0, None}
    shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert f"{text}".replace(", dask", " or dask") in shown


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
    first, *_ = (inspect.getdoc(function_of(name)) or "").splitlines()
    assert first == COMMANDS[name][1]
