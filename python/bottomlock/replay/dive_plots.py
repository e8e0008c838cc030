"""A dive to look into: maps of its tracks, and for each what-if case and method panels against UTC and a map."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from bottomlock.figures.palette import stroke
from bottomlock.figures.series import Figure, Floats, Frame, Times, Track, frame_of
from bottomlock.files.replay_tables import FORWARD, SMOOTHED, ReplayTables
from bottomlock.geodesy import radii_m
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.pages.plots import Choice, Plots
from bottomlock.replay.findings.tracks import TRUSTED
from bottomlock.replay.panels import (
    REFERENCE_COLOUR,
    beams_panel,
    current_panels,
    dash,
    floats,
    nis_panel,
    plain,
    state_panels,
    times,
)

REFERENCE = "reference"
SPAN = 1.5
"""A method that needs more than this many times the map of the track to take is cut off by its frame."""
LATE = 3.0
"""Medians of the steps between pings after which no ping is known any more."""


def taken(manifest: Mapping[str, Any]) -> str:
    """The method whose track is to be taken; of none the first that stands for all, else the first."""
    methods = manifest["methods"]
    wanted = (manifest.get("answer", {}).get("method"), "tc", *methods)
    return str(next(one for one in wanted if one in methods))


def map_of(tables: ReplayTables, what_if: str, methods: Sequence[str]) -> Figure:
    """The map of a what-if case with methods, the track to take and dead reckoning; these two with their ellipses."""
    own, first = tables.of(what_if), taken(tables.manifest)
    claims = [method for method in (first, DEAD_RECKONING) if method in tables.manifest["methods"]]
    tracks = tracks_of(own.samples, list(dict.fromkeys([*methods, *claims])))
    smoothed = tracks_of(own.samples, methods, SMOOTHED).values()
    others = [replace(track, kind="smoothed", sd_north_m=None, sd_east_m=None) for track in smoothed]
    reference = None
    if own.path is not None:
        within = pl.col("time_ns").is_between(own.samples["time_ns"].min(), own.samples["time_ns"].max())
        rows = own.path.filter(within)
        if rows.height:
            reference = Track(
                REFERENCE, REFERENCE_COLOUR, times(rows), floats(rows, "north_m"), floats(rows, "east_m"), width=5.0,
                kind="reference",
            )  # fmt: skip
            others.append(reference)
    ways = {
        method: track if method in claims else replace(track, sd_north_m=None, sd_east_m=None)
        for method, track in tracks.items()
    }
    ways[first] = replace(ways[first], lost=lost_beams(own.pings, ways[first].time_ns))
    return Figure("", (), tracks=[*ways.values(), *others], frame=framed(tracks, reference, first))


def tracks_of(samples: pl.DataFrame, methods: Sequence[str], which: str = FORWARD) -> dict[str, Track]:
    """The way of each method in one what-if case."""
    of_pass = samples.filter(pl.col("pass") == which)
    made = {}
    for method in methods:
        rows = of_pass.filter(pl.col("method") == method)
        if rows.height:
            made[method] = Track(
                method, stroke(method).colour, times(rows), floats(rows, "north_m"), floats(rows, "east_m"),
                floats(rows, "sd_position_north_m"), floats(rows, "sd_position_east_m"), dash=dash(method),
            )  # fmt: skip
    return made


def framed(tracks: Mapping[str, Track], reference: Track | None, first: str) -> Frame:
    """What a map has to show.

    It holds the track to take and the reference; and of dead reckoning and the methods that claim to be consistent
    those for which the map need not grow beyond `SPAN` times.
    """
    held = [
        *([tracks[first]] if first in tracks else list(tracks.values())),
        *([reference] if reference else []),
    ]
    small = frame_of(held)
    for method, track in tracks.items():
        trusted = method in (*TRUSTED, DEAD_RECKONING)
        if trusted and _extent(frame_of([*held, track])) <= SPAN * _extent(small):
            held.append(track)
    return frame_of(held)


def _extent(frame: Frame) -> float:
    return max(frame.north_m - frame.south_m, frame.east_m - frame.west_m)


def lost_beams(pings: pl.DataFrame, time_ns: Times) -> Floats:
    """Most beams that a ping lost since the time before, (n,); all of them where no ping came for long."""
    flags = [name for name in pings.columns if name.endswith("_valid")]
    lost = (~pings.select(flags).to_numpy().astype(bool)).sum(axis=1).astype(float)
    at = pings["time_ns"].to_numpy()
    if not len(at):
        return np.full(len(time_ns), float(len(flags)))
    step = float(np.median(np.diff(at))) if len(at) > 1 else np.inf
    ends = np.searchsorted(at, time_ns, side="right")
    starts = np.concatenate([[0], ends[:-1]])
    most = np.empty(len(time_ns))
    for row, (begin, end) in enumerate(zip(starts, ends, strict=True)):
        if end > begin:
            most[row] = lost[begin:end].max()
        elif end and time_ns[row] - at[end - 1] <= LATE * step:
            most[row] = lost[end - 1]
        else:
            most[row] = len(flags)
    return most


CAPTION = "The way over ground, and the estimates against time"


def plots_of(tables: ReplayTables, *, methods: Mapping[str, Sequence[str]], least_ratio: float) -> Plots:
    """Every view of a dive.

    Args:
        tables: of the replay.
        methods: to choose from, by what-if case.
        least_ratio: of NIS and its degrees, which noise as claimed leads to.
    """
    manifest, first = tables.manifest, taken(tables.manifest)
    cases = [name for name, _ in manifest["what_if"]]
    shown = list(dict.fromkeys([first, *(method for case in cases for method in methods[case])]))
    smoothed = (tables.samples["method"] == first) & (tables.samples["pass"] == SMOOTHED)
    passes = {method: (method, FORWARD) for method in shown}
    passes |= {f"{first}, smoothed": (first, SMOOTHED)} if smoothed.any() else {}
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    views: dict[tuple[str, ...], Figure] = {}
    for case in cases:
        own, charted, beams = tables.of(case), map_of(tables, case, shown), beams_panel(tables.of(case).pings)
        lost = next(track.lost for track in charted.tracks if track.lost is not None)
        beside = [track for track in charted.tracks if track.label in (DEAD_RECKONING, REFERENCE)]
        for label, (method, which) in passes.items():
            nis = nis_panel(own.innovations, [method], least_ratio, compared=False)
            panels = [
                *(panel for of in state_panels(own.samples, method, which).values() for panel in of),
                beams,
                *([nis] if nis.curves else []),
                *current_panels(own.currents, method),
            ]
            (way,) = tracks_of(own.samples, [method], which).values()
            tracks = [replace(way, lost=lost, width=2.0), *(one for one in beside if one.label != method)]
            views[plain(case), label] = Figure("", panels, start_ns, tracks=tracks, frame=charted.frame)
    choices = [
        Choice("Conditions", [plain(case) for case in cases], plain(cases[0])),
        Choice("Method", list(passes), first),
    ]
    return Plots(CAPTION, choices, views, _place(manifest.get("origin")))


def _place(origin: Mapping[str, float] | None) -> tuple[float, float, float, float] | None:
    """Latitude and longitude of the origin, deg, and the metres of a degree of each."""
    if origin is None:
        return None
    latitude = origin["latitude_rad"]
    meridian, transverse = (float(one) for one in radii_m(np.asarray(latitude)))
    height, degree = origin["height_m"], np.pi / 180.0
    return (
        float(np.rad2deg(latitude)),
        float(np.rad2deg(origin["longitude_rad"])),
        degree * (meridian + height),
        degree * (transverse + height) * float(np.cos(latitude)),
    )
