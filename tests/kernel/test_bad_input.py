"""Bad numbers and shapes at the kernel's border: rejected in one line that names the place; repaired never."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bottomlock
from tests.oracle import truth
from tests.property import settings

JANUS = bottomlock.BeamGeometry.janus(0.35)
Y = np.ones((5, 4))
ALL = np.ones((5, 4), dtype=bool)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_valid_beam_without_a_number_names_row_and_beam(bad: float) -> None:
    """A beam that claims to be valid and carries no number is a fault of the reader; row from 0, beam from 1."""
    y = Y.copy()
    y[3, 1] = bad
    with pytest.raises(bottomlock.KernelError, match=r"row 3\b.*beam 2\b"):
        bottomlock.solve_velocity(JANUS, y, ALL, method="lc", beam_sd_mps=0.042)


def test_a_lost_beam_may_hold_anything() -> None:
    """The same number behind a false flag changes not a bit of the answer."""
    y, valid = Y.copy(), ALL.copy()
    valid[3, 1] = False
    plain = bottomlock.solve_velocity(JANUS, y, valid, method="lc", beam_sd_mps=0.042)
    for bad in (np.nan, np.inf, 1e300):
        y[3, 1] = bad
        fix = bottomlock.solve_velocity(JANUS, y, valid, method="lc", beam_sd_mps=0.042)
        np.testing.assert_array_equal(fix.velocity_p_mps, plain.velocity_p_mps)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("velocity_mps", {"velocity_mps": np.ones((5, 3))}),
        ("velocity_mps", {"velocity_mps": np.ones(4)}),
        ("valid", {"valid": np.ones((4, 4), dtype=bool)}),
        ("valid", {"valid": np.ones((5, 3), dtype=bool)}),
        ("valid", {"valid": np.ones((5, 4))}),
        ("beam_sd_mps", {"beam_sd_mps": np.ones(3)}),
        ("beam_sd_mps", {"beam_sd_mps": np.ones((5, 4))}),
        (
            "prior_velocity_p_mps",
            {"prior_velocity_p_mps": np.ones((4, 3)), "prior_cov_m2ps2": np.ones((5, 3, 3))},
        ),
        ("prior_cov_m2ps2", {"prior_velocity_p_mps": np.ones((5, 3)), "prior_cov_m2ps2": np.ones((5, 3))}),
        ("prior", {"prior_velocity_p_mps": np.ones((5, 3))}),
        ("omega_tp_p_radps", {"omega_tp_p_radps": np.ones((5, 2))}),
    ],
)
def test_a_wrong_shape_names_the_array(name: str, change: dict[str, Any]) -> None:
    """One line with the array's own name and the shape that was expected, not a word of foreign libraries."""
    arguments: dict[str, Any] = {
        "velocity_mps": Y,
        "valid": ALL,
        "method": "vb",
        "beam_sd_mps": 0.042,
    } | change
    with pytest.raises(bottomlock.KernelError, match=name) as caught:
        bottomlock.solve_velocity(JANUS, **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("sd", [0.0, -0.042, np.nan, np.inf])
def test_a_beam_without_a_positive_sigma_is_refused(sd: float) -> None:
    """A zero variance would give the reading unlimited weight."""
    with pytest.raises(bottomlock.KernelError, match=r"beam 3\b.*standard deviation"):
        bottomlock.solve_velocity(JANUS, Y, ALL, method="lc", beam_sd_mps=np.array([0.04, 0.04, sd, 0.04]))


@pytest.mark.parametrize(
    ("cov", "why"),
    [
        (np.diag([1.0, 1.0, -1.0]), "a negative variance"),
        (np.full((3, 3), np.nan), "no number"),
        pytest.param(
            np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            "a correlation of 2",
        ),
        pytest.param(np.array([[1.0, 0.9, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 1.0]]), "not symmetric"),
    ],
)
def test_a_prior_that_is_no_covariance_is_refused(cov: np.ndarray, why: str) -> None:
    """VB would weigh with it and return a velocity that looks sound."""
    valid = np.tile([True, True, False, False], (5, 1))
    with pytest.raises(bottomlock.KernelError, match="prior"):
        bottomlock.solve_velocity(
            JANUS,
            Y,
            valid,
            method="vb",
            beam_sd_mps=0.042,
            prior_velocity_p_mps=np.zeros((5, 3)),
            prior_cov_m2ps2=np.tile(cov, (5, 1, 1)),
        )
    assert why


@pytest.mark.parametrize("sd", [0.042, np.float32(0.042), np.array(0.042), [0.042] * 4])
def test_one_sigma_stands_for_all_beams(sd: Any) -> None:  # noqa: ANN401 - any number
    fixes = bottomlock.solve_velocity(JANUS, Y, ALL, method="lc", beam_sd_mps=sd)
    plain = bottomlock.solve_velocity(
        JANUS, Y, ALL, method="lc", beam_sd_mps=np.full(4, np.float64(sd) if np.ndim(sd) == 0 else 0.042)
    )
    np.testing.assert_array_equal(fixes.cov_m2ps2, plain.cov_m2ps2)


def test_rows_of_unequal_length_and_what_is_no_geometry_are_refused() -> None:
    """By name, and not by numpy's word or an attribute's."""
    ragged: Any = [0.04, 0.04, 0.04, [0.04]]
    with pytest.raises(bottomlock.KernelError, match="beam_sd_mps"):
        bottomlock.solve_velocity(JANUS, Y, ALL, method="lc", beam_sd_mps=ragged)
    none: Any = None
    with pytest.raises(TypeError, match="geometry is of type NoneType"):
        bottomlock.solve_velocity(none, Y, ALL, method="lc", beam_sd_mps=0.042)


def test_an_unknown_method_offers_the_known() -> None:
    """A slip of the pen gets its correction."""
    with pytest.raises(bottomlock.KernelError, match="virtual_beam"):
        bottomlock.solve_velocity(JANUS, Y, ALL, method="virtal_beam", beam_sd_mps=0.042)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("directions", "name"),
    [
        (np.array([[0.0, 0.0, 2.0]]), "beam 1"),
        (np.array([[0.0, 0.0, 1.0], [0.0, np.nan, 1.0]]), "beam 2"),
        (np.empty((0, 3)), "beam"),
        (np.tile([0.0, 0.0, 1.0], (9, 1)), "beam"),
        (np.array([0.0, 0.0, 1.0]), "directions"),
    ],
)
def test_a_geometry_that_cannot_be_is_refused(directions: np.ndarray, name: str) -> None:
    """Directions must be unit vectors, one to eight of them."""
    with pytest.raises(bottomlock.KernelError, match=name):
        bottomlock.BeamGeometry(directions)


def navigator() -> bottomlock.Navigator:
    """A navigator that has taken one sample at time 0."""
    start = bottomlock.InitialState(
        time_ns=0,
        position_t_m=np.zeros(3),
        attitude_t_p=np.array([1.0, 0, 0, 0]),
        velocity_p_mps=np.zeros(3),
    )
    made = bottomlock.Navigator(JANUS, settings.table_2(), settings.options(), start)
    made.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=np.array([0, 0, -9.8]))
    return made


@pytest.mark.parametrize("time_ns", [0, -1])
def test_time_that_does_not_advance_is_refused(time_ns: int) -> None:
    """A duplicate or a step back in a log is named with both times, and the navigator goes on as if it never came."""
    nav = navigator()
    before = nav.covariance()
    with pytest.raises(bottomlock.KernelError, match=f"{time_ns} ns"):
        nav.push_imu(time_ns, omega_p_radps=np.zeros(3), force_p_mps2=np.array([0, 0, -9.8]))
    np.testing.assert_array_equal(nav.covariance(), before)
    nav.push_imu(10_000_000, omega_p_radps=np.zeros(3), force_p_mps2=np.array([0, 0, -9.8]))
    assert nav.state()["time_ns"] == 10_000_000


def test_a_ping_twice_is_refused() -> None:
    """The same ping fused twice would count twice."""
    nav = navigator()
    nav.push_beams(0, np.zeros(4), np.ones(4, bool), sd_mps=np.full(4, 0.042))
    with pytest.raises(bottomlock.KernelError, match="0 ns"):
        nav.push_beams(0, np.zeros(4), np.ones(4, bool), sd_mps=np.full(4, 0.042))


def test_an_imu_sample_without_a_number_is_refused() -> None:
    """One NaN would spread through every state and never leave."""
    nav = navigator()
    with pytest.raises(bottomlock.KernelError, match=r"imu.*10000000 ns"):
        nav.push_imu(10_000_000, omega_p_radps=np.array([0, np.nan, 0]), force_p_mps2=np.array([0, 0, -9.8]))
    assert np.isfinite(nav.state()["velocity_p_mps"]).all()


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [
        ("environment", "latitude_rad", 32.8),
        ("environment", "gravity_mps2", -9.8),
        ("imu", "accel_noise_mps_rts", np.nan),
        ("dvl", "beam_noise_sd_mps", -0.042),
        ("initial", "position_sd_m", [2.0, -2.0, 2.0]),
    ],
)
def test_a_model_out_of_range_names_the_key(part: str, key: str, value: Any) -> None:  # noqa: ANN401
    """A latitude in degrees, a negative sigma: named before anything runs."""
    model: dict[str, Any] = dict(settings.table_2())
    model[part] = model[part] | {key: value}
    motion = truth.make(seconds=2.0, rate_hz=10.0)
    with pytest.raises(bottomlock.KernelError, match=key):
        bottomlock.simulate_sensors(
            JANUS,
            motion,  # type: ignore[arg-type]
            model,  # type: ignore[arg-type]
            settings.schedule(2),
            seed=1,
            trajectory_key=1,
            run=0,
        )


def test_a_missing_key_is_named() -> None:
    """A model without its IMU is rejected by name."""
    model: dict[str, Any] = dict(settings.table_2())
    del model["imu"]
    with pytest.raises(bottomlock.KernelError, match="imu"):
        bottomlock.Navigator(JANUS, model, settings.options(), {"time_ns": 0})  # type: ignore[arg-type]


def test_epochs_outside_the_truth_are_refused() -> None:
    """A schedule longer than the motion would have to be made up."""
    motion = truth.make(seconds=2.0, rate_hz=10.0)
    with pytest.raises(bottomlock.KernelError, match="3000000000 ns"):
        bottomlock.simulate_sensors(
            JANUS,
            motion,  # type: ignore[arg-type]
            settings.table_2(),
            settings.schedule(5),
            seed=1,
            trajectory_key=1,
            run=0,
        )


class Interrupted:
    """An array that Ctrl-C comes upon."""

    def __array__(self, *_args: Any, **_kwargs: Any) -> Any:  # noqa: ANN401 - the protocol of arrays
        raise KeyboardInterrupt


def test_an_interrupt_is_no_fault_of_the_input() -> None:
    """Ctrl-C while numbers are read ends the work; it is not said of the numbers."""
    geometry = bottomlock.BeamGeometry.janus(0.5)
    with pytest.raises(KeyboardInterrupt):
        geometry.beam_velocities(Interrupted())
