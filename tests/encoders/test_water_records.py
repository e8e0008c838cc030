"""The water in the records of the encoders, read back: its numbers within the record's steps, and what they reject."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bottomlock.config.scenario import load_scenario
from bottomlock.config.sensors import WaterTrack
from bottomlock.encoders.registry import encoder
from bottomlock.instruments.faults import NONE
from bottomlock.instruments.schedule import records
from bottomlock.instruments.sources import readings_of_scenario
from bottomlock.io.beam_table import Recording
from bottomlock.io.formats import BYTES, read_recording
from bottomlock.io.rows import PLAIN
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.encoders.test_encoders import FOUR, NS_2026, THREE, ping

STEPS = {
    "pd0": 1e-3,
    "waterlinked-json": 0.0,
    "waterlinked-serial": 1e-3,
    "nortek-dvl": 1e-6,
    "nucleus": 1e-6,
}
READERS = {one.name: one.read for one in BYTES}
IN_PLACE = {"waterlinked-json", "waterlinked-serial"}
"""Formats whose instrument measures the water in place of the bottom."""


def sent(name: str, velocity: NDArray[np.float64], **more: Any) -> Recording:  # noqa: ANN401 - any field
    """A ping whose water returned, and for a format that has either one without the bottom."""
    beams = len(velocity)
    bottom = np.full(beams, np.nan) if name in IN_PLACE else np.linspace(0.1, 0.4, beams)
    one = ping(
        beam_velocity_mps=bottom,
        range_m=np.where(np.isfinite(bottom), 20.0, np.nan),
        water_velocity_mps=velocity,
        **({"water_range_m": 5.0} | more),
    )
    return READERS[name](encoder(name, FOUR if beams == 4 else THREE).encode(one), "record", PLAIN)


@pytest.mark.parametrize("name", STEPS)
@given(
    speeds=st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4), lost=st.sets(st.integers(0, 2), max_size=2)
)
def test_the_water_is_read_back(name: str, speeds: list[float], lost: set[int]) -> None:
    velocity = np.array(speeds[: 3 if name == "nucleus" else 4])
    velocity[list(lost)] = np.nan
    recording = sent(name, velocity)
    water = recording.water
    assert water is not None
    assert water.time_ns.tolist() == recording.table.time_ns.tolist() == [NS_2026]
    assert water.valid.tolist() == [np.isfinite(velocity).tolist()]
    known = np.isfinite(velocity)
    assert np.abs(water.velocity_mps[0] - velocity)[known].max() <= 0.5 * STEPS[name] + 1e-12
    assert recording.table.valid.any() == (name not in IN_PLACE)
    if name in {"nortek-dvl", "nucleus"}:
        assert water.range_m[0] == pytest.approx(5.0, rel=1e-6)
    if name == "pd0":
        assert water.range_m[0] == pytest.approx(5.0, abs=0.01)


@pytest.mark.parametrize("name", sorted(IN_PLACE))
def test_a_ping_with_a_beam_of_the_bottom_is_one_of_the_bottom(name: str) -> None:
    one = ping(water_velocity_mps=np.array([0.1, 0.2, 0.3, 0.4]))
    recording = READERS[name](encoder(name, FOUR).encode(one), "record", PLAIN)
    assert recording.water is None
    assert recording.table.beams_valid.tolist() == [3]


def test_the_water_of_a_run_of_a_scenario(tmp_path: Path) -> None:
    """What is drawn is what `convert` reads from the bytes that a simulated Pathfinder sends, at the same times."""
    scenario = load_scenario("straight").with_trajectory(duration_s=12.0)
    scenario = scenario.model_copy(update={"water_track": WaterTrack(range_m=6.0, lost_fraction=0.2)})
    simulation = build_simulation(scenario)
    drawn = sensor_streams(simulation, simulation.truth(), run=2)["beams_water"]
    readings = readings_of_scenario(scenario, run=2)
    writer = encoder("pd0", readings.geometry, start_ns=NS_2026)
    log = tmp_path / "log.pd0"
    log.write_bytes(b"".join(one.data for one in records(readings, writer, NONE, seed=1, offset_ns=NS_2026)))
    recording = read_recording(log)
    water = recording.water
    assert water is not None
    expected = drawn.select(f"beam{k}_mps" for k in range(1, 5)).fill_null(np.nan).to_numpy()
    there = np.isfinite(expected).any(axis=1)
    assert set(water.time_ns.tolist()) <= set(recording.table.time_ns.tolist())
    assert 0.1 < 1.0 - water.valid.mean() < 0.3
    np.testing.assert_array_equal(water.valid, np.isfinite(expected[there]))
    np.testing.assert_allclose(water.velocity_mps, expected[there], atol=0.5e-3 + 1e-12)
    np.testing.assert_allclose(water.range_m, 6.0, atol=0.01)
