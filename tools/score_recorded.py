"""Scores the recordings and writes the tables of docs/recorded.md: `python tools/score_recorded.py [DATA]`.

DATA is the folder of the recordings, by default the one that BOTTOMLOCK_RECORDINGS names. Every table stands between
two marks in the page, and nothing else of the page is changed. `--check` compares instead of writing.
"""

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.io.beams import read_beams, read_geometry
from bottomlock.replay.leave_out import leave_out, over_sets
from bottomlock.replay.run import replay_case
from bottomlock.tables.replay import FORWARD, RECORDED, SMOOTHED
from tools.akit import SECTIONS, akit_case

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "recorded.md"
DRAWS = 1
WHAT_IF = (RECORDED, "lost_34", "outage_60", "outage_120", "outage_300", "caves")


def recordings() -> Path:
    """Default folder of the recordings."""
    return Path(os.environ.get("BOTTOMLOCK_RECORDINGS", ROOT.parent / "shared" / "data"))


def number(value: float | None, digits: int = 3) -> str:
    """Three digits, or a dash."""
    if value is None:
        return "–"
    return f"{value:.{digits}g}" if abs(value) < 100 else f"{value:.0f}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """A table in Markdown, numbers to the right."""
    rule = ["---"] * left + ["---:"] * (len(head) - left)
    lines = [head, rule, *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def code(name: object) -> str:
    """A name in code."""
    return f"`{name!s}`"


def akit_runs(
    data: Path, scratch: Path, *, draws: int = 1, methods: str = "", smooth: bool = True, **which: bool
) -> pl.DataFrame:
    """The table of runs of every section."""
    lines = f"runs = {draws}\nsmooth = {str(smooth).lower()}\n" + (
        f"methods = {methods}\n" if methods else ""
    )
    parts = [
        replay_case(akit_case(data, scratch, section, replay=lines, **which), threads=0).runs
        for section in SECTIONS
    ]
    return pl.concat(parts)


def full_velocity(data: Path, scratch: Path) -> str:
    """LC with every beam and INS alone, section by section."""
    methods = '["ins", "lc"]'
    aided = akit_runs(data, scratch, methods=methods)
    alone = akit_runs(data, scratch, methods='["ins"]', depth=False)
    rows, percents = [], []
    for section in SECTIONS:
        name = f"akit_{section:02d}"
        of = {
            key: frame.filter(
                (pl.col("case") == name) & (pl.col("method") == method) & (pl.col("pass") == which)
            ).row(0, named=True)
            for key, frame, method, which in (
                ("lc", aided, "lc", FORWARD), ("smooth", aided, "lc", SMOOTHED), ("ins", alone, "ins", FORWARD),
            )
        }  # fmt: skip
        percents.append(of["lc"]["position_final_percent"])
        rows.append(
            [
                str(section), number(of["lc"]["distance_m"]), number(of["lc"]["position_final_m"]),
                number(of["lc"]["position_final_percent"]), number(of["lc"]["position_rms_over_time_m"]),
                number(of["smooth"]["position_rms_over_time_m"]), number(of["lc"]["velocity_rms_over_time_mps"]),
                number(of["smooth"]["velocity_rms_over_time_mps"]), number(of["ins"]["position_final_m"]),
            ]
        )  # fmt: skip
    head = [
        "Section", "distance travelled, m", "end, m", "end, % DT", "RMS, m", "RMS smoothed, m",
        "velocity RMS, m/s", "smoothed, m/s", "INS alone, end, m",
    ]  # fmt: skip
    series = pl.Series(percents)
    words = f"\nMedian {number(series.median())} % DT, greatest {number(series.max())} % DT.\n"  # type: ignore[arg-type]
    return table(head, rows) + words


def what_if_cases(runs: pl.DataFrame) -> str:
    """Every method, forward and smoothed: position error at the end in % DT, or its RMS, for every what-if case."""
    total = runs.filter(
        (pl.col("method") == "tc") & (pl.col("pass") == FORWARD) & (pl.col("what_if") == RECORDED)
    ).height
    parts = [f"{total} runs a cell (sections × draws); semi-synthetic.\n"]
    for which in (FORWARD, SMOOTHED):
        rows = []
        for method in runs["method"].unique(maintain_order=True):
            one = runs.filter((pl.col("method") == method) & (pl.col("pass") == which))
            if not one.height:
                continue
            cells = []
            for what_if in WHAT_IF:
                cell = one.filter(pl.col("what_if") == what_if)
                if which == FORWARD:
                    percent = cell["position_final_percent"]
                    cells.append(f"{number(percent.median(), 2)} ({number(percent.max(), 2)})")  # type: ignore[arg-type]
                else:
                    cells.append(number(cell["position_rms_over_time_m"].median()))  # type: ignore[arg-type]
            rows.append([code(method), *cells])
        title = (
            "Forward: position error at the end, % DT, median (greatest)."
            if which == FORWARD
            else "Smoothed: position error over the section, m RMS, median."
        )
        parts.append(
            f"{title}\n\n" + table(["Method", *(what_if.replace("_", " ") for what_if in WHAT_IF)], rows)
        )
    return "\n".join(parts)


def consistency(runs: pl.DataFrame, what_if: str = "lost_34") -> str:
    """One what-if case in full: errors, error over claimed σ, fixes rejected."""
    rows = []
    for method in runs["method"].unique(maintain_order=True):
        one = runs.filter(
            (pl.col("method") == method) & (pl.col("pass") == FORWARD) & (pl.col("what_if") == what_if)
        )
        names = (
            "position_rms_over_time_m",
            "velocity_rms_over_time_mps",
            "attitude_rms_over_time_deg",
            "position_normalised_rms_over_time",
            "velocity_normalised_rms_over_time",
        )
        numbers = [number(one[name].median()) for name in names]  # type: ignore[arg-type]
        fixes = sum(int(one[f"fixes_{fate}"].sum()) for fate in ("accepted", "in_part", "rejected"))
        rejected = f"{100.0 * int(one['fixes_rejected'].sum()) / fixes:.1f}" if fixes else "–"
        rows.append([code(method), *numbers, rejected])
    head = [
        "Method",
        "position RMS, m",
        "velocity RMS, m/s",
        "attitude RMS, °",
        "error/σ: position",
        "error/σ: velocity",
        "rejected, %",
    ]
    return table(head, rows)


def against_tc(runs: pl.DataFrame) -> str:
    """Methods with assumptions against TC: median paired ratio of the RMS position errors, and how often worse."""
    rows = []
    forward = runs.filter(pl.col("pass") == FORWARD)
    base = forward.filter(pl.col("method") == "tc").select(
        "case", "what_if", "run", tc=pl.col("position_rms_over_time_m")
    )
    for method in ("weak_sway", "sway_current", "consistent"):
        cells = []
        for what_if in WHAT_IF:
            one = forward.filter((pl.col("method") == method) & (pl.col("what_if") == what_if))
            joined = one.join(base, on=["case", "what_if", "run"])
            ratio = joined["position_rms_over_time_m"] / joined["tc"]
            cells.append(
                f"{number(float(np.median(ratio.to_numpy())))} ({int((ratio > 1.0).sum())}/{len(ratio)})"
            )
        rows.append([code(method), *cells])
    return table(["Method", *(what_if.replace("_", " ") for what_if in WHAT_IF)], rows)


def robust(plain: pl.DataFrame, sturdy: pl.DataFrame) -> str:
    """Without and with gates of single beams and Student's t: position error at the end, % DT, median (greatest)."""
    rows = []
    for method in ("lc", "tc", "vb_exact", "info", "weak_sway", "sway_current", "consistent"):
        cells = []
        for what_if in (RECORDED, "lost_34", "caves"):
            for frame in (plain, sturdy):
                cell = frame.filter(
                    (pl.col("method") == method)
                    & (pl.col("what_if") == what_if)
                    & (pl.col("pass") == FORWARD)
                )
                percent = cell["position_final_percent"]
                cells.append(f"{number(percent.median(), 2)} ({number(percent.max(), 2)})")  # type: ignore[arg-type]
        rows.append([code(method), *cells])
    head = ["Method"]
    for what_if in (RECORDED, "lost 34", "caves"):
        head += [what_if, f"{what_if}, robust"]
    return table(head, rows)


def caves(data: Path, beams: int) -> str:
    """Beams left out of the caves' pings."""
    instrument = read_geometry("linkquest_caves")
    pings = read_beams(
        data / "caves_girona_linkquest" / "dvl_linkquest.csv",
        beams=instrument.geometry.beams,
        columns=instrument.columns,
    )
    parts = []
    for gate, words in (
        (3.0, "Pings whose closure is within 3 robust sigma"),
        (None, "Every ping of four valid beams"),
    ):
        scores = leave_out(
            instrument.geometry, pings.time_ns, pings.velocity_mps, pings.valid, instrument.beam_sd_mps,
            beams=beams, closure_gate=gate, robust=False,
        )  # fmt: skip
        rows = []
        summary = over_sets(scores)
        for method in summary["method"].unique(maintain_order=True):
            cells = [code(method)]
            for component in ("surge", "sway", "heave", "beam"):
                row = summary.filter((pl.col("method") == method) & (pl.col("component") == component)).row(
                    0, named=True
                )
                if row["sets_solved"] == 0:
                    cells += ["–", "–"]
                    continue
                partly = "" if row["sets_solved"] == row["sets"] else f" [{row['sets_solved']}/{row['sets']}]"
                cells.append(
                    f"{1e3 * row['error_median_mps']:.0f} / {1e3 * row['error_rms_over_pings_mps']:.0f}{partly}"
                )
                cells.append(number(row["normalised_robust"], 2))
            rows.append(cells)
        head = [
            "Method",
            "surge, mm/s",
            "error/σ",
            "sway, mm/s",
            "error/σ",
            "heave, mm/s",
            "error/σ",
            "beam left out, mm/s",
            "error/σ",
        ]
        parts.append(f"{words}: {int(scores['pings'][0])}.\n\n" + table(head, rows))
    return "\n".join(parts)


def replaced(page: str, tables: dict[str, str]) -> str:
    """The page with each table between its marks.

    Raises:
        SystemExit: where the page lacks a mark.
    """
    for name, text in tables.items():
        pattern = re.compile(rf"(<!-- table {name} -->\n)(.*?)(<!-- end -->)", re.DOTALL)
        match = pattern.search(page)
        if match is None:
            raise SystemExit(f"{PAGE}: has no mark for the table '{name}'")
        begin, end = match.start(2), match.start(3)
        page = f"{page[:begin]}\n{text}\n{page[end:]}"
    return page


def main() -> None:
    """Scores all recordings and writes the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="?", type=Path, default=recordings())
    parser.add_argument("--check", action="store_true")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        noisy = akit_runs(asked.data, scratch, draws=DRAWS, noisy=True, asks=True)
        sturdy = akit_runs(asked.data, scratch, draws=DRAWS, smooth=False, noisy=True, robust=True, asks=True)
        poor_sturdy = akit_runs(
            asked.data, scratch, draws=DRAWS, smooth=False, noisy=True, degraded=True, robust=True, asks=True
        )
        poor = akit_runs(asked.data, scratch, draws=DRAWS, noisy=True, degraded=True, asks=True)
        tables = {
            "full": full_velocity(asked.data, scratch),
            "robust": robust(noisy, sturdy),
            "degraded-robust": robust(poor, poor_sturdy),
            "noisy": what_if_cases(noisy),
            "noisy-consistency": consistency(noisy),
            "noisy-tc": against_tc(noisy),
            "degraded": what_if_cases(poor),
            "degraded-consistency": consistency(poor),
            "degraded-tc": against_tc(poor),
            "caves-1": caves(asked.data, 1),
            "caves-2": caves(asked.data, 2),
        }
    page = PAGE.read_text(encoding="utf-8")
    new = replaced(page, tables)
    if asked.check:
        raise SystemExit(0 if new == page else f"{PAGE}: the tables differ from those of the recordings")
    PAGE.write_text(new, encoding="utf-8")
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
