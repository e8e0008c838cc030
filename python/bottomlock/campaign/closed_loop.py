"""Runs whose vehicle flies on its own estimate, and so goes astray with it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bottomlock import kernel
from bottomlock.errors import ScenarioError
from bottomlock.plant.closed_loop import Estimate, TruthBlock, VehicleGroup, cross_track_m, fly_on_estimate
from bottomlock.simulation.build import World
from bottomlock.simulation.measurement_schedule import Conditions

_ARRAYS = ("position_t_m", "attitude_t_p", "velocity_p_mps", "omega_p_radps", "force_p_mps2")


def fly_on_estimates(
    world: World,
    methods: Sequence[str],
    *,
    pilot: str,
    trajectory_key: int,
    first_run: int,
    runs: int,
    threads: int = 0,
    tell: Callable[[float], None] = lambda _: None,
) -> dict[str, Any]:
    """Swims vehicles side by side, guided and controlled on what a method aboard believes.

    With pilot "own" every method of every run has its own vehicle; else a run has one vehicle,
    steered on the estimate of the pilot method; the other methods only estimate.

    The sensor errors of run k are those of run k of any campaign under the same key. Guidance and control take up a new
    estimate every 0.2 s.

    Args:
        world: a scenario whose truth a vehicle swims.
        methods: ways of aiding.
        pilot: "own", or the method, one of `methods`, on whose estimate the vehicle of a run flies.
        trajectory_key: key of the trajectory's random numbers.
        first_run: number of the first run.
        runs: number of runs.
        threads: 0 for as many as there are cores.
        tell: hears the part of the way that is behind, 0 to 1.

    Returns:
        As `kernel.run_batch`, with `cross_track_m` (runs, methods, ticks), the distance of the true vehicle from the
        path segment that it follows, positive to the right, `sample_time_ns` and `dvl_time_ns`.

    Raises:
        ScenarioError: for an analytic truth.
        KernelError: for what the kernel refuses, naming run and method.
    """
    scenario = world.scenario
    if world.vehicle is None or world.mission is None:
        raise ScenarioError(
            f"scenario {scenario.name}: its truth is analytic, no vehicle can fly on an estimate"
        )
    own = pilot == "own"
    vehicles_per_run = len(methods) if own else 1
    fleet = VehicleGroup(
        world.vehicle,
        world.mission,
        runs=runs * vehicles_per_run,
        latitude_rad=world.latitude_rad,
        gravity_mps2=world.gravity_mps2,
        earth_rate_radps=world.earth_rate_radps,
        imu_rate_hz=scenario.imu.rate_hz,
    )
    last_ns = round(world.mission.duration_s * 1e9)
    conditions = Conditions(
        world,
        first_ns=0,
        last_ns=last_ns,
        trajectory_key=trajectory_key,
        first_run=first_run,
        runs=runs,
        vehicles_per_run=vehicles_per_run,
    )
    begin = fleet.start()
    model: Any = scenario.kernel_model(world.gravity_mps2)
    options: Any = scenario.kernel_options()
    loop = kernel.ClosedLoop(
        world.geometry,
        model,
        model,
        options,
        list(methods),
        _start(begin),
        own_vehicles=own,
        seed=scenario.campaign.seed,
        trajectory_key=trajectory_key,
        first_run=first_run,
        threads=threads,
    )
    steering = 0 if own else list(methods).index(pilot)
    before, sampled, pinged = begin, [], []

    def navigate(block: TruthBlock) -> Estimate:
        nonlocal before
        if block.time_ns[0] > begin.time_ns[0]:
            stretch = _joined(before, block)
            plan, _ = conditions.along(stretch["time_ns"], stretch["position_t_m"], stretch["attitude_t_p"])
            loop.advance(stretch, plan)  # type: ignore[arg-type]
            sampled.append(plan["sample_time_ns"])
            pinged.append(plan["dvl_time_ns"])
            before = block
        return Estimate(**loop.belief(steering))

    offsets = []
    for block in fly_on_estimate(fleet, navigate):
        offsets.append(cross_track_m(world.mission, fleet.segment, block.position_t_m[:, -1]))
        tell(min(1.0, float(block.time_ns[-1]) / last_ns))
    offset = np.stack(offsets, axis=1)
    return {
        **loop.results(),
        "cross_track_m": np.broadcast_to(
            offset.reshape(runs, vehicles_per_run, -1), (runs, len(methods), len(offsets))
        ),
        "sample_time_ns": np.concatenate(sampled),
        "dvl_time_ns": np.concatenate(pinged),
    }


def _start(block: TruthBlock) -> Any:  # noqa: ANN401 - the kernel's dict
    return {
        "time_ns": int(block.time_ns[-1]),
        "position_t_m": block.position_t_m[:, -1],
        "attitude_t_p": block.attitude_t_p[:, -1],
        "velocity_p_mps": block.velocity_p_mps[:, -1],
    }


def _joined(before: TruthBlock, block: TruthBlock) -> dict[str, Any]:
    """A block that begins with the last sample of the one before."""
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(before, name)[:, -1:], getattr(block, name)], axis=1)
        for name in _ARRAYS
    }
    return joined | {"time_ns": np.concatenate([before.time_ns[-1:], block.time_ns])}
