"""Flying on an estimate: a perfect one changes nothing, a wrong one leads the vehicle astray."""

import numpy as np
import pytest

from bottomlock.errors import ScenarioError
from bottomlock.plant import Mission, Vehicle, fly, lawn_mower, straight
from bottomlock.plant.closed_loop import (
    Estimate,
    TruthBlock,
    VehicleGroup,
    cross_track_m,
    fly_on_estimate,
    navigation_error,
)
from bottomlock.plant.maths import FloatArray, IntArray
from tests.plant.helpers import GRAVITY_MPS2, LATITUDE_RAD


def _fleet(vehicle: Vehicle, mission: Mission, runs: int) -> VehicleGroup:
    return VehicleGroup(vehicle, mission, runs=runs, latitude_rad=LATITUDE_RAD, gravity_mps2=GRAVITY_MPS2)


def _perfect(block: TruthBlock) -> Estimate:
    return Estimate(block.position_t_m[:, -1], block.attitude_t_p[:, -1], block.velocity_p_mps[:, -1])


@pytest.mark.long
def test_perfect_estimates_fly_the_open_loop_truth(tauv: Vehicle) -> None:
    mission = lawn_mower(duration_s=15.0)
    group = _fleet(tauv, mission, 2)
    blocks = list(fly_on_estimate(group, _perfect))
    truth = fly(tauv, mission, latitude_rad=LATITUDE_RAD, gravity_mps2=GRAVITY_MPS2).truth
    assert (np.concatenate([block.time_ns for block in blocks]) == truth.time_ns).all()
    for name in ("position_t_m", "attitude_t_p", "velocity_p_mps", "omega_p_radps", "force_p_mps2"):
        together = np.concatenate([getattr(block, name) for block in blocks], axis=1)
        assert np.allclose(together, getattr(truth, name)[None], atol=1e-8), name


@pytest.fixture(scope="module")
def misled(tauv: Vehicle) -> tuple[Mission, FloatArray, IntArray]:
    """Four runs of the straight course, the last with yaw off by 3 deg: mission, final positions, final segments."""
    group = _fleet(tauv, straight(duration_s=30.0), 4)

    def wrong(block: TruthBlock) -> Estimate:
        perfect = _perfect(block)
        place = perfect.position_t_m + OFFSETS_M[:, None] * [0.0, 1.0, 0.0]
        w, x, y, z = perfect.attitude_t_p.T
        c, s = np.cos(0.5 * TURN_RAD), np.sin(0.5 * TURN_RAD)
        attitude = np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)
        # The same tangent velocity seen from the turned attitude.
        u, v, d = perfect.velocity_p_mps.T
        velocity = np.stack(
            [np.cos(TURN_RAD) * u + np.sin(TURN_RAD) * v, np.cos(TURN_RAD) * v - np.sin(TURN_RAD) * u, d],
            axis=1,
        )
        return Estimate(place, attitude, velocity)

    last = None
    for block in fly_on_estimate(group, wrong):
        last = block.position_t_m[:, -1]
    assert last is not None
    return group.mission, last, group.segment


OFFSETS_M = np.array([-2.0, 0.0, 3.0, 0.0])
TURN_RAD = np.array([0.0, 0.0, 0.0, np.deg2rad(3.0)])


@pytest.mark.long
def test_a_position_error_puts_the_vehicle_beside_its_path(
    misled: tuple[Mission, FloatArray, IntArray],
) -> None:
    """Each run goes astray by its own error: estimated on the path, truly offset the other way."""
    mission, last, segment = misled
    assert last[:3, 1] == pytest.approx(-OFFSETS_M[:3], abs=0.05)
    assert cross_track_m(mission, segment, last)[:3] == pytest.approx(-OFFSETS_M[:3], abs=0.05)


def test_a_heading_error_crabs_but_holds_the_believed_path(
    misled: tuple[Mission, FloatArray, IntArray],
) -> None:
    """With yaw off by 3 deg and ground velocity known, the crab estimate absorbs the error."""
    _, last, _ = misled
    assert abs(last[3, 1]) < 0.2


def test_astray_is_told_by_the_segment_in_use() -> None:
    """Beside the second leg of a mown lawn, but still on the first: the whole way to the first counts."""
    mission = lawn_mower(leg_m=80.0, spacing_m=30.0)
    place = np.array([[40.0, 30.0, 0.0], [40.0, 1.5, 0.0]])
    assert cross_track_m(mission, np.array([1, 1]), place) == pytest.approx([30.0, 1.5])


def test_navigation_error_is_true_minus_believed(tauv: Vehicle) -> None:
    group = _fleet(tauv, straight(duration_s=2.0), 2)
    block = group.start()
    perfect = _perfect(block)
    error = navigation_error(
        block, Estimate(perfect.position_t_m - 1.0, perfect.attitude_t_p, perfect.velocity_p_mps)
    )
    assert np.allclose(error[:, :3], 1.0)
    assert np.allclose(error[:, 3:], 0.0)


@pytest.mark.parametrize("rate_hz", [5.0, 9.0])
def test_an_imu_too_slow_for_the_loop_is_refused(tauv: Vehicle, rate_hz: float) -> None:
    with pytest.raises(ScenarioError, match=r"imu: rate_hz .* expected at least 10 Hz in the loop"):
        VehicleGroup(
            tauv,
            straight(),
            runs=1,
            latitude_rad=LATITUDE_RAD,
            gravity_mps2=GRAVITY_MPS2,
            imu_rate_hz=rate_hz,
        )


def test_a_lost_estimate_is_named(tauv: Vehicle) -> None:
    group = _fleet(tauv, straight(duration_s=2.0), 3)

    def lost(block: TruthBlock) -> Estimate:
        perfect = _perfect(block)
        place = perfect.position_t_m.copy()
        if block.time_ns[-1] >= 1_000_000_000:
            place[1] = np.nan
        return Estimate(place, perfect.attitude_t_p, perfect.velocity_p_mps)

    with pytest.raises(ScenarioError, match=r"run 1: the estimate at 1\.00 s is not finite"):
        list(fly_on_estimate(group, lost))
