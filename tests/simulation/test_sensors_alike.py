"""What every simulated sensor beside the beams keeps to: no other stream moves, campaign and navigator agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.campaign.closed_loop import run_closed_loop
from bottomlock.config.scenario import Scenario, load_scenario, parse_scenario
from bottomlock.errors import ScenarioError
from bottomlock.kernel import run_batch
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.config.test_scenario import TEXT
from tests.run_events import Readings
from tests.simulation.test_acoustic_simulation import kernel_inputs

CURRENT = {"speed_mps": 0.4, "towards_deg": 60.0, "turn_deg_per_h": 900.0, "shear_north_mps_per_m": 0.01}
SENSORS: dict[str, dict[str, Any]] = {
    "acoustic_position": {
        "rate_hz": 1.0,
        "transceiver_m": [50.0, 80.0, 0.0],
        "lever_arm_m": [0.8, -0.3, 0.6],
    },
    "heading": {},
    "thrust": {"corrects": "all"},
    "water_track": {"lost_fraction": 0.3},
}
"""Sections with keys of a short run."""

STREAMS = {"water_track": "beams_water"}
"""Names of the streams that differ from those of their sections."""


def simulation(**sections: dict[str, Any]) -> Simulation:
    """A figure of eight that dives in a current that turns and is sheared, with other sensors on."""
    content = load_scenario("figure_eight").with_trajectory(duration_s=20.0).model_dump(exclude_unset=True)
    content["mission"] = {**content.get("mission", {}), "current": CURRENT}
    content["environment"] = {**content.get("environment", {}), "earth": "tangent_plane"}
    content |= {"depth": {}, "magnetometer": {}, "gps": {"antenna_depth_m": 1e3, "acquire_s": 0.0}}
    return build_simulation(Scenario.model_validate(content | sections))


@pytest.mark.parametrize("sensor", SENSORS)
def test_switching_it_on_shifts_no_other_stream(sensor: str) -> None:
    off, on = simulation(), simulation(**{sensor: SENSORS[sensor]})
    without, with_it = (sensor_streams(one, off.truth(), run=3) for one in (off, on))
    name = STREAMS.get(sensor, sensor)
    assert name not in without or without[name].height == 0
    assert with_it[name].height == 20
    for other in ("imu", "beams", "depth", "attitude", "gps"):
        assert without[other].height > 0
        assert without[other].equals(with_it[other]), other


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("method", ["tc", "sway_current"])
def test_a_campaigns_run_is_the_streaming_navigator(sensor: str, method: str) -> None:
    """Mean NIS of the DVL equals the batch's, with the sensor pushed in between; without it, it does not."""
    simulated = simulation(**{sensor: SENSORS[sensor]})
    key, plan, arrays, model, options = kernel_inputs(simulated)
    common: Any = {
        "seed": simulated.scenario.campaign.seed, "trajectory_key": key, "first_run": 2, "runs": 1, "threads": 1,
    }  # fmt: skip
    batch = run_batch(simulated.geometry, arrays, model, model, options, plan, [method], **common)
    readings = Readings(simulated, simulated.truth(), run=2)
    fixes = list(readings.fixes(method, readings.valid, range(len(readings.valid))))
    # In the order of the pings, as the batch adds them.
    assert sum(fix.nis for fix in fixes) / len(fixes) == batch["nis_mean"][0, 0]
    plain = simulation()
    key, plan, arrays, model, options = kernel_inputs(plain)
    without = run_batch(plain.geometry, arrays, model, model, options, plan, [method], **common)
    assert without["nis_mean"][0, 0] != batch["nis_mean"][0, 0]


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_vehicle_is_steered_with_it(sensor: str) -> None:
    simulated = simulation(**{sensor: SENSORS[sensor]})
    found = run_closed_loop(simulated, ["tc"], pilot="own", trajectory_key=1, first_run=0, runs=2, threads=1)
    assert np.isfinite(found["error"]).all()
    assert np.abs(found["error"][:, :, -1, :3]).max() < 20.0


@pytest.mark.parametrize("sensor", SENSORS)
def test_what_is_off_decides_nothing(sensor: str) -> None:
    """The hash of a scenario, which keys its results, is that without the section; and every key of it counts."""
    off = simulation().scenario
    keys = SENSORS[sensor]
    assert simulation(**{sensor: keys | {"enabled": False}}).scenario.content_hash() == off.content_hash()
    key = "range_m" if sensor == "water_track" else "rate_hz"
    hashes = {simulation(**{sensor: keys | {key: value}}).scenario.content_hash() for value in (0.5, 1.5)}
    assert len(hashes | {off.content_hash()}) == 3


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("acoustic_position", "noise_m", -1.0), ("acoustic_position", "outlier_fraction", 1.5),
        ("acoustic_position", "rate_hz", 0.0), ("heading", "noise_deg", -1.0), ("thrust", "advance_m", 0.0),
        ("thrust", "error_percent", -100.0), ("thrust", "corrects", "'some'"), ("water_track", "noise_mps", 0.0),
        ("water_track", "wake", 1.5), ("water_track", "pings", "'some'"), ("dvl", "outlier_fraction", 1.5),
        ("dvl", "outlier_factor", 0.5),
    ],
)  # fmt: skip
def test_a_value_out_of_range_is_named(section: str, key: str, value: object) -> None:
    text = TEXT if f"[{section}]" in TEXT else f"{TEXT}\n[{section}]\n"
    text = text.replace(f"[{section}]\n", f"[{section}]\n{key} = {value}\n")
    with pytest.raises(ScenarioError, match=f"'{section}.{key}'"):
        parse_scenario(text, place="t")
