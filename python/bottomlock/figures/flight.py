"""Figure of one simulated trajectory: path, depth, speed, flow angles, actuators and beams."""

import itertools
from collections.abc import Callable
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


def flight_figure(telemetry: pl.DataFrame, beams: pl.DataFrame | None = None) -> Figure:
    """One trajectory: plan view, depth, speed, flow angles, fin angles or thrusts, ranges and which beams returned.

    Args:
        telemetry: the columns of `bottomlock.plant.telemetry`, SI and rad.
        beams: `time_ns` and a boolean column `beam1_valid`, `beam2_valid`, ... per beam, and `beam1_range_m`, ... over
            a seabed; the panels of beams and ranges are left out without them.

    Raises:
        OutputError: a column is missing.
    """
    _require(
        telemetry, ("trajectory", "north_m", "east_m", "depth_m", "depth_wanted_m", "speed_mps", "time_ns")
    )
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(11.0, 7.5), layout="constrained")
        draw: list[tuple[float, Callable[[Axes], None]]] = [
            (1.2, lambda axes: _depth(axes, time_s, telemetry)),
            (1.0, lambda axes: _speed(axes, time_s, telemetry)),
            (1.2, lambda axes: _flow(axes, time_s, telemetry)),
            (1.2, lambda axes: _drives(axes, time_s, telemetry)),
        ]
        if beams is not None:
            if "beam1_range_m" in beams.columns:
                draw.append((1.2, lambda axes: _ranges(axes, beams)))
            draw.append((0.7, lambda axes: _strip(axes, beams)))
        time_s = telemetry["time_ns"].to_numpy() * 1e-9
        grid = figure.add_gridspec(
            len(draw), 2, width_ratios=[1.0, 1.25], height_ratios=[height for height, _ in draw]
        )
        _plan(figure.add_subplot(grid[:, 0]), telemetry)
        panels: list[Axes] = []
        for row, (_, fill) in enumerate(draw):
            panels.append(figure.add_subplot(grid[row, 1], sharex=panels[0] if panels else None))
            fill(panels[-1])
        for axes in panels[:-1]:
            axes.tick_params(labelbottom=False)
        panels[-1].set_xlabel("time, s")
        panels[0].set_xlim(float(time_s[0]), float(time_s[-1]))
        figure.suptitle(str(telemetry["trajectory"][0]).replace("_", " "))
    return figure


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
    axes.plot(time_s, telemetry["depth_wanted_m"], color=_GREY, linestyle="--", label="commanded")
    axes.plot(time_s, telemetry["depth_m"], color=_BLUE, label="actual")
    axes.invert_yaxis()
    low, high = axes.get_ylim()
    if abs(low - high) < 1.0:
        # A constant depth must look constant, not show noise of a micrometre.
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
    axes.set_ylabel("flow angles,\ndeg")
    _room_above(axes)
    axes.legend(loc="upper right", ncols=2)


def _drives(axes: Axes, time_s: np.ndarray[Any, Any], telemetry: pl.DataFrame) -> None:
    fins = [name for name in telemetry.columns if name.startswith("fin_")]
    drives = fins or [name for name in telemetry.columns if name.startswith("thrust_")]
    for name, colour in zip(drives, itertools.cycle(_FINS), strict=False):
        values = telemetry[name].to_numpy()
        shown = np.rad2deg(values) if fins else values
        axes.plot(time_s, shown, color=colour, linewidth=1.0, label=name.split("_")[1])
    axes.set_ylabel("fins, deg" if fins else "thrust, N")
    _room_above(axes)
    axes.legend(loc="upper right", ncols=8)


def _ranges(axes: Axes, beams: pl.DataFrame) -> None:
    """Range of every beam to the seabed; thin where the beam does not return."""
    time_s = beams["time_ns"].to_numpy() * 1e-9
    numbers = [name[4:].split("_")[0] for name in beams.columns if name.endswith("_range_m")]
    for number, colour in zip(numbers, itertools.cycle(_FINS), strict=False):
        reach = beams[f"beam{number}_range_m"].fill_null(np.nan).to_numpy()
        returned = np.where(beams[f"beam{number}_valid"].to_numpy(), reach, np.nan)
        axes.plot(time_s, reach, color=colour, linewidth=0.6, alpha=0.6)
        axes.plot(time_s, returned, color=colour, linewidth=1.8, label=number)
    axes.set_ylabel("range, m")
    _room_above(axes)
    axes.legend(loc="upper right", ncols=8)


def _room_above(axes: Axes) -> None:
    """Headroom for the legend."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.35 * (high - low))


def _strip(axes: Axes, validity: pl.DataFrame) -> None:
    names = [name for name in validity.columns if name.startswith("beam") and name.endswith("_valid")]
    if "time_ns" not in validity.columns or not names:
        raise OutputError(
            "figure: the validity frame needs time_ns and columns beam1_valid, beam2_valid, ..."
        )
    time_s = validity["time_ns"].to_numpy() * 1e-9
    for row, name in enumerate(names, start=1):
        returned = validity[name].to_numpy().astype(bool)
        axes.plot(time_s[returned], np.full(int(returned.sum()), row), "|", color=_GREEN, markersize=6.0)
        axes.plot(time_s[~returned], np.full(int((~returned).sum()), row), "|", color=_ORANGE, markersize=6.0)
    axes.set_yticks(range(1, len(names) + 1), [f"beam {name[4:].removesuffix('_valid')}" for name in names])
    axes.set_ylim(len(names) + 0.6, 0.4)
    axes.grid(visible=False)
    axes.set_title("green: returned, orange: lost", fontsize=8.0, loc="right", pad=2.0)
