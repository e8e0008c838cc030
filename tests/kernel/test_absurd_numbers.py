"""Numbers that no instrument gives: every kernel function refuses them by name, and none returns NaN as an answer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import bottomlock
from bottomlock import kernel
from bottomlock._kernel import BeamGeometry
from bottomlock.errors import KernelError
from tests.property import settings

if TYPE_CHECKING:
    from collections.abc import Callable

ABSURD = [np.nan, np.inf, -np.inf, 1e20, -1e300]
GEOMETRY = BeamGeometry.janus(0.35)


def error_model(**changed: Any) -> Any:  # noqa: ANN401 - an argument of any kind
    """F and Q at rest, with what a test changes."""
    given: dict[str, Any] = {
        "attitude_t_p": [1.0, 0.0, 0.0, 0.0], "velocity_p_mps": np.zeros(3),
        "omega_p_radps": np.zeros(3), "force_p_mps2": np.array([0.0, 0.0, -9.8]),
    }  # fmt: skip
    return kernel.error_model(settings.table_2(), **(given | changed))


@pytest.mark.parametrize("value", ABSURD)
@pytest.mark.parametrize("field", ["velocity_p_mps", "omega_p_radps", "force_p_mps2"])
def test_error_model(field: str, value: float) -> None:
    """NaN at a rate gave NaN in F."""
    with pytest.raises(KernelError, match=f"{field[:5]}.* (is not finite|is .*filler)"):
        error_model(**{field: [0.0, value, 0.0]})


def test_error_model_refuses_a_quaternion_that_is_none() -> None:
    """It was normalised without a word."""
    with pytest.raises(KernelError, match="attitude_t_p has norm 2, expected 1"):
        error_model(attitude_t_p=[2.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("value", ABSURD)
@pytest.mark.parametrize(
    "given",
    [
        lambda value: {"velocity_p_mps": [[0.0, 0.0, 0.0], [1.0, value, 0.0]]},
        lambda value: {"omega_tp_p_radps": [[0.0, 0.0, 0.0], [0.0, value, 0.0]]},
        lambda value: {"beam_bias_mps": [0.0, value, 0.0, 0.0]},
        lambda value: {"scale_factor": value},
    ],
)
def test_beam_velocities(given: Callable[[float], dict[str, Any]], value: float) -> None:
    """A NaN was passed on to the readings."""
    arguments = {"velocity_p_mps": np.zeros((2, 3))} | given(value)
    name = next(iter(given(value)))
    with pytest.raises(KernelError, match=f"{name}"):
        GEOMETRY.beam_velocities(**arguments)


def solve(**changed: Any) -> Any:  # noqa: ANN401 - an argument of any kind
    """Two pings of beams 1 and 2 by the virtual beam, with what a test changes."""
    given: dict[str, Any] = {
        "velocity_mps": np.zeros((2, 4)), "valid": np.tile([True, True, False, False], (2, 1)),
        "method": "virtual_beam", "beam_sd_mps": np.full(4, 0.04), "prior_velocity_p_mps": np.zeros((2, 3)),
        "prior_cov_m2ps2": np.tile(np.eye(3), (2, 1, 1)), "omega_tp_p_radps": np.zeros((2, 3)),
        "virtual_beam_factor": 1.0, "nullified_sway_var_m2ps2": 1e-3, "weak_sway_var_m2ps2": 2.0,
    }  # fmt: skip
    return bottomlock._kernel.solve_velocity(GEOMETRY, **(given | changed))


@pytest.mark.parametrize("value", ABSURD)
@pytest.mark.parametrize(
    ("field", "message"),
    [
        ("velocity_mps", "beam 1 is flagged valid but its velocity"),
        ("beam_sd_mps", "beam 1 is flagged valid but its standard deviation"),
        ("prior_velocity_p_mps", "prior velocity_p_mps"),
        ("prior_cov_m2ps2", "prior cov_m2ps2"),
        ("omega_tp_p_radps", "omega_tp_p_radps"),
        ("virtual_beam_factor", "virtual_beam_factor"),
        ("nullified_sway_var_m2ps2", "nullified_sway_var_m2ps2"),
        ("weak_sway_var_m2ps2", "weak_sway_var_m2ps2"),
    ],
)
def test_solve_velocity(field: str, message: str, value: float) -> None:
    """Priors of 1e300 came out as "solved" with NaN; parameters of other methods were not looked at."""
    given: dict[str, Any] = {
        "velocity_mps": np.full((2, 4), value),
        "beam_sd_mps": np.full(4, value),
        "prior_velocity_p_mps": np.full((2, 3), value),
        "prior_cov_m2ps2": np.tile(np.diag([value * 1e10] * 3), (2, 1, 1)),
        "omega_tp_p_radps": np.full((2, 3), value),
    }
    with pytest.raises(KernelError, match=f"row 0: .*{message}"):
        solve(**{field: given.get(field, value)})


WRAPPED = np.array([0, 2**64 - 5], dtype=np.uint64)


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        (
            WRAPPED,
            "18446744073709551611, which int64 cannot hold, expected .*: a negative time stored as uint64",
        ),
        (np.array([0, 2**62]), "row 1 is 4611686018427387904 ns, more than 146 years from 0"),
        (np.array([-(2**63), 0]), "row 0 is -9223372036854775808 ns, more than 146 years"),
    ],
)
def test_times(stamps: np.ndarray[Any, Any], message: str) -> None:
    """Unsigned times wrapped to negative ones; differences of far times wrap too."""
    navigator = still()
    with pytest.raises(KernelError, match=f"time_ns.* {message}"):
        navigator.push_imu_block(stamps, omega_p_radps=np.zeros((2, 3)), force_p_mps2=np.zeros((2, 3)))
    small = np.array([1, 2], dtype=np.uint64)
    assert (
        navigator.push_imu_block(small, omega_p_radps=np.zeros((2, 3)), force_p_mps2=np.zeros((2, 3))) == []
    )


def still() -> bottomlock.Navigator:
    """A navigator at rest."""
    start: Any = {
        "time_ns": 0, "position_t_m": np.zeros(3), "attitude_t_p": [1.0, 0.0, 0.0, 0.0], "velocity_p_mps": np.zeros(3),
    }  # fmt: skip
    return bottomlock.Navigator(GEOMETRY, settings.table_2(), settings.options(), start)


def test_a_time_of_a_push_has_a_span() -> None:
    """The step of 146 years was taken."""
    with pytest.raises(KernelError, match="imu time 9223372036854775807 ns lies more than 146 years from 0"):
        still().push_imu(2**63 - 1, omega_p_radps=np.zeros(3), force_p_mps2=np.zeros(3))


@pytest.mark.parametrize("value", ABSURD)
@pytest.mark.parametrize(
    ("name", "push"),
    [
        ("imu force", lambda n, x: n.push_imu(10, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, x])),
        ("velocity_p_mps", lambda n, x: n.push_velocity(10, [x, 0.0, 0.0], cov_m2ps2=np.eye(3))),
        ("velocity cov", lambda n, x: n.push_velocity(10, np.zeros(3), cov_m2ps2=np.diag([x * 1e10] * 3))),
        ("depth_m", lambda n, x: n.push_depth(10, x, sd_m=0.1)),
        ("depth sd_m", lambda n, x: n.push_depth(10, 1.0, sd_m=x)),
        ("yaw_rad", lambda n, x: n.push_heading(10, x, sd_rad=0.1)),
        ("gps position", lambda n, x: n.push_position(10, [x, 0.0, 0.0], position_sd_m=np.ones(3))),
        ("gps sd", lambda n, x: n.push_position(10, np.zeros(3), position_sd_m=[1.0, x, 1.0])),
    ],
)
def test_pushes(name: str, push: Callable[[bottomlock.Navigator, float], object], value: float) -> None:
    """By the name of the field, before anything is computed."""
    with pytest.raises(KernelError, match=name):
        push(still(), value)


def test_the_gate_needs_a_probability_whatever_the_gate() -> None:
    """NaN was not looked at with the gate per row."""
    options = settings.options(gate="per_row", gate_probability=np.nan)
    with pytest.raises(KernelError, match="gate_probability is NaN, expected strictly between 0 and 1"):
        bottomlock.Navigator(
            GEOMETRY, settings.table_2(), options,
            {"time_ns": 0, "position_t_m": np.zeros(3), "attitude_t_p": [1, 0, 0, 0], "velocity_p_mps": np.zeros(3)},  # type: ignore[arg-type]
        )  # fmt: skip


@pytest.mark.parametrize(
    ("section", "key"), [("imu", "gyro_noise_rad_rts"), ("dvl", "beam_noise_sd_mps"), ("depth", "sd_m")]
)
def test_models(section: str, key: str) -> None:
    """A density of 1e200 has no square."""
    model: Any = settings.table_2()
    model[section][key] = 1e200
    with pytest.raises(KernelError, match=rf"{key} is .*, expected less than 1e12 in SI units: a filler"):
        kernel.error_model(
            model, attitude_t_p=[1.0, 0.0, 0.0, 0.0], velocity_p_mps=np.zeros(3), omega_p_radps=np.zeros(3),
            force_p_mps2=np.zeros(3),
        )  # fmt: skip


def test_gravity_has_a_range() -> None:
    """A depth in other units made gravity of any size, and so did a model."""
    with pytest.raises(KernelError, match="depth_m is 1e9, expected at most 12 km"):
        kernel.normal_gravity_mps2(0.5, 1e9)
    with pytest.raises(KernelError, match="gravity_mps2 is 980, expected"):
        bottomlock.Environment(latitude_rad=0.5, gravity_mps2=980.0)
