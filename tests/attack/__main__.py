"""Attacks what takes input: `python -m tests.attack`, or a part of it by name, `python -m tests.attack calls`.

The parts are random calls of the kernel, the same of the C library under sanitizers, mutated records in the readers,
kills of campaigns, and bit flips in every kind of file that is read back. Prints a summary and ends with exit code 1 if
anything failed. A random call that failed is made again, with its arguments printed, by `python -m tests.attack calls
--seed SEED --case CASE`.
"""

from __future__ import annotations

import argparse
import importlib
import re
import time
from collections.abc import Callable
from pathlib import Path

from tests.attack.pool import Outcome
from tests.attack.pool import attack as attack_calls
from tests.attack.subjects import run_case
from tests.attack.trial import Trial

COUNTS = {"calls": 1_000_000, "c_calls": 1_000_000, "records": 200_000, "kills": 100, "bit_flips": 200}
"""How many of each part, by default."""


def kinds(faults: list[tuple[int, str]]) -> list[tuple[int, int, str]]:
    """(number, first case, line) of each kind of fault: lines alike but for their numbers are one kind."""
    found: dict[str, tuple[int, int, str]] = {}
    for case, line in sorted(faults):
        kind = re.sub(r"-?\d[\d.e+-]*", "#", re.sub(r"accepted [\w.]+:", "accepted", line))
        number, first, words = found.get(kind, (0, case, line))
        found[kind] = (number + 1, first, words)
    return sorted(found.values(), key=lambda entry: -entry[0])


def run_calls(seed: int, count: int, jobs: int | None, first: int) -> tuple[list[str], Outcome]:
    """The faults of random calls, one line a kind, and the counts."""
    outcome = attack_calls(seed, count, first=first, jobs=jobs)
    lines = [
        f"{line} ({number} of this kind; python -m tests.attack calls --seed {seed} --case {case})"
        for number, case, line in kinds(outcome.faults)
    ]
    return lines, outcome


def run_part(name: str, seed: int, count: int) -> list[str]:
    """The faults of a part in a file of its own, one line each."""
    part: Callable[[int, int], list[str]] = importlib.import_module(f"tests.attack.{name}").attack
    return part(seed, count)


def repeat(seed: int, case: int) -> int:
    """Makes the calls of a case in this process and prints them."""
    trial = Trial(print)
    run_case(seed, case, trial)
    return 1 if trial.faults else 0


def main() -> int:
    """The command line; the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.attack", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("parts", nargs="*", choices=[*COUNTS, []], help="default: all of them")
    for name, count in COUNTS.items():
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, type=int, default=count, help=f"how many {name.replace('_', ' ')}")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, help="processes of the random calls; default: one a core")
    parser.add_argument("--first", type=int, default=0, help="number of the first case of random calls")
    parser.add_argument("--case", type=int, help="make the random calls of this case again and print them")
    parser.add_argument("--out", type=Path, default=Path("out/attack"), help="folder of the failures")
    chosen = parser.parse_args()
    if chosen.case is not None:
        return repeat(chosen.seed, chosen.case)
    chosen.out.mkdir(parents=True, exist_ok=True)
    rows, failed = [], False
    for name in chosen.parts or COUNTS:
        count, began = getattr(chosen, name), time.monotonic()
        if name == "calls":
            lines, outcome = run_calls(chosen.seed, count, chosen.jobs, chosen.first)
            count = sum(outcome.calls.values())
            _print_calls(outcome)
        else:
            lines = run_part(name, chosen.seed, count)
        (chosen.out / f"{name}.txt").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        for line in lines:
            print(f"{name}: {line}")
        rows.append((name, count, len(lines), time.monotonic() - began))
        failed |= bool(lines)
    print(f"{'part':<12}{'count':>12}{'failures':>10}{'seconds':>10}  (seed {chosen.seed})")
    for name, count, number, taken_s in rows:
        print(f"{name:<12}{count:>12,}{number:>10}{taken_s:>10,.0f}")
    return 1 if failed else 0


def _print_calls(outcome: Outcome) -> None:
    print(f"{'function':<24}{'calls':>10}{'accepted':>10}")
    for name, number in sorted(outcome.calls.items()):
        print(f"{name:<24}{number:>10,}{outcome.accepted[name]:>10,}")


if __name__ == "__main__":
    raise SystemExit(main())
