"""What PlotJuggler 3 makes of an MCAP file and of a layout, after its sources."""

import json
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from mcap.reader import make_reader


def series(path: Path) -> dict[str, int]:
    """The number of points of each series by its name, as `NlohmannParser::parseMessageImpl` flattens messages."""
    found: dict[str, int] = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            assert channel.message_encoding == "json"
            for name in _flat(channel.topic, json.loads(message.data)):
                found[name] = found.get(name, 0) + 1
    return found


def _flat(prefix: str, value: object) -> Iterator[str]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(f"{prefix}/{key}", inner)
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from _flat(f"{prefix}[{k}]", inner)
    elif isinstance(value, int | float):  # truth values are numbers there, too; text is none
        yield prefix


def curves(path: Path) -> list[str]:
    """The names of the series that a layout shows; it has what `loadLayoutFromFile` and `xmlLoadState` need."""
    root = ET.parse(path).getroot()
    # MainWindow::loadLayoutFromFile and xmlLoadState
    assert (root.tag, root.get("version")) == ("root", "2.3.8")
    (window,) = root.findall("tabbed_widget")
    assert (window.get("name"), window.get("parent")) == ("Main Window", "main_window")
    tabs = window.findall("Tab")
    index = window.find("currentTabIndex")
    assert index is not None
    assert 0 <= int(index.get("index", "")) < len(tabs)
    found = []
    for tab in tabs:
        assert tab.get("tab_name")
        (container,) = tab.findall("Container")
        (splitter,) = container.findall("DockSplitter")
        # PlotDocker::restoreSplitter reads a size for each of `count` widgets, and fills them with its children.
        children, sizes = list(splitter), [float(text) for text in splitter.get("sizes", "").split(";")]
        assert splitter.get("orientation") in {"|", "-"}
        assert len(children) == len(sizes) == int(splitter.get("count", ""))
        assert abs(sum(sizes) - 1.0) < 1e-5
        for area in children:
            assert area.tag == "DockArea"
            (plot,) = area
            found += _of_plot(plot)
    return found


def _of_plot(plot: ET.Element) -> list[str]:
    """PlotWidget::xmlLoadState."""
    mode = plot.get("mode")
    assert (plot.tag, mode in {"TimeSeries", "XYPlot"}, plot.get("style")) == ("plot", True, "Lines")
    curves_of = plot.findall("curve")
    assert curves_of
    assert all(len(one.get("color", "")) == len("#rrggbb") for one in curves_of)
    keys = ("name",) if mode == "TimeSeries" else ("curve_x", "curve_y")
    return [one.get(key, "") for one in curves_of for key in keys]
