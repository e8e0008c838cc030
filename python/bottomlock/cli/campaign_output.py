"""Terminal output of campaigns: a progress bar, tables of RMS errors, campaigns side by side."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl
from rich.progress import MofNCompleteColumn, ProgressColumn, Task
from rich.table import Table
from rich.text import Text

from bottomlock import own_method
from bottomlock.campaign.run import CampaignProgress, Results
from bottomlock.cli.console import console, late_bar, narrow_table, print_json, say
from bottomlock.report.compare import Comparison
from bottomlock.text import plain


class _Rate(ProgressColumn):
    """Runs per second."""

    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:.1f} runs/s" if task.speed else "- runs/s")


def error_rows(
    rows: pl.DataFrame, columns: Sequence[tuple[str, str, int]]
) -> tuple[list[str], list[list[str]]]:
    """Heads and cells: method, velocity error with its interval, then columns by head, name and decimals."""
    velocity = "velocity_rms_over_runs{}_mps"
    cells = [
        [
            row["method"],
            plain(row[velocity.format("")], digits=4),
            " .. ".join(plain(row[velocity.format(end)], digits=4) for end in ("_lo", "_hi")),
            *(plain(row[name], digits=4, decimals=decimals) for _, name, decimals in columns),
        ]
        for row in rows.iter_rows(named=True)
    ]
    return ["method", "v m/s", "95 %", *(head for head, _, _ in columns)], cells


ATTITUDE = ("att deg", "attitude_rms_over_runs_deg", 3)
POSITION = ("pos m", "position_rms_over_runs_m", 1)


def result_tables(results: Results) -> Iterator[Table]:
    """A table per trajectory, narrow enough for 80 columns."""
    summary = results.summary.with_columns((100.0 * pl.col("rejected_fraction")).alias("rejected_percent"))
    for (trajectory,), rows in summary.group_by("trajectory", maintain_order=True):
        settings = results.manifest["scenarios"][trajectory]["configuration"]["trajectory"]
        last = ("NIS", "nis_mean_over_runs_and_fixes", 2)
        if settings.get("feedback") == "estimate":
            last = ("xtrack m", "cross_track_rms_over_runs_and_time_m", 1)
        columns = [
            ATTITUDE, POSITION, ("NEES", "nees_mean_over_runs_and_time", 1), last,
            ("rej %", "rejected_percent", 2),
        ]  # fmt: skip
        yield narrow_table(f"{trajectory}: RMS over runs at the end", *error_rows(rows, columns))


def print_results(results: Results, out: Path, *, as_json: bool = False) -> None:
    """Prints the tables, and the settings that they belong to; or a row per trajectory and method as JSON."""
    if as_json:
        rows = results.summary.fill_nan(None).to_dicts()
        print_json({"out": str(out), "results": rows})
        return
    for table in result_tables(results):
        console.print(table)
    manifest = results.manifest
    scenarios = manifest["scenarios"]
    if any(
        scenario["configuration"]["trajectory"].get("feedback") == "estimate"
        for scenario in scenarios.values()
    ):
        console.print(
            "Guidance used the estimate; xtrack is the true cross-track error, RMS over time and runs."
        )
    first = results.trajectories[0]
    options = scenarios[first]["options"]
    assumed = options["assumptions"]
    console.print(
        f"NEES of a consistent filter is {manifest['nees_degrees'][first]}, NIS the number of fused rows. "
        f"n_f {assumed['virtual_beam_factor']:g}, ε {assumed['nullified_sway_var_m2ps2']:g} m²/s², "
        f"gate {options['gate']}."
    )
    _print_costs(results)
    say(f"{manifest['wall_time_s']:.1f} s; tables in {out}")


def _print_costs(results: Results) -> None:
    """Prints what the results' methods of one's own cost in this process."""
    methods = set(results.summary["method"])
    for name, cost in own_method.costs().items():
        if name in methods:
            each_us = 1e6 * cost.seconds / cost.pings
            console.print(f"{name}: {cost.pings} pings in Python, {each_us:.0f} µs of a core each")


@contextmanager
def progress_bar(
    out: Path, total: float | None = None, *, kept: str = "chunks"
) -> Iterator[Callable[[CampaignProgress], None]]:
    """A bar over runs with rate and time left, for any number of campaigns; shown from the first report on.

    Ctrl-C ends the command, and says how to resume.

    Args:
        out: directory of the campaigns.
        total: runs of all campaigns; those of the one campaign by default.
        kept: what is there after Ctrl-C.
    """
    done: dict[str, float] = {}
    resumes = f"finished {kept} are kept in {out}: the same command resumes"
    with late_bar("running", MofNCompleteColumn(), _Rate(), interrupted=resumes) as update:

        def report(state: CampaignProgress) -> None:
            done[state.trajectory] = state.runs_done
            update(
                # Runs of an earlier start say nothing of the rate: the clock starts now.
                restart=bool(state.resumed),
                total=state.campaign_runs if total is None else total,
                completed=int(sum(done.values())),
                description=state.trajectory,
            )

        yield report


SHOWN = (("velocity at the end", ", m/s RMS", 3), ("position at the end", ", m RMS", 1), ("NEES", "", 1))
"""Quantities on the screen, with their units and decimals; the page and the table have the others."""

COLUMNS = 7
"""Campaigns beside one another in 80 columns."""


def print_comparison(comparison: Comparison) -> None:
    """Prints the errors at the end, a column for each campaign, and where the page is."""
    labels = comparison.table["campaign"].unique(maintain_order=True).to_list()
    for number, label in enumerate(labels, start=1):
        remark = " (differences are to this one)" if label == comparison.reference else ""
        say(f"{number:>3}  {label}{remark}")
    for (trajectory,), rows in comparison.table.group_by("trajectory", maintain_order=True):
        for quantity, unit, decimals in SHOWN:
            part = rows.filter(rows["quantity"] == quantity)
            for first in range(0, len(labels), COLUMNS):
                here = range(first, min(first + COLUMNS, len(labels)))
                console.print(_table(part, labels, here, f"{trajectory}: {quantity}{unit}", decimals))
    console.print("* differs from the reference: the 95 % interval of the difference excludes zero")
    for trajectory, whys in comparison.unpaired.items():
        for label, why in whys.items():
            say(f"not paired with {comparison.reference}: {label} on {trajectory} ({why})")
    if comparison.page is not None:
        say(f"wrote {comparison.page} and compare.parquet")


def _table(rows: pl.DataFrame, labels: list[str], columns: range, title: str, decimals: int) -> Table:
    """A row for each method, a column for each of some campaigns, by their numbers."""
    cells = {(row["method"], row["campaign"]): row for row in rows.iter_rows(named=True)}
    shown = [
        [method, *(_cell(cells.get((method, labels[k])), decimals) for k in columns)]
        for method in rows["method"].unique(maintain_order=True)
    ]
    return narrow_table(title, ["method", *(str(k + 1) for k in columns)], shown)


def _cell(row: dict[str, Any] | None, decimals: int) -> str:
    """A value, with an asterisk where its difference to the reference is beyond chance."""
    if row is None:
        return "-"
    differs = row["difference"] is not None and not row["difference_lo"] <= 0.0 <= row["difference_hi"]
    return f"{plain(row['value'], digits=4, decimals=decimals)}{'*' if differs else ' '}"
