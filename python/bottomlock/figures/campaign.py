"""A campaign's tables as panels: methods by time, by the values of a setting, by beams, against their claims."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
import polars as pl

from bottomlock.figures.palette import FAINT, WIDTH_IN, stroke
from bottomlock.figures.series import Curve, Figure, Floats, Panel, spreads
from bottomlock.files.columns import COMPONENTS

WIDE, HALF, THIRD, LOW = (6.6, 3.9), (WIDTH_IN, 4.1), (4.2, 3.5), (4.2, 2.6)
"""Width and height of a figure by the place that it has on a page, inches."""
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
) -> Panel:
    """RMS over runs of methods against time, with 95 % bootstrap intervals.

    Args:
        ensemble: `files.columns.ENSEMBLE`.
        trajectory: one of its trajectories.
        quantity: "velocity" or "attitude".
        printed: method, time in s and value of what a paper prints.
        methods: which to draw; all by default.
        banded: methods whose interval is shaded; all that are drawn by default.
        titled: whether the title names the trajectory, for a figure that stands beside those of others.
    """
    unit, title = _AXIS[quantity]
    column, curves = f"{quantity}_rms_over_runs", []
    for method, rows in _by_method(ensemble, trajectory, methods):
        ends = (rows[f"{column}_lo_{unit}"].to_numpy(), rows[f"{column}_hi_{unit}"].to_numpy())
        interval = ends if banded is None or method in banded else None
        curves.append(_curve(method, _time_ns(rows), rows[f"{column}_{unit}"], interval))
    drawn = {curve.label for curve in curves}
    rings = [
        Curve("", stroke(method).colour, np.array([round(1e9 * time_s)]), np.array([value]), kind="rings")
        for method, time_s, value in printed
        if method in drawn
    ]
    return _panel(titled * f"{trajectory.replace('_', ' ')}: " + title, [*curves, *rings])


def nees_of(
    ensemble: pl.DataFrame,
    consistency: pl.DataFrame,
    trajectory: str,
    *,
    methods: Sequence[str] | None = None,
) -> Panel:
    """Mean NEES of the whole state against time, with the chi-squared band that the verdict holds it against."""
    known = consistency.filter((pl.col("trajectory") == trajectory) & (pl.col("quantity") == "nees"))
    row = known.row(0, named=True)
    curves = [
        _curve(method, _time_ns(rows), rows["nees_mean_over_runs"])
        for method, rows in _by_method(ensemble.drop_nulls("nees_mean_over_runs"), trajectory, methods)
    ]
    label = f"grey: consistent filter ({row['degrees']} states, {row['runs']} runs)"
    band = (row["band_lo"], row["band_hi"])
    return _panel("mean NEES of the whole state", curves, band=band, band_label=label)


def sweep_of(rows: pl.DataFrame, level: tuple[str, float] | None = None) -> Panel:
    """Velocity error at the end, RMS over runs, against the values of one setting on one trajectory.

    Args:
        rows: of `files.columns.SWEEP`, of one parameter and one trajectory. The values stand at equal distances.
        level: a method without that setting and its error in m/s, drawn across.
    """
    title = str(rows["trajectory"][0]).replace("_", " ") + ": velocity error, m/s"
    places, curves = rows["value"].unique(maintain_order=True), []
    at = np.arange(len(places), dtype=np.float64)
    for (method,), part in rows.group_by("method", maintain_order=True):
        table = pl.DataFrame([places]).join(part, on="value", how="left", maintain_order="left")
        curves.append(_curve(str(method), at, table["velocity_rms_over_runs_mps"].fill_null(np.nan)))
    if level is not None:
        curves.append(Curve(level[0], stroke(level[0]).colour, at[[0, -1]], np.full(2, level[1])))
    return _panel(title, curves, places=places.to_list())


def calibration_of(curves: Mapping[str, tuple[Floats, Floats]]) -> Panel:
    """Velocity error against its claimed standard deviation over time; consistent methods lie on the diagonal.

    Args:
        curves: for each method the claimed standard deviation and the error, RMS over runs, m/s, (times,) each.
    """
    lines = [Curve(method, stroke(method).colour, *both) for method, both in curves.items()]
    ends = [Curve("", line.colour, line.x[-1:], line.value[-1:], kind="rings") for line in lines]
    title, x_label = "velocity error, m/s RMS (shaded: overconfident)", "claimed σ of velocity, m/s RMS"
    return Panel(title, [*lines, *ends], compared=True, x_label=x_label, diagonal=True)


def normalised_of(normalised_rms: Mapping[str, Floats]) -> Panel:
    """RMS over runs and times of error/σ of each component; a consistent filter has 1.

    Args:
        normalised_rms: (9,) for each method, in the order of `files.columns.COMPONENTS`.
    """
    at, places = np.arange(len(COMPONENTS), dtype=np.float64), [name.replace("_", " ") for name in COMPONENTS]
    consistent = Curve("", FAINT, np.array([-0.5, len(at) - 0.5]), np.ones(2), dash=(2.8, 2.8))
    curves = [_curve(method, at, pl.Series(values)) for method, values in normalised_rms.items()]
    title = "error/σ, RMS (line: a consistent filter)"
    return _panel(title, [consistent, *curves], places=places, joined=False)


def choices_figure(choices: pl.DataFrame) -> Figure:
    """A panel for each method and component: share of the runs in which each source is chosen, stacked from below.

    Args:
        choices: rows of `files.columns.CHOICES` of one trajectory.
    """
    times = choices.select(pl.col("time_ns").unique().sort())
    panels = []
    for (method, component), rows in choices.sort("method", descending=True, maintain_order=True).group_by(
        "method", "component", maintain_order=True
    ):
        title = f"{method}: {component}"
        panels.append(Panel(title, list(_shares(rows, times)), compared=True))
    return Figure("", panels, size_in=(WIDTH_IN, max(2.0, 1.15 * len(panels) + 0.6)))


def _shares(rows: pl.DataFrame, times: pl.DataFrame) -> Iterator[Curve]:
    """The shares of sources, the most frequent source first, each with its part of all choices in its name."""
    wide = rows.pivot("source", index="time_ns", values="runs_chosen")
    counts = times.join(wide, on="time_ns", how="left", maintain_order="left").fill_null(0).drop("time_ns")
    names = sorted(counts.columns, key=lambda name: (-counts[name].sum(), name))
    runs = counts.select(names).to_numpy().astype(np.float64)
    upper = np.cumsum(runs / np.maximum(runs.sum(axis=1, keepdims=True), 1.0), axis=1)
    part, lower = 100.0 * runs.sum(axis=0) / runs.sum(), np.zeros(len(upper))
    for k, name in enumerate(names):
        colour = FAINT if name == "none" else stroke(name).colour
        x, interval = times["time_ns"].to_numpy(), (lower, upper[:, k])
        yield Curve(
            f"{name} {part[k]:.0f} %", colour, x, 0.5 * (lower + upper[:, k]), interval=interval, kind="area"
        )
        lower = upper[:, k]


def _panel(title: str, curves: Sequence[Curve], **more: object) -> Panel:
    """A panel that compares methods, its axis logarithmic where their values spread."""
    shaded = [end for curve in curves for end in curve.bounds or ()]
    values = [*(curve.value for curve in curves), *shaded, np.array(more.get("band") or ())]
    return Panel(title, curves, log=spreads(values), compared=True, **more)  # type: ignore[arg-type]


def _curve(method: str, x: Floats, values: pl.Series, interval: tuple[Floats, Floats] | None = None) -> Curve:
    return Curve(method, stroke(method).colour, x, values.to_numpy(), interval=interval)


def _time_ns(rows: pl.DataFrame) -> Floats:
    return np.rint(rows["time_s"].to_numpy() * 1e9).astype(np.int64)


def _by_method(
    ensemble: pl.DataFrame, trajectory: str, methods: Sequence[str] | None
) -> Iterator[tuple[str, pl.DataFrame]]:
    """The rows of each method on a trajectory in the order of time."""
    rows = ensemble.filter(pl.col("trajectory") == trajectory)
    rows = rows if methods is None else rows.filter(pl.col("method").is_in(list(methods)))
    ordered = rows.sort("time_s", maintain_order=True).group_by("method", maintain_order=True)
    yield from ((str(method), part) for (method,), part in ordered)
