"""The page docs/evidence.md from the small tables in data/evidence.

    python -m tools.evidence                    # writes the page
    python -m tools.evidence --fly study_paper  # flies the table of a study again, then writes the page
    python -m tools.evidence --publish          # writes the verdicts that the advice of reports reads into the package

A table is a Parquet file whose metadata say what it is: `title`, `text`, `place` (its order on the page), `command`,
`commit`, `date`; columns of the last three names do, too. A table that is not shown as it is names in `index` the
columns of its rows on the page, in `on` the column whose values become columns, and in `values` what stands in the
cells; `count` names two columns whose combinations are counted. The table of a study (`files.columns.STUDY`) is summed
by method where it has more than `MOST_ROWS` rows.
"""

from __future__ import annotations

import datetime as dt
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cyclopts
import polars as pl

from bottomlock.files.columns import PUBLISHED, STUDY, check
from bottomlock.report import advice
from bottomlock.report.advice import standing
from bottomlock.statistics.chi_squared import OVERCONFIDENT
from bottomlock.text import number

ROOT = Path(__file__).resolve().parent.parent
DATA, PAGE = ROOT / "data" / "evidence", ROOT / "docs" / "evidence.md"
WORLDS = {"study_paper": "paper", "study_survey": "survey", "study_hovering": "hovering"}
"""Tables whose verdicts ship with the package, and the name of their world there."""
MOST_ROWS = 40
"""Of a table that is shown whole."""
ORIGIN = ("command", "commit", "date")
FORMS = {
    "first_line": {
        "title": "First lines of a replay",
        "text": "`replay --init`, untouched, then `replay`, of open recordings, simulated dives and planted mistakes: "
        "rows of a kind by outcome, held against the truth (`tools/first_line.py`).",
        "count": "kind,outcome",
        "place": "5",
    },
    "mutation_sample": {
        "title": "Random wrong lines",
        "text": "Faults drawn at random, that build, by what the quick tests of their rooms make of them; "
        "groups of rooms that are not listed have not been measured.",
        "count": "group,outcome",
        "place": "50",
    },
}
"""How tables are shown whose tools state their origin alone."""
CODE = ("Cargo.lock", "crates", "python")
"""What the number of a study depends on."""

_HEAD = """\
# Evidence

Every number here stands in a small table in `data/evidence/`, with the command and the commit that made it.
`python -m tools.evidence` writes this page from them, and a test flies a row of each study again.

A method is **overconfident** where its errors exceed its σ: the mean NEES over the runs is above its chi-squared band
at any of five times of a run, in velocity and attitude or in the whole state. It is **conservative** where that of
velocity and attitude is below. All means of a study are one family: methods that are all consistent have another
verdict anywhere in 1 % of studies. Velocity errors are RMS over the runs at the end.
"""


def read(path: Path) -> tuple[pl.DataFrame, dict[str, str]]:
    """A table without the columns of its origin, and what is said of it."""
    table, said = pl.read_parquet(path), pl.read_parquet_metadata(path)
    about = FORMS.get(path.stem, {}) | {
        key: value for key, value in said.items() if not key.startswith("ARROW")
    }
    for name in ORIGIN:
        if name in table.columns:
            about.setdefault(name, ", ".join(map(str, table[name].unique(maintain_order=True))))
    about.setdefault("title", path.stem.replace("_", " ").capitalize())
    return table.drop(ORIGIN, strict=False), about


def page(folder: Path = DATA) -> str:
    """The page, in Markdown."""
    found = {path.stem: read(path) for path in sorted(folder.glob("*.parquet"))}
    ordered = sorted(found.items(), key=lambda item: (int(item[1][1].get("place", 1000)), item[0]))
    parts = [_HEAD]
    for name, (table, about) in ordered:
        made = ", ".join([f"commit {about['commit'][:8]}", *filter(None, [about.get("date")])])
        origin = f"`data/evidence/{name}.parquet`: `{about['command']}`, {made}."
        parts += [f"## {about['title']}", about.get("text", ""), *_shown(table, about), origin]
    return "\n\n".join(part.strip() for part in parts if part) + "\n"


def _shown(table: pl.DataFrame, about: Mapping[str, str]) -> Iterator[str]:
    if "count" in about:
        index, on = about["count"].split(",")
        counts = table.group_by(index, on, maintain_order=True).len()
        yield _markdown(*_pivoted(counts, {"index": index, "on": on, "values": "len"}))
    elif "on" in about:
        yield _markdown(*_pivoted(table, about))
    elif set(STUDY) <= set(table.columns) and table.height > MOST_ROWS:
        yield _markdown(*summed(table))
    elif set(STUDY) <= set(table.columns):
        yield _markdown(*_cells(table))
    else:
        yield _markdown(table.columns, table.head(MOST_ROWS).rows())
        if table.height > MOST_ROWS:
            yield f"The first {MOST_ROWS} of {table.height} rows."


def summed(table: pl.DataFrame) -> tuple[list[str], list[list[Any]]]:
    """A row a method: its verdicts, and the range of its velocity error by the number of beams."""
    world, rows = verdicts(table, ""), []
    table = table.with_columns(returning=pl.col("beams").str.count_matches(",") + 1)
    for (method,), here in table.group_by("method", maintain_order=True):
        ranges = [_range(here.filter(pl.col("returning").is_in(beams))) for beams in ([3, 4], [2], [1])]
        found = standing(world, method)
        counts = [found.cells, found.consistent, found.overconfident, found.overconfident_core]
        rows.append([f"`{method}`", *counts, *ranges])
    heads = ["method", "cells", "consistent", "overconfident", "in velocity and attitude"]
    return [*heads, "3 or 4 beams, m/s", "2 beams, m/s", "1 beam, m/s"], rows


def _range(cells: pl.DataFrame) -> str:
    """Least and greatest velocity error."""
    values = cells["velocity_rms_over_runs_mps"]
    if values.is_empty():
        return ""
    least, most = number(values.min(), 2), number(values.max(), 2)  # type: ignore[arg-type]
    return least if least == most else f"{least}–{most}"


def _cells(table: pl.DataFrame) -> tuple[list[str], list[list[Any]]]:
    """A row a cell of a small study."""
    shown = ["velocity_rms_over_runs_mps", "attitude_rms_over_runs_deg", "position_rms_over_runs_m"]
    shown += ["nees_velocity_attitude", "nees", "nis"]
    rows = [
        [f"`{row['method']}`", row["trajectory"], *(number(row[name]) for name in shown), row["verdict"]]
        for row in table.iter_rows(named=True)
    ]
    heads = ["velocity, m/s", "attitude, °", "position, m", "NEES of 6", "NEES", "NIS", "verdict"]
    return ["method", "trajectory", *heads], rows


def _pivoted(table: pl.DataFrame, about: Mapping[str, str]) -> tuple[list[str], list[Any]]:
    """A row for each value of `index`, a column for each of `on`; several `values` stand with a slash between them."""
    index, values = about["index"].split(","), about["values"].split(",")
    cells = pl.Series("cell", [_cell(row, values) for row in table.iter_rows(named=True)])
    found = table.select(*index, about["on"], cells).pivot(about["on"], index=index, values="cell")
    return found.columns, found.with_columns(pl.exclude(index).fill_null("")).rows()


def _cell(row: Mapping[str, Any], values: Sequence[str]) -> str:
    text = " / ".join(_text(row[name]) for name in values)
    return text + " ▲" if row.get("verdict") == OVERCONFIDENT else text


def _text(value: object) -> str:
    if value is None:
        return "–"
    if not isinstance(value, float):
        return str(value)
    return number(value) if abs(value) >= 1e4 else f"{value:.{4 if abs(value) >= 100.0 else 3}g}"


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    lines = [columns, ["---"] * len(columns), *([_text(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def verdicts(table: pl.DataFrame, world: str) -> pl.DataFrame:
    """The verdicts of a study, `files.columns.PUBLISHED`."""
    return table.with_columns(pl.lit(world).alias("world")).select(list(PUBLISHED))


def published_table() -> pl.DataFrame:
    """The verdicts that ship with the package, from the tables of the studies."""
    return pl.concat([verdicts(read(DATA / f"{name}.parquet")[0], world) for name, world in WORLDS.items()])


def write_published() -> None:
    """Writes the verdicts into the package."""
    origins = [read(DATA / f"{name}.parquet")[1] for name in WORLDS]
    about = {name: "; ".join(dict.fromkeys(origin[name] for origin in origins)) for name in ORIGIN}
    published_table().write_parquet(Path(advice.__file__).with_name(advice.FILE), metadata=about)


def flown(name: str) -> None:
    """Flies the table of a study again by its command, and writes it with the commit of the code.

    Raises:
        SystemExit: for a table that is no study's, a command that fails, and code that is not committed.
    """
    path = DATA / f"{name}.parquet"
    _, about = read(path)
    words = shlex.split(about["command"])
    if words[:2] != ["bottomlock", "study"]:
        raise SystemExit(f"evidence: {name} is not a study's; its command is {about['command']}")
    if changed := git("status", "--porcelain", "--", *CODE):
        raise SystemExit(f"evidence: commit the code first, a table names its commit; changed:\n{changed}")
    with TemporaryDirectory() as folder:
        command = [str(Path(sys.executable).with_name("bottomlock")), *words[1:]]
        subprocess.run([folder if word == "DIR" else word for word in command], check=True)  # noqa: S603 - itself
        table = check(pl.read_parquet(Path(folder) / "study.parquet"), STUDY, place=name)
    today = dt.datetime.now(tz=dt.UTC).date().isoformat()
    table.write_parquet(path, metadata=about | origin(about["command"]) | {"date": today})


def origin(command: str) -> dict[str, str]:
    """What is said of a table of the code at hand: commit and command."""
    return {"commit": git("rev-parse", "HEAD"), "command": command}


def git(*arguments: str) -> str:
    """What Git says of the checkout."""
    command = ["git", "-C", str(ROOT), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()  # noqa: S603 - itself


def main(*, fly: str = "", publish: bool = False) -> None:
    """Writes docs/evidence.md from the small tables in data/evidence.

    Args:
        fly: The table of a study to fly again.
        publish: Write the verdicts into the package.
    """
    if fly:
        flown(fly)
    if publish:
        write_published()
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    cyclopts.run(main)
