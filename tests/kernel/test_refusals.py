"""What the kernel refuses at its border: no number, no shape and no time is repaired; the message names the place."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock import kernel
from bottomlock._kernel import solve_velocity
from bottomlock.errors import KernelError
from tests.oracle import truth
from tests.property import settings

JANUS = bottomlock.BeamGeometry.janus(0.35)
Y, ALL = np.ones((5, 4)), np.ones((5, 4), dtype=bool)
REST: Any = settings.start()
UP = np.array([0.0, 0.0, -9.8])


def still(**options: Any) -> bottomlock.Navigator:  # noqa: ANN401 - any option
    """A navigator at rest, before its first reading."""
    return bottomlock.Navigator(JANUS, settings.table_2(), settings.options(**options), REST, method="tc")


def solve(**changed: Any) -> Any:  # noqa: ANN401 - an argument of any kind
    """Two pings of beams 1 and 2 by the virtual beam."""
    given: dict[str, Any] = {
        "velocity_mps": np.zeros((2, 4)), "valid": np.tile([True, True, False, False], (2, 1)),
        "method": "virtual_beam", "beam_sd_mps": np.full(4, 0.04), "prior_velocity_p_mps": np.zeros((2, 3)),
        "prior_cov_m2ps2": np.tile(np.eye(3), (2, 1, 1)), "omega_tp_p_radps": np.zeros((2, 3)),
        "virtual_beam_factor": 1.0, "nullified_sway_var_m2ps2": 1e-3, "weak_sway_var_m2ps2": 2.0,
    }  # fmt: skip
    return solve_velocity(JANUS, **(given | changed))


def fixes(**changed: Any) -> Any:  # noqa: ANN401 - an argument of any kind
    """Five pings of all beams."""
    given: dict[str, Any] = {"velocity_mps": Y, "valid": ALL, "method": "lc", "beam_sd_mps": 0.042}
    return bottomlock.solve_velocity(JANUS, **(given | changed))


def block(stamps: Any) -> Any:  # noqa: ANN401 - times of any kind
    return still().push_imu_block(stamps, omega_p_radps=np.zeros((2, 3)), force_p_mps2=np.zeros((2, 3)))


def sensors(seconds: int) -> Any:  # noqa: ANN401 - arrays
    """Readings for so many seconds of a motion of two."""
    motion: Any = truth.make(seconds=2.0, rate_hz=10.0)
    return bottomlock.simulate_sensors(
        JANUS, motion, settings.table_2(), settings.schedule(seconds), seed=1, trajectory_key=1, run=0
    )


WRAPPED = np.array([0, 2**64 - 5], dtype=np.uint64)
ASYMMETRIC = np.array([[1.0, 0.9, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
BEYOND_ONE = np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
REFUSED: list[tuple[str, Callable[[], object]]] = [
    (
        "attitude_t_p has norm 2, expected 1",
        lambda: kernel.error_model(
            settings.table_2(), attitude_t_p=[2.0, 0.0, 0.0, 0.0], velocity_p_mps=np.zeros(3),
            omega_p_radps=np.zeros(3), force_p_mps2=UP,
        ),
    ),
    ("time_ns.* 18446744073709551611, which int64 cannot hold, .*: a negative time", lambda: block(WRAPPED)),
    ("time_ns.* row 1 is 4611686018427387904 ns, more than 146 years", lambda: block(np.array([0, 2**62]))),
    (
        "imu time 9223372036854775807 ns lies more than 146 years from 0",
        lambda: still().push_imu(2**63 - 1, omega_p_radps=np.zeros(3), force_p_mps2=np.zeros(3)),
    ),
    ("gate_probability is NaN, expected strictly", lambda: still(gate="per_row", gate_probability=np.nan)),
    ("depth_m is 1e9, expected at most 12 km", lambda: kernel.normal_gravity_mps2(0.5, 1e9)),
    ("gravity_mps2 is 980, expected", lambda: bottomlock.Environment(latitude_rad=0.5, gravity_mps2=980.0)),
    ("velocity_mps", lambda: fixes(velocity_mps=np.ones((5, 3)))),
    ("valid", lambda: fixes(valid=np.ones((4, 4), dtype=bool))),
    ("valid", lambda: fixes(valid=np.ones((5, 4)))),
    ("beam_sd_mps", lambda: fixes(beam_sd_mps=np.ones(3))),
    ("beam_sd_mps", lambda: fixes(beam_sd_mps=np.ones((5, 4)))),
    ("beam_sd_mps", lambda: fixes(beam_sd_mps=[0.04, 0.04, 0.04, [0.04]])),
    ("prior", lambda: fixes(method="vb", prior_velocity_p_mps=np.ones((5, 3)))),
    ("prior_velocity_p_mps", lambda: fixes(prior_velocity_p_mps=np.ones((4, 3)), prior_cov_m2ps2=np.ones((5, 3, 3)))),
    ("prior_cov_m2ps2", lambda: fixes(prior_velocity_p_mps=np.ones((5, 3)), prior_cov_m2ps2=np.ones((5, 3)))),
    ("omega_tp_p_radps", lambda: fixes(omega_tp_p_radps=np.ones((5, 2)))),
    *(
        (r"beam 3\b.*standard deviation", lambda sd=sd: fixes(beam_sd_mps=np.array([0.04, 0.04, sd, 0.04])))
        for sd in (0.0, -0.042, np.nan)
    ),
    *(
        ("prior", lambda cov=cov: solve(prior_cov_m2ps2=np.tile(cov, (2, 1, 1))))
        for cov in (np.diag([1.0, 1.0, -1.0]), np.full((3, 3), np.nan), BEYOND_ONE, ASYMMETRIC)
    ),
    ("virtual_beam", lambda: fixes(method="virtal_beam")),
    ("beam 1", lambda: bottomlock.BeamGeometry(np.array([[0.0, 0.0, 2.0]]))),
    ("beam 2", lambda: bottomlock.BeamGeometry(np.array([[0.0, 0.0, 1.0], [0.0, np.nan, 1.0]]))),
    ("beam", lambda: bottomlock.BeamGeometry(np.empty((0, 3)))),
    ("beam", lambda: bottomlock.BeamGeometry(np.tile([0.0, 0.0, 1.0], (9, 1)))),
    ("directions", lambda: bottomlock.BeamGeometry(np.array([0.0, 0.0, 1.0]))),
    ("3000000000 ns", lambda: sensors(5)),
]  # fmt: skip
"""The words of the refusal, and what is refused."""


@pytest.mark.parametrize(("words", "call"), REFUSED)
def test_what_cannot_be_is_refused_in_one_line(words: str, call: Callable[[], object]) -> None:
    with pytest.raises(KernelError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_what_is_no_geometry_is_of_another_type() -> None:
    none: Any = None
    with pytest.raises(TypeError, match="geometry is of type NoneType"):
        bottomlock.solve_velocity(none, Y, ALL, method="lc", beam_sd_mps=0.042)


def test_unsigned_times_are_times() -> None:
    assert block(np.array([1, 2], dtype=np.uint64)) == []


def test_a_valid_beam_without_a_number_names_row_and_beam_and_a_lost_one_may_hold_anything() -> None:
    """Row from 0, beam from 1. Behind a false flag the same number changes not a bit of the answer."""
    y, valid = Y.copy(), ALL.copy()
    valid[3, 1] = False
    plain = fixes(valid=valid)
    for bad in (np.nan, np.inf, 1e300):
        y[3, 1] = bad
        with pytest.raises(KernelError, match=r"row 3\b.*beam 2\b"):
            fixes(velocity_mps=y)
        np.testing.assert_array_equal(fixes(velocity_mps=y, valid=valid).velocity_p_mps, plain.velocity_p_mps)


def test_one_sigma_stands_for_all_beams() -> None:
    plain = fixes(beam_sd_mps=np.full(4, 0.042))
    for sd in (0.042, np.array(0.042), [0.042] * 4):
        np.testing.assert_array_equal(fixes(beam_sd_mps=sd).cov_m2ps2, plain.cov_m2ps2)


def test_time_that_does_not_advance_and_what_is_no_number_leave_no_trace() -> None:
    """Refused with the time, and the navigator goes on as if they never came; a ping counts once."""
    nav = still()
    nav.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=UP)
    before = nav.covariance()
    for time_ns, force in ((0, UP), (-1, UP), (10_000_000, np.array([0.0, np.nan, -9.8]))):
        with pytest.raises(KernelError, match=f"{time_ns} ns"):
            nav.push_imu(time_ns, omega_p_radps=np.zeros(3), force_p_mps2=force)
    np.testing.assert_array_equal(nav.covariance(), before)
    nav.push_imu(10_000_000, omega_p_radps=np.zeros(3), force_p_mps2=UP)
    assert nav.state()["time_ns"] == 10_000_000
    nav.push_beams(10_000_000, np.zeros(4), np.ones(4, bool), sd_mps=np.full(4, 0.042))
    with pytest.raises(KernelError, match="10000000 ns"):
        nav.push_beams(10_000_000, np.zeros(4), np.ones(4, bool), sd_mps=np.full(4, 0.042))


class Interrupted:
    """An array that Ctrl-C comes upon."""

    def __array__(self, *_args: Any, **_kwargs: Any) -> Any:  # noqa: ANN401 - the protocol of arrays
        raise KeyboardInterrupt


def test_an_interrupt_is_no_fault_of_the_input() -> None:
    """Ctrl-C while numbers are read ends the work; it is not said of the numbers."""
    with pytest.raises(KeyboardInterrupt):
        JANUS.beam_velocities(Interrupted())
