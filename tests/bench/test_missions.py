"""Missions of the benchmark: the list covers its factors, data come from the seed alone, and a replay reads them."""

import shutil
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError, OutputError
from bottomlock.kernel import BeamGeometry
from bottomlock.kernel.models import DvlModel
from bottomlock.replay.case import load_case
from bottomlock.replay.run import replay_case
from partialdvl_bench.beam_errors import noise, recorded_pattern, shoals
from partialdvl_bench.digests import digest, published, rounded, step_of
from partialdvl_bench.load import load_mission, truth_path
from partialdvl_bench.make import RECORD, MadeMission, make_mission, make_missions
from partialdvl_bench.mission_list import (
    FACTORS,
    SPLITS,
    MissionSpec,
    levels,
    mission_list,
    missions_of,
    recorded,
)
from partialdvl_bench.seeds import PUBLIC_SEED, commitment, read_sealed, read_seed, seal
from tests.bench.missions import SEED, made, missions, short_specs


def test_every_level_is_in_every_split_and_every_pair_somewhere() -> None:
    assert len({spec.name for spec in mission_list()}) == len(mission_list())
    every = missions_of()
    assert len(every) >= 40
    factors = [factor for factor in FACTORS if factor not in {"heading", "slip", "water"}]
    later = {"bluerov2_heavy", "inshore", "turning", "blackout"}
    table = {factor: [level for level in levels()[factor] if level not in later] for factor in factors}
    for split, factor in product(SPLITS, factors):
        there = {getattr(spec, factor) for spec in every if spec.split == split}
        assert there == set(table[factor]), (split, factor)
    for one, other in combinations(factors, 2):
        there = {(getattr(spec, one), getattr(spec, other)) for spec in every}
        lacking = set(product(table[one], table[other])) - there
        # Over a flat seabed nothing is lost by geometry.
        assert lacking <= {("flat", "geometric")}, (one, other)
    assert {spec.duration_s for spec in every} == {250.0, 3600.0}


def test_every_mission_has_published_digests_of_data_and_truth() -> None:
    # Those of the test split of version 1.1 are published by who holds its seed.
    known = [spec.name for spec in mission_list() if (spec.version, spec.split) != ("1.1", "test")]
    assert set(published()) == set(known)
    values = [value for one in published().values() for value in one.values()]
    assert len(set(values)) == 2 * len(known)
    assert all(len(value) == 64 for value in values)


def test_the_public_seed_makes_the_published_data() -> None:
    """One mission of the train split; `bottomlock bench make` compares them all."""
    spec = mission_list()[1]
    assert make_mission(spec, PUBLIC_SEED).digests() == published()[spec.name]


def test_the_same_seed_gives_the_same_mission_and_another_another() -> None:
    spec = short_specs()[0]
    one, again, other = (make_mission(spec, seed).digests() for seed in (3, 3, 4))
    assert one == again
    assert one["data"] != other["data"]
    assert one["truth"] != other["truth"]


def test_a_digest_sees_a_step_and_not_a_last_bit() -> None:
    step = step_of("force_x_mps2") or 0.0
    frame = rounded(pl.DataFrame({"time_ns": [0, 1], "force_x_mps2": [1.0, None]}))
    assert digest({"imu": frame}) == digest(
        {"imu": frame.with_columns(pl.col("force_x_mps2") * (1.0 + 1e-15))}
    )
    assert digest({"imu": frame}) != digest({"imu": frame.with_columns(pl.col("force_x_mps2") + step)})
    assert digest({"imu": frame}) != digest(
        {"imu": frame.with_columns(pl.col("force_x_mps2").fill_null(0.0))}
    )
    assert digest({"imu": frame}) != digest({"other": frame})


def test_an_estimator_receives_no_truth_of_the_test_split_unless_it_is_there(tmp_path: Path) -> None:
    spec = next(spec for spec in short_specs() if spec.split == "test")
    folder = tmp_path / "test" / spec.name
    shutil.copytree(made() / "test" / spec.name, folder)
    assert not list(folder.glob("*truth*"))
    assert "reference" not in (folder / "case.toml").read_text()
    assert truth_path(folder) is None
    assert load_mission(folder).truth is None
    assert load_mission(made() / "test" / spec.name).truth is not None


def test_the_start_is_within_its_claimed_errors() -> None:
    for mission in (one for split in missions().values() for one in split):
        frame = pl.read_parquet(truth_path(made() / mission.split / mission.name) or "")
        first = frame.row(0, named=True)
        assert first["time_ns"] == mission.start.time_ns
        position = np.array([first[f"position_{axis}_m"] for axis in ("north", "east", "down")])
        velocity = np.array([first[f"{axis}_mps"] for axis in ("surge", "sway", "heave")])
        attitude = np.array([first[f"attitude_{part}"] for part in "wxyz"])
        initial = mission.model.initial
        assert (np.abs(mission.start.position_t_m - position) < 5.0 * np.array(initial.position_sd_m)).all()
        assert (
            np.abs(mission.start.velocity_p_mps - velocity) < 5.0 * np.array(initial.velocity_sd_mps)
        ).all()
        turned = (
            Rotation.from_quat(mission.start.attitude_t_p, scalar_first=True)
            * Rotation.from_quat(attitude, scalar_first=True).inv()
        )
        assert (np.abs(turned.as_rotvec()) < 5.0 * np.array(initial.attitude_sd_rad)).all()
        assert np.linalg.norm(turned.as_rotvec()) > 0.0


def test_a_loaded_mission_is_what_was_made() -> None:
    spec = short_specs()[0]
    mission = missions()["train"][0]
    tables = make_mission(spec, SEED).tables
    beams = tables["beams"].select("beam1_mps").fill_null(np.nan).to_numpy()[:, 0]
    assert np.array_equal(mission.pings.velocity_mps[:, 0], beams, equal_nan=True)
    assert np.array_equal(mission.imu.omega_p_radps[:, 2], tables["imu"]["omega_z_radps"].to_numpy())
    assert np.allclose(mission.heading.value, tables["heading"]["yaw_rad"], atol=1e-12)
    assert mission.model.of(DvlModel).beam_noise_sd_mps == levels()["dvl"][spec.dvl]["beam_noise_mps"]
    assert mission.grid_ns[0] == mission.start.time_ns + 1_000_000_000
    assert mission.truth is not None
    assert np.array_equal(mission.truth.time_ns, mission.grid_ns)


def test_the_true_current_is_that_of_the_water() -> None:
    """Velocity over ground less the current is the velocity through the water, which has next to no sway over time."""
    spec = next(s for s in short_specs() if s.current == "steady")
    mission = next(m for split in missions().values() for m in split if m.name == spec.name)
    truth = mission.truth
    assert truth is not None
    assert np.hypot(*truth.current_t_mps.T) == pytest.approx(
        levels()["current"]["steady"]["speed_mps"], abs=1e-6
    )
    over_ground = Rotation.from_quat(truth.attitude_t_p, scalar_first=True).apply(truth.velocity_p_mps)
    through = over_ground - np.column_stack([truth.current_t_mps, np.zeros(len(truth.time_ns))])
    forward = Rotation.from_quat(truth.attitude_t_p, scalar_first=True).apply([1.0, 0.0, 0.0])
    aside, aside_over_ground = (
        np.median(np.abs(forward[:, 0] * v[:, 1] - forward[:, 1] * v[:, 0])) for v in (through, over_ground)
    )
    assert aside < 0.02
    assert aside_over_ground > 0.05


def test_bottomlock_replay_reads_a_mission() -> None:
    spec = short_specs()[0]
    case = load_case(made() / "train" / spec.name / "case.toml").with_overrides(methods=["tc"])
    assert replay_case(case).runs["method"].to_list() == ["tc", "dead_reckoning"]


def test_a_changed_mission_is_refused(tmp_path: Path) -> None:
    spec = short_specs()[0]
    folder = tmp_path / "train" / spec.name
    shutil.copytree(made() / "train" / spec.name, folder)
    (folder / "dvl.toml").write_text((folder / "dvl.toml").read_text() + "# changed\n")
    with pytest.raises(DataError, match=r"dvl\.toml: has changed"):
        load_mission(folder)
    (folder / RECORD).unlink()
    with pytest.raises(DataError, match="holds no mission"):
        load_mission(folder)


def test_what_is_there_whole_is_kept_and_what_has_changed_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []

    def counted(spec: MissionSpec, seed: int) -> MadeMission:
        calls.append(spec.name)
        return make_mission(spec, seed)

    monkeypatch.setattr("partialdvl_bench.make.make_mission", counted)
    specs = [replace(spec, duration_s=20.0) for spec in (short_specs()[0], short_specs()[-1])]
    names = [spec.name for spec in specs]
    first = make_missions(specs, lambda _: 5, tmp_path)
    assert make_missions(specs, lambda _: 5, tmp_path) == first
    assert calls == names
    (tmp_path / "sealed" / names[1] / "truth.parquet").unlink()
    (tmp_path / "train" / names[0] / "beams.parquet").write_bytes(b"cut")
    assert make_missions(specs, lambda _: 5, tmp_path) == first
    assert calls == [*names, *names]
    with pytest.raises(OutputError, match=r"differs in: seed or version; .* --force"):
        make_missions(specs, lambda _: 6, tmp_path)
    assert make_missions(specs, lambda _: 6, tmp_path, force=True) != first
    assert len(calls) == 6


@pytest.mark.parametrize("kind", ["gaussian", "student_t3", "recorded"])
def test_noise_has_the_half_width_of_the_data_sheet(kind: str) -> None:
    drawn = noise(kind, 0.04, (50_000, 4), np.random.default_rng(2))
    assert np.quantile(np.abs(drawn), 0.683) == pytest.approx(0.04, rel=0.03)
    # Independent between the beams.
    bounded = np.clip(drawn, -0.2, 0.2)
    assert np.abs(np.corrcoef(bounded.T) - np.eye(4)).max() < 0.02


def test_recorded_losses_are_those_of_the_recording() -> None:
    loss = recorded()["loss"]
    times = np.arange(0, 400_000_000_000, 1_000_000_000, dtype=np.int64)
    valid = recorded_pattern(times, 4, np.random.default_rng(5))
    recorded_rows = {tuple(mark == "1" for mark in row) for row in loss["beams"]}
    assert {tuple(row) for row in valid.tolist()} <= recorded_rows
    share = np.mean([row == "1111" for row in loss["beams"]])
    assert valid.all(axis=1).mean() == pytest.approx(share, abs=0.25)


def test_a_shoal_shifts_a_beam_by_its_own_velocity() -> None:
    directions = np.asarray(BeamGeometry.janus(np.deg2rad(30.0)).directions_p)
    times = np.arange(0, 2000_000_000_000, 1_000_000_000, dtype=np.int64)
    error, valid = shoals(
        times, directions, np.random.default_rng(1), mean_apart_s=40.0, mean_lasting_s=4.0, speed_mps=(1.0, 1.0),
        second_beam=0.0, lost_in_burst=1.0,
    )  # fmt: skip
    met = error != 0.0
    assert (met.sum(axis=1) <= 1).all()
    assert 0.03 < met.any(axis=1).mean() < 0.2
    # A horizontal speed of 1 m/s along a beam of 30 degrees: at most sin 30.
    assert 0.3 < np.abs(error).max() <= 0.5 + 1e-12
    assert (valid.sum(axis=1)[met.any(axis=1)] == 1).all()
    assert valid[~met.any(axis=1)].all()


def test_a_seed_file_is_one_number_and_not_the_public_one(tmp_path: Path) -> None:
    path = tmp_path / "seed.txt"
    path.write_text("123456789\n")
    assert read_seed(path) == 123456789
    for text in ("twelve", str(PUBLIC_SEED), "-1", str(2**128)):
        path.write_text(text)
        with pytest.raises(DataError, match="expected"):
            read_seed(path)


def test_a_sealed_seed_is_the_owners_and_committed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, other = tmp_path / "seed.txt", tmp_path / "other.txt"
    committed = seal(path, "1.1")
    seed = read_seed(path)
    assert path.stat().st_mode & 0o777 == 0o600
    # The digest as anyone computes it, and one worked by hand (`printf 'PartialDVL-Bench 1.1: 12' | sha256sum`).
    assert committed == commitment(seed, "1.1")
    assert commitment(12, "1.1") == "42f5fa59cd8830aba2cecce25c54cb42b2b7ba9e9205f867dd1600fd43c636b5"
    assert commitment(seed, "1.2") != committed
    with pytest.raises(OutputError, match="a seed is never written over"):
        seal(path, "1.1")
    assert read_seed(path) == seed
    with pytest.raises(OutputError, match="cannot be written"):
        seal(tmp_path / "nowhere" / "seed.txt", "1.1")
    seal(other, "1.1")
    assert read_sealed(other, "1.1") == read_seed(other)
    monkeypatch.setattr("partialdvl_bench.seeds.commitments", lambda: {"1.1": committed})
    assert read_sealed(path, "1.1") == seed
    with pytest.raises(DataError, match=r"is not the sealed seed of version 1\.1: its commitment is"):
        read_sealed(other, "1.1")


def test_unknown_splits_and_missions_are_named() -> None:
    with pytest.raises(DataError, match="'tset'"):
        missions_of(("tset",))
    with pytest.raises(DataError, match="'nothing'"):
        missions_of(None, ("nothing",))
