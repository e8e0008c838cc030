"""What a terminal and a notebook show of the results of a campaign, and its plots."""

from typing import TYPE_CHECKING, Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.pages.numbers import number
from bottomlock.statistics.campaign import summary_table
from bottomlock.support.nearest import did_you_mean
from bottomlock.support.notebook import html_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class ShownResults:
    """A line, a table and plots of the tables of a campaign."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    manifest: dict[str, Any]

    def __repr__(self) -> str:
        """Trajectories, runs and methods in a line."""
        parts = [f"{self._runs_of(name)} runs of {name}" for name in self.trajectories]
        methods = self.ensemble["method"].unique(maintain_order=True).to_list()
        return f"<Results: {', '.join(parts)}; {', '.join(methods)}>"

    def _repr_html_(self) -> str:
        """Errors at the end and NEES, a row for each method, a table for each trajectory."""
        head = ("method", "velocity, m/s", "95 %", "attitude, deg", "position, m", "NEES")
        tables = []
        for (name,), rows in summary_table(self.ensemble, self.runs).group_by(
            "trajectory", maintain_order=True
        ):
            words = [
                (
                    str(row["method"]),
                    number(row["velocity_rms_over_runs_mps"]),
                    f"{number(row['velocity_rms_over_runs_lo_mps'])} … {number(row['velocity_rms_over_runs_hi_mps'])}",
                    number(row["attitude_rms_over_runs_deg"]),
                    number(row["position_rms_over_runs_m"]),
                    number(row["nees_mean_over_runs_and_time"]),
                )
                for row in rows.iter_rows(named=True)
            ]
            title = f"{name}: RMS over {self._runs_of(str(name))} runs at the end, mean NEES"
            tables.append(html_table(title, words, head))
        return "".join(tables)

    @property
    def trajectories(self) -> list[str]:
        """Trajectories in the order of the campaign."""
        return self.ensemble["trajectory"].unique(maintain_order=True).to_list()

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
        """Mean NEES of the whole state against time with its 95 % band; as `plot_velocity_error`."""
        return self._plot("nees", trajectory, axes)

    def _plot(self, quantity: str, trajectory: str | None, axes: "Axes | None") -> "Axes":
        # Campaigns on a cluster draw nothing.
        from bottomlock.figures import curves  # noqa: PLC0415
        from bottomlock.figures.notebook import shown_axes  # noqa: PLC0415

        name = self._known(trajectory)
        axes = shown_axes(curves.PLACE) if axes is None else axes
        if quantity == "nees":
            curves.draw_nees(axes, self.ensemble, self.consistency, name)
        else:
            curves.draw_rms(axes, self.ensemble, name, quantity)
        return axes

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
