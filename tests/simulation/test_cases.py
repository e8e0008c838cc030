"""Which beams return in a variant of a scenario, and that nothing else differs."""

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.studies import cases

KEPT = {"dvl", "seabed"}


def short(name: str = "straight", seconds: float = 20.0) -> Scenario:
    return load_scenario(name).with_trajectory(duration_s=seconds, feedback="truth")


def valid(scenario: Scenario) -> np.ndarray:
    simulation = build_simulation(scenario)
    flags: np.ndarray = measurement_schedule(simulation, simulation.truth())["beam_valid"]
    return flags


def test_fourteen_partial_masks() -> None:
    """Beside that of all beams four of three, six of two, four of one."""
    assert [len(mask) for mask in cases.masks(4)] == [4] + [3] * 4 + [2] * 6 + [1] * 4


@pytest.mark.parametrize("mask", [(1, 2, 3, 4), (2, 4), (3,)])
def test_a_mask_is_what_returns(mask: tuple[int, ...]) -> None:
    """Those beams at every ping, whatever the scenario lost before; the name, and with it the streams, stay."""
    scenario = short()
    case = cases.masked(scenario, mask)
    flags = valid(case)
    assert (np.flatnonzero(flags.all(axis=0)) + 1).tolist() == list(mask)
    assert not np.delete(flags, [beam - 1 for beam in mask], axis=1).any()
    assert case.name == scenario.name
    assert case.model_dump(exclude=KEPT) == scenario.model_dump(exclude=KEPT)


@pytest.mark.parametrize("mask", [(), (5,), (0, 1)])
def test_masks_that_cannot_be(mask: tuple[int, ...]) -> None:
    with pytest.raises(ScenarioError, match="expected one or more of 1 to 4"):
        cases.masked(short(), mask)
