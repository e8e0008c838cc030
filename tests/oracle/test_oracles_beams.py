"""The beam oracle on hand-worked cases, before anything is held against it."""

import numpy as np
import pytest

from tests.oracle import beams


def test_beam_one_points_forward_right_and_down() -> None:
    """Hand-worked: sin 20° cos 45° twice and cos 20°; the frame is forward, right, down (Eqs. 13, 14)."""
    horizontal = 0.3420201433256687 / np.sqrt(2)
    expected = [horizontal, horizontal, 0.9396926207859084]
    np.testing.assert_allclose(beams.x_janus()[0], expected, atol=1e-16)


def test_quadrants_follow_the_circle() -> None:
    """Beams 1 to 4 go round by 90°: ahead-right, astern-right, astern-left, ahead-left (Eq. 14)."""
    signs = np.sign(beams.x_janus()).astype(int)
    assert signs.tolist() == [[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]


def test_normal_matrix_of_the_janus() -> None:
    """Hand-worked: AᵀA is diagonal with 2 sin²θ, 2 sin²θ and 4 cos²θ, which fixes every covariance of Eq. 19."""
    s2, c2 = np.sin(beams.TILT_RAD) ** 2, np.cos(beams.TILT_RAD) ** 2
    A = beams.x_janus()
    np.testing.assert_allclose(A.T @ A, np.diag([2 * s2, 2 * s2, 4 * c2]), atol=1e-15)


def test_covariance_at_the_papers_noise() -> None:
    """Hand-worked: 0.042/(√2 sin 20°) = 0.08683 m/s in surge and sway, 0.042/(2 cos 20°) = 0.02235 m/s in heave."""
    R = beams.beam_noise_small_levers(np.full(4, 0.042))
    sd = np.sqrt(np.diag(beams.velocity_covariance(beams.x_janus(), R)))
    np.testing.assert_allclose(sd, [0.08683, 0.08683, 0.02235], atol=5e-6)


def test_reading_of_a_turning_vehicle() -> None:
    """Hand-worked: 1 rad/s about z with the transducer 1 m ahead adds 1 m/s of sway to what the beam sees (Eq. 15)."""
    b = beams.x_janus()[0]
    reading = beams.beam_velocity(
        b, np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), bias=0.5, scale_factor=0.1
    )
    assert reading == pytest.approx(b[1] + 0.5, abs=1e-15)


def test_scale_factor_leaves_the_lever_arm_alone() -> None:
    """Eq. 15 scales the velocity of the platform only, not ω × l."""
    b, v = beams.x_janus()[1], np.array([2.0, -0.1, 0.3])
    w, lever = np.array([0.0, 0.2, 0.1]), np.array([0.5, 0.0, 0.2])
    plain = beams.beam_velocity(b, v, w, lever)
    scaled = beams.beam_velocity(b, v, w, lever, scale_factor=0.01)
    assert scaled - plain == pytest.approx(0.01 * b @ v, abs=1e-15)


def test_least_squares_returns_what_went_in() -> None:
    """Without noise four beams give the velocity back; equal weights leave Eq. 17 as it is."""
    A, v = beams.x_janus(), np.array([2.0, -0.3, 0.1])
    np.testing.assert_allclose(beams.velocity_least_squares(A, A @ v), v, atol=1e-14)
    np.testing.assert_allclose(beams.velocity_weighted(A, A @ v, np.eye(4) * 0.3), v, atol=1e-14)


def test_lever_arms_fill_the_beam_noise() -> None:
    """Eq. 20 reduces to Eq. 21 without lever arms; with them one noisy gyro is seen by every beam."""
    A, sd = beams.x_janus(), np.full(4, 0.042)
    np.testing.assert_allclose(beams.beam_noise(A, np.zeros((4, 3)), 0.1, sd), np.diag(sd**2))
    full = beams.beam_noise(A, np.tile([1.0, 0.0, 0.0], (4, 1)), 0.1, sd)
    assert abs(full[0, 1]) > 1e-3
    assert np.linalg.eigvalsh(full).min() > 0


def test_tight_rows_by_central_difference() -> None:
    """Eq. 22 against Eq. 15 perturbed: velocity, gyro bias (rate = reading − bias), beam bias and scale factor."""
    rng = np.random.default_rng(22)
    A, levers = beams.x_janus(), rng.normal(size=(4, 3))
    velocity, rate, scale = rng.normal(size=3), rng.normal(size=3), 0.02
    H = beams.h_tight(A, velocity, levers, scale)

    def readings(error: np.ndarray) -> np.ndarray:
        return np.array(
            [
                beams.beam_velocity(
                    A[i],
                    velocity + error[6:9],
                    rate - error[12:15],
                    levers[i],
                    float(error[15 + i]),
                    scale + float(error[19]),
                )
                for i in range(4)
            ]
        )

    for column in range(20):
        error = np.zeros(20)
        error[column] = 1e-4
        slope = (readings(error) - readings(-error)) / 2e-4
        np.testing.assert_allclose(slope, H[:, column], atol=1e-10)


def test_loose_rows_are_the_tight_ones_through_the_left_inverse() -> None:
    """The full Eq. 18 keeps the printed velocity block (times 1 + SF) and adds the blocks the paper drops (E7)."""
    A, R = beams.x_janus(), np.diag([1.0, 2.0, 3.0, 4.0])
    H = beams.h_loose(A, R, np.array([2.0, 0.1, 0.0]), np.zeros((4, 3)), 0.0)
    np.testing.assert_allclose(H[:, 6:9], beams.h_loose_printed()[:, 6:9], atol=1e-14)
    np.testing.assert_allclose(H[:, 19], [2.0, 0.1, 0.0], atol=1e-14)
    assert np.abs(H[:, 15:19]).max() > 0.5
