"""The layout of PlotJuggler 3 for an exported MCAP file: two tabs, positions and velocities with their σ, beams, NIS.

A series is named TOPIC/FIELD, as PlotJuggler's parser of JSON makes them (plotjuggler_app/nlohmann_parsers.cpp); truth
values are 0 and 1. The elements are those that plot_docker.cpp, plotwidget.cpp and tabbedplotwidget.cpp read.
"""

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from bottomlock.export.tracks import Export, ExportTrack

VERSION = "2.3.8"
"""`LAYOUT_VERSION` of PlotJuggler 3; it warns of another."""
_COLOURS = ("#1f77b4", "#d62728", "#1ac938", "#ff7f0e", "#9467bd", "#17becf", "#bcbd22", "#f14cc1")

Curves = Sequence[tuple[str, str]]
"""Names of series, each with its colour."""


def plotjuggler_layout(export: Export) -> str:
    """A layout to load in PlotJuggler after the file: the topics of `mcap` for these tracks."""
    root = ET.Element("root", version=VERSION)
    window = ET.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for name, panels in (("tracks", _tracks(export)), ("first track", _first(export))):
        if panels:
            _tab(window, name, panels)
    ET.SubElement(window, "currentTabIndex", index="0")
    # The time begins at the start of the file, not in 1970.
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    ET.indent(root, " ")
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ET.tostring(root, encoding='unicode')}\n"


def _tracks(export: Export) -> dict[str, ET.Element]:
    """Panels that compare the tracks: the map, depths, σ of the positions."""
    placed = [track for track in export.tracks if track.position_t_m is not None]
    if not placed:
        return {}
    return {
        "map: east, north, m": _map(placed),
        "down, m": _plot([(_series(track, "down_m"), track.colour) for track in placed]),
        "1 sigma of north, m": _plot(
            [(_series(track, "sd_position_north_m"), track.colour) for track in export.estimates]
        ),
    }


def _first(export: Export) -> dict[str, ET.Element]:
    """Panels of the first estimate: velocity, its σ, beams, NIS."""
    first = export.estimates[0]
    panels = {
        "velocity, m/s": _several(first, [f"{axis}_mps" for axis in ("surge", "sway", "heave")]),
        "1 sigma of velocity, m/s": _several(
            first, [f"sd_velocity_{axis}_mps" for axis in ("surge", "sway", "heave")]
        ),
    }
    pings = export.pings.get(first.group)
    if pings is not None:
        valid = [name for name in pings.columns if name.endswith("_valid")]
        panels["beams"] = _plot(_coloured([f"/{first.group}/beams/{name}" for name in valid]))
    fix = f"{first.group}_{first.method}"
    if fix in export.fixes:
        panels["NIS and degrees"] = _plot(_coloured([f"/{fix}/fix/nis", f"/{fix}/fix/degrees"]))
    return panels


def _series(track: ExportTrack, column: str) -> str:
    return f"/{track.name}/estimate/{column}"


def _several(track: ExportTrack, columns: Sequence[str]) -> ET.Element:
    return _plot(_coloured([_series(track, column) for column in columns]))


def _coloured(names: Sequence[str]) -> Curves:
    return [(name, _COLOURS[k % len(_COLOURS)]) for k, name in enumerate(names)]


def _plot(curves: Curves) -> ET.Element:
    plot = ET.Element("plot", mode="TimeSeries", style="Lines")
    for name, colour in curves:
        ET.SubElement(plot, "curve", name=name, color=colour)
    return plot


def _map(tracks: Sequence[ExportTrack]) -> ET.Element:
    plot = ET.Element("plot", mode="XYPlot", style="Lines")
    for track in tracks:
        places = {"curve_x": _series(track, "east_m"), "curve_y": _series(track, "north_m")}
        ET.SubElement(plot, "curve", {"name": track.name, "color": track.colour, **places})
    return plot


def _tab(window: ET.Element, name: str, panels: dict[str, ET.Element]) -> None:
    """Panels below each other with the same height."""
    tab = ET.SubElement(window, "Tab", tab_name=name, containers="1")
    sizes = ";".join([f"{1.0 / len(panels):.6f}"] * len(panels))
    splitter = ET.SubElement(
        ET.SubElement(tab, "Container"), "DockSplitter", orientation="-", count=str(len(panels)), sizes=sizes
    )
    for title, plot in panels.items():
        ET.SubElement(splitter, "DockArea", name=title).append(plot)
