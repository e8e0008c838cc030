"""Puts each fault of tests/mutants.toml into a copy of the package and runs its tests: `python tools/mutants.py`.

A fault whose tests all pass has survived: a test is missing. The installed package is not touched. Words after the
command choose the mutants whose name or file holds one of them. Exit code 1 if one survived, 2 if a line is not found.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "tests" / "mutants.toml"
LIMIT_S = 600.0


@dataclass(frozen=True)
class Mutant:
    """A fault: in `file`, `new` in the place of `old`; one of `tests` must fail."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def applied(self, source: str) -> str:
        """The source with the fault.

        Raises:
            ValueError: unless `old` stands there exactly once.
        """
        count = source.count(self.old)
        if count != 1:
            raise ValueError(
                f"{self.file}: {self.old!r} stands there {count} times, expected once ({self.name})"
            )
        return source.replace(self.old, self.new)


def listed(path: Path = LIST) -> list[Mutant]:
    """All mutants.

    Raises:
        TypeError: for a key that is missing or unknown.
    """
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]
    return [Mutant(**entry | {"tests": tuple(entry["tests"])}) for entry in entries]


def copied(folder: Path) -> Path:
    """A copy of the packages with the compiled kernel, to be imported in the place of the installed ones."""
    packages = folder / "python"
    shutil.copytree(ROOT / "python", packages, ignore=shutil.ignore_patterns("__pycache__"))
    found = importlib.util.find_spec("bottomlock._kernel")
    if found is None or found.origin is None:
        raise SystemExit("mutants: bottomlock is not installed; run `make develop` first")
    compiled = packages / "bottomlock" / Path(found.origin).name
    if not compiled.exists():
        shutil.copy(found.origin, compiled)
    return packages


def fails(folder: Path, file: str, tests: tuple[str, ...]) -> bool:
    """Whether a test, or an example in the docstrings of `file`, fails with the package of a folder.

    Raises:
        SystemExit: where no test ran.
    """
    module = ".".join(Path(file).with_suffix("").parts)
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [
        sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not deep and not slow",
        "--doctest-modules", "--pyargs", module, *tests,
    ]  # fmt: skip
    try:
        ended = subprocess.run(  # noqa: S603 - the tests of this checkout
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return True
    if ended.returncode not in {0, 1, 2}:
        raise SystemExit(
            f"mutants: {' '.join(tests)} did not run:\n{ended.stdout[-2000:]}{ended.stderr[-2000:]}"
        )
    return ended.returncode != 0


def survivors(mutants: list[Mutant]) -> list[Mutant]:
    """Runs the tests of each mutant, and first, once, those of the package as it is."""
    survived = []
    with tempfile.TemporaryDirectory() as folder:
        package = copied(Path(folder))
        pairs = dict.fromkeys((mutant.file, mutant.tests) for mutant in mutants)
        for number, (file, tests) in enumerate(pairs, start=1):
            if fails(Path(folder), file, tests):
                raise SystemExit(f"mutants: {' '.join(tests)} fails without a fault; mend it first")
            print(f"without a fault {number}/{len(pairs)} {file}", flush=True)
        began = time.monotonic()
        for number, mutant in enumerate(mutants, start=1):
            path = package / mutant.file
            source = path.read_text(encoding="utf-8")
            path.write_text(mutant.applied(source), encoding="utf-8")
            killed = fails(Path(folder), mutant.file, mutant.tests)
            path.write_text(source, encoding="utf-8")
            survived += [] if killed else [mutant]
            left_s = (time.monotonic() - began) / number * (len(mutants) - number)
            word = "killed" if killed else "SURVIVED"
            print(
                f"{number}/{len(mutants)} {word:<9} {mutant.file}: {mutant.name} ({left_s:.0f} s left)",
                flush=True,
            )
    return survived


def main() -> int:
    """The command line; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("words", nargs="*", help="only mutants whose name or file holds one of these")
    chosen = parser.parse_args()
    mutants = listed()
    if chosen.words:
        mutants = [one for one in mutants if any(word in f"{one.file} {one.name}" for word in chosen.words)]
    stale = []
    for mutant in mutants:
        try:
            mutant.applied((ROOT / "python" / mutant.file).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            stale.append(str(error))
    if stale:
        print("\n".join(stale))
        return 2
    survived = survivors(mutants)
    print(f"{len(mutants)} mutants, {len(survived)} survived")
    return 1 if survived else 0


if __name__ == "__main__":
    raise SystemExit(main())
