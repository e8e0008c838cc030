"""The simulated dive that ships in data/logs/survey_dive: every sensor, the DVL as PD0, and the truth.

    python tools/example_dive.py

writes the sensors' files and SHA256SUMS anew, and prints the start for the case, which is written by hand. The scenario
`survey` is flown for 23 minutes with an IMU of 20 Hz, a Workhorse of 30° and acoustic positions, lost after 3;
the readings are those of its run 0. The start has errors drawn from what the case claims of it.
"""

from __future__ import annotations

import hashlib
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import cyclopts
import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.encoders.registry import encoder
from bottomlock.files.atomic_write import write_bytes, write_parquet, write_text
from bottomlock.instruments.faults import Faults
from bottomlock.instruments.schedule import POWERED_S, records
from bottomlock.instruments.sources import readings_of_scenario, with_geometry
from bottomlock.io import pd0
from bottomlock.io.beam_table import write_recording
from bottomlock.plant.flight import euler_rad
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams

FOLDER = Path(__file__).resolve().parent.parent / "data" / "logs" / "survey_dive"
GEOMETRY = "teledyne_30"
START_NS = 1_767_225_600_000_000_000
"""2026-01-01, UTC: the instruments' clock at the start of the run."""
DURATION_S = 1380.0
LOST_FROM_S = 180.0
"""No acoustic positions from then on."""
START_AT_S, START_SEED = 10.0, 2017
START_SD = {"level_deg": 0.02, "heading_deg": 0.1, "position_m": 2.0, "velocity_mps": 0.02}
"""What the case claims of its start, as the scenario does; seed and claims were fixed before the first replay."""
OMEGA_STEP_RADPS, FORCE_STEP_MPS2 = 2.0**-20, 2.0**-14
"""Steps of the inertial readings: a seventh of the noise of a sample (6.5e-6 rad/s, 3.7e-4 m/s²)."""


def scenario() -> Scenario:
    """The survey, shorter, with acoustic positions and a slower IMU."""
    content = load_scenario("survey").model_dump(exclude_unset=True)
    content["name"] = "survey_dive"
    content["trajectory"]["duration_s"] = DURATION_S
    content["imu"]["rate_hz"] = 20.0
    content["acoustic_position"] = {"rate_hz": 0.1, "noise_m": 1.0, "noise_percent_of_range": 0.0}
    return with_geometry(Scenario.model_validate(content), GEOMETRY)


def _counted(name: str, step: float) -> pl.Expr:
    """A column in whole steps, single precision."""
    return ((pl.col(name) / step).round() * step).cast(pl.Float32)


def made(folder: Path, flown: Scenario) -> list[str]:
    """Writes the sensors' files of a scenario into a folder; their names."""
    simulation = build_simulation(flown)
    truth = simulation.truth()
    streams = sensor_streams(simulation, truth)
    readings = readings_of_scenario(flown)
    offset = START_NS - readings.first_ns
    powered_ns = START_NS - round(POWERED_S * 1e9)
    writer = encoder("pd0", readings.geometry, start_ns=powered_ns)
    sent = b"".join(one.data for one in records(readings, writer, Faults(), seed=0, offset_ns=offset))
    write_bytes(folder / "dvl.pd0", sent)
    with tempfile.TemporaryDirectory() as scratch:
        table = Path(scratch) / "beams.parquet"
        write_recording(pd0.FORMAT.read(sent, "dvl.pd0"), table, source=folder / "dvl.pd0")
        write_parquet(folder / "beams.parquet", pl.read_parquet(table))
    at = (pl.col("time_ns") + offset).alias("time_ns")
    counts = [_counted(f"omega_{axis}_radps", OMEGA_STEP_RADPS) for axis in "xyz"]
    counts += [_counted(f"force_{axis}_mps2", FORCE_STEP_MPS2) for axis in "xyz"]
    write_parquet(folder / "imu.parquet", streams["imu"].select(at, *counts))
    depth = streams["depth"].select(at, pl.col("depth_m").round(3))
    write_text(folder / "depth.csv", depth.write_csv())
    titles = {"roll": "roll_deg", "pitch": "pitch_deg", "yaw": "heading_deg"}
    angles = [pl.col(f"{name}_rad").degrees().round(2).alias(title) for name, title in titles.items()]
    write_text(folder / "compass.csv", streams["attitude"].select(at, *angles).write_csv())
    north, east, down = (pl.col(f"position_{axis}_m").round(2) for axis in ("north", "east", "down"))
    elapsed_s = (pl.col("time_ns") - pl.col("time_ns").first()) * 1e-9
    heard = streams["acoustic_position"].filter(elapsed_s < LOST_FROM_S)
    fixes = heard.select(at, north.alias("north_m"), east.alias("east_m"), down.alias("down_m"))
    write_text(folder / "usbl.csv", fixes.write_csv())
    every = np.flatnonzero(truth.time_ns % 1_000_000_000 == truth.time_ns[0] % 1_000_000_000)
    columns = {"time_ns": truth.time_ns[every] + offset}
    columns |= dict(zip(("north_m", "east_m", "down_m"), truth.position_t_m[every].T.round(4), strict=True))
    body = truth.velocity_p_mps[every].T.round(5)
    columns |= dict(zip(("surge_mps", "sway_mps", "heave_mps"), body, strict=True))
    turned = euler_rad(truth.attitude_t_p[every]).T.round(6)
    columns |= dict(zip(("roll_rad", "pitch_rad", "yaw_rad"), turned, strict=True))
    write_text(folder / "truth.csv", pl.DataFrame(columns).write_csv())
    return ["beams.parquet", "compass.csv", "depth.csv", "dvl.pd0", "imu.parquet", "truth.csv", "usbl.csv"]


def start(reference: pl.DataFrame) -> dict[str, float | list[float]]:
    """Keys of the case's `[start]`: the reference at the start and errors drawn from the claims.

    Args:
        reference: the table of truth.csv.
    """
    row = reference.row(round(START_AT_S), named=True)
    random = np.random.default_rng(START_SEED)

    def drawn(names: tuple[str, ...], claim: str, digits: int, factor: float = 1.0) -> list[float]:
        values = [row[name] * factor + random.normal(0.0, START_SD[claim]) for name in names]
        return [round(float(value), digits) for value in values]

    level = drawn(("roll_rad", "pitch_rad"), "level_deg", 3, 180.0 / np.pi)
    (heading,) = drawn(("yaw_rad",), "heading_deg", 3, 180.0 / np.pi)
    return {
        "roll_deg": level[0],
        "pitch_deg": level[1],
        "heading_deg": heading,
        "position_m": drawn(("north_m", "east_m", "down_m"), "position_m", 2),
        "velocity_mps": drawn(("surge_mps", "sway_mps", "heave_mps"), "velocity_mps", 3),
    }


def main(*, folder: Annotated[Path, cyclopts.Parameter("--out")] = FOLDER) -> None:
    """Writes the simulated dive that ships in data/logs/survey_dive."""
    # The case and the licence are written by hand, and stand in the list where they are.
    by_hand = [name for name in ("LICENSE", "case.toml") if (folder / name).exists()]
    names = sorted([*by_hand, *made(folder, scenario())])
    lines = [f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n" for name in names]
    write_text(folder / "SHA256SUMS", "".join(lines))
    for key, value in start(pl.read_csv(folder / "truth.csv")).items():
        print(f"{key} = {value}")


if __name__ == "__main__":
    cyclopts.run(main)
