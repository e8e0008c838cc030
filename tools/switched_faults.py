"""Rust faults of one build: a function that holds some has its body once more for each, and a run takes one of them."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
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
TEST = [
    "cargo", "test", "--quiet", "--locked", "--offline", "--release", "--package", "bottomlock", "--lib", "--no-run",
    "--message-format=json",
]  # fmt: skip
"""As `make test` has them, but built alone."""
LIMIT_S = 300.0
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


def build(tree: Path, faults: Mapping[int, Fault]) -> tuple[Path, set[int]]:
    """The tests with every fault that builds and can be switched: the program, and the faults in it.

    It is incremental, and without what only a debugger reads.

    Raises:
        RuntimeError: where what does not build is not of a fault.
    """
    good = {file: (tree / file).read_bytes() for file in {fault.file for fault in faults.values()}}
    library = tree / "crates/bottomlock/src/lib.rs"
    whole, left = library.read_bytes(), dict(faults)
    quick = {
        "CARGO_INCREMENTAL": "1",
        "CARGO_PROFILE_TEST_DEBUG": "false",
        "CARGO_TARGET_DIR": str(tree / "target"),
    }
    while True:
        files = {
            file: switched(text, {number: one for number, one in left.items() if one.file == file})
            for file, text in good.items()
        }
        for file, written in files.items():
            (tree / file).write_bytes(written.text)
        library.write_bytes(whole + SOURCE.encode())
        done = subprocess.run(  # noqa: S603
            TEST, cwd=tree, env=os.environ | quick, capture_output=True, text=True, check=False,
        )  # fmt: skip
        messages = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        if done.returncode == 0:
            (program,) = (one["executable"] for one in messages if one.get("executable"))
            return Path(program), {number for one in files.values() for number in one.bodies}
        wrong = blamed(messages, files)
        if not wrong:
            raise RuntimeError(f"the tests do not build:\n{done.stderr}")
        left = {number: one for number, one in left.items() if number not in wrong}


def blamed(messages: Iterable[dict[str, Any]], files: Mapping[str, Written]) -> set[int]:
    """The faults whose bodies hold an error; where none does, those of the functions that do."""
    places = [
        (files[span["file_name"]], span["byte_start"])
        for message in messages
        if isinstance(found := message.get("message"), dict) and found.get("level") == "error"
        for span in found["spans"]
        if span["is_primary"] and span["file_name"] in files
    ]
    return {
        number
        for written, at in places
        for number, (first, last) in written.bodies.items()
        if first <= at < last
    } or {
        number
        for written, at in places
        for (first, last), numbers in written.functions.items()
        if first <= at < last
        for number in numbers
    }


def outcome(tests: Sequence[str | Path], **options: Any) -> str:  # noqa: ANN401 - of `subprocess.run`
    """What tests make of a fault: "killed", "survived" or "timeout"."""
    try:
        done = subprocess.run(tests, capture_output=True, check=False, timeout=LIMIT_S, **options)  # noqa: S603
    except subprocess.TimeoutExpired:
        return "timeout"
    return "killed" if done.returncode else "survived"
