"""The study of convergence: its clock, its wrong starts, and the same readings for all."""

import numpy as np
import pytest

from benches.rivals import rotations
from benches.rivals.convergence import Case, Track, our_track, rival_track, table, world, wrong
from benches.rivals.development import mission_along
from benches.rivals.error_state import ErrorStateFilter
from benches.rivals.iterated import IteratedFilter
from benches.rivals.state import MISALIGNMENT, Additive, RightInvariant
from bottomlock.simulation.build import build_simulation
from bottomlock.truth.truth import Truth
from partialdvl_bench.mission import Mission


@pytest.fixture(scope="module")
def flown() -> tuple[Mission, Truth]:
    simulation = build_simulation(world(15.0))
    truth = simulation.truth()
    return mission_along(simulation, truth), truth


def track_of(degrees: list[float]) -> Track:
    error = np.deg2rad(np.stack([0.0 * np.array(degrees), 0.0 * np.array(degrees), degrees], axis=1))
    cov = np.tile(np.deg2rad(1.0) ** 2 * np.eye(3), (len(degrees), 1, 1))
    return Track(np.arange(1.0, len(degrees) + 1.0), error, cov)


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        ([30.0, 5.0, 1.0, 3.0, 1.0, 0.5], 5.0),
        ([1.0, 1.0, 1.0], 1.0),
        ([30.0, 1.0, 2.5], np.inf),
        ([30.0, 1.0, np.nan], np.inf),
    ],
)
def test_converged_is_within_two_degrees_to_the_end(degrees: list[float], expected: float) -> None:
    assert track_of(degrees).converged_s() == expected


def test_final_nees() -> None:
    assert track_of([30.0, 2.0]).final_nees() == pytest.approx(4.0)
    assert track_of([30.0, np.nan]).final_nees() == np.inf


def test_a_start_is_wrong_as_its_case_says(flown: tuple[Mission, Truth]) -> None:
    mission, truth = flown
    sides = set()
    for seed in range(12):
        begun = wrong(mission, truth, Case(60.0, 10.0), np.random.default_rng(seed))
        start, true = rotations.matrix(begun.start.attitude_t_p), rotations.matrix(truth.attitude_t_p[0])
        error = np.rad2deg(rotations.log(true @ start.T))
        assert abs(error[2]) == pytest.approx(60.0)
        assert np.linalg.norm(error[:2]) == pytest.approx(10.0)
        np.testing.assert_allclose(np.rad2deg(begun.model.initial.attitude_sd_rad), [10.0, 10.0, 60.0])
        sides.add(np.sign(error[2]))
    assert sides == {-1.0, 1.0}


def test_the_kernel_and_the_rivals_see_the_same(flown: tuple[Mission, Truth]) -> None:
    """Where errors are small `tc` and the invariant EKF are one filter, written twice: same attitude, same claim."""
    mission, _ = flown
    ours = our_track("tc", mission, None)
    theirs = rival_track(ErrorStateFilter(mission, RightInvariant()), mission, None)
    sd = np.sqrt(np.diagonal(ours.cov_rad2, axis1=1, axis2=2))
    assert (np.abs(ours.error_rad - theirs.error_rad) < 0.1 * sd).all()
    np.testing.assert_allclose(np.sqrt(np.diagonal(theirs.cov_rad2, axis1=1, axis2=2)), sd, rtol=0.005)


def test_an_iteration_changes_nothing_where_all_is_linear(flown: tuple[Mission, Truth]) -> None:
    mission, _ = flown
    once, iterated = ErrorStateFilter(mission, Additive()), IteratedFilter(mission, Additive())
    for rival in (once, iterated):
        rival.covariance[MISALIGNMENT, :], rival.covariance[:, MISALIGNMENT] = 0.0, 0.0
        rival.update("position", rival.sensors.position(np.array([3.0, -2.0, 21.0]), 0.5))
    np.testing.assert_allclose(iterated.covariance, once.covariance, atol=1e-13)
    np.testing.assert_allclose(Additive().difference(once.state, iterated.state), 0.0, atol=1e-12)


def test_an_iteration_finds_the_most_likely_state(flown: tuple[Mission, Truth]) -> None:
    """A heading of 50° off the start's, with a lever of the tilt: the gradient of the posterior vanishes."""
    mission, truth = flown
    begun = wrong(mission, truth, Case(60.0, 10.0), np.random.default_rng(1))
    rival = IteratedFilter(begun, RightInvariant())
    prior, P = rival.state, rival.covariance.copy()
    measurement = rival.sensors.beams(np.array([1.1, 0.3, -0.8, -0.2]), np.zeros(3))
    assert measurement is not None
    rival.update("ping", measurement)

    def cost(state) -> float:  # type: ignore[no-untyped-def]  # noqa: ANN001
        error = rival.chart.difference(prior, state)
        residual = measurement.innovation(measurement.predict(state))
        alive = np.diag(P) > 0.0
        return float(
            error[alive] @ np.linalg.solve(P[np.ix_(alive, alive)], error[alive])
            + residual @ np.linalg.solve(measurement.cov, residual)
        )

    best = cost(rival.state)
    draw = np.random.default_rng(2)
    for _ in range(20):
        aside = 0.05 * np.sqrt(np.diag(rival.covariance)) * draw.standard_normal(rival.layout.size)
        assert cost(rival.chart.retract(rival.state, aside)) > best


def test_table_counts_who_converged() -> None:
    rows = [
        {"case": "90° yaw", "filter": "tc", "converged_s": time, "final_deg": 0.5, "final_nees": 3.0}
        for time in (10.0, 20.0, float("inf"))
    ]
    assert "| 90° yaw | tc | 2 of 3 | 15 (12 to 18) | 0.5 | 3 |" in table(rows)
