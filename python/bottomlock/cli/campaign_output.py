"""What campaigns show in a terminal: a progress bar, then tables of RMS errors."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import polars as pl
from rich import box
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from bottomlock.campaign.run import CampaignProgress, Results
from bottomlock.cli.console import console, errors
from bottomlock.pages.numbers import plain
from bottomlock.statistics.campaign import summary_table


class _Rate(ProgressColumn):
    """Runs per second."""

    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:.1f} runs/s" if task.speed else "- runs/s")


def _fixed(value: float | None, decimals: int) -> str:
    """With so many decimals at any size."""
    return plain(value, digits=9, decimals=decimals)


def summary(results: Results) -> list[Table]:
    """A table per trajectory, narrow enough for 80 columns."""
    table_of_all = summary_table(results.ensemble, results.runs)
    tables = []
    for (trajectory,), rows in table_of_all.group_by("trajectory", maintain_order=True):
        table = Table(
            title=f"{trajectory}: RMS over runs at the end",
            title_justify="left",
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
        )
        table.add_column("method", no_wrap=True)
        settings = results.manifest["scenarios"][trajectory]["configuration"]["trajectory"]
        astray = settings["feedback"] == "estimate"
        names = ["v m/s", "95 %", "att deg", "pos m", "NEES", "astray m" if astray else "NIS", "rej %"]
        for name in names:
            table.add_column(name, justify="right", no_wrap=True)
        last = ("cross_track_rms_over_runs_and_time_m", 1) if astray else ("nis_mean_over_runs_and_fixes", 2)
        for row in rows.with_columns(rejected_percent=100.0 * pl.col("rejected_fraction")).iter_rows(
            named=True
        ):
            low, high = (_fixed(row[f"velocity_rms_over_runs_{end}_mps"], 3) for end in ("lo", "hi"))
            table.add_row(
                row["method"],
                _fixed(row["velocity_rms_over_runs_mps"], 3),
                f"{low} .. {high}",
                _fixed(row["attitude_rms_over_runs_deg"], 3),
                _fixed(row["position_rms_over_runs_m"], 1),
                _fixed(row["nees_mean_over_runs_and_time"], 1),
                _fixed(row[last[0]], last[1]),
                _fixed(row["rejected_percent"], 2),
            )
        tables.append(table)
    return tables


def print_results(results: Results, out: Path) -> None:
    """The tables, and what they were made with."""
    for table in summary(results):
        console.print(table)
    manifest = results.manifest
    scenarios = manifest["scenarios"]
    if any(one["configuration"]["trajectory"]["feedback"] == "estimate" for one in scenarios.values()):
        console.print(
            "The vehicle flew on its estimate; astray is its true cross-track error, rms over way and runs."
        )
    first = manifest["order"][0]
    options = scenarios[first]["options"]
    console.print(
        f"NEES of an honest filter is {manifest['nees_degrees'][first]}, NIS the number of fused rows. "
        f"n_f {options['virtual_beam_factor']:g}, ε {options['nullified_sway_var_m2ps2']:g} m²/s², "
        f"gate {options['gate']}."
    )
    console.print(f"{manifest['wall_time_s']:.1f} s; tables in {out}")


@contextmanager
def progress_bar(total: float | None = None) -> Iterator[Callable[[CampaignProgress], None]]:
    """A bar over runs with rate and time left, for any number of campaigns; shown from the first report on.

    Args:
        total: runs of all campaigns; those of the one campaign by default.
    """
    columns = (
        TextColumn("{task.description:>12}"),
        BarColumn(),
        MofNCompleteColumn(),
        _Rate(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=errors, transient=False)
    task = bar.add_task("running", total=total)
    done: dict[str, float] = {}

    def report(state: CampaignProgress) -> None:
        bar.start()
        done[state.trajectory] = state.runs_done
        if state.found:
            # Runs of an earlier start say nothing of the rate: the clock starts now.
            bar.reset(task, completed=int(sum(done.values())))
        bar.update(
            task,
            total=state.campaign_runs if total is None else total,
            completed=sum(done.values()),
            description=state.trajectory,
        )

    try:
        yield report
    finally:
        if bar.live.is_started:
            bar.stop()
