"""Mounting and clock of the DVL as states on the recorded sections of A-KIT, as stated and with a mistake put in.

    python -m tools.calibration_recorded [FOLDER]    writes the table into docs/recorded.md
    python -m tools.calibration_recorded --check     compares instead

`FOLDER` has the recordings; by default the environment variable BOTTOMLOCK_RECORDINGS names it.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from bottomlock.config.calibration import CalibrationSection
from bottomlock.replay import compare
from bottomlock.replay.calibration import calibration_table
from bottomlock.replay.case import Case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import noise_residuals, prepare, run_methods
from bottomlock.statistics.replay import runs_table
from bottomlock.tables.replay import RECORDED
from tools.akit import SECTIONS
from tools.recorded_runs import World, section_case
from tools.recorded_tables import code, number, table
from tools.score_recorded import PAGE, marked, recordings, replaced, same_numbers

DRAWS = 5
PRIOR = CalibrationSection(mounting_sd_deg=(1.0, 1.0, 1.0), clock_sd_s=0.2)
"""Of an installation by eye and a host's stamps; fixed before the first run."""


@dataclass(frozen=True)
class Mistake:
    """What a case states that is wrong.

    Attributes:
        words: of it.
        yaw_deg, pitch_deg: added to the mounting.
        late_s: added to the stamps.
    """

    words: str
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    late_s: float = 0.0


MISTAKES = (
    Mistake("as stated"),
    Mistake("yaw + 1°", yaw_deg=1.0),
    Mistake("pitch + 1°", pitch_deg=1.0),
    Mistake("stamps + 0.2 s", late_s=0.2),
)


def mistaken(case: Case, mistake: Mistake, folder: Path) -> Case:
    """A case with a mistake; its DVL's file is written to `folder`."""
    text = Path(case.dvl.geometry).read_text(encoding="utf-8")
    text = text.replace("mounting_yaw_deg = -0.15", f"mounting_yaw_deg = {-0.15 + mistake.yaw_deg}")
    text = text.replace("mounting_pitch_deg = -0.07", f"mounting_pitch_deg = {-0.07 + mistake.pitch_deg}")
    geometry = folder / "mistaken.toml"
    geometry.write_text(text, encoding="utf-8")
    offset_s = case.dvl.clock.offset_s + mistake.late_s
    clock = case.dvl.clock.model_copy(update={"offset_s": offset_s})
    return case.model_copy(
        update={"dvl": case.dvl.model_copy(update={"geometry": str(geometry), "clock": clock})}
    )


def flown(case: Case) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The tables of runs and of calibrations of a case."""
    streams, residuals = read_streams(case), noise_residuals(case)
    parts: dict[str, list[pl.DataFrame]] = {
        name: [] for name in ("samples", "innovations", "pings", "imu", "own")
    }
    start_ns = 0
    for run in range(case.replay.runs):
        prepared = prepare(case, streams, run, residuals)
        result, start_ns = run_methods(case, prepared, None), prepared.alignment.time_ns
        parts["samples"].append(compare.samples_table(case, RECORDED, result))
        parts["innovations"].append(compare.innovations_table(case, RECORDED, result))
        parts["pings"].append(compare.pings_table(case, RECORDED, result))
        parts["imu"].append(compare.imu_faults_table(case, RECORDED, result))
        parts["own"].append(calibration_table(case, RECORDED, result))
    samples, innovations, pings, imu, own = (pl.concat(part) for part in parts.values())
    return runs_table(samples, innovations, pings, imu, compare.path_table(streams), start_ns), own


def sections(data: Path, mistake: Mistake, *, states: bool) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The tables of every section with a mistake, with or without the states."""
    world = World("calibration", asks=(), methods=("ins", "tc"))
    made = []
    with tempfile.TemporaryDirectory() as folder:
        for section in SECTIONS:
            case = mistaken(section_case(data, Path(folder), world, section, DRAWS), mistake, Path(folder))
            made.append(flown(case.model_copy(update={"calibration": PRIOR}) if states else case))
    return pl.concat([runs for runs, _ in made]), pl.concat([own for _, own in made])


def rows(data: Path) -> Iterator[list[str]]:
    """A row per mistake, without and with the states."""
    for mistake in MISTAKES:
        for states in (False, True):
            runs, found = sections(data, mistake, states=states)
            aided, alone = (runs.filter(pl.col("method") == method) for method in ("tc", "ins"))

            def median(frame: pl.DataFrame, name: str) -> str:
                return number(float(np.median(frame[name].to_numpy())))

            found = found.filter(pl.col("method") == "tc")
            yield [
                mistake.words,
                "yes" if states else "no",
                median(alone, "attitude_rms_over_time_deg"),
                median(aided, "attitude_rms_over_time_deg"),
                median(aided, "attitude_normalised_rms_over_time"),
                median(aided, "velocity_rms_over_time_mps"),
                median(aided, "velocity_normalised_rms_over_time"),
                median(aided, "position_final_percent"),
                *(_estimate(found, name) for name in ("mounting_right", "mounting_down", "clock_offset")),
            ]


def _estimate(found: pl.DataFrame, name: str) -> str:
    one = found.filter(pl.col("parameter") == name)
    if not one.height:
        return "–"
    value, sd = (float(np.median(one[column].to_numpy())) for column in ("value", "sd"))
    return f"{value:+.2f} ± {sd:.2f}"


def recorded_table(data: Path) -> str:
    """The table, in Markdown."""
    head = [
        "DVL", "states", "attitude RMS, °: INS", "TC", "error/σ", "velocity RMS, m/s", "error/σ", "end, % DT",
        "found: pitch, °", "yaw, °", "clock, s",
    ]  # fmt: skip
    made = []
    for row in rows(data):
        print(" | ".join(row), flush=True)
        made.append(row)
    words = (
        f"{DRAWS * len(SECTIONS)} runs a row, medians; {code('tc')}, every beam; beforehand ± 1° and ± 0.2 s."
    )
    return f"{words}\n\n{table(head, made, left=2)}"


def main() -> None:
    """Writes the table into the page, or compares it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="?", type=Path, default=recordings())
    parser.add_argument("--check", action="store_true")
    asked = parser.parse_args()
    tables, page = {"calibration": recorded_table(asked.data)}, PAGE.read_text(encoding="utf-8")
    if asked.check:
        there = marked(page, "calibration").group(2).strip()
        sys.exit(0 if same_numbers(there, tables["calibration"].strip()) else "the table has changed")
    PAGE.write_text(replaced(page, tables), encoding="utf-8")


if __name__ == "__main__":
    main()
