"""Robust updates against the literal ones of the papers, and what they may never do."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

import bottomlock
from bottomlock.kernel import Method
from tests.oracle import beams, heavy_tails
from tests.oracle.rotations import Array
from tests.property import settings
from tests.property.test_filter_laws import error_of, initial, state_covariances

A = beams.x_janus()
SD = np.array([0.03, 0.04, 0.05, 0.04])
NO_GATES: dict[str, Any] = {"closure_gate": None, "beam_gate": None}


def pushed(robust: dict[str, Any] | None, P: Array, noise: Array, valid: Array, method: Method = "tc") -> Any:  # noqa: ANN401
    """Correction, covariance after and report of one ping, residual and Jacobian of its valid beams."""
    model = settings.table_2()
    model["environment"]["earth_rate_radps"] = 0.0
    options: Any = settings.options(exact=True) | ({} if robust is None else {"robust": NO_GATES | robust})
    start = initial(np.array([2.0, 0.1, -0.1]), np.array([1.0, 0.0, 0.0, 0.0]))
    nav = bottomlock.Navigator(bottomlock.BeamGeometry(A), model, options, start, method=method, covariance=P)
    nav.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=np.array([0.0, 0.0, -settings.GRAVITY]))
    before = nav.state()
    v, bias, scale = np.asarray(before["velocity_p_mps"]), before["dvl_bias_mps"], before["dvl_scale_factor"]
    expected = np.array(
        [beams.beam_velocity(A[i], v, np.zeros(3), np.zeros(3), bias[i], scale) for i in range(4)]
    )
    (report,) = nav.push_beams(0, expected + noise, valid, sd_mps=SD)
    H = beams.h_tight(A, v, np.zeros((4, 3)), scale)[valid]
    return error_of(nav.state(), before), nav.covariance(), report, H


noises = st.tuples(
    st.lists(st.floats(-0.15, 0.15), min_size=4, max_size=4), st.floats(-3, 3), st.integers(0, 3)
)
masks = st.lists(st.booleans(), min_size=4, max_size=4).filter(any)


def disturbed(drawn: tuple[list[float], float, int]) -> Array:
    """Small errors of all beams and a large one of a single beam."""
    noise = np.array(drawn[0])
    noise[drawn[2]] += drawn[1]
    return noise


@given(P=state_covariances(), drawn=noises, mask=masks, degrees=st.floats(2, 20))
@hypothesis_settings(max_examples=hypothesis_settings().max_examples // 4, deadline=None)
def test_student_t_is_the_variational_update(
    P: Array, drawn: tuple[list[float], float, int], mask: list[bool], degrees: float
) -> None:
    """State, covariance and weights of Agamennoni's update in twenty dimensions; ours works in those of the beams.

    The scale that it is given holds what Student's t tells less than a Gaussian: (ν + 3)/(ν + 1) in the variance.
    """
    noise, valid = disturbed(drawn), np.array(mask)
    got, after, report, H = pushed({"tail": "student_t", "student_t_degrees": degrees}, P, noise, valid)
    less = (degrees + 3) / (degrees + 1)
    x, posterior, w = heavy_tails.student_t(P, H, SD[valid] * np.sqrt(less), noise[valid], degrees)
    sd = np.sqrt(np.diag(P))
    np.testing.assert_allclose(report.beam_weight[valid], w / less, rtol=1e-5)
    np.testing.assert_allclose(got / sd, x / sd, atol=1e-5)
    np.testing.assert_allclose(after / np.outer(sd, sd), posterior / np.outer(sd, sd), atol=1e-5)
    assert np.isnan(report.beam_weight[~valid]).all()


@given(P=state_covariances(), drawn=noises, mask=masks)
@hypothesis_settings(max_examples=hypothesis_settings().max_examples, deadline=None)
def test_outliers_are_those_of_the_literal_rule(
    P: Array, drawn: tuple[list[float], float, int], mask: list[bool]
) -> None:
    """The beams that go, and what the others keep where none stands out."""
    noise, valid = disturbed(drawn), np.array(mask)
    gates = {"closure_gate": 0.99, "beam_gate": 0.99, "tail": "gaussian"}
    _, _, report, H = pushed(gates, P, noise, valid)
    kept = heavy_tails.screened(P, H, A[valid], SD[valid], noise[valid], 0.99)
    np.testing.assert_allclose(report.beam_weight[valid], kept, rtol=1e-6)
