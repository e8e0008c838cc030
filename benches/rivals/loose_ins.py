"""An INS of the kernel aided by velocities from elsewhere, beside depth and heading."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.kernel import Navigator
from partialdvl_bench.mission import Estimates, Mission, initial_state

Floats = NDArray[np.float64]


def loosely_coupled(mission: Mission, velocity_p_mps: Floats, velocity_cov: Floats) -> Estimates:
    """The estimates of a filter that takes a velocity at every time of the grid, as if its errors were white.

    A learned velocity errs alike over many seconds, and by what the inertial readings told it; neither is modelled.

    Args:
        mission: its readings but the beams.
        velocity_p_mps: (n, 3) at the grid; a row that is not finite is left out.
        velocity_cov: (n, 3, 3).
    """
    began = time.perf_counter()
    start, imu = mission.start, mission.imu
    initial = initial_state(mission)
    options = mission.options.replace(imu_sampling="averaged")
    navigator = Navigator(mission.geometry, mission.model, options, initial, method="ins")
    states, covariances = [], []
    taken = int(np.searchsorted(imu.time_ns, start.time_ns))
    for row, time_ns in enumerate(mission.grid_ns.tolist()):
        end = int(np.searchsorted(imu.time_ns, time_ns, side="right"))
        navigator.push_imu_block(
            imu.time_ns[taken:end],
            omega_p_radps=imu.omega_p_radps[taken:end],
            force_p_mps2=imu.force_p_mps2[taken:end],
        )
        taken = end
        if np.isfinite(velocity_p_mps[row]).all():
            navigator.push_velocity(time_ns, velocity_p_mps[row], cov_m2ps2=velocity_cov[row])
        previous_ns = start.time_ns if row == 0 else int(mission.grid_ns[row - 1])
        _push_scalars(navigator, mission, previous_ns, time_ns)
        states.append(navigator.state())
        covariances.append(navigator.covariance())
    covariance = np.stack(covariances)
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=np.stack([state["velocity_p_mps"] for state in states]),
        velocity_cov=covariance[:, 6:9, 6:9],
        position_t_m=np.stack([state["position_t_m"] for state in states]),
        position_cov=covariance[:, :3, :3],
        attitude_t_p=np.stack([state["attitude_t_p"] for state in states]),
        wall_s=time.perf_counter() - began,
    )


def _push_scalars(navigator: Navigator, mission: Mission, after_ns: int, up_to_ns: int) -> None:
    """Depths and headings of an interval; those between two times of the grid come at its end, where they are late."""
    model = mission.model
    for k in _between(mission.depth.time_ns, after_ns, up_to_ns):
        navigator.push_depth(
            int(mission.depth.time_ns[k]), float(mission.depth.value[k]), sd_m=model.depth.sd_m
        )
    if model.heading is not None:
        for k in _between(mission.heading.time_ns, after_ns, up_to_ns):
            navigator.push_heading(
                int(mission.heading.time_ns[k]), float(mission.heading.value[k]), sd_rad=model.heading.sd_rad
            )


def _between(times: NDArray[np.int64], after_ns: int, up_to_ns: int) -> Iterator[int]:
    return iter(range(*np.searchsorted(times, [after_ns + 1, up_to_ns + 1])))


def aided_by(mission: Mission, alone: Estimates) -> Estimates:
    """The estimates of a filter that takes the velocities of another estimator; the time is that of both."""
    aided = loosely_coupled(mission, alone.velocity_p_mps, alone.velocity_cov)
    assert alone.wall_s is not None
    assert aided.wall_s is not None
    return replace(aided, wall_s=aided.wall_s + alone.wall_s)
