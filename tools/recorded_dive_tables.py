"""Tables of docs/recorded.md about dives as their users hold them: `python -m tools.recorded_dive_tables [DATA]`.

The files of a dive (`tools/recorded_dives.py`) go through `bottomlock replay --init` and `bottomlock replay`, with no
key written by hand; beams are then hidden by what-if cases. Writes the tables into the page, and changes nothing else.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import polars as pl

from bottomlock.config.scenario_sections import Outage
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.dvl_sections import WhatIf
from bottomlock.replay.init.make import make_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.run import ReplayResult, replay_case
from bottomlock.tables.replay import FORWARD
from tools import recorded_dives, score_no_imu
from tools.recorded_tables import code, number, table, words
from tools.score_no_imu import OFFSETS, SETTLED_S, outages
from tools.score_recorded import PAGE, replaced

METHODS = ("tc", "weak_sway", "sway_current", "consistent")
DEAD_RECKONING = "dead_reckoning"
WINDOWS: tuple[tuple[float, tuple[int, ...]], ...] = (
    (60.0, (1, 2, 3)),
    (300.0, (1, 2, 3)),
    (300.0, (2, 3)),
    (300.0, (3,)),
)
"""Windows of St Pere, s, and the beams that are lost in them."""
HIDDEN = ((60.0, ()), (300.0, ()), (60.0, (1,)), (300.0, (1,)), (60.0, (1, 2)), (300.0, (1, 2)))
"""Windows of the glider, s, and the beams that are lost in them; every beam where none is named."""
PINGS = (1, 4, 16, 64, 128)
SECTIONS_S = (100.0, 300.0)
STPERE_TABLES = ("imu", "ahrs", "dvl", "gps")


def stpere_case(data: Path, folder: Path) -> Case:
    """The case of St Pere as `replay --init` writes it, with its what-if cases."""
    recorded_dives.stpere(data, folder / "stpere")
    files = [folder / "stpere" / f"{name}.csv" for name in STPERE_TABLES]
    case = load_case(make_case(files, folder / "case.toml").case)
    what_if = (
        WhatIf(name="beam_3_lost", beams_lost=(3,)),
        WhatIf(name="beams_2_and_3_lost", beams_lost=(2, 3)),
    )
    settings = case.replay.model_copy(update={"methods": METHODS, "smooth": False})
    return case.model_copy(update={"what_if": what_if, "replay": settings})


def horizontal(samples: pl.DataFrame) -> pl.DataFrame:
    """Horizontal position of each method against the reference: end, RMS, RMS of the claimed sigma."""
    north, east = (pl.col(f"err_position_{axis}_m") for axis in ("north", "east"))
    squared = north**2 + east**2
    claimed = pl.col("sd_position_north_m") ** 2 + pl.col("sd_position_east_m") ** 2
    known = samples.filter((pl.col("pass") == FORWARD) & north.is_not_null())
    return known.group_by("what_if", "method", maintain_order=True).agg(
        end_m=squared.last().sqrt(),
        rms_m=squared.mean().sqrt(),
        sd_m=claimed.mean().sqrt(),
        error_over_sigma=(squared.mean() / claimed.mean()).sqrt(),
    )


def stpere_table(result: ReplayResult) -> str:
    """End / RMS / error over sigma for each what-if case and method."""
    scores = horizontal(result.samples)
    methods = (*METHODS, DEAD_RECKONING)
    rows = []
    for what_if in scores["what_if"].unique(maintain_order=True):
        cells = []
        for method in methods:
            one = scores.filter((pl.col("what_if") == what_if) & (pl.col("method") == method)).row(
                0, named=True
            )
            cells.append(" / ".join(number(one[key], 2) for key in ("end_m", "rms_m", "error_over_sigma")))
        rows.append((words(what_if), *cells))
    return table(("Beams", *(code(method) for method in methods)), rows)


def stpere_windows(case: Case, window_s: float, lost: tuple[int, ...]) -> pl.DataFrame:
    """A row for each window without these beams and method: change of the horizontal error, its claimed variance."""
    streams = read_streams(case)
    length_s = float(streams.inertial.time_ns[-1] - streams.inertial.time_ns[0]) * 1e-9
    spans = {
        f"hidden_{k}": outages(window_s, k * (window_s + SETTLED_S) / OFFSETS, length_s)
        for k in range(OFFSETS)
    }
    what_if = tuple(
        WhatIf(name=name, outages=tuple(Outage(beams=lost, from_s=a, to_s=b) for a, b in hidden))
        for name, hidden in spans.items()
    )
    samples = replay_case(case.model_copy(update={"what_if": what_if}), streams=streams).samples
    known = samples.filter(pl.col("pass") == FORWARD, pl.col("err_position_north_m").is_not_null())
    first_ns = int(samples["time_ns"].to_numpy().min())
    rows = []
    for (what_if_name, method), frame in known.group_by("what_if", "method", maintain_order=True):
        time_ns = frame["time_ns"].to_numpy()
        error = frame.select("err_position_north_m", "err_position_east_m").to_numpy()
        variance = (frame.select("sd_position_north_m", "sd_position_east_m").to_numpy() ** 2).sum(axis=1)
        for span in spans.get(str(what_if_name), ()):
            begin, end = np.searchsorted(time_ns, [first_ns + round(at_s * 1e9) for at_s in span])
            if end == len(time_ns):
                continue
            change = float(np.hypot(*(error[end] - error[begin])))
            rows.append((str(method), change, float(variance[end] - variance[begin])))
    return pl.DataFrame(rows, schema=["method", "error_m", "claimed_m2"], orient="row")


def windows_table(windows: dict[tuple[float, tuple[int, ...]], pl.DataFrame]) -> str:
    """Median / 90th percentile / error over sigma by length of the windows, lost beams and method."""
    methods = (*METHODS, DEAD_RECKONING)
    rows = []
    for (window_s, lost), scored in windows.items():
        scores = score_no_imu.summary(scored)
        cells = []
        for method in methods:
            one = scores.row(by_predicate=pl.col("method") == method, named=True)
            cells.append(" / ".join(number(one[key], 2) for key in ("median_m", "p90_m", "error_over_sigma")))
        left = ("no bottom", "1 beam", "2 beams")[3 - len(lost)]
        rows.append((f"{one['windows']} of {window_s:.0f} s, {left}", *cells))
    return table(("Windows", *(code(method) for method in methods)), rows)


def stpere_sections(data: Path, folder: Path, length_s: float) -> pl.DataFrame:
    """A row for each section of so many seconds and method: each section alone goes through `--init` and `replay`."""
    recorded_dives.stpere(data, folder / "stpere")
    whole = {name: pl.read_csv(folder / "stpere" / f"{name}.csv") for name in STPERE_TABLES}
    ends = np.array([frame["time"].to_numpy()[[0, -1]] for frame in whole.values()])
    first_s, last_s = float(ends[:, 0].max()), float(ends[:, 1].min())
    rows = []
    for k in range(int((last_s - first_s) / length_s)):
        section = folder / f"section_{length_s:.0f}_{k}"
        section.mkdir()
        inside = pl.col("time").is_between(first_s + k * length_s, first_s + (k + 1) * length_s)
        for name, frame in whole.items():
            frame.filter(inside).write_csv(section / f"{name}.csv")
        files = [section / f"{name}.csv" for name in STPERE_TABLES]
        case = load_case(make_case(files, section / "case.toml").case).with_overrides(methods=list(METHODS))
        scores = horizontal(replay_case(case).samples).with_columns(section=pl.lit(k))
        floor = scores.filter(pl.col("method") == DEAD_RECKONING)["rms_m"].item()
        rows.append(scores.with_columns(of_floor=pl.col("rms_m") / floor))
    return pl.concat(rows)


def sections_table(sections: dict[float, pl.DataFrame]) -> str:
    """RMS, error over sigma, and the ratio to dead reckoning by length of the sections and method."""
    rows = []
    for length_s, scores in sections.items():
        cells = []
        for method in (*METHODS, DEAD_RECKONING):
            one = scores.filter(pl.col("method") == method)
            error, claimed, ratio = one.select("rms_m", "sd_m", "of_floor").to_numpy().T
            rms, claim = (float(np.sqrt(np.mean(column**2))) for column in (error, claimed))
            scored = (rms, rms / claim, float(np.median(ratio)), float(ratio.max()))
            cells.append(" / ".join(number(value, 2) for value in scored))
        rows.append((f"{scores['section'].n_unique()} of {length_s:.0f} s", *cells))
    return table(("Sections", *(code(method) for method in (*METHODS, DEAD_RECKONING))), rows)


def noise_table(folder: Path) -> str:
    """Allan deviation of the level and vertical velocity of the pings times the root of their number, m/s."""
    pings = pl.read_csv(folder / "stpere" / "dvl.csv").drop_nulls().select("vy", "vz")
    rows = []
    for count in PINGS:
        means = pings.group_by(pl.int_range(pl.len()) // count, maintain_order=True).mean()
        deviation = means.select((pl.col("vy", "vz").diff() ** 2).mean().sqrt() * (count / 2.0) ** 0.5).row(0)
        rows.append((str(count), *(number(value, 2) for value in deviation)))
    return table(("Pings averaged", "sway", "heave"), rows)


def glider_table(data: Path, folder: Path) -> str:
    """Hidden bottom: median and 90th percentile of the horizontal error, error over sigma, by window and method."""
    tables = folder / "glider"
    recorded_dives.glider(data, tables)
    case = score_no_imu.case_of("glider", tables, METHODS)
    streams = read_streams(case)
    all_beams = tuple(range(1, streams.instrument.geometry.beams + 1))
    summaries = [
        score_no_imu.summary(score_no_imu.windows(case, streams, window_s, lost or all_beams))
        for window_s, lost in HIDDEN
    ]
    rows = []
    for method in (*METHODS, DEAD_RECKONING, "held"):
        cells = []
        for summary in summaries:
            found = summary.filter(pl.col("method") == method)
            if found.height == 0:
                cells.append("–")
                continue
            one = found.row(0, named=True)
            cells.append(" / ".join(number(one[key], 2) for key in ("median_m", "p90_m", "error_over_sigma")))
        rows.append((code(method), *cells))
    heads = (f"{window_s:.0f} s" + (f", {4 - len(lost)} beams" if lost else "") for window_s, lost in HIDDEN)
    return table(("Method", *heads), rows)


def dive_tables(data: Path) -> dict[str, str]:
    """The tables by their marks."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stpere = stpere_case(data, folder)
        return {
            "stpere": stpere_table(replay_case(stpere)),
            "stpere-windows": windows_table({one: stpere_windows(stpere, *one) for one in WINDOWS}),
            "stpere-sections": sections_table(
                {length_s: stpere_sections(data, folder, length_s) for length_s in SECTIONS_S}
            ),
            "stpere-noise": noise_table(folder),
            "glider": glider_table(data, folder),
        }


def main() -> None:
    """Writes the tables into the page."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else recorded_dives.recordings()
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(replaced(page, dive_tables(data)), encoding="utf-8")
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
