"""A dive to look into: for each what-if case and method panels against UTC and the way over ground."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from bottomlock.figures.palette import stroke
from bottomlock.figures.series import Curve, Floats, Frame, Panel, Times, Track, View, frame_of, valid_panel
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.pages.plots import Choice, Plots
from bottomlock.recordings.geodesy import radii_m
from bottomlock.replay.figures import nis_band, nis_ratios
from bottomlock.replay.findings.against_reckoning import TRUSTED
from bottomlock.tables.replay import FORWARD, SMOOTHED, ReplayTables

REFERENCE = "reference"
REFERENCE_COLOUR = "#8b949e"
LOST_COLOURS = ("#f0c24b", "#f0862d", "#d6391f", "#9c2a6e")
"""Of a track where one, two, three, four or more beams are lost."""
PITCH_COLOUR = "#f56803"
SPAN = 1.5
"""A method that needs more than this many times the map of the track to take is cut off by its frame."""
LATE = 3.0
"""Medians of the steps between pings after which no ping is known any more."""


def taken(manifest: Mapping[str, Any]) -> str:
    """The method whose track is to be taken; of none the first that stands for all, else the first."""
    methods = manifest["methods"]
    wanted = (manifest.get("answer", {}).get("method"), "tc", *methods)
    return str(next(one for one in wanted if one in methods))


def tracks_of(samples: pl.DataFrame, methods: Sequence[str], which: str = FORWARD) -> dict[str, Track]:
    """The way of each method in one what-if case."""
    of_pass = samples.filter(pl.col("pass") == which)
    made = {}
    for method in methods:
        rows = of_pass.filter(pl.col("method") == method)
        if rows.height:
            made[method] = Track(
                method,
                stroke(method).colour,
                _times(rows),
                north_m=_floats(rows, "north_m"),
                east_m=_floats(rows, "east_m"),
                sd_north_m=_floats(rows, "sd_position_north_m"),
                sd_east_m=_floats(rows, "sd_position_east_m"),
                dash=_dash(method),
            )
    return made


def reference_track(path: pl.DataFrame | None, samples: pl.DataFrame) -> Track | None:
    """The reference while the filters run; None without its positions."""
    if path is None:
        return None
    rows = path.filter(pl.col("time_ns").is_between(samples["time_ns"].min(), samples["time_ns"].max()))
    places = (_floats(rows, "north_m"), _floats(rows, "east_m"))
    return Track(REFERENCE, REFERENCE_COLOUR, _times(rows), *places, width=5.0) if rows.height else None


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


def holds(frame: Frame, track: Track) -> bool:
    """Whether a map shows a whole track."""
    north, east = track.north_m, track.east_m
    return bool(
        (north >= frame.south_m).all()
        and (north <= frame.north_m).all()
        and (east >= frame.west_m).all()
        and (east <= frame.east_m).all()
    )


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


def plots_of(tables: ReplayTables, *, methods: Mapping[str, Sequence[str]], least_ratio: float) -> Plots:
    """Every view of a dive.

    Args:
        tables: of the replay.
        methods: to choose from, by what-if case.
        least_ratio: of NIS and its degrees, which noise as claimed leads to.
    """
    manifest = tables.manifest
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    first = taken(manifest)
    cases = [name for name, _ in manifest["what_if"]]
    shown = list(dict.fromkeys([first, *(method for case in cases for method in methods[case])]))
    smoothed = _smoothed(tables.samples, first)
    views: dict[tuple[str, ...], View] = {}
    for case in cases:
        own = tables.of(case)
        tracks = tracks_of(own.samples, [*shown, DEAD_RECKONING])
        reference = reference_track(own.path, own.samples)
        frame = framed(tracks, reference, first)
        beams = beams_panel(own.pings)
        lost = lost_beams(own.pings, next(iter(tracks.values())).time_ns)
        for method, which in [*((one, FORWARD) for one in shown), *((one, SMOOTHED) for one in smoothed)]:
            panels = [
                *state_panels(own.samples, method, which),
                beams,
                *nis_panels(own.innovations, method, least_ratio),
                *current_panels(own.currents, method),
            ]
            ways = [
                *tracks_of(own.samples, [method], which).values(),
                *(tracks[one] for one in (DEAD_RECKONING,) if one in tracks and one != method),
            ]
            ways[0] = _with_lost(ways[0], lost)
            label = method if which == FORWARD else f"{method}, smoothed"
            views[_plain(case), label] = View(panels, [*ways, *([reference] if reference else [])], frame)
    choices = [
        Choice("Conditions", [_plain(case) for case in cases], _plain(cases[0])),
        Choice("Method", [*shown, *(f"{one}, smoothed" for one in smoothed)], first),
    ]
    return Plots(CAPTION, choices, views, start_ns, _place(manifest.get("origin")))


CAPTION = "The way over ground, and the estimates against time"


def _smoothed(samples: pl.DataFrame, method: str) -> list[str]:
    """The method where it has a smoothed pass."""
    there = (samples["method"] == method) & (samples["pass"] == SMOOTHED)
    return [method] if there.any() else []


def _with_lost(track: Track, lost: Floats) -> Track:
    return replace(track, lost=lost, width=2.0)


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


def state_panels(samples: pl.DataFrame, method: str, which: str = FORWARD) -> list[Panel]:
    """Velocity with ±σ, σ of the position, depth and attitude of a method in one case, over dead reckoning."""
    return [panel for panels in STATES.values() for panel in panels(samples, method, which)]


def velocity_panels(samples: pl.DataFrame, method: str, which: str = FORWARD) -> list[Panel]:
    """Surge, sway and heave with ±σ; as `state_panels`."""
    return [
        Panel(
            f"{axis}, m/s",
            _over_reckoning(samples, method, which, f"{axis}_mps", f"sd_velocity_{axis}_mps"),
            decimals=3,
        )
        for axis in ("surge", "sway", "heave")
    ]


def position_sd_panels(samples: pl.DataFrame, method: str, which: str = FORWARD) -> list[Panel]:
    """Claimed σ of the horizontal position, and its error where it is known; as `state_panels`."""
    rows, floor = _rows_of(samples, method, which)
    horizontal = []
    for name, one in ((DEAD_RECKONING, floor), (method, rows)):
        if one.height:
            sd = _norm(one, "sd_position")
            horizontal.append(
                Curve(f"σ, {_plain(name)}", stroke(name).colour, _times(one), sd, None, _dash(name))
            )
    error = _norm(rows, "err_position")
    if np.isfinite(error).any():
        horizontal.append(Curve("error", REFERENCE_COLOUR, _times(rows), error, width=2.0))
    return [Panel("σ of position, horizontal, m", horizontal, decimals=2)]


def depth_panels(samples: pl.DataFrame, method: str, which: str = FORWARD) -> list[Panel]:
    """Depth with ±σ; as `state_panels`."""
    curves = _over_reckoning(samples, method, which, "down_m", "sd_position_down_m")
    return [Panel("depth below the origin, m", curves, decimals=2)]


def attitude_panels(samples: pl.DataFrame, method: str, which: str = FORWARD) -> list[Panel]:
    """Roll and pitch, then heading; as `state_panels`."""
    rows, _ = _rows_of(samples, method, which)
    return [
        Panel(
            "roll and pitch, °",
            [
                Curve("roll", stroke(method).colour, _times(rows), _floats(rows, "roll_deg")),
                Curve("pitch", PITCH_COLOUR, _times(rows), _floats(rows, "pitch_deg"), dash=(5.0, 2.0)),
            ],
        ),
        Panel(
            "heading, °",
            _unwrapped(_over_reckoning(samples, method, which, "yaw_deg")),
            period=360.0,
        ),
    ]


STATES: Mapping[str, Callable[[pl.DataFrame, str, str], list[Panel]]] = {
    "velocity": velocity_panels,
    "position_sd": position_sd_panels,
    "depth": depth_panels,
    "attitude": attitude_panels,
}
"""Panels of samples, method and pass, by quantity."""


def _rows_of(samples: pl.DataFrame, method: str, which: str) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The rows of a method, and those of dead reckoning beside it, which may be none."""
    reckoned = pl.col("method") == DEAD_RECKONING
    beside = samples.filter(reckoned) if method != DEAD_RECKONING else samples.clear()
    return samples.filter((pl.col("method") == method) & (pl.col("pass") == which)), beside


def _over_reckoning(samples: pl.DataFrame, method: str, which: str, name: str, sd: str = "") -> list[Curve]:
    rows, floor = _rows_of(samples, method, which)
    under = [_curve(floor, DEAD_RECKONING, name)] if floor.height else []
    return [*under, _curve(rows, method, name, sd)]


def beams_panel(pings: pl.DataFrame, case: str = "") -> Panel:
    """When each beam was valid, in one case; `case` is named where several panels stand together."""
    valid = pings.select(pl.col("^beam[0-9]+_valid$")).to_numpy().astype(bool)
    return valid_panel(_times(pings), valid, title=f"beams valid, {_plain(case)}" if case else "beams valid")


def nis_panels(innovations: pl.DataFrame, method: str, least_ratio: float) -> list[Panel]:
    """NIS of each ping over its degrees, its sliding mean and the band of that; none for a method without fixes."""
    rows = innovations.filter(
        (pl.col("method") == method) & pl.col("nis").is_not_null() & (pl.col("degrees") > 0)
    )
    mean = nis_ratios(rows)
    if mean is None:
        return []
    time_ns, ratio = _times(rows), (rows["nis"] / rows["degrees"]).to_numpy()
    rejected = (rows["status"] == "rejected").to_numpy()
    curves = [
        Curve("ping", REFERENCE_COLOUR, time_ns[~rejected], ratio[~rejected], kind="dots"),
        *(
            [Curve("rejected", LOST_COLOURS[2], time_ns[rejected], ratio[rejected], kind="dots")]
            if rejected.any()
            else []
        ),
        Curve("mean of 30 pings", stroke(method).colour, *mean),
    ]
    return [
        Panel(
            "NIS over its degrees of freedom", curves, decimals=3, log=True, band=nis_band(rows, least_ratio)
        )
    ]


def current_panels(currents: pl.DataFrame | None, method: str) -> list[Panel]:
    """The current that a method estimates with ±σ; none where it estimates none."""
    rows = currents.filter(pl.col("method") == method) if currents is not None else None
    if rows is None or rows.is_empty():
        return []
    looks = {"north": (stroke(method).colour, ()), "east": (PITCH_COLOUR, (5.0, 2.0))}
    curves = [
        Curve(axis, colour, _times(rows), _floats(rows, f"{axis}_mps"), _floats(rows, f"sd_{axis}_mps"), dash)
        for axis, (colour, dash) in looks.items()
    ]
    return [Panel(f"current, {_plain(method)}, m/s", curves, decimals=3)]


def _curve(rows: pl.DataFrame, method: str, name: str, sd: str = "") -> Curve:
    return Curve(
        _plain(method), stroke(method).colour, _times(rows), _floats(rows, name),
        _floats(rows, sd) if sd else None, _dash(method),
    )  # fmt: skip


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _dash(method: str) -> tuple[float, ...]:
    """Dead reckoning alone is dashed: beside it stands one method."""
    return (6.0, 3.0) if method == DEAD_RECKONING else ()


def _unwrapped(curves: Sequence[Curve]) -> list[Curve]:
    """Angles in degrees that go on where they go around, all from the same turn."""
    going = [np.unwrap(curve.value, period=360.0) for curve in curves]
    first = going[-1][:1]
    turns = [360.0 * np.round((first - value[:1]) / 360.0) for value in going]
    return [
        replace(curve, value=value + turn) for curve, value, turn in zip(curves, going, turns, strict=True)
    ]


def _norm(rows: pl.DataFrame, name: str) -> Floats:
    return np.hypot(_floats(rows, f"{name}_north_m"), _floats(rows, f"{name}_east_m"))


def _times(rows: pl.DataFrame) -> Times:
    return rows["time_ns"].to_numpy()


def _floats(rows: pl.DataFrame, name: str) -> Floats:
    return rows[name].fill_null(np.nan).to_numpy()
