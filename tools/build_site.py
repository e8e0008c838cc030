"""Build the documentation site from the pages of docs/ and the scripts of examples/.

    python -m tools.build_site                       # out/site
    python -m tools.build_site --builder linkcheck   # every link; those outside are tried

Warnings are errors. What docs/ links to in the rest of the checkout becomes a link to the repository, a <picture> of a
forge two figures of which the scheme shows one, and the script of each example can be downloaded from its page.
"""

from __future__ import annotations

import ast
import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import cyclopts
import polars as pl

from tools import key_reference

ROOT = Path(__file__).resolve().parent.parent
REPOSITORY = "https://github.com/bottomlock/bottomlock/blob/main/"
STAGED = ROOT / "out" / "site-source"

_LINK = re.compile(r"(\]\()([^)#\s]+)(#[^)\s]*)?(\))")
_PICTURE = re.compile(
    r'<picture>\s*<source media="\(prefers-color-scheme: dark\)" srcset="(?P<dark>[^"]+)">'
    r'\s*<img alt="(?P<alt>[^"]+)" src="(?P<light>[^"]+)">\s*</picture>'
)
_CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)


def outward(page: Path, text: str, root: Path = ROOT) -> str:
    """A page of docs/ with its links out of docs/ as links to the repository; code stays as it is.

    >>> outward(ROOT / "docs" / "survey.md", "[us](../CONTRIBUTING.md#style) [x](keys.md) `[c](../Makefile)`")
    '[us](https://github.com/bottomlock/bottomlock/blob/main/CONTRIBUTING.md#style) [x](keys.md) `[c](../Makefile)`'
    """

    def one(match: re.Match[str]) -> str:
        opening, path, anchor, closing = match[1], match[2], match[3] or "", match[4]
        if re.match(r"[a-z]+:", path):
            return match[0]
        target = Path(os.path.normpath(page.parent / path))
        if target.is_relative_to(root / "docs") or not target.exists():
            return match[0]
        if target.parent == root / "examples" and target.suffix == ".py":
            gallery = os.path.relpath(root / "docs" / "gallery" / target.name, page.parent)
            return f"{opening}{gallery}{closing}"
        return f"{opening}{REPOSITORY}{target.relative_to(root).as_posix()}{anchor}{closing}"

    parts = _CODE.split(text)
    return "".join(part if index % 2 else _LINK.sub(one, part) for index, part in enumerate(parts))


def in_both_schemes(text: str) -> str:
    """A page whose pictures follow the scheme of the site, which a reader may choose, in place of the browser's alone.

    >>> dark = '<source media="(prefers-color-scheme: dark)" srcset="b.svg">'
    >>> print(in_both_schemes(f'<picture> {dark} <img alt="A curve" src="a.svg"> </picture>'))
    ![A curve](a.svg){.only-light}
    ![A curve](b.svg){.only-dark}
    """
    return _PICTURE.sub(r"![\g<alt>](\g<light>){.only-light}\n![\g<alt>](\g<dark>){.only-dark}", text)


def of_the_site(page: Path, text: str) -> str:
    """A page of docs/ as Sphinx reads it."""
    text = in_both_schemes(outward(page, text))
    if page == ROOT / "docs" / "reference" / "tables.md":
        text += "\n" + tables()
    if page == ROOT / "docs" / "keys.md":
        text += "\n" + key_reference.overview()
    return text


def examples(root: Path = ROOT) -> list[Path]:
    """The scripts of examples/ that are pages, by name."""
    return sorted((root / "examples").glob("*.py"))


def write(path: Path, data: bytes) -> Path:
    """Writes a file if its bytes are others, so that Sphinx reads again what has changed alone."""
    if not path.is_file() or path.read_bytes() != data:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return path


def with_downloads(script: Path, text: str) -> str:
    """An example with a last paragraph that links its script."""
    name = script.name
    links = (
        f"The page was run when this site was built. Download it as {{download}}`script <_downloads/{name}>`."
    )
    pages = re.sub(r"\]\(\.\./docs/", "](../", text)
    return f"{pages.rstrip()}\n\n# %% [markdown]\n# ---\n# {links}\n"


def tables(root: Path = ROOT) -> str:
    """Columns, types and meanings of every table: a section a file of the package's `files`."""
    parts: list[str] = []
    package = root / "python"
    for path in sorted((package / "bottomlock" / "files").glob("*.py")):
        module = importlib.import_module(".".join(path.relative_to(package).with_suffix("").parts))
        body = ast.parse(path.read_text(encoding="utf-8")).body
        found = [part for one, after in pairwise(body) for part in _table(module, one, after)]
        if found:
            title = (module.__doc__ or path.stem).splitlines()[0].rstrip(".")
            parts += [f"## {title}", *found]
    return "\n\n".join(parts) + "\n"


def _table(module: ModuleType, one: ast.stmt, after: ast.stmt) -> Iterator[str]:
    """A mapping of columns to types with the string below it; nothing for any other statement."""
    match one, after:
        case (
            ast.AnnAssign(target=ast.Name(id=name)),
            ast.Expr(value=ast.Constant(value=str(words))),
        ) if not name.startswith("_"):
            columns = getattr(module, name)
            if isinstance(columns, Mapping) and all(
                isinstance(kind, pl.DataType) for kind in columns.values()
            ):
                rows = [f"| `{column}` | {kind} |" for column, kind in columns.items()]
                head = [f"### {name}", "", " ".join(words.split()), "", "| Column | Type |", "|---|---|"]
                yield "\n".join([*head, *rows])


def staged(folder: Path) -> set[Path]:
    """What Sphinx reads, laid out in a folder."""
    made: set[Path] = set()
    for path in sorted((ROOT / "docs").rglob("*")):
        if path.is_dir() or "__pycache__" in path.parts:
            continue
        data = path.read_bytes()
        if path.suffix == ".md":
            data = of_the_site(path, data.decode()).encode()
        made.add(write(folder / path.relative_to(ROOT / "docs"), data))
    made.update(write(folder / name, text.encode()) for name, text in key_reference.pages().items())
    gallery = folder / "gallery"
    for script in examples():
        text = script.read_text(encoding="utf-8")
        made.add(write(gallery / script.name, with_downloads(script, text).encode()))
        made.add(write(gallery / "_downloads" / script.name, text.encode()))
    rustdoc = ROOT / "target" / "doc"
    if (rustdoc / "bottomlock" / "index.html").is_file():
        shutil.copytree(rustdoc, folder / "_extra" / "rust", dirs_exist_ok=True)
    (folder / "_extra").mkdir(exist_ok=True)
    return made


def clear(folder: Path, made: set[Path]) -> None:
    """Removes what an earlier build left there and this one did not make."""
    for path in folder.rglob("*"):
        kept = {"_extra", "jupyter_execute"} & set(path.relative_to(folder).parts)
        if path.is_file() and path not in made and not kept:
            path.unlink()


def main(*, out: Path = ROOT / "out" / "site", builder: str = "html") -> int:
    """Build the documentation site from the pages of docs/ and the scripts of examples/.

    Args:
        out: Folder of the site.
        builder: Sphinx's; `linkcheck` tries every link.
    """
    clear(STAGED, staged(STAGED))
    links = builder == "linkcheck"
    command = [sys.executable, "-m", "sphinx", "-b", builder, "--keep-going", "--quiet", "-j", "2"]
    command += [] if links else ["--fail-on-warning"]
    command += ["-d", str(ROOT / "out" / "site-cache"), str(STAGED), str(out.resolve())]
    silent = subprocess.DEVNULL if links else None
    done = subprocess.run(command, check=False, stderr=silent, cwd=ROOT)  # noqa: S603 - our own arguments
    return broken_links(out / "output.json") if links else done.returncode


def broken_links(report: Path) -> int:
    """Prints what the link check found; the number of broken links within the site, for those outside may be away."""
    found = [json.loads(line) for line in report.read_text(encoding="utf-8").splitlines()]
    broken = [link for link in found if link["status"] == "broken"]
    within = [link for link in broken if not link["uri"].startswith("http")]
    for link in broken:
        print(f"{link['filename']}:{link['lineno']}: {link['uri']}: {link['info'][:100]}")
    print(
        f"{len(found)} links, {len(within)} broken within the site, {len(broken) - len(within)} outside not reached"
    )
    return len(within)


if __name__ == "__main__":
    cyclopts.run(main)
