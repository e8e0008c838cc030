"""What a dive is looked at with: the map scaled to tracks that can be trusted, curves of the tables, beams lost."""

import json

import numpy as np
import polars as pl
import pymap3d
import pytest

from bottomlock.figures.series import Frame, Track
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.replay.dive_plots import framed, lost_beams, taken, tracks_of
from bottomlock.replay.report import dive_of
from tests.pages.test_plots import unpacked
from tests.replay.dive_tables import LOST_S, METHODS, SPIKE_MPS, START_NS, dive_tables, manifest


@pytest.fixture(scope="module")
def tables() -> ReplayTables:
    return dive_tables()


def cut_off(frame: Frame, tracks: dict[str, Track]) -> list[str]:
    """The methods whose tracks leave the map."""
    low, high = (frame.south_m, frame.west_m), (frame.north_m, frame.east_m)
    return [
        method
        for method, track in tracks.items()
        if ((track.north_m < low[0]) | (track.north_m > high[0])).any()
        or ((track.east_m < low[1]) | (track.east_m > high[1])).any()
    ]


def test_the_free_ins_does_not_scale_the_map(tables: ReplayTables) -> None:
    """It ends 4.5 km off; the dive is 12 m wide, and dead reckoning stays with it."""
    tracks = tracks_of(tables.samples, METHODS)
    frame = framed(tracks, None, "tc")
    assert cut_off(frame, tracks) == ["ins"]
    assert frame.north_m - frame.south_m < 20.0
    assert frame.east_m - frame.west_m < 20.0
    assert (tracks[DEAD_RECKONING].north_m < frame.north_m).all()


def test_a_method_without_aid_scales_nothing(tables: ReplayTables) -> None:
    """Not even where there would be room for it; a method that claims to be consistent has that room."""
    off = pl.col("east_m") - 3.0
    for method, held in (("ins", False), (DEAD_RECKONING, True)):
        own = pl.col("method") == method
        there = tables.samples.filter(pl.col("method") == "tc").with_columns(
            method=pl.lit(method), east_m=off
        )
        samples = pl.concat([tables.samples.filter(~own), there])
        tracks = tracks_of(samples, ["tc", method])
        frame = framed(tracks, None, "tc")
        assert cut_off(frame, tracks) == ([] if held else [method])
        assert (frame.west_m < -3.0) is held


@pytest.mark.parametrize(("method", "first"), [("tc", "tc"), (DEAD_RECKONING, DEAD_RECKONING), ("", "tc")])
def test_the_track_to_take_is_shown_first(method: str, first: str) -> None:
    content = manifest()
    content["answer"]["method"] = method
    assert taken(content) == first
    assert taken({"methods": ["mine"], "answer": {"method": ""}}) == "mine"


def test_beams_lost_between_two_points(tables: ReplayTables) -> None:
    """The most that any ping between lost, as pings come faster than the track is sampled."""
    seconds = np.array([0.0, 19.5, 21.5, 29.5, 31.5, 59.8, 70.0])
    lost = lost_beams(tables.pings, START_NS + np.round(seconds * 1e9).astype(np.int64))
    np.testing.assert_array_equal(lost, [0.0, 0.0, 2.0, 2.0, 2.0, 0.0, 4.0])


def test_curves_are_those_of_the_tables(tables: ReplayTables) -> None:
    """Each value of the page's data is of the table at that time, also after its way through the packing."""
    content = json.loads(dive_of(tables).data)
    rows = tables.samples.filter(pl.col("method") == "tc")
    panels = {one["title"]: one for one in content["views"]["recorded\ntc"]["panels"]}
    for title, column, tolerance in (
        ("surge, m/s", "surge_mps", 1e-4),
        ("sway, m/s", "sway_mps", 1e-4),
        ("depth below the origin, m", "down_m", 1e-3),
    ):
        floor, curve = panels[title]["curves"]
        assert (floor["label"], curve["label"]) == ("dead reckoning", "tc")
        seconds = unpacked(content, curve["t"])
        at = np.round(seconds * 1e9).astype(np.int64) + START_NS
        there = rows.filter(pl.col("time_ns").is_in(at.tolist()))[column].to_numpy()
        np.testing.assert_allclose(unpacked(content, curve["v"]), there, atol=tolerance)
    sd = unpacked(content, panels["surge, m/s"]["curves"][1]["sd"])
    np.testing.assert_allclose(sd, 0.0125, atol=6e-5)


def test_place_of_the_origin_as_another_library_has_it(tables: ReplayTables) -> None:
    """1 km north and 2 km east of the origin, by pymap3d and by the page's metres of a degree."""
    latitude, longitude, north, east = json.loads(dive_of(tables).data)["place"]
    there = pymap3d.ned2geodetic(1000.0, 2000.0, 0.0, 54.0, -3.5, 0.0)
    assert latitude + 1000.0 / north == pytest.approx(there[0], abs=5e-6)
    assert longitude + 2000.0 / east == pytest.approx(there[1], abs=1e-5)


def test_a_spike_of_one_sample_survives_an_hour() -> None:
    content = json.loads(dive_of(dive_tables(3600.0, 20.0)).data)
    surge = content["views"]["recorded\ntc"]["panels"][0]["curves"][1]
    values = unpacked(content, surge["v"])
    assert values.max() == pytest.approx(SPIKE_MPS, abs=1e-3)
    assert len(values) < 10_000


def test_lost_beams_break_their_line(tables: ReplayTables) -> None:
    content = json.loads(dive_of(tables).data)
    panel = next(one for one in content["views"]["recorded\ntc"]["panels"] if one["names"])
    times, levels = (unpacked(content, panel["curves"][1][key]) for key in ("t", "v"))
    np.testing.assert_allclose(times[:3], [0.0, *LOST_S], atol=1e-3)
    np.testing.assert_array_equal(levels[:3], [2.0, np.nan, 2.0])
