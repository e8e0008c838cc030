"""Tables of docs/recorded.md about dives as their users hold them: `python -m tools.recorded_dive_tables [DATA]`.

The files of a dive (`tools/recorded_dives.py`) go through `bottomlock replay --init` and `bottomlock replay`, with no
key written by hand; beams are then hidden by what-if cases. Writes the tables into the page, and changes nothing else.
"""

import sys
import tempfile
from pathlib import Path

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
from tools.score_recorded import PAGE, replaced

METHODS = ("tc", "weak_sway", "sway_current", "consistent")
DEAD_RECKONING = "dead_reckoning"
OUTAGES_S = (60.0, 300.0)
OUTAGE_FROM_S = 600.0
WINDOWS_S = (60.0, 300.0)
PINGS = (1, 4, 16, 64, 128)


def stpere_case(data: Path, folder: Path) -> Case:
    """The case of St Pere as `replay --init` writes it, with its what-if cases."""
    recorded_dives.stpere(data, folder / "stpere")
    files = [folder / "stpere" / f"{name}.csv" for name in ("imu", "ahrs", "dvl", "gps")]
    case = load_case(make_case(files, folder / "case.toml").case)
    what_if = (
        WhatIf(name="beam_3_lost", beams_lost=(3,)),
        WhatIf(name="beams_2_and_3_lost", beams_lost=(2, 3)),
        *(
            WhatIf(
                name=f"no_bottom_for_{length_s:.0f}_s",
                outages=(Outage(beams=(1, 2, 3), from_s=OUTAGE_FROM_S, to_s=OUTAGE_FROM_S + length_s),),
            )
            for length_s in OUTAGES_S
        ),
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
        score_no_imu.summary(score_no_imu.windows(case, streams, window_s, all_beams))
        for window_s in WINDOWS_S
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
    return table(("Method", *(f"{window_s:.0f} s" for window_s in WINDOWS_S)), rows)


def dive_tables(data: Path) -> dict[str, str]:
    """The tables by their marks."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return {
            "stpere": stpere_table(replay_case(stpere_case(data, folder))),
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
