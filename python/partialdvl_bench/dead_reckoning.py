"""Dead reckoning on a mission."""

import time

import numpy as np

from bottomlock.dead_reckoning.sensors import Sensors, reckon
from bottomlock.recordings.axes import quaternions
from bottomlock.recordings.streams import Depths
from partialdvl_bench.mission import Estimates, Mission, initial_state


def sensors_of(mission: Mission) -> Sensors:
    """The readings of a mission, whose reference is a heading sensor."""
    return Sensors(
        imu_ns=mission.imu.time_ns,
        omega_p_radps=mission.imu.omega_p_radps,
        force_p_mps2=mission.imu.force_p_mps2,
        ping_ns=mission.pings.time_ns,
        beam_mps=mission.pings.velocity_mps,
        beam_valid=mission.pings.valid,
        depths=Depths(mission.depth.time_ns, mission.depth.value),
        attitudes=None,
        heading_ns=mission.heading.time_ns,
        heading_rad=mission.heading.value,
    )


def estimate(mission: Mission) -> Estimates:
    """The estimates at the grid's times."""
    began = time.perf_counter()
    reckoned = reckon(
        mission.geometry,
        mission.model,
        initial_state(mission),
        sensors_of(mission),
        mission.grid_ns,
        depth_lever_p_m=np.asarray(mission.options.depth_lever_p_m),
    )
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=reckoned.velocity_p_mps,
        velocity_cov=reckoned.velocity_cov_m2ps2,
        position_t_m=reckoned.position_t_m,
        position_cov=reckoned.position_cov_m2,
        attitude_t_p=quaternions(reckoned.attitude),
        wall_s=time.perf_counter() - began,
    )
