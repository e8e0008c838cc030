"""The tables of docs/bench.md, from the leaderboards that `bottomlock bench page` has written.

    python tools/publish_bench.py page/leaderboard.parquet               # our methods on train and validation
    python tools/publish_bench.py page/leaderboard.parquet --rivals      # all entries on the test split
    python tools/publish_bench.py page/leaderboard.parquet --heading     # our methods on the missions of version 1.1

replaces what stands between the two marks of the table.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.atomic_write import write_text
from bottomlock.bench.leaderboard import OVERALL
from bottomlock.bench.tasks import CURRENT, NAVIGATION, RANKED, RECOVERY

PAGE = Path(__file__).resolve().parent.parent / "docs" / "bench.md"
OURS, RIVALS, HEADING = (
    f"<!-- {what}: tools/publish_bench.py -->\n" for what in ("our methods", "rivals", "version 1.1")
)
LAST = "<!-- end -->\n"
OTHERS = ("velocity NEES a component", "drift, % DT", "sway RMS, m/s")


def _number(value: float) -> str:
    digits = 0 if abs(value) >= 100.0 else 2
    return f"{value:.{digits}f}".replace("-", "−")


def table(board: pl.DataFrame) -> str:
    """A row per method in the order of the overall rank."""
    lines = [
        "| | T2 | T3 | T4 | velocity NEES a component | drift, % DT | sway RMS, m/s |",
        "|---|---|---|---|---|---|---|",
    ]

    def one(method: str, task: str, score: str) -> dict[str, float] | None:
        rows = board.filter(
            (pl.col("method") == method) & (pl.col("task") == task) & (pl.col("score") == score)
        )
        return rows.row(0, named=True) if rows.height else None

    def shown(method: str, task: str, score: str) -> str:
        row = one(method, task, score)
        return "–" if row is None else _number(row["value"])

    for method in board.filter(pl.col("task") == OVERALL)["method"]:
        cells = [f"`{method}`"]
        for task in (NAVIGATION, RECOVERY, CURRENT):
            row = one(method, task, RANKED)
            answered = task != CURRENT or shown(method, CURRENT, "current availability") != "0.00"
            if row is None or not answered:
                cells.append("no answer")
                continue
            value, low, high = (_number(row[name]) for name in ("value", "lo", "hi"))
            cells.append(f"{value} ({low} … {high})")
        cells += [shown(method, NAVIGATION, score) for score in OTHERS]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Rewrites the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("leaderboard", type=Path)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--rivals", action="store_true", help="the table with the rivals")
    which.add_argument("--heading", action="store_true", help="the table of version 1.1")
    words = parser.parse_args()
    first = RIVALS if words.rivals else HEADING if words.heading else OURS
    before, rest = PAGE.read_text(encoding="utf-8").split(first)
    _, after = rest.split(LAST, maxsplit=1)
    write_text(PAGE, before + first + table(pl.read_parquet(words.leaderboard)) + LAST + after)


if __name__ == "__main__":
    main()
