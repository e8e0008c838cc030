"""The table of docs/bench.md, from the leaderboard that `bottomlock bench page` has written.

    python tools/publish_bench.py page/leaderboard.parquet

replaces what stands between the two marks of the page.
"""

from __future__ import annotations

import sys
from pathlib import Path

import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.atomic_write import write_text
from bottomlock.bench.leaderboard import OVERALL
from bottomlock.bench.tasks import CURRENT, NAVIGATION, RANKED, RECOVERY

PAGE = Path(__file__).resolve().parent.parent / "docs" / "bench.md"
FIRST, LAST = "<!-- our methods: tools/publish_bench.py -->\n", "<!-- end -->\n"
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

    def one(method: str, task: str, score: str) -> dict[str, float]:
        rows = board.filter(
            (pl.col("method") == method) & (pl.col("task") == task) & (pl.col("score") == score)
        )
        return rows.row(0, named=True)

    for method in board.filter(pl.col("task") == OVERALL)["method"]:
        cells = [f"`{method}`"]
        for task in (NAVIGATION, RECOVERY, CURRENT):
            row = one(method, task, RANKED)
            silent = task == CURRENT and one(method, CURRENT, "current availability")["value"] == 0.0
            value, low, high = (_number(row[name]) for name in ("value", "lo", "hi"))
            cells.append("no answer" if silent else f"{value} ({low} … {high})")
        cells += [_number(one(method, NAVIGATION, score)["value"]) for score in OTHERS]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Rewrites the page."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(FIRST)
    _, after = rest.split(LAST)
    write_text(PAGE, before + FIRST + table(pl.read_parquet(sys.argv[1])) + LAST + after)


if __name__ == "__main__":
    main()
