"""The right-invariant EKF with DVL and depth.

Source: E. R. Potokar, K. Norman and J. G. Mangelson, "Invariant Extended Kalman Filtering for Underwater Navigation",
IEEE Robotics and Automation Letters 6 (2021) 5792, doi 10.1109/LRA.2021.3085167. The filter is `ErrorStateFilter` in
right-invariant errors. A DVL reads Rᵀ v, a right-invariant observation; so is each beam, bᵀ Rᵀ v, which the paper
does not use. Depth is their left-invariant observation with infinite noise in north and east. Errors of
left-invariant observations map by the adjoint, so the update equals that with the row of depth in right-invariant
errors (a test shows it).
"""

from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.state import RightInvariant
from partialdvl_bench.mission import Estimates, Mission


def estimate(mission: Mission) -> Estimates:
    """With a row for each beam that returned."""
    return run(ErrorStateFilter(mission, RightInvariant()), mission)


def estimate_from_velocity(mission: Mission) -> Estimates:
    """As in the paper: with the velocity solved from three or more beams, and nothing from fewer."""
    return run(ErrorStateFilter(mission, RightInvariant(), solved_velocity=True), mission)
