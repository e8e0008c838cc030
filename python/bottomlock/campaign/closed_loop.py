"""Runs in closed loop: guidance and control use the navigation estimate, so its errors move the vehicle."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bottomlock import kernel
from bottomlock.errors import ScenarioError
from bottomlock.plant import AnyVehicle, Mission
from bottomlock.plant.closed_loop import Estimate, TruthBlock, VehicleGroup, cross_track_m, fly_on_estimate
from bottomlock.simulation.build import Simulation
from bottomlock.simulation.measurement_schedule import MeasurementSchedule

_ARRAYS = ("position_t_m", "attitude_t_p", "velocity_p_mps", "omega_p_radps", "force_p_mps2")


def run_closed_loop(
    simulation: Simulation,
    methods: Sequence[str],
    *,
    pilot: str,
    trajectory_key: int,
    first_run: int,
    runs: int,
    threads: int = 0,
    progress: Callable[[float], None] = lambda _: None,
) -> dict[str, Any]:
    """Simulates vehicles side by side whose guidance and control use a navigation estimate.

    With pilot "own" every method of every run has its own vehicle. Otherwise a run has one vehicle, steered on the
    estimate of the pilot method; the other methods only estimate. Guidance and control get a new estimate every 0.2 s.
    The sensor errors of run k are those of run k of any campaign under the same key.

    Args:
        simulation: a scenario with a simulated vehicle.
        methods: the aiding methods.
        pilot: "own", or the method, one of `methods`, whose estimate steers the vehicle of a run.
        trajectory_key: key of the trajectory's random numbers.
        first_run: number of the first run.
        runs: number of runs.
        threads: 0 for as many as there are cores.
        progress: called with the fraction of the duration done, 0 to 1.

    Returns:
        As `kernel.run_batch`, with `sample_time_ns`, `dvl_time_ns`, and `cross_track_m` (runs, methods, ticks): the
        distance of the true vehicle from the path segment that it follows, positive to the right.

    Raises:
        ScenarioError: for an analytic truth.
        KernelError: for input that the kernel rejects, naming run and method.
    """
    if simulation.vehicle is None or simulation.mission is None:
        raise ScenarioError(
            "its truth is analytic, so no vehicle can be steered on an estimate",
            place=f"scenario {simulation.scenario.name}",
        )
    each_its_own = pilot == "own"
    vehicles_per_run = len(methods) if each_its_own else 1
    group = _vehicles(simulation, simulation.vehicle, simulation.mission, runs * vehicles_per_run)
    last_ns = round(simulation.mission.duration_s * 1e9)
    draws = {"trajectory_key": trajectory_key, "first_run": first_run}
    schedule = MeasurementSchedule(
        simulation, first_ns=0, last_ns=last_ns, runs=runs, vehicles_per_run=vehicles_per_run, **draws
    )
    start = group.start()
    loop = _kernel_loop(simulation, methods, start, vehicle_per_method=each_its_own, threads=threads, **draws)
    navigation = _Navigation(loop, schedule, start, pilot=0 if each_its_own else methods.index(pilot))
    offsets = []
    for block in fly_on_estimate(group, navigation.estimate):
        offsets.append(cross_track_m(simulation.mission, group.segment, block.position_t_m[:, -1]))
        progress(min(1.0, float(block.time_ns[-1]) / last_ns))
    by_vehicle = np.stack(offsets, axis=1).reshape(runs, vehicles_per_run, -1)
    offset = np.broadcast_to(by_vehicle, (runs, len(methods), len(offsets)))
    return {**loop.results(), "cross_track_m": offset, **navigation.times()}


def _vehicles(simulation: Simulation, vehicle: AnyVehicle, mission: Mission, count: int) -> VehicleGroup:
    """Equal vehicles at the start of the mission."""
    return VehicleGroup(
        vehicle,
        mission,
        runs=count,
        latitude_rad=simulation.latitude_rad,
        gravity_mps2=simulation.gravity_mps2,
        earth_rate_radps=simulation.earth_rate_radps,
        imu_rate_hz=simulation.scenario.imu.rate_hz,
        earth=simulation.scenario.environment.earth,
    )


def _kernel_loop(
    simulation: Simulation,
    methods: Sequence[str],
    start: TruthBlock,
    **settings: Any,  # noqa: ANN401
) -> kernel.ClosedLoop:
    """The filters of all runs and methods at the start."""
    scenario = simulation.scenario
    model, options = scenario.kernel_model(simulation.gravity_mps2), scenario.kernel_options()
    initial: Any = {
        "time_ns": int(start.time_ns[-1]),
        "position_t_m": start.position_t_m[:, -1],
        "attitude_t_p": start.attitude_t_p[:, -1],
        "velocity_p_mps": start.velocity_p_mps[:, -1],
    }
    return kernel.ClosedLoop(
        simulation.geometry, model, model, options, methods, initial, seed=scenario.campaign.seed, **settings
    )


class _Navigation:
    """The navigation of all vehicles: block by block from the truth to the estimate that steers."""

    def __init__(
        self, loop: kernel.ClosedLoop, schedule: MeasurementSchedule, start: TruthBlock, *, pilot: int
    ) -> None:
        """`pilot`: index of the method whose estimate steers; 0 where every method has its own vehicle."""
        self._loop = loop
        self._schedule = schedule
        self._start_ns = start.time_ns[0]
        self._before = start
        self._pilot = pilot
        self._sample_time_ns: list[np.ndarray[Any, Any]] = []
        self._dvl_time_ns: list[np.ndarray[Any, Any]] = []

    def estimate(self, block: TruthBlock) -> Estimate:
        """Runs the filters over a block of the truth, and returns their estimate at its end."""
        if block.time_ns[0] > self._start_ns:
            truth = _joined(self._before, block)
            schedule, _ = self._schedule.over(truth["time_ns"], truth["position_t_m"], truth["attitude_t_p"])
            self._loop.advance(truth, schedule)  # type: ignore[arg-type]
            self._sample_time_ns.append(schedule["sample_time_ns"])
            self._dvl_time_ns.append(schedule["dvl_time_ns"])
            self._before = block
        return Estimate(**self._loop.estimate(self._pilot))

    def times(self) -> dict[str, np.ndarray[Any, Any]]:
        """Times of the samples and of the pings, ns."""
        return {
            "sample_time_ns": np.concatenate(self._sample_time_ns),
            "dvl_time_ns": np.concatenate(self._dvl_time_ns),
        }


def _joined(before: TruthBlock, block: TruthBlock) -> dict[str, Any]:
    """A block that begins with the last sample of the one before."""
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(before, name)[:, -1:], getattr(block, name)], axis=1)
        for name in _ARRAYS
    }
    return joined | {"time_ns": np.concatenate([before.time_ns[-1:], block.time_ns])}
