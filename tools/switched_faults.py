"""Rust faults of one build: a function that holds some has its body once more for each, and a run takes one of them."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import threading
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SWITCH = "BOTTOMLOCK_FAULT"
SOURCE = f"""
/// Whether the fault of this number is the one of this run.
pub(crate) fn fault(number: u32) -> bool {{
    static ON: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    let read = || std::env::var("{SWITCH}").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    *ON.get_or_init(read) == number
}}
"""
TEST = ["cargo", "test", "--quiet", "--locked", "--offline", "--release", "--package", "bottomlock", "--lib"]
"""As `make test` has them."""
_TOKEN = re.compile(
    rb"""//[^\n]*|/\*.*?\*/|r(\#*)".*?"\1|b?"(?:\\.|[^"\\])*"|b?'(?:\\[^\n]+?|[^\\'\n])'|[{}]""", re.DOTALL
)


@dataclass(frozen=True)
class Fault:
    """A wrong line.

    Attributes:
        group: of rooms.
        file: below the project's root.
        function: qualified name of the function that holds it; "" at the level of the module.
        line: text of its first line, stripped.
        change: what is put in the place of what.
        outcome: "killed", "survived" or "timeout"; "" before it is judged.
        commit: at which it was judged.
        number: of its first line, from 1.
        span: first and last byte of what is replaced.
        new: what takes its place.
        owner: first and last byte of the function, of Rust; (0, 0) outside of one.
    """

    group: str
    file: str
    function: str
    line: str
    change: str
    outcome: str = ""
    commit: str = ""
    number: int = 0
    span: tuple[int, int] = (0, 0)
    new: str = ""
    owner: tuple[int, int] = (0, 0)

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What makes it the same fault in another state of the code."""
        return self.file, self.function, self.line, self.change

    def applied(self, good: str) -> str:
        """The text of the file with the fault."""
        body, (first, last) = good.encode(), self.span
        return (body[:first] + self.new.encode() + body[last:]).decode()


def body_of(text: bytes, owner: tuple[int, int]) -> tuple[int, int] | None:
    """First and last byte of a function's body with its braces; None where it has none.

    >>> text = b"fn f(c: char) -> [u8; 2] { /* } */ g('{', '}') }"
    >>> text[slice(*body_of(text, (0, len(text))))]
    b"{ /* } */ g('{', '}') }"
    """
    opened: list[int] = []
    for token in _TOKEN.finditer(text, *owner):
        if token[0] == b"{":
            opened.append(token.start())
        elif token[0] == b"}" and opened:
            first = opened.pop()
            if token.end() == owner[1]:
                return first, owner[1]
    return None


@dataclass(frozen=True)
class Written:
    """A file with its switches: the spans of each function in it and of the body of each fault."""

    text: bytes
    functions: dict[tuple[int, int], list[int]]
    bodies: dict[int, tuple[int, int]]


def switched(text: bytes, faults: Mapping[int, Fault]) -> Written:
    """The text of a file whose functions take the body of the fault of the run."""
    by_body: dict[tuple[int, int], list[int]] = defaultdict(list)
    for number, fault in faults.items():
        whole = body_of(text, fault.owner)
        if whole is not None and whole[0] < fault.span[0] and fault.span[1] <= whole[1]:
            by_body[whole].append(number)
    out, end = b"", 0
    functions: dict[tuple[int, int], list[int]] = {}
    bodies: dict[int, tuple[int, int]] = {}
    for (first, last), numbers in sorted(by_body.items()):
        if first < end:
            continue
        out += text[end:first]
        start = len(out)
        out += b"{ "
        for number in numbers:
            wrong = faults[number].applied(text.decode()).encode()
            out += f"if crate::fault({number}) ".encode()
            body = wrong[first : len(wrong) - (len(text) - last)]
            bodies[number] = len(out), len(out) + len(body)
            out += body + b" else "
        out += text[first:last] + b" }"
        functions[start, len(out)] = numbers
        end = last
    return Written(out + text[end:], functions, bodies)


def build(
    tree: Path, faults: Mapping[int, Fault], environment: dict[str, str]
) -> tuple[Path, set[int], set[int]]:
    """The tests with every fault that can be switched: the program, the faults in it, and those that do not build.

    Raises:
        RuntimeError: where what does not build is not of a fault.
    """
    good = {file: (tree / file).read_bytes() for file in {fault.file for fault in faults.values()}}
    library = tree / "crates/bottomlock/src/lib.rs"
    whole, left, bad = library.read_bytes(), dict(faults), set[int]()
    try:
        while True:
            files = {
                file: switched(text, {number: one for number, one in left.items() if one.file == file})
                for file, text in good.items()
            }
            for file, written in files.items():
                (tree / file).write_bytes(written.text)
            library.write_bytes(whole + SOURCE.encode())
            done = subprocess.run(  # noqa: S603
                [*TEST, "--no-run", "--message-format=json"],
                cwd=tree, env=environment, capture_output=True, text=True, check=False,
            )  # fmt: skip
            messages = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
            if done.returncode == 0:
                (program,) = (one["executable"] for one in messages if one.get("executable"))
                kept = tree / "switched"
                shutil.copy2(program, kept)
                return kept, {number for written in files.values() for number in written.bodies}, bad
            wrong, unswitched = blamed(messages, files)
            if not wrong | unswitched:
                raise RuntimeError(f"the tests do not build:\n{done.stderr}")
            bad |= wrong
            left = {number: one for number, one in left.items() if number not in wrong | unswitched}
    finally:
        for file, text in good.items():
            (tree / file).write_bytes(text)
        library.write_bytes(whole)


def blamed(messages: Iterable[dict[str, Any]], files: dict[str, Written]) -> tuple[set[int], set[int]]:
    """The faults whose bodies hold an error, and those of a function that has an error elsewhere."""
    wrong, unswitched = set[int](), set[int]()
    for message in messages:
        found = message.get("message")
        if not isinstance(found, dict) or found.get("level") != "error":
            continue
        for span in found["spans"]:
            written = files.get(span["file_name"])
            if written is None or not span["is_primary"]:
                continue
            at = span["byte_start"]
            inside = {number for number, (first, last) in written.bodies.items() if first <= at < last}
            wrong |= inside
            if not inside:
                unswitched |= {
                    number
                    for (first, last), numbers in written.functions.items()
                    if first <= at < last
                    for number in numbers
                }
    return wrong, unswitched - wrong


def outcome(program: Path, number: int, tree: Path, limit_s: float) -> str:
    """What the tests make of a fault: "killed", "survived" or "timeout"."""
    environment = os.environ | {SWITCH: str(number), "CARGO_MANIFEST_DIR": str(tree / "crates/bottomlock")}
    tests = subprocess.Popen(  # noqa: S603
        [program], cwd=tree / "crates/bottomlock", env=environment, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    stop = threading.Timer(limit_s, tests.kill)
    stop.start()
    assert tests.stdout is not None
    with tests:
        failed = any(line.endswith("... FAILED\n") for line in tests.stdout)
        if failed:
            tests.kill()
    stop.cancel()
    if not failed and tests.returncode == -signal.SIGKILL:
        return "timeout"
    return "killed" if failed or tests.returncode else "survived"
