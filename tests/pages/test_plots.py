"""What the page's script is given: every array, within its rounding, each once, and nothing that ends a script."""

import base64
import json
import zlib
from typing import Any

import numpy as np
import pytest

from bottomlock.figures.series import Curve, Figure, Floats, Panel, Track, frame_of, is_utc
from bottomlock.pages.plots import BUCKETS, FEWEST, MISSING, Choice, Plots

START_NS = 1_767_225_610 * 10**9


def unpacked(content: dict[str, Any], index: int) -> Floats:
    """An array as the script reads it."""
    whole = np.frombuffer(zlib.decompress(base64.b64decode(content["data"])), dtype="<i4")
    start, length, step = content["arrays"][index]
    coded = whole[int(start) : int(start) + int(length)]
    values = np.full(len(coded), np.nan)
    there = coded != MISSING
    values[there] = np.cumsum(coded[there].astype(np.int64)) * step
    return values


def plots(*, curves: int = 1, points: int = 400, views: int = 1, label: str = "tc") -> Plots:
    rng = np.random.default_rng(5)
    time_ns = START_NS + np.arange(points) * 50_000_000
    made: dict[tuple[str, ...], Figure] = {}
    for number in range(views):
        drawn = [
            Curve(label, "#9233d2", time_ns, rng.standard_normal(points), sd=np.full(points, 0.25))
            for _ in range(curves)
        ]
        track = Track(label, "#9233d2", time_ns, np.cumsum(rng.standard_normal(points)), np.zeros(points))
        panel = Panel("surge, m/s", drawn, decimals=3)
        made[(str(number),)] = Figure("", [panel], START_NS, tracks=[track], frame=frame_of([track]))
    return Plots("A dive", [Choice("Case", [key for (key,) in made], "0")], made)


def test_arrays_come_back_within_their_rounding() -> None:
    given = plots()
    curve = given.views["0",].panels[0].curves[0]
    curve.value[[7, 8]] = np.nan
    content = json.loads(given.data)
    view = content["views"]["0"]
    packed = view["panels"][0]["curves"][0]
    np.testing.assert_allclose(unpacked(content, packed["t"]), np.arange(400) * 0.05, atol=5e-4)
    np.testing.assert_allclose(unpacked(content, packed["v"]), curve.value, atol=5.1e-5)
    np.testing.assert_allclose(unpacked(content, packed["sd"]), 0.25, atol=5.1e-5)
    track = given.views["0",].tracks[0]
    np.testing.assert_allclose(unpacked(content, view["tracks"][0]["n"]), track.north_m, atol=5.1e-4)
    assert content["utc"] is True
    assert content["start_s"] == START_NS / 1e9


def test_a_filter_that_runs_away_is_packed_in_greater_steps() -> None:
    given = plots()
    given.views["0",].tracks[0].north_m[:] = np.linspace(0.0, 1e9, 400)
    content = json.loads(given.data)
    north = unpacked(content, content["views"]["0"]["tracks"][0]["n"])
    np.testing.assert_allclose(north, np.linspace(0.0, 1e9, 400), atol=2.0)


def test_the_same_array_stands_once() -> None:
    """The times of every curve are the same, and so is its σ."""
    content = json.loads(plots(curves=3).data)
    curves = content["views"]["0"]["panels"][0]["curves"]
    assert len({one["t"] for one in curves}) == 1
    assert len({one["sd"] for one in curves}) == 1
    assert len({one["v"] for one in curves}) == 3


def test_nothing_ends_the_script() -> None:
    text = plots(label="</script><b>").data
    assert "<" not in text
    assert json.loads(text)["views"]["0"]["tracks"][0]["label"] == "</script><b>"


def test_many_views_have_fewer_points() -> None:
    assert plots().buckets == BUCKETS
    assert FEWEST <= plots(curves=5, points=4, views=60).buckets < BUCKETS


@pytest.mark.parametrize(("time_ns", "utc"), [(START_NS, True), (0, False), (86_400 * 10**9, False)])
def test_times_from_zero_are_not_of_the_calendar(time_ns: int, utc: bool) -> None:
    assert is_utc(time_ns) is utc
