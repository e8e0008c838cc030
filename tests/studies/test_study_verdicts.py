"""Verdicts of the studies on NEES set by hand at the limits of their bands, which scipy gives for 6 and 20 degrees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from bottomlock.config.scenario import load_scenario
from bottomlock.statistics import chi_squared
from bottomlock.studies import cases, consistency, sensor_law

RUNS, TIMES_S, TESTS = 40, [1.0, 2.0, 3.0, 4.0, 5.0], 48
DEGREES = {"nees_velocity_attitude": 6, "nees": 20}


def judged(nees: dict[str, np.ndarray]) -> Any:  # noqa: ANN401 - in the place of `run_judged`
    """A batch without errors whose mean NEES is (methods, times) in each run."""
    methods = len(nees["nees"])
    batch: dict[str, Any] = {name: np.broadcast_to(at, (RUNS, *at.shape)) for name, at in nees.items()}
    batch |= {"error": np.zeros((RUNS, methods, 5, 20)), "sd": np.ones((RUNS, methods, 5, 20))}
    batch |= dict.fromkeys(("fixes_accepted", "fixes_rejected"), np.zeros((RUNS, methods), dtype=int))
    return lambda *_, **__: (TIMES_S, batch)


def test_limits_of_a_sensor_laws_verdicts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousandth inside and outside either limit at one of five times; 1 % is shared by 48 tests of five times."""
    tail = 0.5 * 0.01 / (TESTS * 5)
    nees = {}
    for name, degrees in DEGREES.items():
        low, high = chi2.ppf([tail, 1.0 - tail], RUNS * degrees) / RUNS
        at = np.full((4, 5), float(degrees))
        at[:, 3] = np.array([high, high, low, low]) * [0.999, 1.001, 1.001, 0.999]
        nees[name] = at
    monkeypatch.setattr(sensor_law, "run_judged", judged(nees))
    scenario = load_scenario("straight")
    assert scenario.filter.states == 20
    table = sensor_law.run_cell(scenario, (1, 2), 0.0, tests=TESTS)
    expected = [
        chi_squared.CONSISTENT, chi_squared.OVERCONFIDENT, chi_squared.CONSISTENT, chi_squared.CONSERVATIVE,
    ] * len(sensor_law.SENSOR_SETS)  # fmt: skip
    assert table["verdict_velocity_attitude"].to_list() == expected
    assert table["verdict_whole_state"].to_list() == expected


def test_degrees_of_a_consistency_studys_means(monkeypatch: pytest.MonkeyPatch) -> None:
    """Velocity and attitude have six, the whole state as many as the filter, and the bands are theirs."""
    scenario = load_scenario("straight").with_overrides(runs=RUNS, methods=["tc"])
    nees = {name: np.full((1, 5), float(degrees)) for name, degrees in DEGREES.items()}
    monkeypatch.setattr(consistency, "run_judged", judged(nees))
    cell = consistency.run_cell(cases.masked(scenario, (1, 2)), whole=False)
    assert set(cell.select("quantity", "degrees").iter_rows()) == set(DEGREES.items())
    assert consistency.judge(cell)["verdict"].unique().to_list() == [chi_squared.CONSISTENT]
