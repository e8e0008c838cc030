"""The closed forms of Eqs. 23-49 against one generic weighted least squares, which knows none of them."""

import numpy as np
import pytest

from tests.oracle import beams, selector
from tests.oracle import partial_closed_forms as paper
from tests.oracle.rotations import Array

B = beams.x_janus()
Y1, Y2 = 0.61, -0.37
SD1, SD2 = 0.042, 0.055
PRIOR = np.array([2.1, 0.2, -0.15])
PRIOR_COV = np.array([[0.09, 0.01, -0.02], [0.01, 0.16, 0.005], [-0.02, 0.005, 0.04]])
E_Z = np.array([0.0, 0.0, 1.0])


def generic(extra_row: Array, extra_value: float, extra_var: float) -> tuple[Array, Array]:
    """Velocity and covariance from beams 1, 2 and one further row."""
    A = np.vstack([B[:2], extra_row])
    R = np.diag([SD1**2, SD2**2, extra_var])
    y = np.array([Y1, Y2, extra_value])
    return beams.velocity_weighted(A, y, R), beams.velocity_covariance(A, R)


def test_printed_third_beam_sd_forgets_correlation() -> None:
    """Eq. 28 equals n_f √(b₃ᵀPb₃) for a diagonal P only (E6)."""
    diagonal = np.diag(np.diag(PRIOR_COV))
    same = paper.third_beam_sd_corrected(B, diagonal, 3.0)
    assert paper.third_beam_sd_as_printed(B, diagonal, 3.0) == pytest.approx(same, rel=1e-14)
    assert paper.third_beam_sd_as_printed(B, PRIOR_COV, 1.0) != pytest.approx(
        paper.third_beam_sd_corrected(B, PRIOR_COV, 1.0), rel=1e-3
    )


def test_printed_nullified_sway_covariance_is_its_limit() -> None:
    """Eq. 36 leaves out what a sway of variance ε does to heave, ε tan²θ/2 (6.6 % of ε), and their covariance."""
    epsilon = 1e-3
    printed = paper.nullified_sway_covariance_as_printed(B, SD1, SD2, epsilon)
    right = paper.nullified_sway_covariance_corrected(B, SD1, SD2, epsilon)
    assert right[0, 0] == pytest.approx(printed[0, 0], rel=1e-12)
    shortfall = epsilon * np.tan(beams.TILT_RAD) ** 2 / 2
    assert right[2, 2] - printed[2, 2] == pytest.approx(shortfall, rel=1e-9)
    np.testing.assert_array_equal(printed, np.diag(np.diag(printed)))
    assert abs(right[1, 2]) == pytest.approx(epsilon * np.tan(beams.TILT_RAD) / np.sqrt(2), rel=1e-12)


def test_virtual_heave_is_a_heave_row_and_the_sign_is_plus() -> None:
    """Eqs. 45 and 46: generic least squares agrees with the plus sign; the minus is negative beyond 0.0316 m/s (E1)."""
    heave_sd = float(np.sqrt(PRIOR_COV[2, 2]))
    velocity, cov = generic(E_Z, PRIOR[2], PRIOR_COV[2, 2])
    assert paper.partial_loose_surge(B, Y1, Y2) == pytest.approx(velocity[0], abs=1e-13)
    assert paper.virtual_heave_sway(B, Y1, Y2, PRIOR[2]) == pytest.approx(velocity[1], abs=1e-12)
    right = paper.virtual_heave_sway_variance_corrected(B, SD1, SD2, heave_sd)
    assert right == pytest.approx(cov[1, 1], rel=1e-12)
    assert paper.virtual_heave_cross_covariance(B, SD1, SD2) == pytest.approx(cov[0, 1], rel=1e-11)
    assert paper.virtual_heave_sway_variance_as_printed(B, 0.042, 0.042, 0.0317) < 0
    assert paper.virtual_heave_sway_variance_as_printed(B, 0.042, 0.042, 0.0315) > 0


def test_selector_equals_nullified_sway() -> None:
    """Erratum E4: with ε near zero NSV wins sway, and surge is a tie of three methods."""
    surge = paper.partial_loose_surge_variance(B, SD1, SD2)
    sd3 = paper.third_beam_sd_corrected(B, PRIOR_COV, 1.0)
    sway = paper.virtual_heave_sway_variance_corrected(B, SD1, SD2, 0.2)
    variances = {
        "NSV": np.diag(paper.nullified_sway_covariance_as_printed(B, SD1, SD2, 1e-3)),
        "VB": np.diag(paper.virtual_beam_covariance(B, SD1, SD2, sd3)),
        "PLCF": np.array([surge, np.inf, np.inf]),
        "VHV": np.array([surge, sway, np.inf]),
    }
    chosen, R = selector.select(variances)
    # Surge is a tie to rounding, so its name says nothing; its variance does.
    assert chosen[1:] == ["NSV", "NSV"]
    assert variances["NSV"][0] == pytest.approx(surge, rel=1e-12)
    assert R[0, 0] == pytest.approx(surge, rel=1e-12)


def test_selector_with_the_printed_sign_takes_the_negative_variance() -> None:
    """Errata E1 and E4 together: Eq. 46 as printed wins Eq. 48 with a variance below zero."""
    surge = paper.partial_loose_surge_variance(B, SD1, SD2)
    chosen, R = selector.select(
        {
            "NSV": np.diag(paper.nullified_sway_covariance_as_printed(B, SD1, SD2, 1e-3)),
            "VHV": np.diag(paper.virtual_heave_covariance_as_printed(B, SD1, SD2, 0.2)),
        }
    )
    assert chosen[1] == "VHV"
    assert R[1, 1] < 0
    assert R[0, 0] == pytest.approx(surge, rel=1e-12)
