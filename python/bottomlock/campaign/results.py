"""The results of a campaign, what a terminal and a notebook show of them, and their plots."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.campaign_tables import CampaignResults, read_campaign_tables, sample_files
from bottomlock.pages.page import Table
from bottomlock.pages.pieces import notebook_table
from bottomlock.statistics.campaign import summary_table
from bottomlock.statistics.compare import QUANTITIES, comparison_table
from bottomlock.text import did_you_mean, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class Results(CampaignResults):
    """The tables of a finished campaign, see `bottomlock.files.columns` for their columns.

    Attributes:
        manifest: what decided the numbers, as `manifest.json` has it.
        runs: a row per trajectory, run and method: errors over time and at the end, NEES, NIS, counts of fixes.
        ensemble: a row per trajectory, method and second: RMS over runs with intervals.
        consistency: mean NEES with its band.
        choices: what `elc` chose at each ping.
        paths: the true paths.
        folder: where all of it is; None for a campaign in memory.
        samples_in_memory: `samples`; None for a campaign in a folder.
    """

    folder: Path | None
    samples_in_memory: pl.DataFrame | None = None

    @property
    def samples(self) -> pl.LazyFrame:
        """A row per trajectory, run, method and second: error and its standard deviation (`files.columns.SAMPLES`).

        Of a campaign in a folder nothing is read before `collect`, and then what the query needs.
        """
        if self.folder is None:
            return (pl.DataFrame() if self.samples_in_memory is None else self.samples_in_memory).lazy()
        files = [
            path for name in self.trajectories for path, _ in sample_files(self.folder, self.manifest, name)
        ]
        return pl.scan_parquet(files, glob=False)

    @property
    def summary(self) -> pl.DataFrame:
        """A row per trajectory and method: RMS over runs at the end with intervals, NEES, NIS, rejected fixes."""
        return summary_table(self.ensemble, self.runs)

    def __repr__(self) -> str:
        """Trajectories, runs and methods in a line."""
        parts = [f"{self._runs_of(name)} runs of {name}" for name in self.trajectories]
        methods = self.ensemble["method"].unique(maintain_order=True).to_list()
        return f"<Results: {', '.join(parts)}; {', '.join(methods)}>"

    def _repr_html_(self) -> str:
        """Errors at the end and NEES with their intervals, a row for each method, a table for each trajectory."""
        return "".join(notebook_table(self._table(name)) for name in self.trajectories)

    def compare(self, other: Self, labels: tuple[str, str] = ("this", "other")) -> pl.DataFrame:
        """These results beside others, as `bottomlock report A B` has them; differences are these minus the others.

        Run k of both is a pair where the true motion and the seed are the same: what both share drops out of the
        difference. Where they are not, the intervals are those of independent runs, and `paired` is false.

        Args:
            other: results that the differences are taken to.
            labels: names of these and of the others in the table.

        Returns:
            `files.columns.COMPARISON`: a row per campaign, trajectory, method and quantity.

        Raises:
            DataError: for what is no results, without a common trajectory, and for labels that are the same.
        """
        if not isinstance(other, Results):
            raise DataError(
                f"compare is given a {type(other).__name__}",
                expected="Results, such as read_results(FOLDER) returns",
            )
        if labels[0] == labels[1]:
            raise DataError(f"labels are twice {labels[0]!r}", expected="two that differ")
        if not set(self.trajectories) & set(other.trajectories):
            raise DataError(
                f"the results have no trajectory in common: {', '.join(self.trajectories)} and "
                f"{', '.join(other.trajectories)}",
                hint="scenarios of one name are compared",
            )
        return comparison_table({labels[0]: self, labels[1]: other}, labels[1])

    def _table(self, trajectory: str) -> Table:
        """A row for each method: what it errs by at the end and over time with 95 % intervals, and its NEES."""
        here = comparison_table({"": self}, "").filter(pl.col("trajectory") == trajectory)
        columns = [name if unit == "1" else f"{name}, {unit}" for name, (_, unit, _) in QUANTITIES.items()]
        rows = []
        for (method,), part in here.group_by("method", maintain_order=True):
            of = {row["quantity"]: row for row in part.iter_rows(named=True)}
            rows.append([f"`{method}`", *(_with_interval(of.get(name)) for name in QUANTITIES)])
        caption = f"{trajectory}: RMS over {self._runs_of(trajectory)} runs, mean NEES, with 95 % intervals"
        return Table(["method", *columns], rows, caption)

    def plot_velocity_error(self, trajectory: str | None = None, *, axes: "Axes | None" = None) -> "Axes":
        """RMS over runs of the velocity error against time, 95 % intervals shaded.

        Args:
            trajectory: one of the campaign's; its only one by default.
            axes: matplotlib axes to draw on; those of a new figure by default.

        Returns:
            The axes.

        Raises:
            DataError: for a trajectory that the campaign does not have, or none of several.
        """
        return self._plot("velocity", trajectory, axes)

    def plot_attitude_error(self, trajectory: str | None = None, *, axes: "Axes | None" = None) -> "Axes":
        """RMS over runs of the misalignment against time; as `plot_velocity_error`."""
        return self._plot("attitude", trajectory, axes)

    def plot_nees(self, trajectory: str | None = None, *, axes: "Axes | None" = None) -> "Axes":
        """Mean NEES of the whole state against time with its band; as `plot_velocity_error`."""
        return self._plot("nees", trajectory, axes)

    def _plot(self, quantity: str, trajectory: str | None, axes: "Axes | None") -> "Axes":
        # Campaigns on a cluster draw nothing.
        from bottomlock.figures import campaign, drawing  # noqa: PLC0415
        from bottomlock.figures.series import Figure  # noqa: PLC0415

        name = self._known(trajectory)
        if quantity == "nees":
            panel = campaign.nees_of(self.ensemble, self.consistency, name)
        else:
            panel = campaign.errors_of(self.ensemble, name, quantity)
        figure = Figure("", [panel], size_in=campaign.HALF)
        return drawing.shown(figure, None if axes is None else [axes])[0]

    def _known(self, trajectory: str | None) -> str:
        known = self.trajectories
        if trajectory is None and len(known) == 1:
            return known[0]
        if trajectory not in known:
            hint = did_you_mean(str(trajectory), known)
            raise DataError(f"trajectory is {trajectory!r}{hint or ','} expected one of {', '.join(known)}")
        return trajectory

    def _runs_of(self, trajectory: str) -> int:
        return self.runs.filter(pl.col("trajectory") == trajectory)["run"].n_unique()


def read_results(folder: str | Path) -> Results:
    """The results of a campaign that `run_campaign` or `bottomlock run` has finished in a folder.

    Raises:
        DataError: for a folder without a finished campaign of this version, and for a table that is missing or has
            changed since it was written.
    """
    tables = read_campaign_tables(Path(folder))
    return Results(
        tables.manifest, tables.runs, tables.ensemble, tables.consistency, tables.choices, tables.paths,
        tables.folder,
    )  # fmt: skip


def _with_interval(row: Mapping[str, Any] | None) -> str:
    """A value and its interval; a dash where there is none."""
    if row is None:
        return number(None)
    return f"{number(row['value'])} ({number(row['lo'])} … {number(row['hi'])})"
