"""docs/architecture.md and the tree agree: paths exist, rooms are named; links of all pages resolve."""

import re
import tomllib
from pathlib import Path

import pytest

ROOTS = ("", "python/bottomlock", "python", "crates/bottomlock/src")
"""What a path on the page may be relative to."""

_PATH = re.compile(
    r"(?<![\w./*-])((?:[\w.-]+/)+(?:[\w.-]+\.(?:py|rs|toml|md|j2|csv))?|[\w-]+\.(?:py|rs))(?![\w*])"
)
_OURS = re.compile(r"^(crates|python|tests|tools|docs|data|benches)/|\.(py|rs|toml|md|j2)$")
_GENERATED = {"__pycache__"}


def named_paths(page: str) -> set[str]:
    """Paths of the checkout that a page names; those of results, such as `figures/`, are not."""
    found = set(_PATH.findall(re.sub(r"\]\([^)]*\)", "]", page)))
    return {path for path in found if _OURS.search(path)} - {"scenario.toml", "case.toml"}


def exists(root: Path, path: str) -> bool:
    return any((root / prefix / path).exists() for prefix in ROOTS)


def rooms(root: Path) -> list[str]:
    """Every folder of the package and of the kernel, relative to the checkout."""
    tops = [root / "python", root / "crates" / "bottomlock" / "src"]
    folders = [
        folder for top in tops for folder in top.rglob("*") if folder.is_dir() and any(folder.iterdir())
    ]
    return sorted(
        f"{folder.relative_to(root).as_posix()}/"
        for folder in folders
        if not _GENERATED.intersection(folder.relative_to(root).parts)
    )


@pytest.fixture(scope="module")
def page(root: Path) -> str:
    return (root / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_every_named_path_exists(root: Path, page: str) -> None:
    paths = named_paths(page)
    assert len(paths) > 80
    assert sorted(path for path in paths if not exists(root, path)) == []


def test_every_room_is_named(root: Path, page: str) -> None:
    tree = page.split("## The tree\n", 1)[1].split("\n## ", 1)[0]
    found = rooms(root)
    assert len(found) > 25
    assert [room for room in found if f"    {room} " not in tree] == []


LEVELS = {"attack", "benchmarks", "c", "golden", "oracle", "property", "repository", "ros", "statistical"}
"""Folders of tests that are of no one room."""


def test_tests_stand_by_the_rooms(root: Path) -> None:
    """`tests/replay` tests what is in `bottomlock/replay`."""
    package = {path.name for path in (root / "python" / "bottomlock").iterdir() if path.is_dir()}
    folders = {path.parent.name for path in (root / "tests").glob("*/*.py")}
    assert sorted(folders - package - LEVELS) == []
    assert sorted(path.name for path in (root / "tests").glob("test_*.py")) == []


def layers(page: str, after: str) -> list[set[str]]:
    """The layers, from the top down, of the block that follows some words."""
    block = page.split(after, 1)[1].split("```\n", 2)[1]
    return [siblings(line) for line in block.splitlines()]


def siblings(layer: str) -> set[str]:
    """The rooms of a layer, parted by | or by :."""
    return set(re.split(r" [|:] ", layer))


def test_python_layers_are_those_of_the_contract(root: Path, page: str) -> None:
    settings = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = [one for one in settings["tool"]["importlinter"]["contracts"] if one["id"] == "layers"]
    enforced = [siblings(layer) - {"__main__"} for layer in contract["layers"]]
    assert layers(page, "Python layers") == enforced


def test_kernel_modules_are_those_of_its_own_test(root: Path, page: str) -> None:
    """That each imports from below is asserted of `ROOMS` there; siblings stand in some order."""
    text = (root / "crates" / "bottomlock" / "tests" / "laws" / "rooms.rs").read_text(encoding="utf-8")
    rooms = re.findall(r'^    "(\w+)",$', text, re.MULTILINE)
    for layer in reversed(layers(page, "Kernel modules, in the same order")):
        assert set(rooms[: len(layer)]) == layer
        del rooms[: len(layer)]
    assert rooms == []


PAGES = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md", "docs")


def pages(root: Path) -> list[Path]:
    """Every page in Markdown at the top of the checkout and under docs/."""
    tops = [root / name for name in PAGES]
    return [file for top in tops for file in (sorted(top.rglob("*.md")) if top.is_dir() else [top])]


_QUOTED = re.compile(r"`((?:crates|python|tests|tools|docs|data|benches)/[^`\s:]+)(?:::\w+)?`")


def test_paths_on_every_page_exist(root: Path) -> None:
    """The changelog names what has gone, and NAME stands for a file to be written."""
    quoted = {
        f"{file.relative_to(root)}: {path}"
        for file in pages(root)
        if file.name != "CHANGELOG.md"
        for path in _QUOTED.findall(file.read_text(encoding="utf-8"))
        if "NAME" not in path and not (root / path).exists()
    }
    assert sorted(quoted) == []


def test_pre_commit_runs_make_lint(root: Path) -> None:
    (parts,) = re.findall(r"^lint: (.*)$", (root / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    hooks = re.findall(
        r"^ +entry: make (.*)$", (root / ".pre-commit-config.yaml").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert hooks == parts.split()


_LINK = re.compile(r"\]\(([^)\s]+)\)")
_FENCED = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)


def anchors(text: str) -> set[str]:
    """The anchors that a forge gives to a page's headings."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def broken_links(file: Path) -> list[str]:
    """Relative links of a page that lead nowhere: to no file, or to no heading of it."""
    broken = []
    for link in _LINK.findall(_FENCED.sub("", file.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (file.parent / path).resolve() if path else file
        if not target.exists() or (anchor and anchor not in anchors(target.read_text(encoding="utf-8"))):
            broken.append(link)
    return broken


def test_relative_links_resolve(root: Path) -> None:
    files = pages(root)
    assert len(files) > 40
    broken = {str(file.relative_to(root)): broken_links(file) for file in files}
    assert {name: links for name, links in broken.items() if links} == {}
