"""What the sensors meet: epochs, lost beams, ranges, GPS at the surface, offsets of compass and pressure."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import DataError, ScenarioError
from bottomlock.io.beams import read_beams
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import (
    MeasurementSchedule,
    measurement_schedule,
    schedule_and_footprints,
)
from bottomlock.simulation.sensor_streams import sensor_streams

SECOND = 1_000_000_000


def scenario_with(name: str = "straight", **sections: dict[str, Any]) -> Scenario:
    """A packaged scenario with some keys of its sections changed, 20 s long unless they say otherwise."""
    scenario = load_scenario(name)
    content = scenario.model_dump(exclude_unset=True)
    content["trajectory"]["duration_s"] = 20.0
    for section, change in sections.items():
        content[section] = (content.get(section) or {}) | change
    return Scenario.model_validate(content)


def simulation_with(name: str = "straight", **sections: dict[str, Any]) -> Simulation:
    """Its world."""
    return build_simulation(scenario_with(name, **sections))


def test_epochs_and_outages() -> None:
    """DVL at 1 Hz from 1 s; beams lost for a while; sensors that are off have no epochs."""
    simulation = simulation_with(
        dvl={"beams_lost": (), "outages": [{"beams": [1], "from_s": 10.0, "to_s": 15.0}]}
    )
    plan = measurement_schedule(simulation, simulation.truth())
    assert plan["dvl_time_ns"].tolist() == [k * SECOND for k in range(1, 21)]
    assert plan["sample_time_ns"].tolist() == plan["dvl_time_ns"].tolist()
    assert np.flatnonzero(~plan["beam_valid"][:, 0]).tolist() == list(range(9, 14))
    assert plan["beam_valid"][:, 1:].all()
    assert all(len(plan[f"{name}_time_ns"]) == 0 for name in ("depth", "magnetometer", "gps"))
    with pytest.raises(DataError, match="nothing to record"):
        measurement_schedule(
            simulation_with(trajectory={"duration_s": 0.5}),
            simulation_with(trajectory={"duration_s": 0.5}).truth(),
        )


def test_range_over_a_flat_seabed_by_hand() -> None:
    """Level at 20 m over 60 m: 40 m below, every beam 20 deg off the vertical: 40 / cos 20 deg, incidence 20 deg."""
    simulation = simulation_with(
        seabed={"kind": "plane", "depth_m": 60.0}, dvl={"beams_lost": (), "max_range_m": 100.0}
    )
    plan, hits = schedule_and_footprints(simulation, simulation.truth())
    assert hits is not None
    assert plan["beam_valid"].all()
    # Trim pitches the vehicle by some tenths of a degree; the beams fore and aft differ by as much.
    assert hits.range_m.mean() == pytest.approx(40.0 / np.cos(np.deg2rad(20.0)), rel=2e-3)
    assert hits.incidence_rad.mean() == pytest.approx(np.deg2rad(20.0), rel=2e-3)
    near = simulation_with(
        seabed={"kind": "plane", "depth_m": 60.0}, dvl={"beams_lost": (), "max_range_m": 42.0}
    )
    assert not measurement_schedule(near, near.truth())["beam_valid"].any()


def test_a_slope_takes_the_beams_that_look_along_it() -> None:
    """Deepening to the north by 40 deg: the beams ahead graze the slope at more than 50 deg, those astern do not."""
    simulation = simulation_with(
        seabed={"kind": "plane", "depth_m": 60.0, "slope_north_deg": 40.0},
        dvl={"beams_lost": (), "max_incidence_deg": 50.0},
    )
    valid = measurement_schedule(simulation, simulation.truth())["beam_valid"]
    assert valid.all(axis=0).tolist() == [False, True, True, False]
    assert not valid[:, [0, 3]].any()


def test_chance_is_drawn_by_run() -> None:
    """Run 3 alone meets what run 3 of five meets; runs differ; a beam without a dropout never drops out."""
    dvl = {"beams_lost": (), "dropouts": [{"beams": [2, 3], "mean_up_s": 5.0, "mean_down_s": 5.0}]}
    simulation = simulation_with(dvl=dvl)
    truth = simulation.truth()
    together = measurement_schedule(simulation, truth, trajectory_key=9, runs=5)["beam_valid"]
    alone = measurement_schedule(simulation, truth, trajectory_key=9, first_run=3, runs=1)["beam_valid"]
    assert together.shape == (5, 20, 4)
    assert (together[3] == alone[0]).all()
    assert (together[0] != together[1]).any()
    assert together[..., [0, 3]].all()
    every = simulation_with(dvl={"beams_lost": (), "altitude_loss": {"mean_up_s": 5.0, "mean_down_s": 5.0}})
    lost = measurement_schedule(every, truth, trajectory_key=9, runs=5)["beam_valid"]
    assert (lost.all(axis=2) | ~lost.any(axis=2)).all()
    assert 0 < lost.mean() < 1


def test_a_recorded_pattern_is_replayed(tmp_path: Path) -> None:
    """Three pings a second apart, over and over; what lacks a column is rejected before anything runs."""
    log = {"time_ns": [5 * SECOND, 6 * SECOND, 7 * SECOND]}
    log |= {f"beam{k}_valid": [1, int(k > 2), int(k != 4)] for k in range(1, 5)}
    pl.DataFrame(log).write_csv(tmp_path / "log.csv")
    simulation = simulation_with(dvl={"beams_lost": (), "replay_validity": str(tmp_path / "log.csv")})
    valid = measurement_schedule(simulation, simulation.truth())["beam_valid"]
    assert (valid[:3] == [[1, 1, 1, 1], [0, 0, 1, 1], [1, 1, 1, 0]]).all()
    assert (valid[3:6] == valid[:3]).all()
    pl.DataFrame(log).drop("beam3_valid").write_csv(tmp_path / "short.csv")
    with pytest.raises(ScenarioError, match=r"dvl\.replay_validity: .*column 'beam3_valid' is missing"):
        simulation_with(dvl={"replay_validity": str(tmp_path / "short.csv")})


def test_surroundings_move_the_readings_by_hand() -> None:
    """1 % denser water and half a metre of tide at 20 m; a declination of 5 deg that is not corrected."""
    simulation = simulation_with(
        depth={"enabled": True, "true_density_kg_per_m3": 1035.25, "tide_m": 0.5},
        magnetometer={"enabled": True, "declination_deg": 5.0, "assumed_declination_deg": 0.0},
    )
    plan = measurement_schedule(simulation, simulation.truth())
    assert plan["depth_offset_m"] == pytest.approx(1.01 * 20.5 - 20.0, abs=1e-3)
    assert plan["yaw_offset_rad"] == pytest.approx(np.deg2rad(-5.0), abs=1e-9)
    known = simulation_with(magnetometer={"enabled": True, "declination_deg": 5.0})
    assert measurement_schedule(known, known.truth())["yaw_offset_rad"] == pytest.approx(0.0, abs=1e-12)


def test_gps_is_received_at_the_surface_alone() -> None:
    """At the surface for ten seconds, then a dive: ten fixes, no more."""
    way = {"waypoints_m": [[0.0, 0.0], [200.0, 0.0]], "depth_profile": [[0.0, 0.0], [10.0, 0.0], [40.0, 9.0]]}
    straight = load_scenario("straight").model_dump(exclude_unset=True)
    content = straight | {
        "trajectory": {"kind": "waypoints", "duration_s": 40.0}, "mission": way, "gps": {"enabled": True},
    }  # fmt: skip
    simulation = build_simulation(Scenario.model_validate(content))
    truth = simulation.truth()
    plan = measurement_schedule(simulation, truth)
    under = truth.position_t_m[:, 2] > 0.3
    first_under = truth.time_ns[under][0]
    assert 8 * SECOND < first_under < 14 * SECOND
    assert (plan["gps_time_ns"][plan["gps_received"]] < first_under).all()
    assert plan["gps_received"].sum() == first_under // SECOND


def test_stretches_join_to_the_whole() -> None:
    """However the truth is cut, the same schedule: masks, offsets, GPS."""
    simulation = simulation_with(
        "slope",
        trajectory={"duration_s": 30.0, "feedback": "truth"},
        depth={"enabled": True, "tide_m": 1.0},
        magnetometer={"enabled": True, "declination_deg": 3.0, "hard_iron_nt": [500.0, 0.0, 0.0]},
        gps={"enabled": True, "antenna_depth_m": 24.0},
    )
    truth = simulation.truth()
    whole = measurement_schedule(simulation, truth, runs=2)
    pieces = MeasurementSchedule(simulation, first_ns=0, last_ns=int(truth.time_ns[-1]), runs=2)
    parts: dict[str, list[Any]] = {name: [] for name in whole}
    for first, last in pairwise([0, 1, 130, 149, 150, 151, 2000, len(truth.time_ns) - 1]):
        part = slice(first, last + 1)
        plan, _ = pieces.over(
            truth.time_ns[part], truth.position_t_m[None, part], truth.attitude_t_p[None, part]
        )
        for name in whole:
            if name in plan:
                parts[name].append(plan[name])
    for name, values in whole.items():
        joined = np.concatenate(parts[name], axis=-2 if name == "beam_valid" else -1)
        assert joined == pytest.approx(values, abs=1e-12), name
    assert 0 < whole["gps_received"].sum() < len(whole["gps_received"])


def test_streams_are_those_of_the_campaign(tmp_path: Path) -> None:
    """The tables hold what the kernel draws for the run, ranges with their noise, nothing where a beam is lost."""
    simulation = simulation_with("slope", trajectory={"duration_s": 60.0, "feedback": "truth"})
    truth = simulation.truth()
    streams = sensor_streams(simulation, truth, run=4)
    plan, hits = schedule_and_footprints(
        simulation, truth, trajectory_key=trajectory_key("slope"), first_run=4, runs=1
    )
    assert hits is not None
    valid = plan["beam_valid"][0]
    assert streams["imu"].height == len(truth.time_ns)
    assert streams["depth"].height == 0
    beams = streams["beams"]
    noise = []
    for k in range(4):
        flags = beams[f"beam{k + 1}_valid"].to_numpy()
        assert (flags == valid[:, k]).all()
        for name in ("mps", "range_m"):
            assert (beams[f"beam{k + 1}_{name}"].is_null().to_numpy() == ~flags).all()
        noise.append(beams[f"beam{k + 1}_range_m"].drop_nulls().to_numpy() - hits.range_m[flags, k])
    # 0.05 m of noise: the band of the standard deviation holds with a false-alarm rate of 1e-6.
    every = np.concatenate(noise)
    assert 0.035 < every.std() < 0.07
    beams.write_parquet(tmp_path / "beams.parquet")
    assert read_beams(tmp_path / "beams.parquet", beams=4).valid.sum() == valid.sum()
    again = sensor_streams(simulation, truth, run=4)
    assert all(again[name].equals(streams[name]) for name in streams)
    assert not sensor_streams(simulation, truth, run=5)["beams"].equals(beams)
