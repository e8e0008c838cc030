"""Variants of a scenario that differ only in which beams return, so that their runs are paired.

A variant keeps the scenario's name, and with it the random streams: run k has the same sensor errors in all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from bottomlock.config.scenario import Scenario
from bottomlock.config.scenario_sections import Dropout
from bottomlock.errors import ScenarioError

PAPER_TRAJECTORIES = ("straight", "figure_eight", "lawn_mower")
"""The packaged scenarios of the 2017 paper."""

VARYING = "varying"
"""In place of the list of beams where it changes with time."""

MEAN_UP_S, MEAN_DOWN_S = 20.0, 10.0
"""Independent dropouts of every beam, valid two thirds of the time: every mask occurs, also that without beams."""

SLOPE_BELOW_START_M = 48.0
SLOPE_NORTH_DEG, SLOPE_EAST_DEG = 1.0, 12.0
SLOPE_MAX_RANGE_M, SLOPE_MAX_INCIDENCE_DEG = 60.0, 70.0
"""A seabed that slopes down to the east and slightly to the north: downhill beams go out of range first. With this
altitude each packaged trajectory starts with four beams and loses some later."""


@dataclass(frozen=True)
class Case:
    """A scenario under one rule of beam loss: a short name, the beams that return, and the scenario."""

    name: str
    beams: str
    scenario: Scenario


def beam_list(mask: tuple[int, ...]) -> str:
    """Beams as text: `1,2`.

    >>> beam_list((1, 2))
    '1,2'
    """
    return ",".join(str(beam) for beam in mask)


def masks(beams: int, *, whole: bool = True) -> list[tuple[int, ...]]:
    """Every set of returning beams, 1 to `beams`, more beams first; `whole`: with all beams.

    >>> masks(3)
    [(1, 2, 3), (1, 2), (1, 3), (2, 3), (1,), (2,), (3,)]
    >>> len(masks(4, whole=False))
    14
    """
    sizes = range(beams if whole else beams - 1, 0, -1)
    return [mask for size in sizes for mask in combinations(range(1, beams + 1), size)]


def beams_of(scenarios: Sequence[Scenario]) -> int:
    """The number of beams that the instruments of all scenarios have.

    Raises:
        ScenarioError: for instruments of different beams.
    """
    found = {scenario.dvl.beams for scenario in scenarios}
    if len(found) != 1:
        raise ScenarioError("expected scenarios whose instruments have the same number of beams")
    return found.pop()


def masked(scenario: Scenario, mask: tuple[int, ...]) -> Case:
    """The scenario with these beams from first to last and no others.

    Raises:
        ScenarioError: for a beam that the instrument does not have, and for none.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> case = masked(load_scenario("straight"), (1, 4))
        >>> case.name, case.beams, case.scenario.dvl.beams_lost
        ('beams_14', '1,4', (2, 3))
    """
    beams = scenario.dvl.beams
    if not mask or not set(mask) <= set(range(1, beams + 1)):
        raise ScenarioError(
            f"scenario {scenario.name}: a mask of beams {list(mask)}, expected one or more of 1 to {beams}"
        )
    lost = tuple(beam for beam in range(1, beams + 1) if beam not in mask)
    name = "beams_" + "".join(str(beam) for beam in mask)
    return Case(name, beam_list(mask), _on_truth(scenario, beams_lost=lost))


def dropouts(scenario: Scenario) -> Case:
    """The scenario with random dropouts of each beam, independently."""
    every = tuple(range(1, scenario.dvl.beams + 1))
    rule = Dropout(beams=every, mean_up_s=MEAN_UP_S, mean_down_s=MEAN_DOWN_S)
    return Case("dropouts", VARYING, _on_truth(scenario, dropouts=(rule,)))


def over_slope(scenario: Scenario, start_depth_m: float) -> Case:
    """The scenario over a slope, with beams lost by range and incidence only: its own seabed, or a default one."""
    if scenario.seabed:
        limits = ("min_range_m", "max_range_m", "max_incidence_deg")
        kept = {name: getattr(scenario.dvl, name) for name in limits}
        return Case("slope", VARYING, _on_truth(scenario, seabed=scenario.seabed, **kept))
    seabed = {
        "kind": "plane",
        "depth_m": start_depth_m + SLOPE_BELOW_START_M,
        "slope_north_deg": SLOPE_NORTH_DEG,
        "slope_east_deg": SLOPE_EAST_DEG,
    }
    case = _on_truth(
        scenario, seabed=seabed, max_range_m=SLOPE_MAX_RANGE_M, max_incidence_deg=SLOPE_MAX_INCIDENCE_DEG
    )
    return Case("slope", VARYING, case)


def outage(scenario: Scenario, mask: tuple[int, ...], *, from_s: float, to_s: float) -> Case:
    """The scenario with every beam, but between two times only those of `mask` (errors as `masked`)."""
    partial = masked(scenario, mask)
    rule = {"beams": partial.scenario.dvl.beams_lost, "from_s": from_s, "to_s": to_s}
    # The section's own check rejects an empty interval.
    checked = type(scenario.dvl).model_validate(_whole(scenario) | {"outages": [rule]})
    return Case(partial.name, partial.beams, partial.scenario.model_copy(update={"dvl": checked}))


def _whole(scenario: Scenario) -> dict[str, Any]:
    """Keys of `[dvl]` that lose no beam."""
    losing = {
        "beams_lost", "outages", "dropouts", "altitude_loss", "replay_validity",
        "min_range_m", "max_range_m", "max_incidence_deg",
    }  # fmt: skip
    dvl = scenario.dvl
    return {name: getattr(dvl, name) for name in dvl.model_fields_set - losing}


def _on_truth(scenario: Scenario, *, seabed: dict[str, Any] | None = None, **rules: Any) -> Scenario:  # noqa: ANN401
    """The scenario on a truth that all methods share, its own rules of beam loss replaced."""
    if scenario.trajectory.feedback == "estimate":
        scenario = scenario.with_trajectory(feedback="truth", pilot="own")
    dvl = type(scenario.dvl).model_validate(_whole(scenario) | rules)
    return scenario.model_copy(update={"dvl": dvl, "seabed": seabed or {}})
