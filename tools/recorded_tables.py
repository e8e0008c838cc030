"""Tables of docs/recorded.md in Markdown, from tables of runs."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from bottomlock.io.beams import read_beams, read_geometry
from bottomlock.replay.leave_out import leave_out, over_sets
from bottomlock.tables.replay import FORWARD, RECORDED, SIGMAS, SMOOTHED
from tools.akit import SECTIONS
from tools.akit_reference import Innovations, ReferenceQuality
from tools.recorded_runs import TRUSTED

LOST_MPS = 0.2
"""Velocity error at the end from which a run counts as locked out; the median is 0.02 m/s, the greatest of any other
run 0.1 m/s. Every run has beams at the end, `lc` with two beams excepted."""
ONE_SECTION, ONE_CASE = 1, "lost_34"
"""The section and what-if case of the table `one`, whose first draw a test compares with the code."""


def number(value: float | None, digits: int = 3) -> str:
    """So many digits, or a dash."""
    if value is None or not np.isfinite(value):
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


def words(what_if: str) -> str:
    """A what-if case in a heading."""
    return what_if.replace("_", " ")


def cells_of(runs: pl.DataFrame, method: str, what_if: str, which: str = FORWARD) -> pl.DataFrame:
    """The runs of one cell: method, what-if case and pass."""
    return runs.filter(
        (pl.col("method") == method) & (pl.col("what_if") == what_if) & (pl.col("pass") == which)
    )


def spread(cell: pl.DataFrame, digits: int = 2) -> str:
    """Position error at the end in % DT: median, 90th percentile and greatest of a cell."""
    percent = cell["position_final_percent"]
    values = (percent.median(), percent.quantile(0.9, "linear"), percent.max())
    return " / ".join(number(value, digits) for value in values)  # type: ignore[arg-type]


def full_velocity(full: pl.DataFrame, alone: pl.DataFrame) -> str:
    """LC with every beam and INS alone, section by section."""
    rows, percents = [], []
    for section in SECTIONS:
        name = f"akit_{section:02d}"
        one = full.filter(pl.col("case") == name)
        forward = cells_of(one, "lc", RECORDED).row(0, named=True)
        smoothed = cells_of(one, "lc", RECORDED, SMOOTHED).row(0, named=True)
        ins = cells_of(alone.filter(pl.col("case") == name), "ins", RECORDED).row(0, named=True)
        aided = cells_of(one, "ins", RECORDED).row(0, named=True)
        percents.append(forward["position_final_percent"])
        rows.append(
            [
                str(section), number(forward["distance_m"]), number(forward["position_final_m"]),
                number(forward["position_final_percent"]), number(forward["position_rms_over_time_m"]),
                number(smoothed["position_rms_over_time_m"]), number(forward["velocity_rms_over_time_mps"]),
                number(smoothed["velocity_rms_over_time_mps"]), number(ins["position_final_m"]),
                number(aided["position_final_m"]),
            ]
        )  # fmt: skip
    head = [
        "Section", "distance travelled, m", "end, m", "end, % DT", "RMS, m", "RMS smoothed, m",
        "velocity RMS, m/s", "smoothed, m/s", "INS alone, end, m", "INS and depth, end, m",
    ]  # fmt: skip
    line = f"\nMedian {number(float(np.median(percents)))} % DT, greatest {number(max(percents))} % DT.\n"
    return table(head, rows) + line


def what_if_cases(runs: pl.DataFrame) -> str:
    """Every method and what-if case: position error at the end in % DT."""
    names = runs["what_if"].unique(maintain_order=True).to_list()
    rows = [
        [code(method), *(spread(cells_of(runs, method, what_if)) for what_if in names)]
        for method in runs["method"].unique(maintain_order=True)
    ]
    count = cells_of(runs, "tc", RECORDED).height
    title = (
        f"{count} runs a cell (sections × draws); semi-synthetic. Position error at the end, % DT: median / 90th "
        "percentile / greatest.\n\n"
    )
    return title + table(["Method", *map(words, names)], rows)


def consistency(runs: pl.DataFrame, what_if: str) -> str:
    """One what-if case in full: errors, error over claimed σ, coverage, fixes rejected."""
    rows = []
    for method in runs["method"].unique(maintain_order=True):
        one = cells_of(runs, method, what_if)
        names = [
            "position_rms_over_time_m",
            "velocity_rms_over_time_mps",
            "attitude_rms_over_time_deg",
            *(f"{name}_normalised_rms_over_time" for name in ("position", "velocity", "attitude")),
        ]
        numbers = [number(one[name].median()) for name in names]  # type: ignore[arg-type]
        covered = [
            " / ".join(f"{100.0 * one[f'{name}_covered_{k}sigma'].mean():.0f}" for k in SIGMAS)  # type: ignore[operator]
            for name in ("position", "velocity", "attitude")
        ]
        fixes = sum(int(one[f"fixes_{fate}"].sum()) for fate in ("accepted", "in_part", "rejected"))
        rejected = f"{100.0 * int(one['fixes_rejected'].sum()) / fixes:.1f}" if fixes else "–"
        rows.append([code(method), *numbers, *covered, rejected])
    head = [
        "Method", "position RMS, m", "velocity RMS, m/s", "attitude RMS, °", "error/σ: position", "velocity",
        "attitude", "within 1 / 2 / 3 σ, %: position", "velocity", "attitude", "rejected, %",
    ]  # fmt: skip
    return table(head, rows)


def against_tc(runs: pl.DataFrame) -> str:
    """Methods with assumptions against TC: median paired ratio of the RMS position errors, and how often worse."""
    rows = []
    names = runs["what_if"].unique(maintain_order=True).to_list()
    forward = runs.filter(pl.col("pass") == FORWARD)
    base = forward.filter(pl.col("method") == "tc").select(
        "case", "what_if", "run", tc=pl.col("position_rms_over_time_m")
    )
    for method in ("weak_sway", "sway_current", "consistent"):
        cells = []
        for what_if in names:
            joined = cells_of(forward, method, what_if).join(base, on=["case", "what_if", "run"])
            ratio = joined["position_rms_over_time_m"] / joined["tc"]
            worse = f"{int((ratio > 1.0).sum())}/{len(ratio)}"
            cells.append(f"{number(float(np.median(ratio.to_numpy())))} ({worse})")
        rows.append([code(method), *cells])
    return table(["Method", *map(words, names)], rows)


def robust_and_plain(robust: pl.DataFrame, plain: pl.DataFrame) -> str:
    """Robust and not: position error at the end, % DT, median / 90th percentile / greatest."""
    names = plain["what_if"].unique(maintain_order=True).to_list()
    head = ["Method"]
    for what_if in names:
        head += [f"{words(what_if)}, robust", f"{words(what_if)}, not robust"]
    rows = [
        [
            code(method),
            *(spread(cells_of(runs, method, what_if)) for what_if in names for runs in (robust, plain)),
        ]
        for method in TRUSTED
    ]
    return table(head, rows)


def smoothed_and_filtered(runs: pl.DataFrame) -> str:
    """RMS errors over the section, filtered → smoothed, medians, and in how many runs the smoother's are greater."""
    rows = []
    for what_if in runs["what_if"].unique(maintain_order=True):
        for method in runs["method"].unique(maintain_order=True):
            forward, smoothed = (cells_of(runs, method, what_if, which) for which in (FORWARD, SMOOTHED))
            joined = forward.join(smoothed, on=["case", "run"], suffix="_smoothed")
            cells = []
            for name in (
                "position_rms_over_time_m",
                "velocity_rms_over_time_mps",
                "attitude_rms_over_time_deg",
            ):
                before, after = joined[name], joined[f"{name}_smoothed"]
                middle = f"{number(before.median())} → {number(after.median())}"  # type: ignore[arg-type]
                cells.append(f"{middle} ({int((after > before).sum())}/{joined.height})")
            rows.append([code(method), words(what_if), *cells])
    return table(["Method", "case", "position RMS, m", "velocity RMS, m/s", "attitude RMS, °"], rows, left=2)


def lost_runs(worlds: dict[str, pl.DataFrame]) -> str:
    """Every run of a trusted method that is locked out (`LOST_MPS`); `lc` where it has three beams at the end."""
    beams_at_end = ~((pl.col("method") == "lc") & (pl.col("what_if") == "lost_34"))
    rows = []
    for name, runs in worlds.items():
        lost = runs.filter(
            (pl.col("pass") == FORWARD)
            & pl.col("method").is_in(TRUSTED)
            & beams_at_end
            & (pl.col("velocity_final_mps") > LOST_MPS)
        )
        rows += [
            [
                words(name), row["case"].removeprefix("akit_"), str(row["run"]), code(row["method"]),
                words(row["what_if"]), number(row["velocity_final_mps"]), number(row["position_final_percent"]),
                str(row["fixes_accepted"] + row["fixes_in_part"]), str(row["fixes_rejected"]),
            ]
            for row in lost.sort("case", "method", "what_if", "run").iter_rows(named=True)
        ]  # fmt: skip
    if not rows:
        return f"No run of a trusted method ends with a velocity error of more than {LOST_MPS:g} m/s.\n"
    head = [
        "World", "section", "draw", "method", "case", "velocity error at the end, m/s", "position, % DT",
        "fixes used", "rejected",
    ]  # fmt: skip
    return table(head, rows, left=5)


def one_draw(worlds: dict[str, pl.DataFrame]) -> str:
    """The first draw of one section and case in every world: position error at the end in metres, five digits."""
    rows = []
    first = {
        name: runs.filter((pl.col("case") == f"akit_{ONE_SECTION:02d}") & (pl.col("run") == 0))
        for name, runs in worlds.items()
    }
    for method in next(iter(first.values()))["method"].unique(maintain_order=True):
        ends = [cells_of(runs, method, ONE_CASE)["position_final_m"][0] for runs in first.values()]
        rows.append([code(method), *(f"{end:.5g}" for end in ends)])
    return table(["Method", *map(words, first)], rows)


def reference_table(sections: Sequence[ReferenceQuality]) -> str:
    """The reference against the DVL and against itself, section by section."""
    rows = [
        [
            str(one.section), f"{one.positions.shift_s:.2f}", number(one.positions.rms),
            number(one.positions.rms_unshifted), f"{one.positions.scale:.4f}", f"{one.velocities.shift_s:.2f}",
            f"{one.velocities.scale:.4f}", number(one.own_velocity_rms_m), f"{1e3 * one.surge_sd_mps:.1f}",
            f"{one.surge_correlation_5s:.2f}",
            f"{1e3 * one.altitude_drift_mps:.2f}", f"{1e3 * one.altitude_rms_m:.0f}",
            " / ".join(f"{1e3 * step:.0f}" for step in one.altitude_step_rms_m),
        ]
        for one in sections
    ]  # fmt: skip
    head = [
        "Section", "positions: DVL late, s", "residual, m", "unshifted, m", "scale", "velocities: DVL late, s",
        "scale", "positions − ∫ own velocity, m RMS", "surge − DVL, mm/s", "its correlation over 5 s",
        "altitude − ∫ DVL: drift, mm/s", "RMS about it, mm", "change in 1 / 10 / 100 s, mm RMS",
    ]  # fmt: skip
    return table(head, rows)


def innovation_table(sections: Sequence[Innovations]) -> str:
    """The beams against our own INS, and its velocity against the reference, section by section."""
    rows = [
        [
            str(one.section), f"{1e3 * one.sd_mps:.1f}", " / ".join(f"{value:.2f}" for value in one.correlation),
            f"{one.nis_per_degree:.2f}", f"{1e3 * one.surge_error_mps:.1f}", f"{1e3 * one.surge_sd_mps:.1f}",
            f"{one.surge_error_mps / one.surge_sd_mps:.1f}",
        ]
        for one in sections
    ]  # fmt: skip
    head = [
        "Section", "innovation of a beam, mm/s", "its correlation over 1 / 5 / 10 s", "NIS per degree",
        "surge − reference, mm/s RMS", "claimed σ", "ratio",
    ]  # fmt: skip
    return table(head, rows)


def caves(data: Path, beams: int) -> str:
    """Beams left out of the caves' pings."""
    instrument = read_geometry("linkquest_caves")
    pings = read_beams(data / "caves_girona_linkquest" / "dvl_linkquest.csv", geometry=instrument)
    parts = []
    for gate, title in (
        (3.0, "Pings whose closure is within 3 robust sigma"),
        (None, "Every ping of four valid beams"),
    ):
        scores = leave_out(
            instrument.geometry, pings.time_ns, pings.velocity_mps, pings.valid, instrument.beam_sd_mps,
            beams=beams, closure_gate=gate, robust=False,
        )  # fmt: skip
        summary = over_sets(scores)
        rows = [_caves_row(summary, method) for method in summary["method"].unique(maintain_order=True)]
        head = ["Method"]
        for component in ("surge", "sway", "heave", "beam left out"):
            head += [f"{component}, mm/s", "error/σ"]
        parts.append(f"{title}: {int(scores['pings'][0])}.\n\n" + table(head, rows))
    return "\n".join(parts)


def _caves_row(summary: pl.DataFrame, method: str) -> list[str]:
    """Median / RMS error and error/σ of a method, for each component."""
    cells = [code(method)]
    for component in ("surge", "sway", "heave", "beam"):
        row = summary.filter((pl.col("method") == method) & (pl.col("component") == component)).row(
            0, named=True
        )
        if row["sets_solved"] == 0:
            cells += ["–", "–"]
            continue
        partly = "" if row["sets_solved"] == row["sets"] else f" [{row['sets_solved']}/{row['sets']}]"
        median, rms = 1e3 * row["error_median_mps"], 1e3 * row["error_rms_over_pings_mps"]
        cells += [f"{median:.0f} / {rms:.0f}{partly}", number(row["normalised_robust"], 2)]
    return cells
