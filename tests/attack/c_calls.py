"""Random calls of the C library, in C, under the sanitizers of addresses and undefined behaviour."""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path

from tools.install_c import CRATE, install


class NoSanitizersError(Exception):
    """The compiler has none."""


def build(prefix: Path, folder: Path) -> Path:
    """The program of random calls, linked to the static library of an installed prefix.

    Raises:
        NoSanitizersError: where the compiler has none.
        RuntimeError: where it fails otherwise.
    """
    built = folder / "random_calls"
    command = ["cc", "-g", "-O1", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"]
    command += [
        "-fno-sanitize-recover=all",
        f"-I{prefix / 'include'}",
        str(CRATE / "tests" / "random_calls.c"),
    ]
    command += [str(prefix / "lib" / "libbottomlock.a"), "-lpthread", "-lm", "-ldl", "-o", str(built)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode and re.search(r"cannot find .*(asan|ubsan)|unrecognized|unsupported", done.stderr):
        raise NoSanitizersError("the compiler has no sanitizers here")
    if done.returncode:
        raise RuntimeError(done.stderr)
    return built


def attack(seed: int, count: int) -> list[str]:
    """Faults of random calls: what the program or a sanitizer says."""
    with tempfile.TemporaryDirectory() as temporary:
        prefix = Path(temporary)
        install(prefix)
        command = [str(build(prefix, prefix)), str(seed), str(count)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    return [] if done.returncode == 0 else (done.stderr or f"exit code {done.returncode}").splitlines()
