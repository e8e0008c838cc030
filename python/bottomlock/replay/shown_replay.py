"""A finished replay in Python: what a terminal and a notebook show of it, its tables, and its plots."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl

from bottomlock.errors import DataError
from bottomlock.figures.drawing import shown
from bottomlock.figures.series import Figure, Panel
from bottomlock.files.replay_tables import FORWARD, SMOOTHED
from bottomlock.pages.page import Table
from bottomlock.pages.pieces import notebook_table, title_of
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.dive_plots import map_of, taken
from bottomlock.replay.page import featured_in, results_table
from bottomlock.replay.panels import STATES, beams_panel, nis_panel, state_panels
from bottomlock.replay.report import least_ratio_of, read_replay, run_and_report
from bottomlock.statistics.replay import summary_table
from bottomlock.text import did_you_mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Replay:
    """A finished replay: its tables as Polars data frames, and the figures of its page, one call each.

    A plot takes the name of a what-if case (the recording as it is by default) and of a method (the one whose track
    is to be taken by default); `methods` are those of the page by default. Plots draw on new axes, or on those given
    as `axes`.

    Attributes:
        folder, tables: of the replay.
        manifest: the content of `manifest.json`.
        runs: a row per what-if case, method and pass (`files.replay_tables.REPLAY_RUNS`).
        samples: estimates, errors and claimed σ against time (`files.replay_tables.REPLAY_SAMPLES`).
        innovations: a row per what-if case, method and ping (`files.replay_tables.innovations_schema`).
        pings: the beams as the filters received them (`files.replay_tables.pings_schema`).
        reference: positions of the reference (`files.replay_tables.PATH`); None without them.
        calibration: estimated parameters of the DVL (`files.replay_tables.CALIBRATION`); None where they are no states.
        currents: the estimated current (`files.replay_tables.CURRENTS`); None where it is no state.
    """

    def __init__(self, folder: str | Path) -> None:
        """Reads a replay.

        Args:
            folder: directory that `run_replay` or `bottomlock replay` has written.

        Raises:
            DataError: for a directory without a finished replay, or a table that is missing or has changed since it
                was written.
        """
        self.folder = Path(folder)
        self.tables = tables = read_replay(folder)
        self.manifest, self.runs, self.samples = tables.manifest, tables.runs, tables.samples
        self.innovations, self.pings, self.reference = tables.innovations, tables.pings, tables.path
        self.calibration, self.currents = tables.calibration, tables.currents

    @property
    def verdict(self) -> str:
        """Whether the replay can be trusted: "yes", "partly" or "no"."""
        return str(self.manifest["answer"]["verdict"])

    @property
    def method(self) -> str:
        """The method whose track is to be taken, or the first that stands for all."""
        return taken(self.manifest)

    @property
    def methods(self) -> list[str]:
        """Every method, dead reckoning too."""
        return list(self.manifest["methods"])

    @property
    def what_ifs(self) -> list[str]:
        """The what-if cases; the first is the recording as it is."""
        return [name for name, _ in self.manifest["what_if"]]

    def __repr__(self) -> str:
        """Case, verdict, methods and what-if cases in a line."""
        cases = "" if len(self.what_ifs) == 1 else f"; {', '.join(self.what_ifs)}"
        return (
            f"<Replay of {self.manifest['case']}: trusted {self.verdict}; {', '.join(self.methods)}{cases}>"
        )

    def _repr_html_(self) -> str:
        """The answer, and for each what-if case the errors at the end, a row for each method and pass."""
        answer = self.manifest["answer"]
        head = Table(
            ["Can I trust this?", self.verdict.capitalize()],
            [["", answer["sentence"]]],
            self.manifest["case"],
        )
        return notebook_table(head) + "".join(notebook_table(self._table(name)) for name in self.what_ifs)

    def plot_map(
        self,
        what_if: str | None = None,
        *,
        methods: Sequence[str] | None = None,
        axes: "Axes | None" = None,
    ) -> "Axes":
        """The way over ground, 2σ ellipses, beams lost and the reference.

        Args:
            what_if: a what-if case.
            methods: which to draw; the track to take and dead reckoning are drawn too.
            axes: matplotlib axes to draw on; those of a new figure by default.

        Returns:
            The axes.

        Raises:
            DataError: for a what-if case or method that the replay does not have.
        """
        case = self._case(what_if)
        charted = map_of(self.tables, case, self._drawn(case, methods))
        (axes,) = shown(charted, None if axes is None else [axes])
        # Whoever moves or enlarges the axes keeps one scale.
        axes.set_aspect("equal", adjustable="datalim")
        return axes

    def plot_state(
        self,
        quantity: str,
        method: str | None = None,
        what_if: str | None = None,
        *,
        which: str = FORWARD,
        axes: "Sequence[Axes] | None" = None,
    ) -> "list[Axes]":
        """A quantity with ±σ against time, over dead reckoning, on axes of its own for each part.

        Args:
            quantity: "velocity" (surge, sway and heave), "position_sd" (horizontal, and the error where it is known),
                "depth" (below the origin) or "attitude" (roll and pitch, then heading).
            method: one of the replay's.
            what_if: a what-if case.
            which: pass, "forward" or "smoothed".
            axes: as many matplotlib axes to draw on; those of a new figure by default.

        Returns:
            The axes.

        Raises:
            DataError: for a quantity, what-if case, method or pass that the replay does not have, and another number
                of axes.
        """
        _known("quantity", quantity, STATES)
        return self._panels(state_panels(*self._states(method, what_if, which))[quantity], axes)

    def plot_nis(
        self,
        what_if: str | None = None,
        *,
        methods: Sequence[str] | None = None,
        axes: "Axes | None" = None,
    ) -> "Axes":
        """NIS over its degrees of freedom, sliding mean, with the 95 % band of a consistent filter; as `plot_map`."""
        case = self._case(what_if)
        rows = self.tables.of(case).innovations
        return self._panel(nis_panel(rows, self._drawn(case, methods), least_ratio_of(self.manifest)), axes)

    def plot_beams(self, what_if: str | None = None, *, axes: "Axes | None" = None) -> "Axes":
        """Which beams were valid against time in a what-if case; as `plot_map`."""
        case = self._case(what_if)
        return self._panel(beams_panel(self.tables.of(case).pings, case), axes)

    @cached_property
    def _start_ns(self) -> int:
        return int(self.samples["time_ns"].min())  # type: ignore[arg-type]

    def _table(self, what_if: str) -> Table:
        table = results_table(self.runs, self.samples, what_if)
        return Table(table.columns, table.rows, f"{title_of(what_if)}. {table.caption}", table.left)

    def _case(self, what_if: str | None) -> str:
        return self.what_ifs[0] if what_if is None else _known("what_if", what_if, self.what_ifs)

    def _drawn(self, what_if: str, methods: Sequence[str] | None) -> list[str]:
        """The methods that are drawn; by default those of the page."""
        if methods is None:
            return featured_in(self.manifest, summary_table(self.runs), what_if)
        if isinstance(methods, str):
            raise DataError(f"methods is {methods!r}", expected=f"a list of names, such as [{methods!r}]")
        return [_known("methods", one, self.methods) for one in methods]

    def _states(self, method: str | None, what_if: str | None, which: str) -> tuple[pl.DataFrame, str, str]:
        """The samples of a what-if case, the method, and the pass."""
        method = self.method if method is None else _known("method", method, self.methods)
        samples = self.tables.of(self._case(what_if)).samples
        there = samples.filter(pl.col("method") == method)["pass"].unique()
        _known("which", which, [one for one in (FORWARD, SMOOTHED) if one in there])
        return samples, method, which

    def _panel(self, panel: Panel, axes: "Axes | None") -> "Axes":
        return self._panels([panel], None if axes is None else [axes])[0]

    def _panels(self, panels: Sequence[Panel], axes: "Sequence[Axes] | None") -> "list[Axes]":
        if axes is not None and len(axes) != len(panels):
            raise DataError(f"axes are {len(axes)}", expected=f"{len(panels)}, one for each panel")
        return shown(Figure("", panels, self._start_ns), axes)


def run_replay(case: str | Path | Case, out: str | Path, *, threads: int = 0, force: bool = False) -> Replay:
    """Navigates a recorded dive again, as `bottomlock replay`, and writes tables, page and figures to `out`.

    Args:
        case: the file of a case (TOML), or a case.
        out: directory: new, empty, or of the same case.
        threads: number of threads, 0 for one per core; the results do not depend on it.
        force: start over in a directory of another case.

    Raises:
        ScenarioError: for a case that is not one, naming the key.
        DataError, KernelError: for a recording that cannot be navigated, naming file, row or time.
        OutputError: for a directory that holds something else, or cannot be written.
    """
    loaded = case if isinstance(case, Case) else load_case(case)
    inputs = [] if isinstance(case, Case) else [Path(case)]
    run_and_report(loaded, out, inputs=inputs, threads=threads, force=force)
    return Replay(out)


def _known(name: str, value: str, known: Sequence[str]) -> str:
    """A value that is among the known ones.

    Raises:
        DataError: where it is not, with the nearest.
    """
    if value not in known:
        hint = did_you_mean(str(value), known)
        raise DataError(f"{name} is {value!r}{hint or ','} expected one of {', '.join(known)}")
    return value
