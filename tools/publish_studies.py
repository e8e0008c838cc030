"""Carry the published studies into the package, the README, docs/methods/index.md and docs/masks.md.

    python tools/publish_studies.py                      # after docs/consistency*.md was written again
    python tools/publish_studies.py --check              # exit code 1 where one of them differs from the pages
    python tools/publish_studies.py --masks out/masks/masks.md      # after `bottomlock masks` with all cases

The pages of consistency are what `bottomlock consistency` wrote, one for each world. Their verdicts go to the package,
where the advice of a campaign's report reads them, and to the table in docs/methods/index.md and the recommendation in
README.md. Of a masks study the tables go to docs/masks.md; the conclusions there are written by hand.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import polars as pl

from bottomlock.report.advice import REFERENCES
from bottomlock.report.published import FILE, never_overconfident, standing
from bottomlock.statistics.chi_squared import CONSISTENT
from bottomlock.studies.consistency_table import MARKS
from bottomlock.tables.studies import PUBLISHED, QUANTITIES

ROOT = Path(__file__).resolve().parent.parent
WORLDS = {
    "paper": "docs/consistency.md",
    "survey": "docs/consistency_survey.md",
    "hovering": "docs/consistency_hovering.md",
}
"""The page of each world. The first must be there."""

HEADS = {
    "paper": "In the paper's world",
    "survey": "In the survey world",
    "hovering": "In the hovering world",
}
TABLE, ADVICE = "table of methods", "never overconfident"
"""Names of the written parts of docs/methods/index.md and README.md."""

MASKS = {
    "velocity under every mask": "Velocity under every mask",
    "recovery": "When the beams come back",
}
"""Names of the written parts of docs/masks.md, and the heading of each in the study's page."""


class PageError(Exception):
    """A page that the study's command did not write, or a text without the marks of its written parts."""


def read_page(text: str, world: str, place: str) -> pl.DataFrame:
    """The verdicts of a page, `tables.studies.PUBLISHED`.

    Raises:
        PageError: for a page without the three tables.
    """
    cells: dict[tuple[str, str, str], dict[str, str]] = {}
    for quantity, words in QUANTITIES.items():
        section = _section(text, words, f"{place}: expected a page of `bottomlock consistency`")
        for key, verdict in _verdicts(section):
            cells.setdefault(key, {})[quantity] = verdict
    rows = [(world, *key, *(verdicts.get(name) for name in QUANTITIES)) for key, verdicts in cells.items()]
    return pl.DataFrame(rows, schema=dict(PUBLISHED), orient="row")


def _section(text: str, heading: str, expected: str) -> str:
    """What stands under a heading of the second level."""
    found = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    if found is None:
        raise PageError(f"{expected}, found no section '{heading}'")
    return found[1]


def _verdicts(section: str) -> Iterator[tuple[tuple[str, str, str], str]]:
    """Method, trajectory and beams with the verdict, from the tables of one quantity."""
    marks = {mark.strip(): verdict for verdict, mark in MARKS.items()}
    trajectory, methods = "", [""]
    for line in section.splitlines():
        if not line.startswith("| "):
            trajectory = ""
            continue
        first, *rest = (part.strip() for part in line.strip("|").split("|"))
        if not trajectory:
            trajectory, methods = first, rest
        elif not first.startswith("---"):
            for method, cell in zip(methods, rest, strict=True):
                if cell:
                    value, _, mark = cell.partition(" ")
                    float(value)
                    yield (method, trajectory, first), marks[mark] if mark else CONSISTENT


def read_pages(root: Path) -> pl.DataFrame:
    """The verdicts of every page that is there."""
    parts: list[pl.DataFrame] = []
    for world, name in WORLDS.items():
        if (root / name).is_file() or not parts:
            parts.append(read_page((root / name).read_text(encoding="utf-8"), world, name))
    return pl.concat(parts)


def with_table(page: str, published: pl.DataFrame) -> str:
    """docs/methods/index.md with the last columns of its table written again.

    Raises:
        PageError: where the marks of a part are missing, or a method of the table is in no study.
    """
    rows = [line for line in _part(page, TABLE)[1].splitlines() if line.startswith("| `")]
    worlds = published["world"].unique(maintain_order=True).to_list()
    written = [_row(["Method", "What it does with the beams", *(HEADS[world] for world in worlds)])]
    written.append("|" + "---|" * (2 + len(worlds)))
    for row in rows:
        name, words = (part.strip() for part in row.strip("|").split("|")[:2])
        method = name.strip("`")
        if method not in set(published["method"]):
            raise PageError(f"docs/methods/index.md: method '{method}' is in no published consistency study")
        written.append(_row([name, words, *(_words(published, method, world) for world in worlds)]))
    return _replaced(page, TABLE, written)


def with_advice(readme: str, published: pl.DataFrame) -> str:
    """README.md with the methods that may be recommended.

    Raises:
        PageError: where the marks of the part are missing.
    """
    return _replaced(readme, ADVICE, [advice(published)])


def advice(published: pl.DataFrame) -> str:
    """The methods that may be recommended, with the number of cells behind that."""
    worlds = published["world"].unique(maintain_order=True).to_list()
    links = ", ".join(f"[{HEADS[world].removeprefix('In ')}]({WORLDS[world]})" for world in worlds)
    found = [method for method in never_overconfident(published) if method not in REFERENCES]
    names = ", ".join(f"`{method}`" for method in found) or "no method"
    return f"Overconfident in no cell of the consistency study in {links}: {names}."


def with_masks(page: str, study: str, place: str) -> str:
    """docs/masks.md with the legend and the tables of a masks study.

    Raises:
        PageError: where the marks of a part are missing, or the study has no recovery because it left out cases.
    """
    for name, heading in MASKS.items():
        section = _section(study, heading, f"{place}: expected a page of `bottomlock masks` with all cases")
        page = _replaced(page, name, [section.strip()])
    return page


def _words(published: pl.DataFrame, method: str, world: str) -> str:
    there = published.filter(pl.col("world") == world)
    return standing(there, method).words if method in set(there["method"]) else "not flown"


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _marks(name: str) -> tuple[str, str]:
    return f"<!-- {name}: written by tools/publish_studies.py -->", f"<!-- end of {name} -->"


def _part(text: str, name: str) -> list[str]:
    """What stands before, between and after the marks of a part."""
    first, last = _marks(name)
    if text.count(first) != 1 or text.count(last) != 1:
        raise PageError(f"expected the marks '{first}' and '{last}' once each")
    before, rest = text.split(first)
    return [before + first, *rest.split(last)]


def _replaced(text: str, name: str, lines: list[str]) -> str:
    before, _, after = _part(text, name)
    return "\n\n".join([before, "\n".join(lines), _marks(name)[1] + after])


def main(arguments: list[str]) -> int:
    """Writes what the arguments say, see the head of this file; exit code 2 for other arguments."""
    match arguments:
        case [] | ["--check"]:
            return _publish_consistency(check=bool(arguments))
        case ["--masks", name]:
            page = ROOT / "docs" / "masks.md"
            text, study = (path.read_text(encoding="utf-8") for path in (page, Path(name)))
            page.write_text(with_masks(text, study, name), encoding="utf-8")
            print("publish_studies: wrote docs/masks.md; compare its conclusions with the tables")
            return 0
    print("usage: python tools/publish_studies.py [--check | --masks STUDY/masks.md]")
    return 2


def _publish_consistency(*, check: bool) -> int:
    published = read_pages(ROOT)
    readme, methods = ROOT / "README.md", ROOT / "docs" / "methods" / "index.md"
    wanted = {
        ROOT / "python" / "bottomlock" / "report" / FILE: published.write_csv(),
        readme: with_advice(readme.read_text(encoding="utf-8"), published),
        methods: with_table(methods.read_text(encoding="utf-8"), published),
    }
    differ = [
        path
        for path, text in wanted.items()
        if not path.is_file() or path.read_text(encoding="utf-8") != text
    ]
    for path in differ:
        if check:
            print(f"publish_studies: {path.name} is not what the pages say; run this without --check")
        else:
            path.write_text(wanted[path], encoding="utf-8")
            print(f"publish_studies: wrote {path.relative_to(ROOT)}")
    return int(bool(differ) and check)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
