"""Dead reckoning in a campaign: on the filters' own readings, as far off as it claims, null what it has not."""

from functools import cache

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.campaign.build import BuiltScenario, build_scenarios, build_simulations
from bottomlock.campaign.chunk import Chunk, ChunkTables, run_chunk
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.simulation.sensor_streams import sensor_streams

RECKONING = "dead_reckoning"
KEYS = {
    "heading": {"heading.enabled": True, "heading.noise_deg": 0.3, "heading.offset_sd_deg": 2.0,
                "heading.walk_sd_deg": 1.0, "heading.walk_time_s": 30.0},
    "magnetometer": {"magnetometer.enabled": True, "magnetometer.yaw_noise_deg": 0.3,
                     "magnetometer.roll_pitch_noise_deg": 0.3, "magnetometer.yaw_offset_sd_deg": 2.0,
                     "magnetometer.yaw_walk_sd_deg": 1.0, "magnetometer.walk_time_s": 30.0},
}  # fmt: skip
"""Keys that give a scenario an attitude reference."""


def scenario(**keys: object) -> Scenario:
    """A turning vehicle with all beams, a minute long."""
    one = load_scenario("figure_eight").with_trajectory(duration_s=60.0).replace({"dvl.beams_lost": []})
    return one.replace(keys).with_overrides(methods=["tc", RECKONING, "ins"])


@cache
def built(reference: str) -> BuiltScenario:
    return build_scenarios(build_simulations([scenario(**KEYS[reference])]))[0]


def chunk(one: BuiltScenario, runs: int, first: int = 0) -> ChunkTables:
    return run_chunk(one, Chunk(one.scenario.name, first, runs))


def of_reckoning(table: pl.DataFrame) -> pl.DataFrame:
    return table.filter(pl.col("method") == RECKONING)


def test_the_filters_are_what_they_are_without_it() -> None:
    one = built("heading")
    without = build_scenarios(build_simulations([one.scenario.with_overrides(methods=["tc", "ins"])]))[0]
    ours, theirs = chunk(one, 3), chunk(without, 3)
    assert ours.samples["method"].unique(maintain_order=True).to_list() == ["tc", RECKONING, "ins"]
    for mine, other in ((ours.samples, theirs.samples), (ours.counts, theirs.counts)):
        assert mine.filter(pl.col("method") != RECKONING).equals(other)


def test_what_it_does_not_estimate_is_null() -> None:
    result = chunk(built("magnetometer"), 2)
    own = of_reckoning(result.counts)
    absent = ["nis_mean_over_fixes", "fixes_accepted", "fixes_rejected", "err_gyro_bias_x_radps"]
    assert own.select(absent).null_count().row(0) == (2,) * len(absent)
    samples = of_reckoning(result.samples)
    assert samples["nees"].null_count() == samples["nees_velocity_attitude"].null_count() == samples.height
    stated = samples.select("^(err|sd)_.*$")
    assert stated.null_count().row(0) == (0,) * stated.width
    others = result.samples.filter(pl.col("method") != RECKONING)
    assert others["nees"].null_count() == 0


@pytest.mark.long
@pytest.mark.parametrize("reference", ["heading", "magnetometer"])
def test_errors_are_of_the_size_that_it_claims(reference: str) -> None:
    """RMS of error over σ at the end, horizontally, over 64 runs: 1 within 4 of its sigma, 1/√128."""
    samples = of_reckoning(chunk(built(reference), 64).samples)
    last = samples.filter(pl.col("time_ns") == samples["time_ns"].max())
    off = np.concatenate(
        [last[f"err_position_{axis}_m"] / last[f"sd_position_{axis}_m"] for axis in ("north", "east")]
    )
    assert 0.65 < np.sqrt(np.mean(off**2)) < 1.35
    yaw = (last["err_misalignment_down_rad"] / last["sd_misalignment_down_rad"]).to_numpy()
    assert 0.65 < np.sqrt(np.mean(yaw**2)) < 1.35


def test_the_yaw_is_that_of_the_latest_heading() -> None:
    """True less estimated yaw is true less measured yaw, at the readings' own times."""
    one = built("heading")
    samples = of_reckoning(chunk(one, 1).samples)
    heading = sensor_streams(one.simulation, one.truth)["heading"]
    rows = np.searchsorted(one.truth.time_ns, heading["time_ns"].to_numpy())
    true = Rotation.from_quat(one.truth.attitude_t_p[rows], scalar_first=True).as_euler("ZYX")[:, 0]
    off = (true - heading["heading_rad"].to_numpy() + np.pi) % (2.0 * np.pi) - np.pi
    both = samples.select("time_ns", "err_misalignment_down_rad").join(
        pl.DataFrame({"time_ns": heading["time_ns"], "off": off}), on="time_ns"
    )
    assert both.height > 50
    assert both["err_misalignment_down_rad"].to_numpy() == pytest.approx(both["off"].to_numpy(), abs=2e-3)


def test_without_a_reference_or_with_feedback_it_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"needs an attitude reference: enable \[magnetometer\]"):
        build_simulations([scenario()])
    swims = load_scenario("straight").with_trajectory(
        source="vehicle", vehicle="remus100", feedback="estimate"
    )
    steered = swims.replace({"heading.enabled": True}).with_overrides(methods=[RECKONING])
    with pytest.raises(ScenarioError, match="steers no vehicle"):
        build_simulations([steered])
