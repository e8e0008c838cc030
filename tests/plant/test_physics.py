"""Laws the equations of motion must keep, at any state."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bottomlock.plant import Vehicle
from bottomlock.plant.equations import (
    added_mass_matrix,
    fin_wrench,
    lift_and_drag,
    propeller_wrench,
    rigid_body_mass_matrix,
    to_platform,
    to_tangent,
)
from bottomlock.plant.maths import SCALAR, FloatArray
from bottomlock.recordings.rotation import matrices
from tests.plant.helpers import GRAVITY_MPS2, finned, nu_dot
from tests.plant.matrices import (
    added_mass_coriolis_matrix,
    hull_damping_matrix,
    restoring_vector,
    rigid_body_coriolis_matrix,
)

VEHICLES = {name: finned(name) for name in ("tauv", "remus100")}

velocities = hnp.arrays(np.float64, 6, elements=st.floats(-4.0, 4.0, width=32))
deflections = hnp.arrays(np.float64, 4, elements=st.floats(-0.5, 0.5, width=32))
quaternions = hnp.arrays(np.float64, 4, elements=st.floats(-1.0, 1.0, width=32)).filter(
    lambda q: float(np.linalg.norm(q)) > 0.1
)
names = st.sampled_from(sorted(VEHICLES))


@pytest.mark.parametrize("name", sorted(VEHICLES))
def test_mass_matrices_are_symmetric_and_positive(name: str) -> None:
    for matrix in (rigid_body_mass_matrix(VEHICLES[name]), added_mass_matrix(VEHICLES[name])):
        assert (matrix == matrix.T).all()
        assert np.linalg.eigvalsh(matrix).min() > 0.0


@given(names, quaternions, velocities, deflections, st.floats(0.0, 25.0))
def test_components_equal_the_vectorial_form(
    name: str, quaternion: FloatArray, nu: FloatArray, fins: FloatArray, shaft: float
) -> None:
    """M nu' = tau - C_RB nu - C_A nu - D nu - g, with matrices built apart from the components."""
    vehicle, quaternion = VEHICLES[name], quaternion / np.linalg.norm(quaternion)
    thrust, torque = propeller_wrench(vehicle)(float(nu[0]), shaft)
    tau = np.array(fin_wrench(vehicle, SCALAR)(tuple(nu.tolist()), fins.tolist()))
    tau += np.array([thrust, 0.0, 0.0, torque, 0.0, 0.0])
    tau -= hull_damping_matrix(vehicle, nu) @ nu
    tau -= (rigid_body_coriolis_matrix(vehicle, nu) + added_mass_coriolis_matrix(vehicle, nu)) @ nu
    tau -= restoring_vector(vehicle, quaternion, GRAVITY_MPS2)
    expected = np.linalg.solve(rigid_body_mass_matrix(vehicle) + added_mass_matrix(vehicle), tau)
    found = nu_dot(vehicle, nu, [*fins, shaft], quaternion=quaternion)
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-8 * max(1.0, float(np.abs(expected).max())))


@given(names, quaternions, velocities, deflections)
def test_energy_never_grows_without_thrust(
    name: str, quaternion: FloatArray, nu: FloatArray, fins: FloatArray
) -> None:
    """Kinetic energy of body and water plus weight and buoyancy: its rate is drag's power."""
    vehicle, quaternion = VEHICLES[name], quaternion / np.linalg.norm(quaternion)
    rate = nu_dot(vehicle, nu, [*fins, 0.0], quaternion=quaternion)
    mass = rigid_body_mass_matrix(vehicle) + added_mass_matrix(vehicle)
    power = float(nu @ mass @ rate) + float(nu @ restoring_vector(vehicle, quaternion, GRAVITY_MPS2))
    assert power <= 1e-8 * max(1.0, float(np.abs(nu).max()) ** 3) * 1e3


@given(quaternions, hnp.arrays(np.float64, 3, elements=st.floats(-5.0, 5.0)))
def test_rotations_on_components_match_the_matrix(quaternion: FloatArray, vector: FloatArray) -> None:
    quaternion = quaternion / np.linalg.norm(quaternion)
    matrix = matrices(quaternion)
    q, v = quaternion.tolist(), vector.tolist()
    assert np.allclose(to_tangent(*q, *v), matrix @ vector, atol=1e-12)
    assert np.allclose(to_platform(*q, *v), matrix.T @ vector, atol=1e-12)


@pytest.mark.parametrize("angle_deg", [0.0, 5.0, 15.0, 25.0, 40.0, 90.0, 135.0, 180.0])
def test_fin_lift_is_odd_and_stalls(tauv: Vehicle, angle_deg: float) -> None:
    """Linear below the stall, a flat plate beyond it; drag is even and never negative."""
    coefficients = lift_and_drag(tauv, SCALAR)
    angle = np.deg2rad(angle_deg)
    lift, drag = coefficients(float(angle))
    assert coefficients(float(-angle)) == pytest.approx((-lift, drag))
    assert drag > 0.0
    if angle_deg <= 10.0:
        assert lift == pytest.approx(tauv.fins.lift_slope * angle, rel=0.02)
    if angle_deg >= 40.0:
        assert lift == pytest.approx(2.0 * abs(np.sin(angle)) * np.sin(angle) * np.cos(angle), abs=0.01)
