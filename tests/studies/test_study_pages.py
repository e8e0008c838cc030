"""Pages of the masks study and of the sensor law: what the tables say, with figures in the page's colours."""

from __future__ import annotations

import re

import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from numpy.typing import NDArray

from bottomlock.figures.by_category import category_figure
from bottomlock.figures.palette import stroke
from bottomlock.pages.page import html
from bottomlock.studies import masks_page, sensor_law_page
from bottomlock.tables.studies import MASKS, RECOVERY_SUMMARY, SENSOR_LAW
from tests.studies.test_masks import row


def _text(page: str) -> str:
    return " ".join(
        re.sub(r"<[^>]+>", " ", re.sub(r"<(svg|style).*?</\1>", "", page, flags=re.DOTALL)).split()
    )


def test_a_masks_page_has_every_value_and_mark() -> None:
    """A value that a few runs decide, an overconfident one, and the recovery."""
    rows = [
        row(),
        row(method="vb", velocity_rms_over_runs_mps=4.56, velocity_rms_over_runs_lo_mps=4.4,
            velocity_rms_over_runs_hi_mps=4.7, nees_velocity_attitude_mean_over_runs_and_time=60.0,
            verdict="overconfident"),
        row(case="dropouts", beams="varying", velocity_rms_over_runs_lo_mps=0.07, velocity_rms_over_runs_hi_mps=0.31),
    ]  # fmt: skip
    table = pl.DataFrame(rows, schema=dict(MASKS), orient="row")
    recovery: dict[str, object] = dict.fromkeys(RECOVERY_SUMMARY, 1)
    recovery |= {"trajectory": "straight", "case": "beams_12", "beams": "1,2", "method": "tc"}
    recovery |= {"back_at_epoch": None, "recovered": False, "nis_5": 7.25}
    summary = pl.DataFrame([recovery], schema=dict(RECOVERY_SUMMARY), orient="row", strict=False)
    page = html(masks_page.page(table, summary, ["Made by a test."], ["None."]))
    text = _text(page)
    assert "4.56 ▲" in text
    assert re.search(r"0\.2\d* † 0\.07\d*–0\.31", text)
    assert "1 of 3 values rest on a few runs" in text
    assert "never" in text
    assert "7.25" in text
    assert page.count('<svg role="img"') == 1
    assert "rest on a few runs" not in html(masks_page.page(table[:2], None, [], []))


def test_a_sensor_law_page_has_summary_and_cells() -> None:
    summary = pl.DataFrame(
        {
            "method": ["tc", "tc"], "sensors": ["none", "depth"], "cells": [2, 2], "worse": [0, 1],
            "runaways": [0, 2], "left_band": [0, 0], "overconfident": [0, 0],
            "velocity_median_mps": [0.5, 0.25], "velocity_greatest_mps": [1.0, 0.75],
        }
    )  # fmt: skip
    cell: dict[str, object] = dict.fromkeys(SENSOR_LAW, 1.0)
    cell |= {
        "trajectory": "straight",
        "beams": "1,2",
        "current_mps": 0.3,
        "method": "tc",
        "median_rises_above": "none",
        "run_rises_above": "none",
    }
    cell |= {"verdict_velocity_attitude": "overconfident", "verdict_whole_state": "consistent", "runs": 2}
    cell |= {"velocity_rms_over_runs_mps": 0.321}
    cells = [
        cell | {"sensors": "none", "median_rises_above": "", "run_rises_above": ""},
        cell | {"sensors": "depth"},
    ]
    table = pl.DataFrame(cells, schema=dict(SENSOR_LAW), orient="row", strict=False)
    facts = {"runs": 2, "seed": 1, "false_alarm": 0.01, "made_with": "hands", "command": "none"}
    page = html(sensor_law_page.page(table, summary, facts))
    text = _text(page)
    assert (
        "of 2 cells with a further sensor the median velocity error rises in 1, the error of a run in 2"
        in text
    )
    assert "straight, 0.3 m/s across" in text
    assert "0.321 ▲ rises runaway" in text
    assert page.count('<svg role="img"') == 2
    assert "**" not in text


@pytest.mark.parametrize("is_first_a_level", [False, True])
def test_points_of_a_category_stand_side_by_side(*, is_first_a_level: bool) -> None:
    """At their own errors, with their bars; the level is that of the first category."""
    curves = {"tc": np.array([1.0, 2.0]), "vb": np.array([3.0, 4.0])}
    bars = {method: (0.9 * curve, 1.1 * curve) for method, curve in curves.items()}
    figure = category_figure(curves, ["a", "b"], "t", intervals=bars, is_first_a_level=is_first_a_level)
    (axes,) = figure.axes
    drawn = {method: _line(axes, stroke(method).marker) for method in curves}
    for method, (x, y) in drawn.items():
        np.testing.assert_array_equal(y, curves[method])
        np.testing.assert_allclose(x, [0.0, 1.0], atol=0.36)
    assert not set(drawn["tc"][0]) & set(drawn["vb"][0])
    across = [np.asarray(line.get_xydata(), dtype=float) for line in axes.lines]
    levels = [points[0, 1] for points in across if points.shape == (2, 2) and points[0, 1] == points[1, 1]]
    assert levels == ([1.0, 3.0] if is_first_a_level else [])
    assert len(axes.collections) == 2


def _line(axes: Axes, marker: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The points with a marker."""
    (found,) = (line for line in axes.lines if line.get_marker() == marker)
    return np.asarray(found.get_xdata(), dtype=float), np.asarray(found.get_ydata(), dtype=float)
