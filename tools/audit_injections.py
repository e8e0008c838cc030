"""The audit's table: defects planted one by one in logs, what is found of them, and how often a clean log is accused.

    python tools/audit_injections.py --recordings DIR --clean 200 --write docs/audit.md

Without `--write` it prints. Recordings that are not there are left out, and are named.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import beta

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.audit.run import Audit
from bottomlock.recordings.finding import Finding
from tools.audit_defects import DEFECTS, Planted, audited
from tools.audit_worlds import Noise, World, others, recorded, simulated
from tools.score_recorded import print_or_write

WITHIN = 0.15
"""Error of a size that counts as found."""


@dataclass(frozen=True)
class Cell:
    """What an audit made of a planted defect: the finding that names it, its relative error, and findings besides."""

    planted: Planted
    named: Finding | None
    error: float | None
    false: tuple[str, ...]

    @property
    def as_it_should(self) -> bool:
        """Found within 15 % where it is observable, and nothing else accused."""
        right = self.named is not None and (self.error is None or abs(self.error) < WITHIN)
        return not self.false and (right or not self.planted.observable)

    @property
    def words(self) -> str:
        """The cell of the table."""
        false = f" **false: {', '.join(self.false)}**" if self.false else ""
        one, size = self.planted, self.planted.size
        if self.named is not None:
            text = "found" if size is None else f"{abs(self.named.size):.3g} {one.unit}"
            mark = (
                "" if self.error is None or abs(self.error) < WITHIN or not one.observable else " **(off)**"
            )
            return f"{text}{mark}{'' if one.observable else ' (sd too large to judge)'}{false}"
        if one.observable:
            return f"**missed**{false}"
        return ("–" if not np.isfinite(one.sd) else f"– (± {one.sd:.2g} {one.unit})") + false


def judged(planted: Planted, clean: Audit) -> Cell:
    """The audit of a planted defect, judged."""
    before = {(one.kind, one.beams) for one in clean.findings}
    kinds_before = {one.kind for one in clean.findings if not one.beams}
    named, false = None, []
    for one in audited(planted.world).findings:
        if one.kind in planted.kinds and set(planted.beams) <= set(one.beams):
            named = named or one
        elif (
            one.severity != "note"
            and one.kind not in planted.also
            and (one.kind, one.beams) not in before
            and one.kind not in kinds_before
        ):
            false.append(one.kind + (f" {one.beams}" if one.beams else ""))
    error = None
    if named is not None and planted.size is not None:
        error = abs(named.size) / abs(planted.size) - 1.0
    return Cell(planted, named, error, tuple(false))


CLEAN: dict[str, dict[str, object]] = {
    "plain": {},
    "correlated noise, 0.8": {"noise": Noise(correlation=0.8)},
    "noise 50 mm/s": {"noise": Noise(sd_mps=0.05)},
    "one beam 4 times noisier, correlated": {"noise": Noise(unequal=4.0, correlation=0.6)},
    "a third of the beams lost": {"noise": Noise(lost=0.3, run=10.0)},
    "300 pings": {"pings": 300},
    "slow": {"speed": 0.1},
    "at rest": {"speed": 0.0},
    "beams alone": {"instrument": False, "beside": False},
    "wandering velocity": {"noise": Noise(shared_mps=0.03)},
}
"""Kinds of clean logs: name and arguments of `simulated`."""


def accused(kind: str, logs: int, first_seed: int) -> list[tuple[int, str]]:
    """Findings that are no notes in clean logs of a kind: seed and what was found."""
    settings = {"pings": 1200} | CLEAN[kind]
    return [
        (seed, f"{one.kind} {one.beams or ''}: {one.text}")
        for seed in range(first_seed, first_seed + logs)
        for one in audited(simulated(seed, **settings)).findings  # type: ignore[arg-type]
        if one.severity != "note" and one.kind != "time_gaps"
        # True of these logs.
        if not (one.kind == "noisy_beam" and "noisier" in kind)
    ]


def worlds(recordings: Path | None, scratch: Path) -> tuple[list[World], list[World]]:
    """The logs of the two tables: those at hand when the audit was built, and others."""
    return [simulated(1), *recorded(recordings, scratch)], list(others(recordings, scratch))


def injection_table(logs: Sequence[World]) -> tuple[str, list[Cell]]:
    """The table in Markdown, and its cells."""
    cleans = [audited(world) for world in logs]
    lines = [
        "| Planted | " + " | ".join(world.name for world in logs) + " |",
        "|---|" + "---|" * len(logs),
    ]
    cells = []
    for name, plant in DEFECTS.items():
        row = [judged(plant(world, clean), clean) for world, clean in zip(logs, cleans, strict=True)]
        cells += row
        lines.append(f"| {name} | " + " | ".join(cell.words for cell in row) + " |")
    clean_row = [
        ", ".join(one.kind for one in c.findings if one.severity != "note") or "nothing" for c in cleans
    ]
    lines.append("| *as recorded* | " + " | ".join(clean_row) + " |")
    return "\n".join(lines) + "\n", cells


def clean_table(logs: int) -> tuple[str, int]:
    """False alarms in clean logs, and their number."""
    lines, wrong, total = ["| Clean logs | Logs | Accused |", "|---|---:|---:|"], 0, 0
    each = max(1, logs // len(CLEAN))
    for number, kind in enumerate(CLEAN):
        found = accused(kind, each, 50_000 + 1000 * number)
        for seed, text in found:
            print(f"accused: {kind}, seed {seed}: {text}", file=sys.stderr)
        count = len({seed for seed, _ in found})
        wrong, total = wrong + count, total + each
        lines.append(f"| {kind} | {each} | {count} |")
    most = float(beta.ppf(0.95, wrong + 1, total - wrong))
    lines.append(f"| all | {total} | {wrong} (less than {100.0 * most:.2g} % at 95 %) |")
    return "\n".join(lines) + "\n", wrong


def _summary(cells: Sequence[Cell]) -> str:
    observable = [cell for cell in cells if cell.planted.observable]
    right = sum(cell.as_it_should for cell in observable)
    return (
        f"Observable: {len(observable)} of {len(cells)}; found within 15 % of their size and alone: {right}. "
        f"Findings besides: {sum(bool(cell.false) for cell in cells)}."
    )


def main() -> None:
    """Prints the tables, or writes them between their marks in a page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=Path, default=os.environ.get("BOTTOMLOCK_RECORDINGS"))
    parser.add_argument("--clean", type=int, default=200, help="number of clean simulated logs")
    parser.add_argument("--write", type=Path, help="page to write to, between its marks")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        tables = [injection_table(logs) for logs in worlds(arguments.recordings, Path(scratch))]
    clean, _ = clean_table(arguments.clean) if arguments.clean else ("", 0)
    text = (
        "Logs of other instruments and vehicles, which were not at hand when the audit was built:\n\n".join(
            f"{table}\n{_summary(cells)}\n\n" for table, cells in tables
        )
    )
    text += clean
    print_or_write(arguments.write, {"injections": text})


if __name__ == "__main__":
    main()
