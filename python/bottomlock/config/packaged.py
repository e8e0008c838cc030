"""The TOML files that ship with the package, scenarios, vehicles and geometries, or those of a user in their place."""

from functools import cache
from importlib import resources
from pathlib import Path
from typing import Literal

from bottomlock.config.toml_file import read_text
from bottomlock.errors import ScenarioError, note
from bottomlock.files.atomic_write import write_text
from bottomlock.files.overwriting import check_free
from bottomlock.text import guess

FOLDERS = {"scenario": "scenarios", "vehicle": "vehicles", "geometry": "geometries"}


def packaged_names(folder: str) -> list[str]:
    """Names of the packaged files of a folder, sorted.

    >>> "tauv" in packaged_names("vehicles")
    True
    """
    files = (resources.files("bottomlock.config") / folder).iterdir()
    return sorted(one.name.removesuffix(".toml") for one in files if one.name.endswith(".toml"))


def packaged_text(folder: str, name: str) -> str:
    """The text of a packaged file."""
    file = resources.files("bottomlock.config") / folder / f"{name}.toml"
    return file.read_text(encoding="utf-8")


def text_of(kind: Literal["scenario", "vehicle", "geometry"], source: str | Path) -> tuple[str, str]:
    """The text of a packaged file by its name, or of a file; and how errors name it.

    A packaged name is taken as such; a `Note` says so where NAME.toml is in the working directory.

    Raises:
        ScenarioError: for a file that is not there or cannot be read.
    """
    path, names = Path(source), packaged_names(FOLDERS[kind])
    if str(source) in names:
        if (beside := Path(f"{source}.toml")).is_file():
            _note_once(kind, str(source), beside.resolve())
        return packaged_text(FOLDERS[kind], str(source)), f"{kind} {source}"
    if path.is_dir() and str(source):
        results = "`bottomlock report` takes a folder of results" if kind == "scenario" else ""
        raise ScenarioError("is a folder", place=path, expected=f"a {kind} (TOML)", hint=results)
    if not path.is_file():
        raise ScenarioError(
            "is neither a file nor packaged",
            key=f"{kind} '{source}'",
            expected=f"a file, or one of {', '.join(names)}",
            hint=guess(str(source), names),
        )
    return read_text(path), str(path)


@cache
def _note_once(kind: str, name: str, _file: Path) -> None:
    note(f"{kind} '{name}' is the packaged one; for the file in this folder write {name}.toml")


def copy_packaged(kind: str, name: str, destination: str | Path, *, force: bool = False) -> Path:
    """Writes a packaged scenario, vehicle or geometry out to edit; an existing file is replaced with `force` alone.

    Raises:
        ScenarioError: for a kind that is not in `FOLDERS`, and a name that is not packaged.
        OutputError: where the destination is there without `force`, or cannot be written.
    """
    if kind not in FOLDERS.values():
        raise ScenarioError(f"{kind} are not copied", expected=", ".join(FOLDERS.values()))
    names = packaged_names(kind)
    if name not in names:
        raise ScenarioError(
            f"is not among the packaged {kind}",
            key=f"'{name}'",
            expected=f"one of {', '.join(names)}",
            hint=guess(name, names),
        )
    destination = Path(destination)
    check_free(destination, force=force)
    write_text(destination, packaged_text(kind, name))
    return destination
