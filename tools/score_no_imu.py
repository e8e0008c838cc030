"""Scores navigation without inertial readings: `python tools/score_no_imu.py TABLES [--window 60 300] [--methods tc]`.

TABLES is the folder that `tools/recorded_dives.py` writes. All beams are hidden in windows of so many seconds, and the
displacement of each method over the window is compared with that of the hidden velocities, turned by the same attitude.
Errors of attitude, scale and position are common to both and are left out of what the filter claims. Prints for each
recording, window and method the median, the 90th percentile and the RMS of the horizontal error, and RMS error over RMS
sigma; `held` is the last velocity held along the vehicle's axes.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.config.scenario_sections import Outage
from bottomlock.dead_reckoning.track import attitude_between
from bottomlock.kernel.attitude_motion import held
from bottomlock.replay.attitude_inertial import complete_pings
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.dvl_sections import WhatIf
from bottomlock.replay.reading import read_streams
from bottomlock.replay.run import replay_case
from bottomlock.replay.streams import Streams

Floats = NDArray[np.float64]
OFFSETS = 3
"""Replays for a window, each with other times of its outages."""
SETTLED_S = 120.0
"""Time with beams between two outages."""
LONGEST_GAP_S = 20.0
"""Windows with a longer gap between hidden pings have no truth."""

GEOMETRY = """configuration = "angles"
tilts_deg = {tilts}
azimuths_deg = {azimuths}
mounting_yaw_deg = {yaw}
beam_noise_mps = {noise}
[columns]
time = "time"
time_unit = "s"
velocity = {beams}
lost_when_empty = true
range = {ranges}
"""
CASE = """name = "{name}"
[origin]
latitude_deg = {latitude}
[imu]
source = "attitude"
bridge_gaps_s = 1000.0
[dvl]
file = "{folder}/dvl_beams.csv"
geometry = "dvl.toml"
clock = {{ column = "time" }}
errors = {{ beam_bias_mps = 0.0, beam_bias_walk_mps_per_rt_s = 0.0, scale_factor_percent = 0.0, \
scale_factor_walk_percent_per_rt_s = 0.0 }}
[attitude]
file = "{folder}/{attitude}.csv"
clock = {{ column = "time", unordered = "drop" }}
roll = "roll"
pitch = "pitch"
yaw = "{heading}"
unit = "deg"
roll_pitch_sd_deg = 0.01
yaw_sd_deg = 0.01
{water}[start]
at_s = {at_s}
level = "attitude"
heading = "attitude"
velocity = "beams"
position_sd_m = [0.1, 0.1, 0.1]
[replay]
smooth = false
"""
RECORDINGS: dict[str, dict[str, Any]] = {
    "glider": {
        "latitude": 41.55, "attitude": "attitude", "heading": "heading", "at_s": 4190.0, "tilts": [30.0] * 4,
        "azimuths": [45.0, 225.0, 315.0, 135.0], "yaw": 0.0, "noise": 0.02,
    },
    "stpere": {
        "latitude": 42.2, "attitude": "ahrs", "heading": "yaw", "at_s": 5.0, "tilts": [25.0] * 3,
        "azimuths": [0.0, 120.0, 240.0], "yaw": 70.2, "noise": 0.07,
    },
}  # fmt: skip
"""Facts of the recordings; the noise of a beam is that of complete pings one after the other."""


def case_of(name: str, tables: Path, methods: tuple[str, ...], water: str = "") -> Case:
    """The case of a recording; `water` is the section of its water track as text."""
    facts = RECORDINGS[name]
    beams = [f"beam{k + 1}_mps" for k in range(len(facts["tilts"]))]
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(tables).parent / f"{name}_dvl.toml"
        ranges = [f"beam{k + 1}_range_m" for k in range(len(beams))]
        kept.write_text(
            GEOMETRY.format(beams=beams, ranges=ranges, **facts).replace("'", '"'), encoding="utf-8"
        )
        path = Path(folder) / "case.toml"
        path.write_text(CASE.format(name=name, folder=tables, water=water, **facts), encoding="utf-8")
        case = load_case(path)
    return case.model_copy(
        update={
            "dvl": case.dvl.model_copy(update={"geometry": str(kept)}),
            "replay": case.replay.model_copy(update={"methods": methods}),
        }
    )


def outages(window_s: float, offset_s: float, length_s: float) -> list[tuple[float, float]]:
    """Begin and end of the windows, s from the start."""
    begins = np.arange(SETTLED_S + offset_s, length_s - window_s, window_s + SETTLED_S)
    return [(float(begin), float(begin + window_s)) for begin in begins]


def true_displacement(streams: Streams, begin_ns: int, end_ns: int) -> Floats | None:
    """(3,) way of the hidden pings in the tangent frame, m; None where they have a gap."""
    time_ns, velocity = complete_pings(streams, streams.beams)
    rows = np.flatnonzero((time_ns > begin_ns) & (time_ns < end_ns))
    if rows.size < 2 or rows[0] == 0 or rows[-1] == len(time_ns) - 1:
        return None
    rows = np.arange(rows[0] - 1, rows[-1] + 2)
    if np.diff(time_ns[rows]).max() > LONGEST_GAP_S * 1e9:
        return None
    grid = np.arange(begin_ns, end_ns + 1, 100_000_000)
    seconds = (time_ns[rows] - begin_ns) * 1e-9
    along = np.stack(
        [np.interp((grid - begin_ns) * 1e-9, seconds, velocity[rows, k]) for k in range(3)], axis=1
    )
    assert streams.attitudes is not None
    return np.asarray(np.trapezoid(attitude_between(streams.attitudes)(grid).apply(along), dx=0.1, axis=0))


def held_displacement(streams: Streams, begin_ns: int, end_ns: int) -> Floats:
    """(3,) way of the last velocity held along the vehicle's axes."""
    grid = np.arange(begin_ns, end_ns + 1, 100_000_000)
    last = held(grid[:1], *complete_pings(streams, streams.beams))
    assert streams.attitudes is not None
    turned = attitude_between(streams.attitudes)(grid).apply(np.repeat(last, len(grid), axis=0))
    return np.asarray(np.trapezoid(turned, dx=0.1, axis=0))


def windows(case: Case, streams: Streams, window_s: float, lost: tuple[int, ...]) -> pl.DataFrame:
    """A row for each window and method: horizontal error and claimed sigma of the way, m."""
    length_s = float(streams.attitudes.time_ns[-1] - streams.attitudes.time_ns[0]) * 1e-9  # type: ignore[union-attr]
    start_s = case.start.at_s or 0.0
    rows = []
    for k in range(OFFSETS):
        spans = outages(window_s, k * (window_s + SETTLED_S) / OFFSETS, length_s - start_s)
        hidden = WhatIf(name="hidden", outages=tuple(Outage(beams=lost, from_s=a, to_s=b) for a, b in spans))
        result = replay_case(case.model_copy(update={"what_if": (hidden,)}), streams=streams)
        samples = result.samples.filter((pl.col("what_if") == "hidden") & (pl.col("pass") == "forward"))
        first_ns = int(samples["time_ns"].min())  # type: ignore[arg-type]
        for begin_s, end_s in spans:
            rows += _window(streams, samples, first_ns + round(begin_s * 1e9), first_ns + round(end_s * 1e9))
    return pl.DataFrame(rows)


def _window(streams: Streams, samples: pl.DataFrame, begin_ns: int, end_ns: int) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    truth = None
    for (method,), frame in samples.group_by("method", maintain_order=True):
        time_ns = frame["time_ns"].to_numpy()
        ends = np.searchsorted(time_ns, [begin_ns, end_ns]).clip(0, len(time_ns) - 1)
        truth = true_displacement(streams, int(time_ns[ends[0]]), int(time_ns[ends[1]]))
        if truth is None:
            return []
        place = frame.select("north_m", "east_m").to_numpy()[ends]
        sd = frame.select("sd_position_north_m", "sd_position_east_m").to_numpy()[ends]
        error = place[1] - place[0] - truth[:2]
        claimed = float((sd[1] ** 2 - sd[0] ** 2).sum())
        found.append({"method": method, "error_m": float(np.hypot(*error)), "claimed_m2": claimed})
    if truth is None:
        return []
    way = held_displacement(streams, int(time_ns[ends[0]]), int(time_ns[ends[1]]))
    return [*found, {"method": "held", "error_m": float(np.hypot(*(way - truth)[:2])), "claimed_m2": None}]


def summary(rows: pl.DataFrame) -> pl.DataFrame:
    """A row for each method: number of windows, errors, and RMS error over RMS sigma."""
    return rows.group_by("method", maintain_order=True).agg(
        windows=pl.len(),
        median_m=pl.col("error_m").median(),
        p90_m=pl.col("error_m").quantile(0.9),
        rms_m=(pl.col("error_m") ** 2).mean().sqrt(),
        error_over_sigma=((pl.col("error_m") ** 2).sum() / pl.col("claimed_m2").sum()).sqrt(),
    )


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tables", type=Path)
    parser.add_argument("--window", type=float, nargs="+", default=[60.0, 300.0])
    parser.add_argument("--methods", nargs="+", default=["tc", "weak_sway", "sway_current", "consistent"])
    parser.add_argument("--recordings", nargs="+", default=list(RECORDINGS))
    parser.add_argument(
        "--lost", type=int, nargs="*", default=None, help="beams that are hidden; default all"
    )
    parser.add_argument("--water", default="", help="keys of [water_track], for instance 'cells = [1, 2]'")
    asked = parser.parse_args()
    water = f"[water_track]\n{asked.water}\n" if asked.water else ""
    for name in asked.recordings:
        case = case_of(name, (asked.tables / name).resolve(), tuple(asked.methods), water)
        streams = read_streams(case)
        lost = tuple(asked.lost or range(1, streams.beams.valid.shape[1] + 1))
        print(*streams.notes, sep="\n")
        for window_s in asked.window:
            print(f"{name}, {window_s:g} s, beams hidden: {lost}")
            with pl.Config(tbl_hide_dataframe_shape=True, tbl_hide_column_data_types=True, float_precision=2):
                print(summary(windows(case, streams, window_s, lost)))


if __name__ == "__main__":
    main()
