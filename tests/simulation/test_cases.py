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


def valid(scenario: Scenario, runs: int = 1) -> np.ndarray:
    simulation = build_simulation(scenario)
    flags: np.ndarray = measurement_schedule(simulation, simulation.truth(), runs=runs)["beam_valid"]
    return flags


def test_fourteen_partial_masks() -> None:
    """Four of three beams, six of two, four of one; a three-beam instrument has three and three."""
    sizes = [len(mask) for mask in cases.masks(4, whole=False)]
    assert sizes == [3] * 4 + [2] * 6 + [1] * 4
    assert [len(mask) for mask in cases.masks(3, whole=False)] == [2, 2, 2, 1, 1, 1]


@pytest.mark.parametrize("mask", [(1, 2, 3, 4), (2, 4), (3,)])
def test_a_mask_is_what_returns(mask: tuple[int, ...]) -> None:
    """Those beams at every ping, whatever the scenario lost before; the name, and with it the streams, stay."""
    scenario = short()
    case = cases.masked(scenario, mask)
    flags = valid(case.scenario)
    assert (np.flatnonzero(flags.all(axis=0)) + 1).tolist() == list(mask)
    assert not np.delete(flags, [beam - 1 for beam in mask], axis=1).any()
    assert case.scenario.name == scenario.name
    same = scenario.model_dump(exclude=KEPT)
    assert case.scenario.model_dump(exclude=KEPT) == same


def test_a_mask_replaces_every_rule_of_loss() -> None:
    """The slope with its seabed, limits, dropouts and own pilots becomes a flight on the truth under the mask alone."""
    case = cases.masked(load_scenario("slope").with_trajectory(duration_s=20.0), (1, 3))
    dvl = case.scenario.dvl
    assert (dvl.beams_lost, dvl.dropouts, dvl.max_range_m) == ((2, 4), (), np.inf)
    assert case.scenario.seabed == {}
    assert case.scenario.trajectory.feedback == "truth"


def test_outage_in_the_middle() -> None:
    """All beams, two of them between the times, the first epoch after it whole again."""
    flags = valid(cases.outage(short(), (2, 3), from_s=5.0, to_s=9.0).scenario)
    assert flags[:4].all()
    assert flags[4:8].tolist() == [[False, True, True, False]] * 4
    assert flags[8:].all()


def test_dropouts_come_and_go() -> None:
    """Every beam is up two thirds of the time (100 runs of 20 s, correlated over 7 s: a band of five points)."""
    flags = valid(cases.dropouts(short()).scenario, runs=100)
    assert flags.mean(axis=(0, 1)) == pytest.approx([2 / 3] * 4, abs=0.07)


def test_slope_by_geometry_alone() -> None:
    """Ours under a scenario without a seabed, the scenario's own where it has one; no run differs from another."""
    ours = cases.over_slope(short(seconds=250.0), 20.0).scenario
    flags = valid(ours)
    assert flags.ndim == 2
    assert flags[0].all()
    assert not flags[-1].all()
    own = cases.over_slope(load_scenario("slope"), 20.0).scenario
    assert own.seabed == load_scenario("slope").seabed
    assert own.dvl.max_range_m == 64.0
    assert own.dvl.dropouts == ()


@pytest.mark.parametrize("mask", [(), (5,), (0, 1)])
def test_masks_that_cannot_be(mask: tuple[int, ...]) -> None:
    with pytest.raises(ScenarioError, match="expected one or more of 1 to 4"):
        cases.masked(short(), mask)
