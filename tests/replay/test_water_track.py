"""Water track in a replay: a dive in a current with its bottom hidden, the section's keys, the page."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.files.atomic_write import write_parquet
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.io.beam_table import WaterTable
from bottomlock.io.beams import read_geometry
from bottomlock.replay.case import load_case
from bottomlock.replay.init.make import make_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import kernel_log, prepare
from bottomlock.replay.run import replay_case
from bottomlock.replay.tune.parameters import noise_of
from tests.dive import Dive, drawn_dive
from tests.dive_logs import beam_table, write_csv
from tests.replay.undiagnosed import replay_undiagnosed
from tests.toml_text import toml

CURRENT = np.array([0.25, -0.15, 0.0])
CASE = toml({
    "": {"name": "water"},
    "origin": {"latitude_deg": 45.0},
    "imu": {
        "file": "imu.csv", "clock": {"column": "time"}, "force": ["fx", "fy", "fz"], "omega": ["wx", "wy", "wz"],
    },
    "imu.errors": {
        "accel_bias_mg": 1.0, "gyro_bias_deg_per_h": 30.0, "accel_noise_mps_per_rt_h": 0.05,
        "gyro_noise_deg_per_rt_h": 0.3,
    },
    "dvl": {"file": "beams.parquet", "geometry": "waterlinked_a50"},
    "dvl.errors": {"beam_bias_mps": 0.0, "scale_factor_percent": 0.0},
    "water_track": {"noise_mps": 0.02},
    "reference": {
        "file": "truth.csv", "clock": {"column": "time"}, "north": "north", "east": "east", "down": "down",
        "velocity_body": ["u", "v", "w"], "roll": "roll", "pitch": "pitch", "yaw": "yaw",
    },
    "start": {
        "level": "reference", "level_sd_deg": 0.5, "heading": "reference", "heading_sd_deg": 0.5,
        "velocity": "reference", "position": "reference", "position_sd_m": [0.05] * 3,
    },
    "replay": {"methods": ["ins", "tc", "sway_current"], "smooth": False},
    "what_if": [{"name": "hidden", "outages": [{"beams": [1, 2, 3, 4], "from_s": 60.0, "to_s": 200.0}]}],
})  # fmt: skip


def water_of(dive: Dive, seed: int = 1) -> WaterTable:
    """Two cells of each ping: the beams less the current along them, with noise of their own."""
    rng, geometry = np.random.default_rng(seed), read_geometry("waterlinked_a50").geometry
    lever = np.asarray(geometry.lever_arms_p_m)
    assert not lever.any()
    turned = Rotation.from_euler("ZYX", dive.at(dive.ping_s, np.unwrap(dive.rpy, axis=0))[:, ::-1])
    through = dive.at(dive.ping_s, dive.velocity) - turned.inv().apply(CURRENT)
    along = np.repeat(geometry.beam_velocities(through), 2, axis=0)
    along += 0.02 * rng.normal(size=along.shape)
    count = len(dive.ping_s)
    none = np.full(along.shape, np.nan)
    return WaterTable(
        np.repeat(np.round(dive.ping_s * 1e9).astype(np.int64), 2), np.tile(np.array([1, 2]), count),
        np.tile([2.0, 4.0], count), along, np.ones(along.shape, dtype=bool), none, none,
    )  # fmt: skip


def write(folder: Path, dive: Dive, water: WaterTable | None = None) -> Path:
    """The tables of a dive; returns the case's path."""
    named = dict(zip(("fx", "fy", "fz"), dive.force.T, strict=True))
    named |= dict(zip(("wx", "wy", "wz"), dive.omega.T, strict=True))
    write_csv(folder / "imu.csv", {"time": dive.imu_s} | named)
    every = slice(None, None, 50)
    columns = dict(zip(("north", "east", "down"), dive.position[every].T, strict=True))
    columns |= dict(zip(("u", "v", "w"), dive.velocity[every].T, strict=True))
    columns |= dict(zip(("roll", "pitch", "yaw"), dive.rpy[every].T, strict=True))
    write_csv(folder / "truth.csv", {"time": dive.imu_s[every]} | columns)
    write_parquet(folder / "beams.parquet", beam_table(dive))
    write_parquet(folder / "beams_water.parquet", (water or water_of(dive)).to_frame())
    path = folder / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(7, seconds=210.0)


@pytest.fixture(scope="module")
def case_file(tmp_path_factory: pytest.TempPathFactory, dive: Dive) -> Path:
    return write(tmp_path_factory.mktemp("water"), dive)


@pytest.fixture(scope="module")
def replayed(case_file: Path) -> ReplayTables:
    return replay_case(load_case(case_file))


def end_m(result: ReplayTables, what_if: str, method: str) -> float:
    row = result.runs.filter((pl.col("what_if") == what_if) & (pl.col("method") == method)).row(0, named=True)
    return float(row["position_final_m"])


def test_the_water_holds_the_position_while_the_bottom_is_hidden(
    replayed: ReplayTables, case_file: Path
) -> None:
    """140 s without the bottom: an error within 2 sigma, 4 m an axis; without the water it is three times as large."""
    case = load_case(case_file)
    alone = replay_undiagnosed(case.model_copy(update={"water_track": None}))
    held = replayed.samples.filter((pl.col("what_if") == "hidden") & (pl.col("method") == "tc")).tail(1)
    sd = held.select("sd_position_north_m", "sd_position_east_m").to_numpy()
    assert (sd < 5.0).all()
    assert end_m(replayed, "hidden", "tc") < 2.0 * float(np.linalg.norm(sd) / np.sqrt(2.0))
    assert end_m(alone, "hidden", "tc") > 3.0 * end_m(replayed, "hidden", "tc")
    assert alone.currents is None
    assert "water_track" not in alone.manifest


def test_the_current_is_estimated_with_its_sigma(replayed: ReplayTables) -> None:
    """By every method but ins, at the end of the part with the bottom within 4 sigma, and sigma of a few cm/s."""
    assert replayed.currents is not None
    assert set(replayed.currents["method"]) == {"tc", "sway_current"}
    rows = replayed.currents.filter(pl.col("what_if") == "recorded")
    last = rows.filter(pl.col("time_ns") == rows["time_ns"].max())
    for name, true in (("north", CURRENT[0]), ("east", CURRENT[1])):
        sd = last[f"sd_{name}_mps"]
        assert ((last[f"{name}_mps"] - true).abs() < 4.0 * sd + 0.005).all()
        assert (sd < 0.05).all()


def test_the_beams_given_are_those_of_the_section(case_file: Path) -> None:
    """The mean of both cells at 3 m, with the stated noise, on the clock of the DVL."""
    path = case_file.with_name("later.toml")
    text = CASE.replace(
        'geometry = "waterlinked_a50"',
        'clock = { column = "time_ns", unit = "ns", offset_s = 2.5 }\ngeometry = "waterlinked_a50"',
    )
    path.write_text(text, encoding="utf-8")
    streams = read_streams(load_case(path))
    assert streams.water is not None
    table = WaterTable.from_frame(pl.read_parquet(case_file.with_name("beams_water.parquet")), "w")
    np.testing.assert_array_equal(streams.water.time_ns, table.time_ns[::2] + 2_500_000_000)
    np.testing.assert_array_equal(streams.water.time_ns, streams.beams.time_ns)
    kept = streams.water.valid.all(axis=1)
    assert kept.mean() > 0.95
    both = 0.5 * (table.velocity_mps[::2] + table.velocity_mps[1::2])
    near = np.abs(streams.water.velocity_mps - both).max(axis=1)
    assert (near[kept] < 1e-12).mean() > 0.95
    assert set(streams.water.sd_mps.ravel().tolist()) == {0.02}
    assert streams.water_counts is not None
    assert streams.water_counts.closure > 0
    assert streams.clocks["water_track"].kept == len(streams.water.time_ns)
    prepared = prepare(load_case(path), streams)
    log = kernel_log(load_case(path), prepared, streams.beams.valid[prepared.pings])
    given = slice(
        *np.searchsorted(streams.water.time_ns, [log["imu_time_ns"][0], log["imu_time_ns"][-1] + 1])
    )
    for name in ("time_ns", "velocity_mps", "valid", "sd_mps", "range_m"):
        np.testing.assert_array_equal(log[f"water_track_{name}"], getattr(streams.water, name)[given])


def test_ranges_to_the_bottom_cut_the_cells(tmp_path: Path, dive: Dive) -> None:
    """The bottom 4.5 m along every beam: 4.1 m straight down at 22.5 deg, and cell 2 reaches 5 m."""
    path = write(tmp_path, dive)
    beams = pl.read_parquet(tmp_path / "beams.parquet")
    ranges = {f"beam{k + 1}_range_m": pl.lit(4.5) for k in range(4)}
    write_parquet(tmp_path / "beams.parquet", beams.with_columns(**ranges))
    streams = read_streams(load_case(path))
    assert streams.water is not None
    assert streams.water_counts is not None
    assert streams.water_counts.side_lobes == 4 * len(dive.ping_s)
    assert set(streams.water.range_m.tolist()) <= {2.0, 3.0}
    assert (streams.water.range_m[streams.water.valid.any(axis=1)] == 2.0).all()


def test_the_cells_fit_each_method(replayed: ReplayTables) -> None:
    sensors = replayed.manifest["sensors"]
    fits = {row["method"]: row for row in sensors["recorded"] if row["sensor"] == "water_track"}
    assert list(fits) == ["tc", "sway_current"]
    assert set(replayed.manifest["files"]) == {"imu", "dvl", "water_track", "reference"}
    # The mean of two independent cells has half the variance of one, which is claimed: 2 of 4, of 837 pings to 4 sigma.
    assert fits["tc"]["degrees"] == 4.0
    assert abs(fits["tc"]["nis"] - 2.0) < 4.0 * np.sqrt(8.0 / 837.0) / 2.0


def test_a_first_case_names_the_water_beside_the_beams(tmp_path: Path, dive: Dive) -> None:
    """The beams are written anew beside the case, and the water stays where it was; without it there is no section."""
    write(tmp_path, dive)
    named = [tmp_path / "beams.parquet", tmp_path / "imu.csv"]
    (tmp_path / "case").mkdir()
    make_case(named, tmp_path / "case" / "dive.toml")
    case = load_case(tmp_path / "case" / "dive.toml")
    assert case.water_file is not None
    assert case.water_file.resolve() == tmp_path / "beams_water.parquet"
    assert read_streams(case).water is not None
    (tmp_path / "beams_water.parquet").rename(tmp_path / "case" / "dive_beams_water.parquet")
    make_case(named, tmp_path / "case" / "dive.toml", force=True)
    case = load_case(tmp_path / "case" / "dive.toml")
    assert case.water_track is not None
    assert case.water_track.file is None
    assert read_streams(case).water is not None
    (tmp_path / "case" / "dive_beams_water.parquet").unlink()
    make_case(named, tmp_path / "case" / "dive.toml", force=True)
    assert load_case(tmp_path / "case" / "dive.toml").water_track is None


def test_what_of_the_water_is_tuned(case_file: Path, tmp_path: Path, dive: Dive) -> None:
    """Its noise, unless the instrument records one with each cell, and the current's own part of a layer."""
    case = load_case(case_file)
    keys = ["water_track.noise_mps", "filter.current_layers.sd_mps"]
    found = [one for one in noise_of(case, read_streams(case)) if one.key in keys]
    assert [(one.key, one.start) for one in found] == [(keys[0], 0.02), (keys[1], 0.04)]
    water = water_of(dive)
    recorded = replace(water, sd_mps=np.where(water.cell[:, None] == 1, 0.02, 0.03) * np.ones((1, 4)))
    recorded.sd_mps[::3] *= 1.5
    other = load_case(write(tmp_path, dive, recorded))
    assert [one.key for one in noise_of(other, read_streams(other)) if one.key in keys] == keys[1:]
    without = case.model_copy(update={"water_track": None})
    assert not [one for one in noise_of(without, read_streams(without)) if one.key in keys]
