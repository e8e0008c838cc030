"""Scores the recordings and writes the tables of docs/recorded.md: `python tools/score_recorded.py [DATA]`.

DATA is the folder of the recordings, by default the one that BOTTOMLOCK_RECORDINGS names. Every table stands between
two marks in the page, and nothing else of the page is changed. `--check` compares instead of writing: numbers may
differ by one unit of their last digit, since processors and libraries round differently. `--parts FOLDER` keeps the
finished parts, and a second call continues an interrupted one.
"""

import argparse
import os
import re
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.files.atomic_write import write_text
from tools import recorded_tables
from tools.akit import SECTIONS
from tools.akit_reference import innovations, reference_quality
from tools.recorded_runs import recorded_runs

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "recorded.md"
DRAWS = 10
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def recordings() -> Path:
    """Default folder of the recordings."""
    return Path(os.environ.get("BOTTOMLOCK_RECORDINGS", ROOT.parent / "shared" / "data"))


def all_tables(data: Path, parts: Path, *, draws: int, jobs: int) -> dict[str, str]:
    """Every table of the page by its mark."""
    runs = recorded_runs(data, parts, draws=draws, jobs=jobs)
    robust = {name: runs[name] for name in ("noisy", "degraded")}
    quality = [reference_quality(data, parts, section) for section in SECTIONS]
    tables = {
        "full": recorded_tables.full_velocity(runs["full"], runs["alone"]),
        "reference": recorded_tables.reference_table(quality),
        "innovations": recorded_tables.innovation_table(
            [innovations(data, parts, section) for section in SECTIONS]
        ),
        "twin": "\n".join(
            (
                "Every beam:\n",
                recorded_tables.consistency(runs["twin"], "recorded"),
                "Beams 3 and 4 lost:\n",
                recorded_tables.consistency(runs["twin"], "lost_34"),
            )
        ),
        "twin-smoothed": recorded_tables.smoothed_and_filtered(runs["twin"]),
        "lost": recorded_tables.lost_runs(robust),
        "one": recorded_tables.one_draw(robust),
        "caves-1": recorded_tables.caves(data, 1),
        "caves-2": recorded_tables.caves(data, 2),
    }
    for name, frame in robust.items():
        tables |= {
            name: recorded_tables.what_if_cases(frame),
            f"{name}-consistency": recorded_tables.consistency(frame, "lost_34"),
            f"{name}-consistency-recorded": recorded_tables.consistency(frame, "recorded"),
            f"{name}-tc": recorded_tables.against_tc(frame),
            f"{name}-plain": recorded_tables.robust_and_plain(frame, runs[f"{name}_plain"]),
            f"{name}-smoothed": recorded_tables.smoothed_and_filtered(runs[f"{name}_smoothed"]),
        }
    return tables


def replaced(page: str, tables: dict[str, str]) -> str:
    """The page with each table between its marks.

    Raises:
        SystemExit: where the page lacks a mark.
    """
    for name, text in tables.items():
        match = marked(page, name)
        begin, end = match.start(2), match.end(2)
        page = f"{page[:begin]}\n{text}\n{page[end:]}"
    return page


def write_tables(page: Path, tables: dict[str, str]) -> None:
    """Writes tables between their marks into a page.

    Raises:
        SystemExit: where the page lacks a mark.
    """
    write_text(page, replaced(page.read_text(encoding="utf-8"), tables))


def print_or_write(page: Path | None, tables: dict[str, str]) -> None:
    """Prints tables, or writes them between their marks into a page.

    Raises:
        SystemExit: where the page lacks a mark.
    """
    if page is None:
        print("\n".join(tables.values()))
    else:
        write_tables(page, tables)


def marked(page: str, name: str) -> re.Match[str]:
    """Where a table stands in the page; its text is group 2.

    Raises:
        SystemExit: where the page lacks the mark.
    """
    match = re.search(rf"(<!-- table {name} -->\n)(.*?)(?=<!-- end -->)", page, re.DOTALL)
    if match is None:
        raise SystemExit(f"the page has no mark for the table '{name}'")
    return match


def same_numbers(there: str, now: str) -> bool:
    """Whether two texts are the same but for one unit of the last digit of their numbers.

    >>> same_numbers("end 0.448 m", "end 0.449 m"), same_numbers("end 0.448 m", "end 0.45 m")
    (True, False)
    """
    if NUMBER.sub("#", there) != NUMBER.sub("#", now):
        return False
    pairs = zip(NUMBER.findall(there), NUMBER.findall(now), strict=True)
    return all(abs(float(a) - float(b)) <= 1.001 * min(_unit(a), _unit(b)) for a, b in pairs)


def _unit(text: str) -> float:
    """One unit of the last digit of a number as written."""
    digits, _, power = text.partition("e")
    _, _, fraction = digits.partition(".")
    return float(10.0 ** (int(power or 0) - len(fraction)))


def main() -> None:
    """Scores all recordings and writes the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", nargs="?", type=Path, default=recordings())
    parser.add_argument("--check", action="store_true", help="compare with the page instead of writing it")
    parser.add_argument(
        "--parts", type=Path, help="folder that keeps finished parts; default: a temporary one"
    )
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes; default: one per core"
    )
    asked = parser.parse_args()
    for name in ("akit_snapir", "caves_girona_linkquest"):
        if not (asked.data / name).is_dir():
            raise SystemExit(
                f"{asked.data}: has no folder '{name}', expected the recordings (BOTTOMLOCK_RECORDINGS)"
            )
    with tempfile.TemporaryDirectory() as folder:
        tables = all_tables(asked.data, asked.parts or Path(folder), draws=DRAWS, jobs=asked.jobs)
    page = PAGE.read_text(encoding="utf-8")
    if asked.check:
        differing = [
            name
            for name, text in tables.items()
            if not same_numbers(marked(page, name)[2].strip(), text.strip())
        ]
        raise SystemExit(
            f"{PAGE}: differs from the recordings in: {', '.join(differing)}" if differing else 0
        )
    write_text(PAGE, replaced(page, tables))
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
