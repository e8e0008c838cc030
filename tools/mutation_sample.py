"""Puts random wrong lines into the code and counts those that the quick tests see: `python -m tools.mutation_sample`.

Rust faults are drawn from the list of cargo-mutants and judged by the kernel's unit tests, all in one build
(`tools.switched_faults`). Python faults are drawn over the syntax tree and judged by those quick tests of their rooms
that run the line. Faults that do not build are left out and others drawn.

A row of the table is a fault: group, file, function, line (its text), change, outcome ("killed", "survived", or
"timeout", which counts as killed), and the commit that it was judged at. `--again TABLE` judges the faults of an
earlier table once more, where function, line and change still stand, and prints both shares: the gate before and after
a change. A table of `--out` keeps its rows of other groups, so that groups can be judged one after another.

    python -m tools.mutation_sample --out data/evidence/mutation_sample.parquet
    python -m tools.mutation_sample logs --each 20
    python -m tools.mutation_sample --again data/evidence/mutation_sample.parquet
"""

from __future__ import annotations

import ast
import compileall
import json
import os
import random
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

import cyclopts
import polars as pl
from coverage import CoverageData
from rich.console import Console
from rich.progress import track
from scipy.stats import beta

import bottomlock
from tools.evidence import origin
from tools.switched_faults import SWITCH, Fault, build, outcome

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
SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip


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
    lines, body = text.split("\n"), text.encode()
    faults: list[Fault] = []

    def visit(node: ast.AST, function: str) -> None:
        for wrong in changes(node):
            # Of a branch the condition is replaced, and of an argument its value.
            old: Any = node.test if isinstance(node, ast.If | ast.While) else node
            old = old.value if isinstance(old, ast.keyword) else old
            span = byte(lines, old.lineno) + old.col_offset, byte(lines, old.end_lineno) + old.end_col_offset
            new = ast.unparse(ast.fix_missing_locations(wrong))
            new = new if isinstance(old, ast.stmt | ast.Slice) else f"({new})"
            same = " ".join(body[slice(*span)].decode().split())
            line, change = lines[old.lineno - 1].strip(), f"{same[:120]} -> {new[:120]}"
            file = path.relative_to(root).as_posix()
            faults.append(Fault(group, file, function, line, change, number=old.lineno, span=span, new=new))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            function = f"{function}.{node.name}".lstrip(".")
        for name, field in ast.iter_fields(node):
            if name in {"annotation", "returns", "decorator_list"} or isinstance(node, ast.Raise):
                continue
            for child in field if isinstance(field, list) else [field]:
                if isinstance(child, ast.AST):
                    visit(child, function)

    visit(ast.parse(text), "")
    return faults


def byte(lines: list[str], line: int, column: int = 0) -> int:
    """The byte of a character: its line from 1, its column from 0."""
    return len("\n".join([*lines[: line - 1], lines[line - 1][:column]]).encode())


def rust_faults(group: str) -> list[Fault]:
    """Every fault of a group in cargo-mutants' list (.cargo/mutants.toml)."""
    command = ["cargo", "mutants", "--list", "--json", "--package", "bottomlock"]
    faults = []
    for entry in json.loads(subprocess.check_output(command, cwd=ROOT)):  # noqa: S603 - our own arguments
        if entry["file"].removeprefix(KERNEL).split("/")[0] not in RUST[group]:
            continue
        lines = (ROOT / entry["file"]).read_text(encoding="utf-8").split("\n")

        def place(span: Any, lines: list[str] = lines) -> tuple[int, int]:  # noqa: ANN401
            first, last = (byte(lines, at["line"], at["column"] - 1) for at in (span["start"], span["end"]))
            return first, last

        function, number, span = entry["function"], entry["span"]["start"]["line"], place(entry["span"])
        old = "\n".join(lines).encode()[slice(*span)].decode() if entry["genre"] != "FnValue" else "body"
        name, owner = (function["function_name"], place(function["span"])) if function else ("", (0, 0))
        faults.append(Fault(
            group, entry["file"], name, lines[number - 1].strip(), f"{old} -> {entry['replacement']}",
            number=number, span=span, new=entry["replacement"], owner=owner,
        ))  # fmt: skip
    return faults


def judged_rust(chosen: list[Fault]) -> Iterator[Fault | None]:
    """The faults with their outcomes, in order; None for one that does not build.

    All are in one build, but those of a function that cannot be switched, such as a constant one: they are left out.
    """
    numbered = dict(enumerate(chosen, 1))
    with tempfile.TemporaryDirectory() as tree:
        copied = ["cp", "-r", "crates", ".cargo", "Cargo.toml", "Cargo.lock", tree]
        subprocess.run(copied, cwd=ROOT, check=True)  # noqa: S603 - our own arguments
        crate = Path(tree) / "crates" / "bottomlock"
        program, switched = build(Path(tree), numbered)
        for number, fault in numbered.items():
            run = os.environ | {SWITCH: str(number), "CARGO_MANIFEST_DIR": str(crate)}
            judged = number in switched
            yield replace(fault, outcome=outcome([program], cwd=crate, env=run)) if judged else None


QUICK = [
    sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "not long and not deep",
]  # fmt: skip


def linked(folder: Path) -> dict[str, str]:
    """The package in a folder, each file a link, and the environment of tests that import it from there."""
    subprocess.run(["cp", "-rs", ROOT / "python" / "bottomlock", folder], check=True)  # noqa: S603, S607
    for kernel in Path(bottomlock.__file__).parent.glob("_kernel*.so"):
        if not (folder / "bottomlock" / kernel.name).exists():
            (folder / "bottomlock" / kernel.name).symlink_to(kernel)
    return os.environ | {
        "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}", "PYTHONDONTWRITEBYTECODE": "1", "MPLBACKEND": "Agg",
        "CI": "1", "RAYON_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
    }  # fmt: skip


def covered(group: str, work: Path) -> CoverageData:
    """Which tests of the group's rooms run which line, by coverage."""
    folders = [f"tests/{room}" for room in PYTHON[group] if (ROOT / "tests" / room).is_dir()]
    rc = f"[run]\ndynamic_context = test_function\ndata_file = {work / 'data'}\nsource = {ROOT / 'python'}\n"
    (work / "rc").write_text(rc)
    command = [sys.executable, "-m", "coverage", "run", f"--rcfile={work / 'rc'}", *QUICK[1:], *folders]
    subprocess.run(command, cwd=ROOT, env=linked(work), stdout=sys.stderr, check=False)  # noqa: S603 - ours
    data = CoverageData(str(work / "data"))
    data.read()
    return data


def tests_of(fault: Fault, data: CoverageData) -> list[str]:
    """The tests that run its line; where none does, as with a constant, those that run any line of the file."""
    by_line = data.contexts_by_lineno(str(ROOT / fault.file))
    for contexts in (by_line.get(fault.number, ()), chain(*by_line.values())):
        places = {context.rpartition(".") for context in contexts if context.startswith("tests.")}
        if places:
            return sorted(f"{module.replace('.', '/')}.py::{test}" for module, _, test in places)
    return []


def judge_python(fault: Fault, data: CoverageData) -> Fault | None:
    """The fault with its outcome; None for one with which the module cannot be imported."""
    tests = tests_of(fault, data)
    if not tests:
        return replace(fault, outcome="survived")
    file = Path(fault.file).relative_to("python")
    module = ".".join(file.with_suffix("").parts).removesuffix(".__init__")
    with tempfile.TemporaryDirectory() as folder:
        options = {"cwd": ROOT, "env": linked(Path(folder))}
        path = Path(folder) / file
        good = path.read_text(encoding="utf-8")
        path.unlink()
        path.write_text(fault.applied(good), encoding="utf-8")
        if outcome([sys.executable, "-c", f"import {module}"], **options) == "killed":
            return None
        return replace(fault, outcome=outcome([*QUICK, "-x", *tests], **options))


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
        return rust_faults(group)
    rooms = [ROOT / "python" / "bottomlock" / room for room in PYTHON[group]]
    files = [path for room in rooms for path in sorted(room.rglob("*.py")) if "vendor" not in path.parts]
    return [fault for path in files for fault in python_faults(group, path, ROOT)]


def judged(group: str, chosen: list[Fault], jobs: int) -> Iterator[Fault]:
    """Those of the chosen faults that build, each with its outcome, in order."""
    pool = ThreadPoolExecutor(jobs)
    with tempfile.TemporaryDirectory() as work:
        if group in RUST:
            found = judged_rust(chosen)
        else:
            compileall.compile_dir(ROOT / "python" / "bottomlock", quiet=2)
            found = pool.map(partial(judge_python, data=covered(group, Path(work))), chosen)
        try:
            yield from filter(None, track(found, group, len(chosen), console=Console(stderr=True)))
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


def main(
    *groups: str, each: int = 60, jobs: int = 2, again: Path | None = None, out: Path | None = None
) -> None:
    """Judges a sample of random wrong lines and prints the share that the quick tests see.

    Args:
        groups: groups of rooms; all by default.
        each: faults that build, of each group.
        jobs: Python faults judged side by side.
        again: table of an earlier run: the same faults once more.
        out: Parquet file for the table; it keeps what it holds of other groups.
    """
    groups = groups or (*RUST, *PYTHON)
    before = pl.read_parquet(again) if again else None
    after = pl.read_parquet(out) if out and out.exists() else table([])
    after = after.filter(~pl.col("group").is_in(groups))
    for group in groups:
        faults = all_faults(group)
        if before is None:
            # Of cargo-mutants' faults about a third does not build.
            chosen, limit = sampled(faults, 2 * each, group), each
        else:
            rows = before.filter(pl.col("group") == group).select("file", "function", "line", "change").rows()
            first = {fault.key: fault for fault in reversed(faults)}
            chosen, limit = [first[key] for key in dict.fromkeys(rows) if key in first], len(rows)
        about = origin("python -m tools.mutation_sample")
        found = list(islice(judged(group, chosen, jobs), limit))
        for fault in found:
            if fault.outcome == "survived":
                print(f"survived: {fault.file}:{fault.number} {fault.change}")
        after = pl.concat([after, table(found).with_columns(commit=pl.lit(about["commit"]))])
        if out:
            after.write_parquet(out, metadata=about)
    pl.Config.set_tbl_rows(-1)
    if before is not None:
        same = ["group", "file", "function", "line", "change"]
        both = before.join(after, on=same, suffix="_after").unique(same, maintain_order=True)
        print("before\n", shares(both))
        after = both.drop("outcome").rename({"outcome_after": "outcome"})
        print("after")
    print(shares(after))


if __name__ == "__main__":
    cyclopts.run(main)
