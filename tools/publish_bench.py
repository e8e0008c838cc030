"""The tables of docs/bench.md: those of the public missions from their scores, that of the test split as it is sent.

    python tools/publish_bench.py                                    # from benches/rivals/public_scores.csv
    python tools/publish_bench.py page/leaderboard.parquet --test    # from what `bottomlock bench page` has written

replaces what stands between the marks of each table. `tools/bench_public.py` makes the scores.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.files.atomic_write import write_text
from bottomlock.kernel import METHODS
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.statistics.compare import difference_of, estimate_of
from partialdvl_bench.leaderboard import OVERALL, leaderboard
from partialdvl_bench.mission_list import MissionSpec, mission_list
from partialdvl_bench.tables import SCORES
from partialdvl_bench.tasks import CURRENT, NAVIGATION, RANKED, RECOVERY, TASKS

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "bench.md"
PUBLIC_SCORES = ROOT / "benches" / "rivals" / "public_scores.csv"
LAST = "<!-- end -->\n"

SCORES_KEPT = {
    "T2_nats": (NAVIGATION, RANKED),
    "T3_nats": (RECOVERY, RANKED),
    "T4_nats": (CURRENT, RANKED),
    "velocity_nees": (NAVIGATION, "velocity NEES a component"),
    "position_nees": (NAVIGATION, "position NEES a component"),
    "velocity_rms_mps": (NAVIGATION, "velocity RMS, m/s"),
    "sway_rms_mps": (NAVIGATION, "sway RMS, m/s"),
    "position_rms_m": (NAVIGATION, "position RMS, m"),
    "drift_percent": (NAVIGATION, "drift, % DT"),
    "current_rms_mps": (CURRENT, "current RMS, m/s"),
    "current_nees": (CURRENT, "current NEES a component"),
    "current_availability": (CURRENT, "current availability"),
}
"""Columns of the public scores: task and score of each."""
OTHERS = ("velocity NEES a component", "position NEES a component", "drift, % DT", "sway RMS, m/s")
KINDS: dict[str, Callable[[MissionSpec], bool]] = {
    "version 1": lambda spec: spec.version == "1",
    "slow heading": lambda spec: bool(spec.heading),
    "slip": lambda spec: bool(spec.slip),
    "hovering": lambda spec: spec.vehicle == "bluerov2_heavy",
}
"""Kinds of public missions, each mission in one."""
OURS = (*METHODS, DEAD_RECKONING)


def public_scores() -> pl.DataFrame:
    """The scores as `bottomlock bench score` writes them, of the public missions."""
    table = pl.read_csv(PUBLIC_SCORES, schema_overrides={"version": pl.String})
    parts = [
        table.select(
            "method", "mission", pl.lit(task).alias("task"), pl.lit(score).alias("score"),
            pl.col(column).alias("value"), pl.lit(1).alias("rows"),
        ).drop_nulls("value")
        for column, (task, score) in SCORES_KEPT.items()
    ]  # fmt: skip
    return pl.concat(parts).cast(dict(SCORES))  # type: ignore[arg-type]


def _number(value: float) -> str:
    digits = 0 if abs(value) >= 100.0 else 2
    return f"{value:.{digits}f}".replace("-", "−")


def _interval(value: float, low: float, high: float) -> str:
    return f"{_number(value)} ({_number(low)} … {_number(high)})"


def table(board: pl.DataFrame) -> str:
    """A row per method in the order of the overall rank."""
    lines = [
        "| | T2 | T3 | T4 | velocity NEES | position NEES | drift, % DT | sway RMS, m/s |",
        "|---|---|---|---|---|---|---|---|",
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
            cells.append(_interval(*(row[name] for name in ("value", "lo", "hi"))))
        cells += [shown(method, NAVIGATION, score) for score in OTHERS]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def of_specs(scores: pl.DataFrame, specs: list[MissionSpec]) -> pl.DataFrame:
    """The scores on some missions."""
    return scores.filter(pl.col("mission").is_in([spec.name for spec in specs]))


def by_kind(scores: pl.DataFrame) -> str:
    """T2 in nats a component and velocity NEES a component of each method on each kind of mission."""
    lines = [
        "| | " + " | ".join(f"{kind}: T2 | NEES" for kind in KINDS) + " |",
        "|---" * (1 + 2 * len(KINDS)) + "|",
    ]
    means = {
        kind: {
            (row["method"], row["score"]): row["mean"]
            for row in of_specs(scores, _public(kind))
            .filter(pl.col("task") == NAVIGATION)
            .group_by("method", "score")
            .agg(mean=pl.col("value").mean())
            .iter_rows(named=True)
        }
        for kind in KINDS
    }
    methods = leaderboard(scores).filter(pl.col("task") == OVERALL)["method"]
    for method in methods:
        cells = [
            _number(means[kind][method, score])
            for kind in KINDS
            for score in (RANKED, "velocity NEES a component")
        ]
        lines.append(f"| `{method}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def leaders(scores: pl.DataFrame) -> str:
    """Of each kind and task our first, the first rival, and the paired difference in nats a component."""
    lines = ["| | missions | our first | first rival | difference |", "|---|---|---|---|---|"]
    kinds = {
        **{kind: _public(kind) for kind in KINDS},
        "all": [spec for kind in KINDS for spec in _public(kind)],
    }
    for kind, specs in kinds.items():
        for task in TASKS:
            part = of_specs(scores, specs).filter((pl.col("task") == task) & (pl.col("score") == RANKED))
            if task == CURRENT:
                answered = of_specs(scores, specs).filter(
                    (pl.col("score") == "current availability") & (pl.col("value") > 0.0)
                )
                part = part.join(answered, on=["method", "mission"], how="semi")
            ours, theirs = (
                _first(part.filter(pl.col("method").is_in(OURS) == own), part["mission"].n_unique())
                for own in (True, False)
            )
            if ours is None or theirs is None:
                continue
            values = [
                part.filter(pl.col("method") == one).sort("mission")["value"].to_numpy()
                for one in (ours, theirs)
            ]
            first, second = (estimate_of(value, is_rms=False)[0] for value in values)
            difference = difference_of(*values, is_rms=False, paired=True)
            lines.append(
                f"| {kind}, {task[:2]} | {len(values[0])} | `{ours}` {_number(first)} | `{theirs}` {_number(second)} | "
                f"{_interval(*difference)} |"
            )
    return "\n".join(lines) + "\n"


def _first(part: pl.DataFrame, missions: int) -> str | None:
    """The method of the least mean among those that answer every mission; None without any."""
    means = part.group_by("method").agg(pl.col("value").mean(), count=pl.len())
    whole = means.filter(pl.col("count") == missions).sort("value", "method")
    return str(whole["method"][0]) if whole.height else None


def _public(kind: str) -> list[MissionSpec]:
    return [spec for spec in mission_list() if spec.split != "test" and KINDS[kind](spec)]


def tables() -> dict[str, str]:
    """The public tables by their mark."""
    scores = public_scores()
    later = [spec for kind in ("slow heading", "slip", "hovering") for spec in _public(kind)]
    return {
        "version 1": table(leaderboard(of_specs(scores, _public("version 1")))),
        "version 1.1": table(leaderboard(of_specs(scores, later))),
        "by kind": by_kind(scores),
        "leaders": leaders(scores),
    }


def mark(name: str) -> str:
    """The line before a table."""
    return f"<!-- {name}: tools/publish_bench.py -->\n"


def replaced(page: str, name: str, text: str) -> str:
    """A page with another table of this name."""
    before, rest = page.split(mark(name))
    _, after = rest.split(LAST, maxsplit=1)
    return before + mark(name) + text + LAST + after


def publish_public() -> None:
    """Rewrites the public tables."""
    page = PAGE.read_text(encoding="utf-8")
    for name, text in tables().items():
        page = replaced(page, name, text)
    write_text(PAGE, page)


def main() -> None:
    """Rewrites the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "leaderboard", type=Path, nargs="?", help="of the test split of version 1.1, with --test"
    )
    parser.add_argument("--test", action="store_true", help="the table of the test split of version 1.1")
    words = parser.parse_args()
    if words.test != (words.leaderboard is not None):
        parser.error("a leaderboard is given with --test, and --test with a leaderboard")
    if words.test:
        page = PAGE.read_text(encoding="utf-8")
        write_text(PAGE, replaced(page, "test of version 1.1", table(pl.read_parquet(words.leaderboard))))
        return
    publish_public()


if __name__ == "__main__":
    main()
