"""The first step of a campaign: every scenario built, checked, and its truth computed once."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bottomlock import own_method
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.files.columns import PATHS
from bottomlock.own_method import DEAD_RECKONING, in_this_process_alone
from bottomlock.plant import Flight
from bottomlock.plant.closed_loop import cross_track_m
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.truth import Truth

CONTROL_RATE_HZ = 5.0
"""Samples of the cross-track error per second, as many as there are control steps in closed loop."""


@dataclass(frozen=True, eq=False)
class BuiltScenario:
    """A scenario that is ready to run.

    Attributes:
        simulation: the scenario with everything that it names.
        truth: the true motion; runs in closed loop leave it, all others share it.
        cross_track_m: (ticks,) cross-track error of the vehicle along that truth; None for an analytic truth.
    """

    simulation: Simulation
    truth: Truth
    cross_track_m: NDArray[np.float64] | None

    @property
    def scenario(self) -> Scenario:
        """The scenario's settings."""
        return self.simulation.scenario

    @property
    def closed_loop(self) -> bool:
        """Whether guidance and control use the navigation estimate in place of the truth."""
        return self.scenario.trajectory.feedback == "estimate"


AnyScenarios = Scenario | str | Path | Iterable[Scenario | str | Path]
"""Scenarios as users name them: one or several, each as `load_scenario` takes it."""


def scenarios_of(given: AnyScenarios, **overrides: Any) -> list[Scenario]:  # noqa: ANN401 - as `with_overrides`
    """The scenarios of a campaign, with other runs, seed or methods where they are given.

    Raises:
        ScenarioError: for what is no scenario and no list of them, and as `load_scenario`.
    """
    if isinstance(given, Scenario | str | Path):
        given = [given]
    several: Any = given  # a caller without a type checker may give anything
    if isinstance(several, Mapping | bytes) or not isinstance(several, Iterable):
        raise ScenarioError(
            f"scenarios is {several!r:.60}", expected="a list such as ['straight', 'own.toml']"
        )
    changed = {key: value for key, value in overrides.items() if value is not None}
    scenarios = [load_scenario(source) for source in several]
    return [scenario.with_overrides(**changed) for scenario in scenarios] if changed else scenarios


def build_simulations(scenarios: Sequence[Scenario]) -> list[Simulation]:
    """Loads and checks everything that the scenarios name, without any truth.

    Raises:
        ScenarioError: for no scenario, two of one name, two classes of one name, dead reckoning without an attitude
            reference, and what `build_simulation` rejects.
    """
    names = [scenario.name for scenario in scenarios]
    if not names or len(set(names)) != len(names):
        raise ScenarioError(expected=f"scenarios of different names, got {names}")
    _check_own_methods(scenarios)
    for scenario in scenarios:
        _check_reckoning(scenario)
    with _one_blas_thread():
        return [build_simulation(scenario) for scenario in scenarios]


def _check_own_methods(scenarios: Sequence[Scenario]) -> None:
    """Rejects scenarios whose methods of one name are different classes: the kernel has one of a name at a time.

    Raises:
        ScenarioError: naming scenario, method and both places.
    """
    places: dict[str, str] = {}
    for scenario in scenarios:
        for place in scenario.campaign.own_methods:
            name = own_method.load(place)
            if places.setdefault(name, place) != place:
                raise ScenarioError(
                    f"method '{name}' is {place}, and {places[name]} before it: expected one "
                    "class of a name in a campaign",
                    place=f"scenario {scenario.name}",
                )


def check_found_elsewhere(scenarios: Sequence[Scenario]) -> None:
    """Rejects methods of one's own that the processes of Dask do not find.

    Raises:
        ScenarioError: naming scenario and method.
    """
    for scenario in scenarios:
        for name in in_this_process_alone(scenario.campaign.methods):
            raise ScenarioError(
                f"method '{name}' is in this process alone, where Dask's workers do not find "
                "it: move its class to the top level of a file, and import it or name "
                "FILE.py:CLASS",
                place=f"scenario {scenario.name}",
            )


def _check_reckoning(scenario: Scenario) -> None:
    """Rejects dead reckoning where nothing tells the attitude, or where the vehicle is steered by the estimate.

    Raises:
        ScenarioError: naming the section.
    """
    if DEAD_RECKONING not in scenario.campaign.methods:
        return
    place = f"scenario {scenario.name}: campaign.methods names '{DEAD_RECKONING}'"
    if not (scenario.magnetometer.enabled or scenario.heading.enabled):
        raise ScenarioError(
            f"{place}, which needs an attitude reference: enable [magnetometer] (roll, pitch and yaw) or [heading]"
        )
    if scenario.trajectory.feedback == "estimate":
        raise ScenarioError(
            f'{place}, which steers no vehicle: leave it out, or set trajectory.feedback to "truth"'
        )


def build_scenarios(simulations: Sequence[Simulation]) -> list[BuiltScenario]:
    """Computes the truth of every simulation.

    Raises:
        DataError: for an analytic motion that is not possible.
    """
    with _one_blas_thread():
        return [_built(simulation) for simulation in simulations]


def _one_blas_thread() -> AbstractContextManager[Any]:
    """Idle BLAS threads spin on the cores that the kernel needs next."""
    limits: AbstractContextManager[Any] = threadpool_limits(limits=1, user_api="blas")
    return limits


def _built(simulation: Simulation) -> BuiltScenario:
    if simulation.vehicle is None:
        return BuiltScenario(simulation, simulation.truth(), None)
    flight = simulation.flight()
    return BuiltScenario(simulation, flight.truth, _cross_track_m(flight))


def _cross_track_m(flight: Flight) -> NDArray[np.float64]:
    history = flight.history
    every = max(1, round(len(history.time_ns) / (flight.mission.duration_s * CONTROL_RATE_HZ)))
    return cross_track_m(flight.mission, history.segment[::every], history.state[::every, :3])


def true_paths(built: Sequence[BuiltScenario]) -> pl.DataFrame:
    """The true position of every scenario once a second (`files.columns.PATHS`); closed-loop runs leave this path."""
    parts = []
    for simulation in built:
        every = slice(None, None, max(1, round(simulation.scenario.imu.rate_hz)))
        north, east, depth = simulation.truth.position_t_m[every].T
        columns = {
            "time_ns": simulation.truth.time_ns[every],
            "north_m": north,
            "east_m": east,
            "depth_m": depth,
        }
        parts.append(pl.DataFrame(columns).with_columns(pl.lit(simulation.scenario.name).alias("trajectory")))
    return pl.concat(parts).select(list(PATHS))
