"""Check that docs/equations.md, the code and the tests speak of the same equations.

Three rules: the table of the 2017 paper has each of Eqs 1-49 once, and names code and test in each row, as
that of the ellipsoid does; every path in a row exists, and
what follows `::` stands in that file; every equation and erratum cited in crates/ and python/ has its row.
A citation without a year, or with 2017 before it on the line, means Tal et al. 2017; 2015 means Klein &
Diamant 2015; any other year is another work and is passed over.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TABLE = "docs/equations.md"
FIRST, LAST = 1, 49

_SECTION = re.compile(r"^## (?:Equations of .*\b(2015|2017|WGS 84)|(Errata))\b")
_ROW = re.compile(r"^\|\s*(E?\d+(?:\s*[-–]\s*\d+)?)\s*\|(.*)\|\s*$")
_PATH = re.compile(r"`((?:crates|python|tests|tools|docs|data)/[^`:]+)(?:::([^`]+))?`")
_NUMBER = r"\(?\d{1,2}\)?(?![\d.]*\.\d)(?!\d)"
_CITATION = re.compile(rf"\bEqs?\.?\s*({_NUMBER}(?:\s*(?:[-–,&]|and|to)\s*{_NUMBER})*)")
_RANGE = re.compile(r"(\d+)\)?\s*(?:[-–]|to)\s*\(?(\d+)|(\d+)")
_YEAR = re.compile(r"\b(?:19|20)\d\d\b")
_ERRATUM = re.compile(r"\b[Ee]rrat(?:um|a)\s+((?:E\d+(?:,\s*|\s+and\s+)?)+)")


@dataclass(frozen=True)
class Table:
    """Rows of docs/equations.md: equation numbers by year of the paper, errata by name."""

    equations: dict[str, set[int]]
    errata: set[str]
    complaints: list[str]


def numbers(text: str) -> list[int]:
    """Equation numbers in a list such as `(31)–(36), 48`, ranges filled."""
    found: list[int] = []
    for first, last, single in _RANGE.findall(text):
        found.extend([int(single)] if single else range(int(first), int(last) + 1))
    return found


def read_table(root: Path) -> Table:
    """The rows of docs/equations.md, with a complaint for each path or name that does not exist."""
    equations: dict[str, set[int]] = {"2015": set(), "2017": set(), "WGS 84": set()}
    errata: set[str] = set()
    complaints: list[str] = []
    section = ""
    for line_number, line in enumerate((root / TABLE).read_text(encoding="utf-8").splitlines(), start=1):
        if line.startswith("## "):
            heading = _SECTION.match(line)
            section = (heading[1] or heading[2]) if heading else ""
        row = _ROW.match(line)
        if row is None or not section:
            continue
        place = f"{TABLE}:{line_number}"
        if section == "Errata":
            errata.add(row[1])
        else:
            for number in numbers(row[1]):
                if number in equations[section]:
                    complaints.append(f"{place}: Eq. {number} has two rows")
                equations[section].add(number)
        complaints.extend(f"{place}: {problem}" for problem in _missing(root, _PATH.findall(row[2])))
        if section in {"2017", "WGS 84"}:
            complaints.extend(f"{place}: Eq. {row[1]} {problem}" for problem in _unwitnessed(root, row[2]))
    absent = sorted(set(range(FIRST, LAST + 1)) - equations["2017"])
    complaints.extend(f"{TABLE}: Eq. {number} has no row" for number in absent)
    return Table(equations, errata, complaints)


def _missing(root: Path, paths: list[tuple[str, str]]) -> Iterator[str]:
    for path, name in paths:
        if not (root / path).is_file():
            yield f"{path} does not exist"
        elif name and name not in (root / path).read_text(encoding="utf-8"):
            yield f"{path} has no `{name}`"


def _unwitnessed(root: Path, row: str) -> Iterator[str]:
    """A row's code cell names a place in the product, its test cell a test function by name."""
    _what, _form, code, test, _errata = row.split("|")
    if not re.search(r"`(?:crates|python)/", code):
        yield "names no code"
    tests = _PATH.findall(test)
    if not tests:
        yield "names no test"
    for path, name in tests:
        file = root / path
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
        if text and not re.search(rf"\b(?:fn|def) {re.escape(name)}\b", text):
            yield f"names a test that is no function: {path}::{name}"


def check_citations(root: Path, table: Table) -> list[str]:
    """A complaint for each equation or erratum that the code cites and the table lacks."""
    complaints: list[str] = []
    for folder, suffixes in (("crates", {".rs"}), ("python", {".py", ".pyi", ".toml"})):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in suffixes:
                continue
            for line_number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
                place = f"{path.relative_to(root)}:{line_number}"
                complaints.extend(f"{place}: {problem}" for problem in _unlisted(line, table))
    return complaints


def _unlisted(line: str, table: Table) -> Iterator[str]:
    for citation in _CITATION.finditer(line):
        years = _YEAR.findall(line[: citation.start()])
        year = years[-1] if years else "2017"
        if year not in table.equations:
            continue
        for number in set(numbers(citation[1])) - table.equations[year]:
            yield f"cites Eq. {number} of {year}, which has no row in {TABLE}"
    for citation in _ERRATUM.finditer(line):
        for name in set(re.findall(r"E\d+", citation[1])) - table.errata:
            yield f"cites erratum {name}, which has no row in {TABLE}"


def main() -> int:
    """Print every complaint; the exit code is 1 if there is one."""
    table = read_table(ROOT)
    complaints = table.complaints + check_citations(ROOT, table)
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    if not complaints:
        counts = f"{len(table.equations['2017'])} equations and {len(table.errata)} errata"
        print(f"check_equations: {counts} in order")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
