"""The robust rival, the slow errors of the heading as a rival's states, and the start before the first beam."""

import dataclasses

import numpy as np
import pytest

from benches.rivals import error_state, robust
from benches.rivals.development import mission_of
from benches.rivals.error_state import ErrorStateFilter
from benches.rivals.propagation import noise, transition
from benches.rivals.robust import RobustFilter, screened, student_t_variance
from benches.rivals.sensors import Sensors
from benches.rivals.state import Additive, Layout, at_start, covariance_at_start
from benches.rivals.strapdown import Earth, Increment
from bottomlock.config.scenario import load_scenario
from bottomlock.kernel.models import HeadingModel
from partialdvl_bench.mission import Mission
from tests.oracle import heavy_tails

SLOW = HeadingModel(sd_rad=0.01, offset_sd_rad=0.07, walk_sd_rad=0.05, walk_time_s=60.0)


@pytest.fixture(scope="module")
def mission() -> Mission:
    return mission_of(load_scenario("survey_table2").with_trajectory(duration_s=20.0))


@pytest.fixture(scope="module")
def slow(mission: Mission) -> Mission:
    """With a heading reference that has slow errors."""
    return dataclasses.replace(mission, model=mission.model.replace(heading=SLOW))


def test_weights_are_those_of_the_variational_update() -> None:
    """Against the slow oracle of the kernel's own weights, with an outlier of eight sigma."""
    draw = np.random.default_rng(4)
    root, H = draw.normal(size=(5, 5)), draw.normal(size=(4, 5))
    P, sd, z = 1e-4 * root @ root.T, np.array([0.1, 0.1, 0.2, 0.1]), np.array([0.05, -0.8, 0.1, 0.02])
    found = student_t_variance(z, H @ P @ H.T, sd**2, 4.0)
    scaled = sd * np.sqrt(7.0 / 5.0)
    _, _, weights = heavy_tails.student_t(P, H, scaled, z, 4.0)
    np.testing.assert_allclose(found, scaled**2 / weights, rtol=1e-6)
    assert weights[1] < 0.3


def test_closure_of_a_janus_by_hand(mission: Mission) -> None:
    """(e₁ − e₂ + e₃ − e₄)²/4σ² with velocity unknown, whose quantile of 99.73 % is 9.0: e = 6.0 σ passes, 6.1 fails."""
    directions = mission.geometry.directions_p
    sign = np.array([1.0, -1.0, 1.0, -1.0])
    # The same with beams of 1 and 2 σ, whose sum of squares is 10 instead of 4: 3 √10 = 9.49.
    for sd, size, left in ((1.0, 5.99, 4), (1.0, 6.01, 3), (2.0, 9.47, 4), (2.0, 9.51, 3)):
        S = np.diag([1.0, sd**2, 1.0, sd**2]) + 1e6 * directions @ directions.T
        innovation = 0.25 * size * sign
        kept = screened(innovation, S, directions, closure_gate=0.9973, beam_gate=None)
        assert kept.sum() == left
        assert screened(innovation, S, directions, closure_gate=None, beam_gate=None).all()


def test_the_beam_that_is_off_is_removed(mission: Mission) -> None:
    """The prediction says which of four; with three left all are kept, and a beam alone is tested by its own gate."""
    directions = mission.geometry.directions_p
    S = np.eye(4) + 0.1 * directions @ directions.T
    innovation = np.array([0.2, -0.1, 9.0, 0.3])
    gates = {"closure_gate": 0.9973, "beam_gate": 0.9973}
    assert screened(innovation, S, directions, **gates).tolist() == [True, True, False, True]
    alone = screened(innovation[2:3], S[2:3, 2:3], directions[2:3], **gates)
    assert alone.tolist() == [False]
    assert screened(innovation[3:], S[3:, 3:], directions[3:], **gates).all()


def test_a_burst_of_wrong_beams_moves_it_less(mission: Mission) -> None:
    """Two beams read 1 m/s too much for five seconds: the plain filter without a gate follows, the robust does not."""
    velocity = mission.pings.velocity_mps.copy()
    velocity[8:13, :2] += 1.0
    wrong = dataclasses.replace(mission, pings=dataclasses.replace(mission.pings, velocity_mps=velocity))
    plain = dataclasses.replace(wrong, options=wrong.options.replace(gate="off"))
    assert mission.truth is not None
    worst = [
        np.linalg.norm(found.velocity_p_mps - mission.truth.velocity_p_mps, axis=1).max()
        for found in (robust.estimate(wrong), error_state.estimate(plain))
    ]
    assert worst[0] < 0.5 * worst[1]


def test_six_rejected_pings_are_taken(mission: Mission) -> None:
    rival = RobustFilter(mission)
    rival.held.waits = False
    off = mission.geometry.directions_p @ [12.0, 0.0, 0.0]
    before = rival.state.velocity_p_mps.copy()
    for k in range(6):
        assert rival.rejected == k
        np.testing.assert_array_equal(rival.state.velocity_p_mps, before)
        rival.measure("ping", off, None)
    assert not np.array_equal(rival.state.velocity_p_mps, before)


def test_slow_errors_of_the_heading_are_states(slow: Mission, mission: Mission) -> None:
    """Two states where the model claims them, with its σ; they add to the reading, and the walk stays at its σ."""
    assert Layout.of(mission).heading.stop == Layout.of(mission).heading.start
    layout = Layout.of(slow, 3)
    assert layout.heading.stop - layout.heading.start == 2
    assert layout.size == layout.heading.stop
    P = covariance_at_start(slow, layout)
    np.testing.assert_allclose(np.sqrt(np.diag(P)[layout.heading]), [SLOW.offset_sd_rad, SLOW.walk_sd_rad])
    state, measurement = at_start(slow, layout), Sensors(slow, layout).heading(np.array([0.3]))
    assert measurement is not None
    step = 1e-6 * np.eye(layout.size)
    columns = [
        (
            measurement.predict(Additive().retract(state, one))
            - measurement.predict(Additive().retract(state, -one))
        )
        / 2e-6
        for one in step
    ]
    np.testing.assert_allclose(np.stack(columns, axis=-1), measurement.jacobian(state), atol=1e-8)
    still = Increment(np.zeros(3), np.zeros(3), np.zeros((3, 3)))
    earth = Earth.of(slow.model.environment)
    phi = transition(layout, still, 0.1, earth, slow.model)
    after = phi @ P @ phi.T + noise(layout, phi, 0.1, slow.model)
    np.testing.assert_allclose(
        np.sqrt(np.diag(after)[layout.heading]), [SLOW.offset_sd_rad, SLOW.walk_sd_rad], rtol=1e-5
    )


def test_before_the_first_bottom_lock_the_start_is_held(mission: Mission) -> None:
    """Without any beam the velocity stays that of the start and is claimed so; beams that determine it end that."""
    none = np.zeros_like(mission.pings.valid)
    blind = dataclasses.replace(mission, pings=dataclasses.replace(mission.pings, valid=none))
    found = error_state.estimate(blind)
    off = np.linalg.norm(found.velocity_p_mps[-1] - mission.start.velocity_p_mps)
    claimed = np.sqrt(np.trace(found.velocity_cov[-1]))
    start = np.linalg.norm(mission.model.initial.velocity_sd_mps)
    assert off < 4.0 * start
    assert start < claimed < 3.0 * start
    rival = ErrorStateFilter(mission)
    lost, one, three = np.full(4, np.nan), np.array([0.1, *[np.nan] * 3]), np.array([0.1, 0.2, 0.1, np.nan])
    rows = []
    for ping in (lost, one, lost, three, lost):
        measured = rival.measurement("ping", ping, None)
        rows.append(0 if measured is None else len(measured.value))
    # A velocity, a beam, a velocity again, three beams, and then nothing.
    assert rows == [3, 1, 3, 3, 0]
    assert not rival.held.waits
