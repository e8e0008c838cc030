"""Methods on common axes: errors, NEES, sweeps, calibration and sets of beams as data, and the one drawing of them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from bottomlock.figures.labels import Line, coincident, draw_lines, label_ends
from bottomlock.figures.palette import FAINT, INK, STYLE, WIDTH_IN, draw_order, marks, new_figure, stroke
from bottomlock.figures.series import Floats
from bottomlock.tables.campaign import COMPONENTS

LOG_SPREAD = 12.0
"""Ratio of the largest to the smallest value above which the axis is logarithmic."""
SLANTED_FROM = 5
"""Letters of a name on the horizontal axis from which names are written at a slant."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Methods on common axes.

    Attributes:
        title: quantity and unit, above the axes.
        curves: x and y (n,) of each method; NaN where it has none.
        x_label: of the horizontal axis.
        names: of the x 0, 1, ...; () where they are numbers.
        intervals: low and high (n,) of some methods.
        points: method, x and y of values beside the curves, drawn hollow.
        marker: of these.
        band: low and high of a shaded range of y, and words on it above the axes; None for none.
        level: name and y of a line across; None for none.
        against_claim: x and y are one quantity, claimed and true: equal logarithmic axes, shaded above the diagonal.
        joined: values are joined by lines; otherwise those of one x stand side by side.
    """

    title: str
    curves: Mapping[str, tuple[Floats, Floats]]
    x_label: str = ""
    names: Sequence[str] = ()
    intervals: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)
    points: Sequence[tuple[str, float, float]] = ()
    marker: str = "D"
    band: tuple[float, float, str] | None = None
    level: tuple[str, float] | None = None
    against_claim: bool = False
    joined: bool = True


_AXIS = {"velocity": ("mps", "velocity error, m/s RMS"), "attitude": ("deg", "misalignment, degrees RMS")}


def errors_of(
    ensemble: pl.DataFrame,
    trajectory: str,
    quantity: str,
    printed: Iterable[tuple[str, float, float]] = (),
    *,
    methods: Sequence[str] | None = None,
    banded: Sequence[str] | None = None,
    titled: bool = False,
) -> Comparison:
    """RMS over runs of methods against time, with 95 % bootstrap intervals.

    Args:
        ensemble: `tables.campaign.ENSEMBLE`.
        trajectory: one of its trajectories.
        quantity: "velocity" or "attitude".
        printed: method, time in s and value of what a paper prints.
        methods: which to draw; all by default.
        banded: methods whose interval is shaded; all that are drawn by default.
        titled: whether the title names the trajectory, for a figure that stands beside those of others.
    """
    unit, title = _AXIS[quantity]
    rows = _rows(ensemble, trajectory, methods)
    middle, low, high = (
        _by_method(rows, f"{quantity}_rms_over_runs{end}_{unit}") for end in ("", "_lo", "_hi")
    )
    return Comparison(
        titled * f"{trajectory.replace('_', ' ')}: " + title,
        middle,
        "time, s",
        intervals={m: (low[m][1], high[m][1]) for m in middle if banded is None or m in banded},
        points=[one for one in printed if one[0] in middle],
    )


def nees_of(
    ensemble: pl.DataFrame,
    consistency: pl.DataFrame,
    trajectory: str,
    *,
    methods: Sequence[str] | None = None,
) -> Comparison:
    """Mean NEES of the whole state against time, with the chi-squared band that the verdict holds it against."""
    rows = _rows(ensemble, trajectory, methods).drop_nulls("nees_mean_over_runs")
    known = consistency.filter((pl.col("trajectory") == trajectory) & (pl.col("quantity") == "nees"))
    band = known.row(0, named=True)
    words = f"grey: consistent filter ({band['degrees']} states, {band['runs']} runs)"
    return Comparison(
        "mean NEES of the whole state",
        _by_method(rows, "nees_mean_over_runs"),
        "time, s",
        band=(band["band_lo"], band["band_hi"], words),
    )


def sweep_of(rows: pl.DataFrame, level: tuple[str, float] | None = None) -> Comparison:
    """Velocity error at the end, RMS over runs, against the values of one setting on one trajectory.

    Args:
        rows: of `tables.studies.SWEEP`, of one parameter and one trajectory. The values stand at equal distances.
        level: a name and an error in m/s to compare with, drawn across.
    """
    values = rows["value"].unique(maintain_order=True)
    curves = {
        str(method): (
            np.arange(len(values), dtype=np.float64),
            _aligned(values, part)["velocity_rms_over_runs_mps"].fill_null(np.nan).to_numpy(),
        )
        for (method,), part in rows.group_by("method", maintain_order=True)
    }
    title = str(rows["trajectory"][0]).replace("_", " ") + ": velocity error, m/s"
    return Comparison(title, curves, names=values.to_list(), level=level)


def _aligned(places: pl.Series, rows: pl.DataFrame) -> pl.DataFrame:
    """The row of each place, in their order; nulls where there is none."""
    return pl.DataFrame([places]).join(rows, on=places.name, how="left", maintain_order="left")


def places_of(rows: pl.DataFrame, methods: Sequence[str], title: str) -> Comparison:
    """Velocity errors at the end with 95 % intervals in the cells of a study, the methods side by side.

    Args:
        rows: of `tables.studies.STUDY` on one trajectory, with the name of each cell as `place`.
        methods: which to draw.
        title: quantity and unit.
    """
    places = rows["place"].unique(maintain_order=True)
    at = np.arange(len(places), dtype=np.float64)
    curves, intervals = {}, {}
    for method in methods:
        part = _aligned(places, rows.filter(pl.col("method") == method))
        middle, low, high = (
            part[f"velocity_rms_over_runs{end}_mps"].fill_null(np.nan).to_numpy()
            for end in ("", "_lo", "_hi")
        )
        curves[method], intervals[method] = (at, middle), (low, high)
    return Comparison(title, curves, names=places.to_list(), intervals=intervals, joined=False)


def calibration_of(curves: Mapping[str, tuple[Floats, Floats]]) -> Comparison:
    """Velocity error against its claimed standard deviation over time; consistent methods lie on the diagonal.

    Args:
        curves: for each method the claimed standard deviation and the error, RMS over runs, m/s, (times,) each.
    """
    return Comparison(
        "velocity error, m/s RMS (shaded: overconfident)", curves, "claimed σ of velocity, m/s RMS",
        points=[(method, float(x[-1]), float(y[-1])) for method, (x, y) in curves.items()], marker="o",
        against_claim=True,
    )  # fmt: skip


def normalised_of(normalised_rms: Mapping[str, Floats]) -> Comparison:
    """RMS over runs and times of error/σ of each component; a consistent filter has 1.

    Args:
        normalised_rms: (9,) for each method, in the order of `tables.campaign.COMPONENTS`.
    """
    at = np.arange(len(COMPONENTS), dtype=np.float64)
    return Comparison(
        "error/σ, RMS (line: a consistent filter)",
        {method: (at, values) for method, values in normalised_rms.items()},
        names=[name.replace("_", " ") for name in COMPONENTS],
        level=("", 1.0),
        joined=False,
    )


def _rows(ensemble: pl.DataFrame, trajectory: str, methods: Sequence[str] | None) -> pl.DataFrame:
    rows = ensemble.filter(pl.col("trajectory") == trajectory)
    return rows if methods is None else rows.filter(pl.col("method").is_in(list(methods)))


def _by_method(rows: pl.DataFrame, column: str) -> dict[str, tuple[Floats, Floats]]:
    """Times and values of each method."""
    return {
        str(method): (part["time_s"].to_numpy(), part[column].to_numpy())
        for (method,), part in rows.sort("time_s", maintain_order=True).group_by(
            "method", maintain_order=True
        )
    }


WIDE, HALF, THIRD, LOW = (6.6, 3.9), (WIDTH_IN, 4.1), (4.2, 3.5), (4.2, 2.6)
"""Width and height of a figure by the place that it has on a page, inches."""


def place_of(size_in: tuple[float, float]) -> tuple[float, float, float, float]:
    """The axes of a comparison in a figure of a size, as parts of it: the names stand to the right of them."""
    width, height = size_in
    return 0.6 / width, 0.52 / height, 1.0 - 1.75 / width, 1.0 - 0.9 / height


def comparison_figure(shown: Comparison, size_in: tuple[float, float] = HALF) -> Figure:
    """A comparison in a figure of its own, width and height in inches."""
    with mpl.rc_context(STYLE):
        figure = new_figure(size_in[1], size_in[0])
        left, bottom, width, height = place_of(size_in)
        slant = 0.34 / size_in[1] * any(len(name) >= SLANTED_FROM for name in shown.names)
        draw(figure.add_axes((left, bottom + slant, width, height - slant)), shown)
    return figure


def draw(axes: Axes, shown: Comparison) -> None:
    """Draws a comparison on axes whose place is final."""
    with mpl.rc_context(STYLE):
        curves = {method: shown.curves[method] for method in draw_order(list(shown.curves))}
        groups = coincident(
            {method: np.concatenate(one) for method, one in curves.items()}, 2e-3 if shown.names else 1e-4
        )
        axes.set_title(shown.title, loc="left", pad=6.0 if shown.band is None else 16.0)
        axes.set_xlabel(shown.x_label)
        _scale(axes, shown)
        _background(axes, shown)
        if shown.joined:
            lines = [Line(group, *curves[group[0]]) for group in groups]
            _shade(axes, shown, lines)
            draw_lines(axes, lines)
        else:
            lines = _side_by_side(axes, shown, groups)
        for line in lines if shown.names and shown.joined else ():
            _mark(axes, line.methods[0], line.x, line.y)
        for method, x, y in shown.points:
            axes.plot(
                x, y, marker=shown.marker, markersize=7.0, markerfacecolor="none", markeredgewidth=1.5,
                color=stroke(method).colour, clip_on=False, zorder=4,
            )  # fmt: skip
        label_ends(axes, lines)


def _mark(axes: Axes, method: str, x: Floats, y: Floats) -> None:
    """A mark of the method on every value."""
    axes.plot(x, y, **(marks(method, len(x)) | {"linestyle": "", "markevery": None}))


def _scale(axes: Axes, shown: Comparison) -> None:
    every = np.concatenate([y for _, y in shown.curves.values()])
    if shown.against_claim:
        every = np.concatenate([*(x for x, _ in shown.curves.values()), every])
        every = every[np.isfinite(every) & (every > 0.0)]
        low, high = float(every.min()) / 1.3, float(every.max()) * 1.3
        axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high))
        for axis in (axes.xaxis, axes.yaxis):
            log_ticks(axis, 12)
        return
    if shown.names:
        margin = 0.15 if shown.joined else 0.4
        axes.set_xlim(-margin, len(shown.names) - 1 + margin)
        slanted = max(map(len, shown.names)) >= SLANTED_FROM
        axes.set_xticks(
            range(len(shown.names)), shown.names, rotation=30 if slanted else 0,
            ha="right" if slanted else "center",
        )  # fmt: skip
    else:
        axes.set_xlim(0.0, max(float(x[-1]) for x, _ in shown.curves.values()))
    more = [*(y for _, _, y in shown.points), *(shown.band or ())[:2], *(shown.level or ())[1:]]
    scale_errors(
        axes, np.concatenate([every, *(end for ends in shown.intervals.values() for end in ends), more])
    )


def _background(axes: Axes, shown: Comparison) -> None:
    """The diagonal, the band, the level, and borders between what stands side by side."""
    if shown.against_claim:
        low, high = axes.get_xlim()
        axes.plot([low, high], [low, high], color=INK, linewidth=1.0, zorder=1)
        axes.fill_between([low, high], [low, high], [high, high], color=FAINT, alpha=0.14, linewidth=0.0)
    if shown.band is not None:
        low, high, words = shown.band
        axes.axhspan(low, high, color=FAINT, alpha=0.35, linewidth=0.0)
        axes.text(0.0, 1.02, words, transform=axes.transAxes, fontsize=8.5, color=INK, va="bottom")
    if shown.level is not None:
        name, level = shown.level
        axes.axhline(level, color=FAINT, linewidth=1.4, linestyle=(0, (2, 2)), zorder=1)
        axes.annotate(
            name, (0.0, level), xytext=(4, 4), textcoords="offset points", fontsize=9.0, va="bottom"
        )
    if not shown.joined:
        axes.grid(visible=False, axis="x")
        for border in np.arange(1, len(shown.names)) - 0.5:
            axes.axvline(border, color=FAINT, alpha=0.25, linewidth=0.6)


def _shade(axes: Axes, shown: Comparison, lines: Sequence[Line]) -> None:
    # Overlapping bands must stay transparent.
    alpha = 0.14 if axes.get_yscale() == "log" or len(shown.intervals) < 3 else 0.06
    for line in lines:
        for method in [one for one in line.methods if one in shown.intervals][:1]:
            low, high = shown.intervals[method]
            axes.fill_between(line.x, low, high, color=stroke(method).colour, alpha=alpha, linewidth=0.0)


def _side_by_side(axes: Axes, shown: Comparison, groups: Sequence[tuple[str, ...]]) -> list[Line]:
    """A mark and a bar for each value; lines whose last points are where labels begin."""
    methods = [method for group in groups for method in group]
    beside = {method: 0.7 * ((k + 0.5) / len(methods) - 0.5) for k, method in enumerate(methods)}
    for method in methods:
        x, y = shown.curves[method]
        _mark(axes, method, x + beside[method], y)
        if method in shown.intervals:
            axes.vlines(
                x + beside[method], *shown.intervals[method], color=stroke(method).colour, linewidth=1.4
            )
    return [
        Line(group, shown.curves[group[0]][0] + beside[group[-1]], shown.curves[group[0]][1])
        for group in groups
    ]


def scale_errors(axes: Axes, values: Floats) -> None:
    """Limits with a margin around values (n,); a logarithmic axis where the spread exceeds `LOG_SPREAD`."""
    finite = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.5, 1.0)
    if high > LOG_SPREAD * low:
        axes.set_yscale("log")
        axes.set_ylim(low / 1.25, high * 1.25)
        log_ticks(axes.yaxis, 12)
        axes.grid(visible=True, which="minor", axis="y", alpha=0.10)
    else:
        air = 0.05 * (high - low) or 0.05 * high
        axes.set_ylim(max(0.0, low - air), high + air)


def log_ticks(axis: Axis, most: int, subs: Sequence[float] = (1.0,)) -> None:
    """Ticks of a logarithmic axis: at most so many with numbers, at these multiples of powers of ten."""
    axis.set_major_locator(LogLocator(numticks=most, subs=subs))
    axis.set_major_formatter(FuncFormatter(plain_number))
    axis.set_minor_formatter(NullFormatter())


def plain_number(value: float, _: int) -> str:
    """Tick label of a power of ten: 0.01, 100, 10⁵.

    >>> [plain_number(10.0**k, 0) for k in (-2, 0, 3, 6)]
    ['0.01', '1', '1000', '$10^{6}$']
    """
    return f"{value:g}" if 1e-3 <= value <= 1e4 else f"$10^{{{round(np.log10(value))}}}$"
