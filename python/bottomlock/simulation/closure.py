"""Whether the strapdown of perfect inertial samples returns a truth."""

import numpy as np

from bottomlock import kernel
from bottomlock.kernel.models import InitialState
from bottomlock.simulation.build import Simulation
from bottomlock.truth import Truth


def closure(simulation: Simulation, truth: Truth) -> tuple[float, float]:
    """Error of the inertial navigation on the truth's own samples, at its end: position, m, and attitude, rad.

    It is what sampling at the IMU's rate loses, and would show a truth whose samples do not belong together.
    """
    scenario = simulation.scenario
    start = InitialState(
        time_ns=int(truth.time_ns[0]),
        position_t_m=truth.position_t_m[0],
        attitude_t_p=truth.attitude_t_p[0],
        velocity_p_mps=truth.velocity_p_mps[0],
    )
    # The truth's samples are values at their times, and equal ones are no fault of a sensor.
    options = scenario.kernel_options()
    options = options.replace(
        imu_sampling="instantaneous", imu_limits=options.imu_limits.replace(stuck_after=0)
    )
    navigator = kernel.Navigator(
        simulation.geometry, scenario.kernel_model(simulation.gravity_mps2), options, start, method="ins"
    )
    navigator.push_imu_block(
        truth.time_ns, omega_p_radps=truth.omega_p_radps, force_p_mps2=truth.force_p_mps2
    )
    state = navigator.state()
    w, x, y, z = (float(part) for part in state["attitude_t_p"])
    conjugate = np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    turned = 2.0 * (conjugate @ truth.attitude_t_p[-1])[1:]
    return (
        float(np.linalg.norm(np.asarray(state["position_t_m"]) - truth.position_t_m[-1])),
        float(np.linalg.norm(turned)),
    )
