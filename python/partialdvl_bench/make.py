"""Makes the missions: readings, a case file that `bottomlock replay` reads as well, the truth, and their digests."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

import bottomlock
from bottomlock import DataError, OutputError, Scenario, Simulation, Truth, sensor_streams
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Files, Result
from bottomlock.files.records import read_record, read_recorded
from bottomlock.files.table_file import read_parquet
from bottomlock.plant.telemetry import euler_rad
from partialdvl_bench.beam_errors import with_errors
from partialdvl_bench.case_text import case_text, instrument_text
from partialdvl_bench.digests import digest, rounded
from partialdvl_bench.mission_list import MissionSpec, levels
from partialdvl_bench.seeds import stream
from partialdvl_bench.slip import drawn_slip, slipping
from partialdvl_bench.worlds import simulation_of

TRUTH, RECORD, CASE, INSTRUMENT = "truth.parquet", "mission.record.json", "case.toml", "dvl.toml"
SEALED = "sealed"
"""Folder of the truths of the test split, beside `train`, `validation` and `test`."""

AXES = ("north", "east", "down")

_PLANE = 'earth = "tangent_plane"\n'


@dataclass(frozen=True, eq=False)
class MadeMission:
    """A mission as it is written: tables of its readings by name, its case and instrument files, and its truth."""

    spec: MissionSpec
    tables: dict[str, pl.DataFrame]
    case: str
    instrument: str
    truth: pl.DataFrame

    def digests(self) -> dict[str, str]:
        """Digests of what an estimator receives and of the truth.

        The case states its plane Earth since there is another; the mission is the same.
        """
        case = self.case.split("\n[reference]")[0].replace(_PLANE, "")
        return {
            "data": digest(self.tables, case + self.instrument),
            "truth": digest({"truth": self.truth}),
        }


def make_mission(spec: MissionSpec, seed: int) -> MadeMission:
    """Simulates a mission; the same seed gives the same mission.

    Raises:
        ScenarioError: where the seed draws a current against which the vehicle cannot swim.
    """
    simulation = simulation_of(spec, seed)
    truth = _truth(spec, seed, simulation)
    streams = sensor_streams(simulation, truth)
    axes = [
        f"{what}_{axis}_{unit}" for what, unit in (("omega", "radps"), ("force", "mps2")) for axis in "xyz"
    ]
    heading = streams["heading"].select("time_ns", pl.col("heading_rad").alias("yaw_rad"))
    tables = {
        # Steps of 2⁻²² rad/s and 2⁻¹⁶ m/s² are exact in single precision up to 4 rad/s and 256 m/s².
        "imu": rounded(streams["imu"]).with_columns(pl.col(axes).cast(pl.Float32)),
        "beams": rounded(_beams(spec, seed, simulation, streams["beams"])),
        "depth": rounded(streams["depth"]),
        "heading": rounded(heading.with_columns(roll_rad=pl.lit(0.0), pitch_rad=pl.lit(0.0))),
    }
    if spec.water:
        tables["water"] = rounded(streams["beams_water"])
    start = _start(spec, seed, simulation.scenario, truth)
    return MadeMission(
        spec=spec,
        tables=tables,
        case=case_text(spec, simulation, start, reference=spec.split != "test"),
        instrument=instrument_text(spec),
        truth=rounded(truth_table(simulation, truth)),
    )


def _truth(spec: MissionSpec, seed: int, simulation: Simulation) -> Truth:
    """The vehicle's motion, with the mission's slip."""
    truth = simulation.truth()
    if not spec.slip:
        return truth
    slip = drawn_slip(
        stream(seed, spec.name, "slip"), duration_s=spec.duration_s, **levels()["slip"][spec.slip]
    )
    return slipping(truth, slip, simulation.earth_rate_radps)


def truth_table(simulation: Simulation, truth: Truth) -> pl.DataFrame:
    """The truth at every whole second: position, velocity, attitude, and the current at the vehicle's depth."""
    rows = np.flatnonzero((truth.time_ns - truth.time_ns[0]) % 1_000_000_000 == 0)
    columns: dict[str, object] = {"time_ns": truth.time_ns[rows]}
    columns |= dict(zip((f"position_{axis}_m" for axis in AXES), truth.position_t_m[rows].T, strict=True))
    names = ("surge_mps", "sway_mps", "heave_mps")
    columns |= dict(zip(names, truth.velocity_p_mps[rows].T, strict=True))
    columns |= dict(zip((f"attitude_{part}" for part in "wxyz"), truth.attitude_t_p[rows].T, strict=True))
    columns |= dict(
        zip(("roll_rad", "pitch_rad", "yaw_rad"), euler_rad(truth.attitude_t_p[rows]).T, strict=True)
    )
    assert simulation.mission is not None  # every mission has a vehicle
    water = simulation.mission.current.columns(np.asarray(truth.time_ns * 1e-9, dtype=np.float64))[rows]
    current = water[:, 0:2] + water[:, 4:6] * truth.position_t_m[rows, 2:3]
    columns |= {"current_north_mps": current[:, 0], "current_east_mps": current[:, 1]}
    return pl.DataFrame(columns)


def _beams(spec: MissionSpec, seed: int, simulation: Simulation, beams: pl.DataFrame) -> pl.DataFrame:
    count = simulation.geometry.beams
    velocity = beams.select(f"beam{k + 1}_mps" for k in range(count)).fill_null(np.nan).to_numpy()
    valid = beams.select(f"beam{k + 1}_valid" for k in range(count)).to_numpy()
    time_ns, directions = beams["time_ns"].to_numpy(), np.asarray(simulation.geometry.directions_p)
    velocity, valid = with_errors(spec, seed, time_ns, velocity, valid, directions)
    columns: dict[str, object] = {"time_ns": time_ns}
    for k in range(count):
        columns |= {f"beam{k + 1}_mps": velocity[:, k], f"beam{k + 1}_valid": valid[:, k]}
    return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None))


def _start(spec: MissionSpec, seed: int, scenario: Scenario, truth: Truth) -> dict[str, list[float]]:
    """The state that an estimator begins with: the true one with errors of the claimed σ; angles in degrees."""
    initial, draw = scenario.initial, stream(seed, spec.name, "start")
    turned = draw.standard_normal(3) * np.deg2rad([initial.roll_deg, initial.pitch_deg, initial.yaw_deg])
    attitude = Rotation.from_rotvec(turned) * Rotation.from_quat(truth.attitude_t_p[0], scalar_first=True)
    yaw, pitch, roll = attitude.as_euler("ZYX", degrees=True)
    return {
        "position_m": (truth.position_t_m[0] + draw.standard_normal(3) * initial.position_m)
        .round(3)
        .tolist(),
        "velocity_mps": (truth.velocity_p_mps[0] + draw.standard_normal(3) * initial.velocity_mps)
        .round(5)
        .tolist(),
        "angles_deg": [round(float(angle), 5) for angle in (roll, pitch, yaw)],
    }


def mission_results(spec: MissionSpec, out: Path, key: str) -> tuple[Result, Result]:
    """A mission's folder, and that of its truth: the same, or for a test mission one in the folder `sealed`."""
    made_from = {"seed or version": key}
    mission = Result(out / spec.split / spec.name, "mission", "bench make", made_from, resumes=True)
    place = truth_folder(out, spec)
    return mission, mission if place == mission.out else Result(
        place, "truth", "bench make", made_from, resumes=True
    )


def write_mission(made: MadeMission, out: Path, key: str, *, force: bool = False) -> None:
    """Writes a mission's folder; the truth of a test mission goes to the folder `sealed`.

    Args:
        made: the mission.
        out: folder of the missions.
        key: of `key_of`: from what it was made.
        force: replace a mission of another key.

    Raises:
        OutputError: for a folder of something else, a mission of another key without `force`, and a folder that cannot
            be written.
    """
    files: Files = {f"{name}.parquet": parquet_bytes(table) for name, table in made.tables.items()}
    files |= {INSTRUMENT: made.instrument, CASE: made.case}
    truth: Files = {TRUTH: parquet_bytes(made.truth)}
    mission, apart = mission_results(made.spec, out, key)
    if apart is mission:
        files |= truth
    else:
        apart.write(truth, force=force)
    content = {"split": made.spec.split, "key": key} | made.digests()
    mission.write(files, force=force, more=content)


def truth_folder(out: Path, spec: MissionSpec) -> Path:
    """Where the truth of a mission stands below a folder of missions."""
    return out / (SEALED if spec.split == "test" else spec.split) / spec.name


def make_missions(
    specs: Sequence[MissionSpec],
    seed_of: Callable[[MissionSpec], int],
    out: str | Path,
    progress: Callable[[str, int], None] = lambda _name, _done: None,
    *,
    force: bool = False,
) -> dict[str, dict[str, str]]:
    """Makes and writes missions; one that is there whole, from the same seed and version, is kept.

    Args:
        specs: the missions.
        seed_of: the seed of each.
        out: folder of the missions.
        progress: called with a mission's name and the number of those before it.
        force: replace missions of another seed or version.

    Returns:
        The digests of each mission by name.

    Raises:
        OutputError: for a folder that holds something else, or a mission of another seed or version without `force`,
            before any is made; and for a folder that cannot be written.
        ScenarioError: as `make_mission`.
    """
    out = Path(out)
    for split in {spec.split for spec in specs}:
        folder = out / split
        strange = [one for one in folder.iterdir() if not (one / RECORD).exists()] if folder.is_dir() else []
        if strange and any(one.is_file() for one in strange):
            raise OutputError(
                f"{folder}: holds '{strange[0].name}', expected missions alone; choose another folder"
            )
    digests = {}
    keys = {spec: key_of(spec, seed_of(spec)) for spec in specs}
    for spec, key in keys.items():
        for result in mission_results(spec, out, key):
            result.check(force=force)
    for done, (spec, key) in enumerate(keys.items()):
        progress(spec.name, done)
        kept = _kept(spec, out, key)
        if kept is None:
            made = make_mission(spec, seed_of(spec))
            write_mission(made, out, key, force=force)
            kept = made.digests()
        digests[spec.name] = kept
    progress("", len(specs))
    return digests


def key_of(spec: MissionSpec, seed: int) -> str:
    """What a mission is made from: its seed, the kernel, and the files of this room and of the simulated vehicle.

    A digest of all, from which a sealed seed cannot be found.
    """
    total = hashlib.sha256(f"{seed}\0{spec.name}\0{bottomlock.__version__}".encode())
    for room in ("partialdvl_bench", "bottomlock.plant", "bottomlock.simulation"):
        for entry in sorted(resources.files(room).iterdir(), key=lambda one: one.name):
            if entry.name.endswith((".py", ".toml")) and entry.name != "digests.toml":
                total.update(entry.read_bytes())
    return total.hexdigest()


def _kept(spec: MissionSpec, out: Path, key: str) -> dict[str, str] | None:
    """The digests of a mission that is there whole, from the same key; None where it has to be made."""
    folder = out / spec.split / spec.name
    try:
        record = read_record(folder / RECORD)
        if record is None or record.get("key") != key:
            return None
        for name in record["digests"]:
            read_recorded(folder / name, record, remedy="it is made again")
        truth = digest({"truth": read_parquet(truth_folder(out, spec) / TRUTH)})
    except DataError:
        return None
    return {name: record[name] for name in ("data", "truth")} if truth == record["truth"] else None
