"""Puts random wrong lines into the code and counts those that the quick tests see: `python -m tools.mutation_sample`.

Rust faults are drawn from the list of cargo-mutants and judged by the kernel's unit tests, all in one build
(`tools.switched_faults`). Python faults are drawn over
the syntax tree and judged by those quick tests of their rooms that run the line. Faults that do not build are left out
and others drawn.

A row of the table is a fault: group, file, function, line (its text), change, outcome ("killed", "survived", or
"timeout", which counts as killed), and the commit that it was judged at. `--again TABLE` judges the faults of an
earlier table once more, where function, line and change still stand, and prints both shares: the gate before and after
a change. `--goes-on` keeps what `--out` holds, and judges what is missing of the groups at this commit.

    python -m tools.mutation_sample --out data/evidence/mutation_sample.parquet [--goes-on]
    python -m tools.mutation_sample --groups logs --each 20
    python -m tools.mutation_sample --again data/evidence/mutation_sample.parquet
"""

from __future__ import annotations

import argparse
import ast
import compileall
import json
import os
import py_compile
import random
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from itertools import accumulate, islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import polars as pl
from coverage import CoverageData
from rich.console import Console
from rich.progress import Progress
from scipy.stats import beta

import bottomlock
from tools.switched_faults import TEST, Fault, build, outcome

ROOT = Path(__file__).resolve().parent.parent
KERNEL = "crates/bottomlock/src/"
RUST = {
    "kernel mathematics": ("aiding", "dvl", "earth", "error_model", "mechanisation", "smoother", "frames.rs"),
    "filter and navigator": ("filter", "navigator", "replay", "model.rs", "state.rs"),
}
PYTHON = {
    "logs": ("io", "recordings", "audit", "replay", "dead_reckoning", "export"),
    "live and ports": ("live", "ports", "encoders", "instruments", "setup"),
    "simulation, campaign, pages": (
        "plant", "simulation", "campaign", "studies", "statistics", "figures", "pages", "report", "observability",
        "config", "files",
    ),
}  # fmt: skip
"""Rooms of each group; a room's tests are those in the folder of its name."""
LIMIT_S = 300.0
SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip


def run(command: list[str], **options: Any) -> subprocess.CompletedProcess[Any]:  # noqa: ANN401
    """A command of this tool's own, whose exit code its caller reads."""
    return subprocess.run(command, check=False, **options)  # noqa: S603


def changes(node: ast.AST) -> Iterator[ast.AST]:  # noqa: C901, PLR0912
    """The wrong forms of a node of the syntax tree."""
    match node:
        case ast.Compare(left, [operator, *others], values) if type(operator) in SWAPPED:
            yield ast.Compare(left, [SWAPPED[type(operator)](), *others], values)  # type: ignore[list-item]
        case ast.BoolOp(operator, values):
            yield ast.BoolOp(SWAPPED[type(operator)](), values)  # type: ignore[arg-type]
        case ast.BinOp(left, operator, right) if type(operator) in SWAPPED:
            yield ast.BinOp(left, SWAPPED[type(operator)](), right)  # type: ignore[arg-type]
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield operand
        case ast.Constant(bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(int() | float() as value):
            yield ast.Constant(value + 1)
            yield ast.Constant(value * 2 if value else -1)
        case ast.IfExp(condition, then, other):
            yield ast.IfExp(condition, other, then)
        case ast.If(test) | ast.While(test):
            yield ast.UnaryOp(ast.Not(), test)
        case ast.Return(ast.expr() as value) if not isinstance(value, ast.Constant):
            yield ast.Return(ast.Constant(None))
        case ast.Expr(ast.Call()):
            yield ast.Pass()
        case ast.keyword(str(), ast.expr() as value) if isinstance(value, ast.Name | ast.Attribute):
            yield ast.Constant(None)
        case ast.Slice(ast.expr() as lower, upper, step):
            yield (
                ast.Slice(None, upper, step)
                if upper
                else ast.Slice(ast.BinOp(lower, ast.Add(), ast.Constant(1)), upper, step)
            )
        case _:
            return


def python_faults(group: str, path: Path, root: Path) -> list[Fault]:
    """Every fault of a Python file, but those in annotations, in what is raised, and in decorators."""
    text = path.read_text(encoding="utf-8")
    tree, lines, body = ast.parse(text), text.splitlines(), text.encode()
    starts = _starts(text)
    faults: list[Fault] = []

    def visit(node: ast.AST, function: str) -> None:
        for wrong in changes(node):
            # Of a branch the condition is replaced, and of an argument its value.
            old: Any = node.test if isinstance(node, ast.If | ast.While) else node
            old = old.value if isinstance(old, ast.keyword) else old
            span = starts[old.lineno - 1] + old.col_offset, starts[old.end_lineno - 1] + old.end_col_offset
            new = ast.unparse(ast.fix_missing_locations(wrong))
            new = new if isinstance(old, ast.stmt | ast.Slice) else f"({new})"
            same = " ".join(body[slice(*span)].decode().split())
            line, change = lines[old.lineno - 1].strip(), f"{same[:120]} -> {new[:120]}"
            file = path.relative_to(root).as_posix()
            faults.append(Fault(group, file, function, line, change, number=old.lineno, span=span, new=new))
        inner = function
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            inner = f"{function}.{node.name}".lstrip(".")
        for name, field in ast.iter_fields(node):
            if name in {"annotation", "returns", "decorator_list"} or isinstance(node, ast.Raise):
                continue
            for child in field if isinstance(field, list) else [field]:
                if isinstance(child, ast.AST):
                    visit(child, inner)

    visit(tree, "")
    return faults


def _starts(text: str) -> list[int]:
    """The byte at which each line begins."""
    return [0, *accumulate(len(line.encode()) + 1 for line in text.split("\n"))]


def rust_faults() -> list[Fault]:
    """Every fault in cargo-mutants' list (.cargo/mutants.toml)."""
    listed = run(
        ["cargo", "mutants", "--list", "--json", "--package", "bottomlock"],
        cwd=ROOT,  capture_output=True, text=True,
    ).stdout  # fmt: skip
    group_of = {room: group for group, rooms in RUST.items() for room in rooms}
    faults = []
    for entry in json.loads(listed):
        room = entry["file"].removeprefix(KERNEL).split("/")[0]
        if room not in group_of:
            continue
        text = (ROOT / entry["file"]).read_text(encoding="utf-8")
        lines, starts = text.splitlines(), _starts(text)

        def place(span: Any, lines: list[str] = lines, starts: list[int] = starts) -> tuple[int, int]:  # noqa: ANN401
            # Columns are characters, from 1.
            first, last = (
                starts[at["line"] - 1] + len(lines[at["line"] - 1][: at["column"] - 1].encode())
                for at in (span["start"], span["end"])
            )
            return first, last

        function, number, span = entry["function"], entry["span"]["start"]["line"], place(entry["span"])
        old = text.encode()[slice(*span)].decode() if entry["genre"] != "FnValue" else "body"
        name, owner = (function["function_name"], place(function["span"])) if function else ("", (0, 0))
        faults.append(Fault(
            group_of[room], entry["file"], name, lines[number - 1].strip(), f"{old} -> {entry['replacement']}",
            number=number, span=span, new=entry["replacement"], owner=owner,
        ))  # fmt: skip
    return faults


def quick_build(tree: Path) -> dict[str, str]:
    """The environment of a build: incremental, and without what only a debugger reads."""
    return os.environ | {
        "CARGO_INCREMENTAL": "1",
        "CARGO_PROFILE_TEST_DEBUG": "false",
        "CARGO_TARGET_DIR": str(tree / "target"),
    }


def judged_rust(chosen: list[Fault], tree: Path) -> Iterator[Fault | None]:
    """The faults with their outcomes, in order; None for one that does not build.

    All are in one build, but those of a function that cannot be switched, such as a constant one.
    """
    numbered, quick = dict(enumerate(chosen, 1)), quick_build(tree)
    program, switched, bad = build(tree, dict(numbered), quick)
    for number, fault in numbered.items():
        if number in switched:
            yield replace(fault, outcome=outcome(program, number, tree, LIMIT_S))
        elif number in bad:
            yield None
        else:
            yield tried(fault, tree, [*TEST, "--no-run"], TEST, cwd=tree, env=quick)


def tried(
    fault: Fault,
    tree: Path,
    builds: list[str],
    tests: list[str],
    **options: Any,  # noqa: ANN401
) -> Fault | None:
    """The fault with its outcome in a copy of the code; None for one that does not build."""
    path = tree / fault.file
    good = path.read_text(encoding="utf-8")
    try:
        path.write_text(fault.applied(good), encoding="utf-8")
        if run(builds, capture_output=True, **options).returncode:
            return None
        done = run(tests, capture_output=True, timeout=LIMIT_S, **options)
        return replace(fault, outcome="survived" if done.returncode == 0 else "killed")
    except subprocess.TimeoutExpired:
        return replace(fault, outcome="timeout")
    finally:
        path.write_text(good, encoding="utf-8")


def crates_copy(folder: Path) -> Path:
    """A copy of the crates for faults."""
    for name in ("crates", ".cargo"):
        shutil.copytree(ROOT / name, folder / name)
    for name in ("Cargo.toml", "Cargo.lock"):
        shutil.copy2(ROOT / name, folder)
    return folder


def package_copy(folder: Path) -> Path:
    """A copy of the package for faults; its compiled files are checked by the hash of their source."""
    package = folder / "python" / "bottomlock"
    shutil.copytree(ROOT / "python" / "bottomlock", package, ignore=shutil.ignore_patterns("__pycache__"))
    if not list(package.glob("_kernel*")):
        (source,) = Path(bottomlock.__file__).parent.glob("_kernel*.so")
        shutil.copy2(source, package)
    compileall.compile_dir(package, quiet=2, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)
    return package.parent


def _environment(python: Path) -> dict[str, str]:
    return os.environ | {
        "PYTHONPATH": f"{python}{os.pathsep}{ROOT}", "PYTHONDONTWRITEBYTECODE": "1", "MPLBACKEND": "Agg",
        "CI": "1", "RAYON_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
    }  # fmt: skip


QUICK = ["pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "not long and not deep"]


def tests_by_line(group: str, python: Path, work: Path) -> dict[str, dict[int, set[str]]]:
    """Of each file and line the tests of the group's rooms that run it, by coverage; line 0: any line of the file."""
    folders = [f"tests/{room}" for room in PYTHON[group] if (ROOT / "tests" / room).is_dir()]
    (work / "rc").write_text(
        f"[run]\ndynamic_context = test_function\ndata_file = {work / 'data'}\nsource = {python}\n"
    )
    run(
        [sys.executable, "-m", "coverage", "run", f"--rcfile={work / 'rc'}", "-m", *QUICK, *folders],
        cwd=ROOT, env=_environment(python), stdout=sys.stderr,
    )  # fmt: skip
    data = CoverageData(str(work / "data"))
    data.read()
    found: dict[str, dict[int, set[str]]] = {}
    for file in data.measured_files():
        lines: dict[int, set[str]] = defaultdict(set)
        for number, contexts in data.contexts_by_lineno(file).items():
            tests = {test for context in contexts if context and (test := _test(context))}
            lines[number] |= tests
            lines[0] |= tests
        found[f"python/{Path(file).relative_to(python).as_posix()}"] = lines
    return found


def _test(context: str) -> str:
    """`tests.io.test_text.test_blank` as pytest names it; "" for a function that is no test."""
    module, _, name = context.rpartition(".")
    while module and not (ROOT / f"{module.replace('.', '/')}.py").exists():
        module, _, above = module.rpartition(".")
        name = f"{above}::{name}"
    if not module.startswith("tests."):
        return ""
    return f"{module.replace('.', '/')}.py::{name}"


def judge_python(
    fault: Fault, lines: dict[str, dict[int, set[str]]], copies: SimpleQueue[Path]
) -> Fault | None:
    """The fault with its outcome; None for one with which the module cannot be imported."""
    by_line = lines.get(fault.file, {})
    tests = sorted(by_line.get(fault.number) or by_line.get(0) or ())
    if not tests:
        return replace(fault, outcome="survived")
    module = (
        fault.file.removeprefix("python/").removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    )
    builds, judges = [sys.executable, "-c", f"import {module}"], [sys.executable, "-m", *QUICK, "-x", *tests]
    python = copies.get()
    try:
        return tried(fault, python.parent, builds, judges, cwd=ROOT, env=_environment(python))
    finally:
        copies.put(python)


def sampled(faults: list[Fault], each: int, group: str) -> list[Fault]:
    """`each` faults of different lines, the same ones for the same code."""
    draw = random.Random(f"mutation sample {group}")  # noqa: S311
    by_line: dict[tuple[str, int], list[Fault]] = defaultdict(list)
    for fault in faults:
        by_line[fault.file, fault.number].append(fault)
    places = draw.sample(sorted(by_line), min(each, len(by_line)))
    return [draw.choice(by_line[place]) for place in places]


def all_faults(group: str) -> list[Fault]:
    """Every fault of a group."""
    if group in RUST:
        return [fault for fault in rust_faults() if fault.group == group]
    files = [
        path
        for room in PYTHON[group]
        for path in sorted((ROOT / "python" / "bottomlock" / room).rglob("*.py"))
        if "vendor" not in path.parts
    ]
    return [fault for path in files for fault in python_faults(group, path, ROOT)]


def judged(group: str, chosen: list[Fault], jobs: int) -> Iterator[Fault]:
    """Those of the chosen faults that build, each with its outcome, in order."""
    with tempfile.TemporaryDirectory() as folder, Progress(console=Console(stderr=True)) as bar:
        if group in RUST:
            tree = crates_copy(Path(folder))
            found = judged_rust(chosen, tree)
            yield from filter(None, bar.track(found, total=len(chosen), description=group))
            return
        copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(jobs):
            copies.put(package_copy(Path(folder) / str(number)))
        first = copies.get()
        lines = tests_by_line(group, first, Path(folder))
        copies.put(first)
        judge = partial(judge_python, lines=lines, copies=copies)
        pool = ThreadPoolExecutor(jobs)
        try:
            for fault in bar.track(pool.map(judge, chosen), total=len(chosen), description=group):
                if fault is not None:
                    yield fault
        finally:
            pool.shutdown(cancel_futures=True)


def table(faults: Iterable[Fault]) -> pl.DataFrame:
    """The faults as a table."""
    columns = ("group", "file", "function", "line", "change", "outcome", "commit")
    rows = [{name: asdict(fault)[name] for name in columns} for fault in faults]
    return pl.DataFrame(rows, schema=dict.fromkeys(columns, pl.String))


def shares(faults: pl.DataFrame) -> pl.DataFrame:
    """Of each group the faults, those killed, and the share with its 95 % interval (Clopper and Pearson)."""
    counted = faults.group_by("group", maintain_order=True).agg(
        pl.len().alias("faults"), (pl.col("outcome") != "survived").sum().alias("killed")
    )
    n, k = counted["faults"].to_numpy(), counted["killed"].to_numpy()
    low, high = beta.ppf(0.025, k, n - k + 1), beta.ppf(0.975, k + 1, n - k)
    return counted.with_columns(
        (pl.col("killed") / pl.col("faults")).alias("share"),
        pl.Series("from", low).fill_nan(0.0), pl.Series("to", high).fill_nan(1.0),
    )  # fmt: skip


def judged_before(path: Path | None, groups: Iterable[str]) -> list[Fault]:
    """The faults of a table, but those of the groups that were judged at another commit, whose sample is another.

    Raises:
        SystemExit: for a missing file.
    """
    if path is None or not path.is_file():
        raise SystemExit("--goes-on needs --out with the table of an interrupted run")
    faults = [Fault(**row) for row in pl.read_parquet(path).iter_rows(named=True)]
    return [one for one in faults if one.group not in groups or one.commit == head()]


def head() -> str:
    """The commit of the code."""
    return str(run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout).strip()


def write(faults: list[Fault], path: Path) -> None:
    """Writes the table with the commit of the code and the command."""
    metadata = {"commit": head(), "command": "python -m tools.mutation_sample"}
    table(faults).write_parquet(path, metadata=metadata)


def main() -> None:
    """Judges the sample and prints the shares."""
    parser = argparse.ArgumentParser(description="Share of random wrong lines that the quick tests see.")
    parser.add_argument("--groups", nargs="*", default=[*RUST, *PYTHON], help="groups of rooms")
    parser.add_argument("--each", type=int, default=60, help="faults that build, of each group")
    parser.add_argument("--jobs", type=int, default=2, help="Python faults judged side by side")
    parser.add_argument("--again", type=Path, help="table of an earlier run: the same faults once more")
    parser.add_argument("--out", type=Path, help="Parquet file for the table; it grows as faults are judged")
    parser.add_argument("--goes-on", action="store_true", help="after an interrupt: keep what --out holds")
    options = parser.parse_args()
    before = pl.read_parquet(options.again) if options.again else None
    found = judged_before(options.out, options.groups) if options.goes_on else []
    for group in options.groups:
        faults = all_faults(group)
        if before is None:
            # Of cargo-mutants' faults about a third does not build.
            done = {one.key for one in found if one.group == group}
            chosen = [one for one in sampled(faults, 2 * options.each, group) if one.key not in done]
            limit = max(options.each - len(done), 0)
        else:
            rows = before.filter(pl.col("group") == group).select("file", "function", "line", "change").rows()
            first = {fault.key: fault for fault in reversed(faults)}
            chosen, limit = [first[key] for key in dict.fromkeys(rows) if key in first], len(rows)
        for fault in islice(judged(group, chosen, options.jobs), limit):
            found.append(replace(fault, commit=head()))
            if options.out:
                write(found, options.out)
    pl.Config.set_tbl_rows(-1)
    after = table(found)
    if before is not None:
        same = ["group", "file", "function", "line", "change"]
        both = before.join(after, on=same, suffix="_after").unique(same, maintain_order=True)
        print("before\n", shares(both))
        after = both.drop("outcome").rename({"outcome_after": "outcome"})
        print("after")
    print(shares(after))
    for fault in found:
        if fault.outcome == "survived":
            print(f"survived: {fault.file}:{fault.number} {fault.change}")


if __name__ == "__main__":
    main()
