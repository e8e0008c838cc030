"""The house keeps its promises: commands in the README, one version, files that ship, one way into the kernel."""

import ast
import importlib.metadata
import importlib.resources
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from tools import check_equations

# What tools leave beside the sources, and the extension, which is built and not copied.
GENERATED = {".pyc", ".so", ".pyd", ".dylib"}


def toml(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def fenced(page: str, heading: str, language: str = "") -> list[str]:
    """Fenced blocks of one language under a heading of a page."""
    section = page.split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]
    return [body for tag, body in re.findall(r"```(\w*)\n(.*?)```", section, re.DOTALL) if tag == language]


@pytest.fixture(scope="module")
def readme(root: Path) -> str:
    return (root / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("heading", "command"), [("Run it", "make demo"), ("Test it", "make test")])
def test_the_first_command_of_the_readme(root: Path, readme: str, heading: str, command: str) -> None:
    """A newcomer pastes the first block under each heading: one line, and a target that exists."""
    assert fenced(readme, heading)[0].strip() == command
    target = command.removeprefix("make ")
    assert re.search(rf"^{target}:", (root / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("where", ["README.md", "docs", "python", "examples", "crates"])
def test_nothing_is_installed_from_an_index(root: Path, where: str) -> None:
    """Nothing is published yet: `pip install '.[live]'` in the sources, never `bottomlock[live]` by name."""
    paths = (
        [root / where]
        if where.endswith(".md")
        else [*(root / where).rglob("*.md"), *(root / where).rglob("*.py")]
    )
    for path in paths:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"(pip|pipx|uv) (install|add)\b[^\n`]*\bbottomlock(\[|['\"`\s]|$)", text), path


def test_a_new_user_reads_one_screen(readme: str) -> None:
    """At most 700 words; of folders outside the checkout nothing; one figure, in both colour schemes."""
    words = re.sub(r"<!--.*?-->|\]\([^)]*\)|<[^>]+>", " ", readme, flags=re.DOTALL).split()
    assert len(words) <= 700
    assert "../" not in readme
    first = readme.split("\n## ", 1)[0]
    assert re.search(r'<source media="\(prefers-color-scheme: dark\)" srcset="([^"]+)">', first)
    for figure in re.findall(r'(?:srcset|src)="([^"]+)"', first):
        assert (Path(__file__).resolve().parents[2] / figure).is_file()


def test_the_example_of_the_velocity_page_runs(root: Path) -> None:
    """It solves the surge of beams 1 and 2 and nothing else."""
    page = (root / "docs" / "howto" / "velocity.md").read_text(encoding="utf-8")
    (example,) = fenced(f"{page}\n", "In Python", "python")
    names: dict[str, Any] = {}
    exec(compile(example, "velocity.md", "exec"), names)
    velocity = np.asarray(names["fixes"].velocity_p_mps)
    assert velocity[0, 0] == pytest.approx(2.0, abs=1e-12)
    assert np.isnan(velocity[0, 1:]).all()


def test_every_method_has_its_row_and_its_page(root: Path) -> None:
    from bottomlock.kernel import METHODS

    folder = root / "docs" / "methods"
    index = (folder / "index.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", index, re.MULTILINE) == list(METHODS)
    for method in METHODS:
        page = (folder / f"{method}.md").read_text(encoding="utf-8")
        assert all(f'"../figures/method_{method}_{scheme}.svg"' in page for scheme in ("light", "dark"))


def test_versions_and_dates_agree(root: Path) -> None:
    """Cargo.toml has the one version; the newest section of the CHANGELOG and the citation are of its day."""
    version = toml(root / "Cargo.toml")["workspace"]["package"]["version"]
    assert importlib.metadata.version("bottomlock") == bottomlock.__version__ == version
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", citation, re.MULTILINE) == [version]
    locked = {package["name"]: package["version"] for package in toml(root / "Cargo.lock")["package"]}
    assert locked["bottomlock"] == locked["bottomlock-py"] == version
    changes = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d\d-\d\d))?$", changes, re.MULTILINE)
    assert sections[0] == ("Unreleased", "")
    assert sections[1] == (version, *re.findall(r"^date-released: (.*)$", citation, re.MULTILINE))


def test_every_package_file_ships(root: Path) -> None:
    """Scenarios, stub and marker are read at run time or by type checkers, so the wheel must hold them all."""
    source = root / "python" / "bottomlock"
    shipped = importlib.resources.files("bottomlock")
    expected = [
        path.relative_to(source)
        for path in source.rglob("*")
        if path.is_file() and path.suffix not in GENERATED and not path.name.startswith(".")
    ]
    assert len(expected) > 3
    missing = [str(path) for path in expected if not shipped.joinpath(*path.parts).is_file()]
    assert missing == []


def test_licences_ship() -> None:
    """Both licences ask to go with every copy."""
    shipped = {Path(str(path)).name for path in importlib.metadata.files("bottomlock") or []}
    assert {"LICENSE", "LICENSE-MIT", "LICENSE-APACHE"} <= shipped


def test_kernel_has_one_importer(root: Path) -> None:
    """All Python goes through bottomlock.kernel, which checks shapes in the user's words."""
    importers = set()
    for path in (root / "python").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match node:
                case ast.ImportFrom(module=module, names=names):
                    found = [module or "", *(f"{module}.{alias.name}" for alias in names)]
                case ast.Import(names=names):
                    found = [alias.name for alias in names]
                case _:
                    continue
            if "bottomlock._kernel" in found:
                importers.add(path.relative_to(root / "python").as_posix())
    assert importers == {"bottomlock/kernel/__init__.py"}


def test_equations_are_in_order() -> None:
    """Every equation of the paper has its place and its witness, and every citation its row."""
    table = check_equations.read_table(check_equations.ROOT)
    assert table.complaints + check_equations.check_citations(check_equations.ROOT, table) == []
