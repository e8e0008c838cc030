"""Figures: data frames in, files out; no statistics are computed here."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bottomlock.errors import OutputError

_STYLE: Any = {
    "svg.hashsalt": "bottomlock",
    "svg.fonttype": "path",
    "font.size": 9.0,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
}
# Colours that stay apart for colour-blind readers (Okabe and Ito 2008).
_BLUE, _ORANGE, _GREEN, _PURPLE, _GREY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#888888"
_FINS = (_BLUE, _ORANGE, _GREEN, _PURPLE)


def flight_figure(telemetry: pl.DataFrame, validity: pl.DataFrame | None = None) -> Figure:
    """Draw one trajectory: plan view, depth, speed, flow angles, fin angles and which beams returned.

    Args: telemetry: the columns of `bottomlock.plant.telemetry`, SI and rad. validity: `time_ns` and a
    boolean column `beam_1_valid`, `beam_2_valid`, ... per beam; the strip is left out without it.

    Raises:
        OutputError: a column is missing.
    """
    _require(
        telemetry, ("trajectory", "north_m", "east_m", "depth_m", "depth_wanted_m", "speed_mps", "time_ns")
    )
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(11.0, 7.5), layout="constrained")
        rows = 4 if validity is None else 5
        heights = [1.2, 1.0, 1.2, 1.2, 0.7][:rows]
        grid = figure.add_gridspec(rows, 2, width_ratios=[1.0, 1.25], height_ratios=heights)
        _plan(figure.add_subplot(grid[:, 0]), telemetry)
        time_s = telemetry["time_ns"].to_numpy() * 1e-9
        panels = [figure.add_subplot(grid[0, 1])]
        panels += [figure.add_subplot(grid[row, 1], sharex=panels[0]) for row in range(1, rows)]
        _depth(panels[0], time_s, telemetry)
        _speed(panels[1], time_s, telemetry)
        _flow(panels[2], time_s, telemetry)
        _fins(panels[3], time_s, telemetry)
        if validity is not None:
            _strip(panels[4], validity)
        for panel in panels[:-1]:
            panel.tick_params(labelbottom=False)
        panels[-1].set_xlabel("time, s")
        panels[0].set_xlim(float(time_s[0]), float(time_s[-1]))
        figure.suptitle(str(telemetry["trajectory"][0]).replace("_", " "))
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure by its suffix (.svg, .png, .pdf); the same figure gives the same bytes as SVG.

    Raises:
        OutputError: the place cannot be written or the suffix is unknown.
    """
    metadata = {"Date": None} if path.suffix == ".svg" else {}
    try:
        with mpl.rc_context(_STYLE):
            figure.savefig(path, dpi=150, metadata=metadata)
    except (OSError, ValueError) as error:
        raise OutputError(f"figure {path}: cannot be written: {error}") from error


def _require(frame: pl.DataFrame, columns: tuple[str, ...]) -> None:
    for column in columns:
        if column not in frame.columns:
            raise OutputError(f"figure: column '{column}' is missing; found {', '.join(frame.columns)}")


def _plan(axes: Axes, telemetry: pl.DataFrame) -> None:
    north, east = telemetry["north_m"].to_numpy(), telemetry["east_m"].to_numpy()
    axes.plot(east, north, color=_BLUE, linewidth=1.5)
    axes.plot(east[0], north[0], "o", color=_GREEN, label="start")
    axes.plot(east[-1], north[-1], "s", color=_ORANGE, label="end")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.legend(loc="best")


def _depth(axes: Axes, time_s: np.ndarray[Any, Any], telemetry: pl.DataFrame) -> None:
    axes.plot(time_s, telemetry["depth_wanted_m"], color=_GREY, linestyle="--", label="wanted")
    axes.plot(time_s, telemetry["depth_m"], color=_BLUE, label="swum")
    axes.invert_yaxis()
    low, high = axes.get_ylim()
    if abs(low - high) < 1.0:
        # a constant depth should look constant, not like noise of a micrometre
        middle = 0.5 * (low + high)
        axes.set_ylim(middle + 0.5, middle - 0.5)
    axes.set_ylabel("depth, m")
    axes.legend(loc="best", ncols=2)


def _speed(axes: Axes, time_s: np.ndarray[Any, Any], telemetry: pl.DataFrame) -> None:
    axes.plot(time_s, telemetry["speed_mps"], color=_BLUE)
    low, high = axes.get_ylim()
    middle = 0.5 * (low + high)
    axes.set_ylim(min(low, middle - 0.05), max(high, middle + 0.05))
    axes.ticklabel_format(useOffset=False)
    axes.set_ylabel("speed, m/s")


def _flow(axes: Axes, time_s: np.ndarray[Any, Any], telemetry: pl.DataFrame) -> None:
    for column, label, colour in (
        ("sideslip_rad", "sideslip", _BLUE),
        ("angle_of_attack_rad", "angle of attack", _ORANGE),
    ):
        axes.plot(time_s, np.rad2deg(telemetry[column].to_numpy()), color=colour, label=label)
    axes.set_ylabel("through the\nwater, deg")
    axes.legend(loc="best", ncols=2)


def _fins(axes: Axes, time_s: np.ndarray[Any, Any], telemetry: pl.DataFrame) -> None:
    for index, colour in enumerate(_FINS, start=1):
        angle = np.rad2deg(telemetry[f"fin_{index}_rad"].to_numpy())
        axes.plot(time_s, angle, color=colour, linewidth=1.0, label=str(index))
    axes.set_ylabel("fins, deg")
    axes.legend(loc="upper right", ncols=4)


def _strip(axes: Axes, validity: pl.DataFrame) -> None:
    names = [name for name in validity.columns if name.startswith("beam_") and name.endswith("_valid")]
    if "time_ns" not in validity.columns or not names:
        raise OutputError(
            "figure: the validity frame needs time_ns and columns beam_1_valid, beam_2_valid, ..."
        )
    time_s = validity["time_ns"].to_numpy() * 1e-9
    for row, name in enumerate(names, start=1):
        returned = validity[name].to_numpy().astype(bool)
        axes.plot(time_s[returned], np.full(int(returned.sum()), row), "|", color=_GREEN, markersize=6.0)
        axes.plot(time_s[~returned], np.full(int((~returned).sum()), row), "|", color=_ORANGE, markersize=6.0)
    axes.set_yticks(
        range(1, len(names) + 1), [name.removesuffix("_valid").replace("_", " ") for name in names]
    )
    axes.set_ylim(len(names) + 0.6, 0.4)
    axes.grid(visible=False)
    axes.set_title("green: returned, orange: lost", fontsize=8.0, loc="right", pad=2.0)
