"""Inertial readings integrated over segments, against the trapezoidal rule written out."""

import numpy as np
import pytest

from bottomlock.errors import KernelError
from bottomlock.kernel import integrate_segments
from bottomlock.recordings.rig_motion import integrate
from bottomlock.recordings.streams import Inertial
from tests.oracle.rotations import Array, exp_rotation


def literal(time_ns: Array, force: Array, omega: Array) -> tuple[Array, Array, Array, Array]:
    """C, ∫ C f dt, ∫ C dt and ∫ (∫ C dt eⱼ) × C f dt at every reading of one segment."""
    C = [np.eye(3)]
    for k in range(1, len(time_ns)):
        step_s = (time_ns[k] - time_ns[k - 1]) * 1e-9
        C.append(C[-1] @ exp_rotation(0.5 * (omega[k - 1] + omega[k]) * step_s))

    def integral(values: list[Array]) -> Array:
        total = [np.zeros_like(values[0])]
        for k in range(1, len(values)):
            step_s = (time_ns[k] - time_ns[k - 1]) * 1e-9
            total.append(total[-1] + 0.5 * step_s * (values[k - 1] + values[k]))
        return np.array(total)

    felt = [c @ f for c, f in zip(C, force, strict=True)]
    swept = integral(C)
    pushed = [
        np.stack([np.cross(swept[k][:, j], felt[k]) for j in range(3)], axis=1) for k in range(len(felt))
    ]
    return np.array(C), integral(felt), swept, integral(pushed)


def test_two_segments() -> None:
    rng = np.random.default_rng(1)
    time_ns = np.cumsum(rng.integers(8_000_000, 12_000_000, 2 * 120))
    force, omega = rng.normal(size=(240, 3)) - [0.0, 0.0, 9.8], rng.normal(size=(240, 3))
    found = integrate_segments(time_ns, force, omega, 120)
    for segment, rows in enumerate((slice(0, 120), slice(120, 240))):
        for name, expected in zip(
            ("rotation", "force_integral_mps", "rotation_integral_s", "bias_integral"),
            literal(time_ns[rows], force[rows], omega[rows]),
            strict=True,
        ):
            np.testing.assert_allclose(found[name][segment], expected, atol=1e-12, err_msg=name)  # type: ignore[literal-required]


def test_wrong_readings() -> None:
    time_ns, level = np.arange(10) * 10_000_000, np.zeros((10, 3))
    with pytest.raises(KernelError, match="readings is 4, expected a number by which the 10 readings divide"):
        integrate_segments(time_ns, level, level, 4)
    with pytest.raises(KernelError, match="omega_p_radps"):
        integrate_segments(time_ns, level, np.where(np.arange(30).reshape(10, 3) == 7, np.nan, level), 5)
    with pytest.raises(KernelError, match=r"force_p_mps2 has shape \(9, 3\), expected \(10, 3\)"):
        integrate_segments(time_ns, level[:9], level, 5)


@pytest.mark.parametrize("wild", [np.nan, np.inf, 1e200])
def test_a_segment_with_a_wild_reading_is_left_out(wild: float) -> None:
    rng = np.random.default_rng(2)
    time_ns = np.arange(3000) * 20_000_000
    force, omega = rng.normal(size=(3000, 3)) - [0.0, 0.0, 9.8], rng.normal(size=(3000, 3))
    whole = integrate(Inertial(time_ns, force, omega))
    force[1500, 1] = wild
    found = integrate(Inertial(time_ns, force, omega))
    assert whole is not None and found is not None  # noqa: PT018 - both for the type checker
    assert (whole.count, found.count) == (3, 2)
    np.testing.assert_array_equal(found.bias_integral, whole.bias_integral[[0, 2]])
