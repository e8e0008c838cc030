"""A dive of known truth through the whole path: what was written in odd units and frames comes back as it was."""

import numpy as np
import polars as pl
import pytest

from bottomlock.files.replay_tables import IMU_FAULTS, SIGMAS, ReplayTables
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.run import replay_case
from bottomlock.statistics.replay import runs_table
from tests.oracle.rotations import matrix_from_quaternion
from tests.replay import synthetic_dive

ASKED = """
[replay]
methods = ["ins", "lc", "tc", "info", "vb", "sway_current"]
[[what_if]]
name = "lost_34"
beams_lost = [3, 4]
[[what_if]]
name = "outage"
outages = [{ beams = [1, 2, 3, 4], from_s = 20.0, to_s = 50.0 }]
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return load_case(synthetic_dive.write(tmp_path_factory.mktemp("dive"), ASKED))


@pytest.fixture(scope="module")
def replayed(case: Case) -> ReplayTables:
    return replay_case(case)


def test_readings_come_back_in_si(case: Case) -> None:
    """Axes, units, mounting, clocks, lever arms and scale undone: every stream is that of the truth, to rounding."""
    true, streams = synthetic_dive.motion(), read_streams(case)
    np.testing.assert_array_equal(streams.inertial.time_ns, true["time_ns"])
    np.testing.assert_allclose(streams.inertial.force_p_mps2, true["force_p_mps2"], atol=1e-9)
    np.testing.assert_allclose(streams.inertial.omega_p_radps, true["omega_p_radps"], atol=1e-12)
    rows = slice(25, None, 50)
    np.testing.assert_array_equal(streams.beams.time_ns, true["time_ns"][rows])
    earth = 7.292115e-5 * np.array([np.cos(np.deg2rad(32.8)), 0.0, -np.sin(np.deg2rad(32.8))])
    R = [matrix_from_quaternion(q) for q in true["attitude_t_p"]]
    rate_tp = np.array([w - r.T @ earth for w, r in zip(true["omega_p_radps"], R, strict=True)])
    beams = streams.instrument.geometry.beam_velocities(true["velocity_p_mps"], omega_tp_p_radps=rate_tp)[
        rows
    ]
    np.testing.assert_allclose(streams.beams.velocity_mps, beams, atol=1e-9)
    assert streams.reference is not None
    assert streams.reference.position_t_m is not None
    assert streams.reference.velocity_p_mps is not None
    assert streams.depths is not None
    each = slice(0, None, 50)
    np.testing.assert_array_equal(streams.reference.time_ns, true["time_ns"][each])
    np.testing.assert_allclose(streams.reference.position_t_m, true["position_t_m"][each], atol=1e-6)
    # The reference is carried to the IMU with what the gyros read, the Earth's rate included: 7e-5 rad/s on 1.6 m.
    np.testing.assert_allclose(streams.reference.velocity_p_mps, true["velocity_p_mps"][each], atol=2e-4)
    np.testing.assert_allclose(streams.depths.depth_m[::4], true["position_t_m"][:-1:50, 2], atol=1e-9)


def test_perfect_readings_navigate_back_to_the_truth(replayed: ReplayTables) -> None:
    """With all beams the error at the end is centimetres on 120 m, and millimetres per second in velocity."""
    rows = synthetic_dive.rows_of(replayed.runs, what_if="recorded", method="lc")
    assert rows["position_final_m"].to_numpy().max() < 0.15
    assert rows["velocity_rms_over_time_mps"].to_numpy().max() < 0.003
    np.testing.assert_allclose(rows["distance_m"], 120.0, rtol=1e-3)


def test_positions_on_the_earth(replayed: ReplayTables) -> None:
    """Latitude and longitude of the estimate are those of its tangent coordinates, by the book."""
    from tests.oracle import geodesy

    home = geodesy.ecef(np.deg2rad(32.8), np.deg2rad(35.0), 12.0)
    for row in replayed.samples.sample(20, seed=1).iter_rows(named=True):
        ned = np.array([row["north_m"], row["east_m"], row["down_m"]])
        latitude, longitude, height = geodesy.geodetic_of_ned(ned, home, 32.8, 35.0)
        assert row["latitude_deg"] == pytest.approx(np.rad2deg(latitude), abs=1e-11)
        assert row["longitude_deg"] == pytest.approx(np.rad2deg(longitude), abs=1e-11)
        assert row["height_m"] == pytest.approx(height, abs=1e-6)


def test_coverage_counts_axes_within_sigma(replayed: ReplayTables) -> None:
    """Errors of 0.5, 1.5 and 2.5 σ on the axes: a third is within one, two thirds within two, all within three."""
    factors = {"surge": 0.5, "sway": -1.5, "heave": 2.5}
    samples = replayed.samples.with_columns(
        (factor * pl.col(f"sd_velocity_{axis}_mps")).alias(f"err_velocity_{axis}_mps")
        for axis, factor in factors.items()
    )
    faults = replayed.runs.select(list(IMU_FAULTS)).unique(maintain_order=True)
    runs = runs_table(samples, replayed.innovations, replayed.pings, faults, replayed.path, 0)
    for k, fraction in zip(SIGMAS, (1 / 3, 2 / 3, 1.0), strict=True):
        np.testing.assert_allclose(runs[f"velocity_covered_{k}sigma"], fraction, rtol=1e-12)
    rms = np.sqrt((0.25 + 2.25 + 6.25) / 3)
    np.testing.assert_allclose(runs["velocity_normalised_rms_over_time"], rms, rtol=1e-12)


def test_without_a_height_positions_are_compared_on_the_level(case: Case) -> None:
    """No height is invented: the error down is empty, and norm, error/σ and coverage are those of north and east."""
    assert case.reference is not None
    without = case.model_copy(
        update={"reference": case.reference.model_copy(update={"height": None}), "what_if": ()}
    )
    level = replay_case(without.with_methods(["tc"]))
    assert level.samples["err_position_down_m"].null_count() == level.samples.height
    own = synthetic_dive.rows_of(level.samples, **{"pass": "forward"})
    last = own.row(-1, named=True)
    row = synthetic_dive.rows_of(level.runs, **{"pass": "forward"}).row(0, named=True)
    errors = np.array([last["err_position_north_m"], last["err_position_east_m"]])
    assert row["position_final_m"] == pytest.approx(np.linalg.norm(errors), rel=1e-12)
    normalised = own.slice(1).select(
        (pl.col(f"err_position_{axis}_m") / pl.col(f"sd_position_{axis}_m")) ** 2
        for axis in ("north", "east")
    )
    expected = np.sqrt(normalised.to_numpy().mean())
    assert row["position_normalised_rms_over_time"] == pytest.approx(expected, rel=1e-12)
    assert row["position_covered_3sigma"] is not None
