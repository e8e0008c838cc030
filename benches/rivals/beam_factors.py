"""The factors of the graph that gtsam does not have: a beam, a depth, a heading, the walk of the instrument errors.

An error is expected minus measured; a Jacobian is by gtsam's navigation state (attitude, position, velocity, each as a
rotation or shift in platform axes), the inertial bias (accelerometers, gyros) and the instrument errors.
"""

from collections.abc import Sequence
from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def skew(a: Floats) -> Floats:
    """[a×]."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def beam_factor(
    keys: Sequence[int],
    reading_mps: float,
    direction: Floats,
    lever: Floats,
    omega_ip_p: Floats,
    earth_rate_t: Floats,
    *,
    bias_row: int | None,
    size: int,
    noise: Any,  # noqa: ANN401 - gtsam has no types
) -> Any:  # noqa: ANN401
    """A reading y = b · [(1 + SF) v + ω_tp × l] + bias, with ω_tp = ω_ip − b_g − Rᵀ ω_ie, of keys N, B and D.

    The scale factor is row −2 of the instrument errors; `bias_row` is the beam's own, None where it has none. Without a
    lever arm the inertial bias is no variable of the factor.
    """
    has_lever = bool(np.any(lever))
    n, b, d = keys
    # b · (ω × l) = (l × b) · ω.
    across = np.cross(lever, direction)

    def error(_: Any, values: Any, jacobians: Any) -> Floats:  # noqa: ANN401
        state, instrument = values.atNavState(n), values.atVector(d)
        back = state.attitude().matrix().T
        velocity_p = back @ state.velocity()
        scale = 1.0 + instrument[-2]
        expected = scale * (direction @ velocity_p)
        if bias_row is not None:
            expected += instrument[bias_row]
        by_angle = scale * (direction @ skew(velocity_p))
        if has_lever:
            earth_p = back @ earth_rate_t
            expected += across @ (omega_ip_p - values.atConstantBias(b).gyroscope() - earth_p)
            by_angle = by_angle - across @ skew(earth_p)
        if jacobians is not None:
            by_state = np.zeros((1, 9), order="F")
            by_state[0, 0:3], by_state[0, 6:9] = by_angle, scale * direction
            by_instrument = np.zeros((1, size), order="F")
            by_instrument[0, -2] = direction @ velocity_p
            if bias_row is not None:
                by_instrument[0, bias_row] = 1.0
            jacobians[0], jacobians[1] = by_state, by_instrument
            if has_lever:
                by_bias = np.zeros((1, 6), order="F")
                by_bias[0, 3:6] = -across
                jacobians[2] = by_bias
        return np.array([expected - reading_mps])

    return gtsam.CustomFactor(noise, [n, d, b] if has_lever else [n, d], error)


def depth_factor(n: int, d: int, depth_m: float, lever: Floats, size: int, sd_m: float) -> Any:  # noqa: ANN401
    """(r + R l)_z plus the sensor's bias, the last of the instrument errors."""

    def error(_: Any, values: Any, jacobians: Any) -> Floats:  # noqa: ANN401
        state = values.atNavState(n)
        down = state.attitude().matrix()[2]
        if jacobians is not None:
            by_state = np.zeros((1, 9), order="F")
            by_state[0, 0:3], by_state[0, 3:6] = -down @ skew(lever), down
            by_instrument = np.zeros((1, size), order="F")
            by_instrument[0, -1] = 1.0
            jacobians[0], jacobians[1] = by_state, by_instrument
        expected = state.position()[2] + down @ lever + values.atVector(d)[-1]
        return np.array([expected - depth_m])

    return gtsam.CustomFactor(_sigma(sd_m), [n, d], error)


def velocity_factor(n: int, velocity_p_mps: Floats, noise: Any) -> Any:  # noqa: ANN401
    """The velocity in platform axes, Rᵀ v."""

    def error(_: Any, values: Any, jacobians: Any) -> Floats:  # noqa: ANN401
        state = values.atNavState(n)
        velocity_p = state.attitude().matrix().T @ state.velocity()
        if jacobians is not None:
            by_state = np.zeros((3, 9), order="F")
            by_state[:, 0:3], by_state[:, 6:9] = skew(velocity_p), np.eye(3)
            jacobians[0] = by_state
        return np.asarray(velocity_p - velocity_p_mps)

    return gtsam.CustomFactor(noise, [n], error)


def heading_factor(n: int, d: int, yaw_rad: float, slow: range, size: int, sd_rad: float) -> Any:  # noqa: ANN401
    """Yaw of R plus the sensor's slow errors, rows of the instrument errors; on the circle. Undefined on end."""

    def error(_: Any, values: Any, jacobians: Any) -> Floats:  # noqa: ANN401
        rotation = values.atNavState(n).attitude().matrix()
        north, east = rotation[0, 0], rotation[1, 0]
        if jacobians is not None:
            # The bow R e_x moves by R (θ × e_x) = θ_z R e_y − θ_y R e_z.
            by_y, by_z = -rotation[:, 2], rotation[:, 1]
            level = north**2 + east**2
            by_state = np.zeros((1, 9), order="F")
            by_state[0, 1] = (north * by_y[1] - east * by_y[0]) / level
            by_state[0, 2] = (north * by_z[1] - east * by_z[0]) / level
            by_instrument = np.zeros((1, size), order="F")
            by_instrument[0, list(slow)] = 1.0
            jacobians[0], jacobians[1] = by_state, by_instrument
        difference = np.arctan2(east, north) + values.atVector(d)[list(slow)].sum() - yaw_rad
        return np.array([np.arctan2(np.sin(difference), np.cos(difference))])

    return gtsam.CustomFactor(_sigma(sd_rad), [n, d], error)


def walk_factor(before: int, after: int, decay: Floats, sd: Floats) -> Any:  # noqa: ANN401
    """x⁺ = decay · x + n, each error by itself."""
    by_before = np.asfortranarray(-np.diag(decay))
    by_after = np.asfortranarray(np.eye(len(decay)))

    def error(_: Any, values: Any, jacobians: Any) -> Floats:  # noqa: ANN401
        if jacobians is not None:
            jacobians[0], jacobians[1] = by_before, by_after
        return np.asarray(values.atVector(after) - decay * values.atVector(before))

    return gtsam.CustomFactor(gtsam.noiseModel.Diagonal.Sigmas(sd), [before, after], error)


def _sigma(sd: float) -> Any:  # noqa: ANN401 - gtsam has no types
    return gtsam.noiseModel.Diagonal.Sigmas(np.array([sd]))
