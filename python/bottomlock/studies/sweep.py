"""Sensitivity to the settings that the paper leaves open, changed one at a time."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import polars as pl

from bottomlock.campaign.engine import halves
from bottomlock.campaign.run import CampaignProgress, run_campaign
from bottomlock.config.scenario import Scenario
from bottomlock.tables.studies import CURRENT, SWEEP, VIRTUAL_BEAM_FACTOR


@dataclass(frozen=True)
class Setting:
    """A setting with its values and the methods that depend on it."""

    parameter: str
    values: tuple[float | str, ...]
    methods: tuple[str, ...]
    change: Callable[[Scenario, Any], Scenario]


def _filter(key: str) -> Callable[[Scenario, Any], Scenario]:
    def change(scenario: Scenario, value: float | str) -> Scenario:
        return scenario.model_copy(update={"filter": scenario.filter.model_copy(update={key: value})})

    return change


def _initial_attitude(scenario: Scenario, factor: float) -> Scenario:
    initial = scenario.initial
    scaled = {key: factor * getattr(initial, key) for key in ("roll_deg", "pitch_deg", "yaw_deg")}
    return scenario.model_copy(update={"initial": initial.model_copy(update=scaled)})


def _cross_current(scenario: Scenario, speed_mps: float) -> Scenario:
    current = {"speed_mps": speed_mps, "towards_deg": 90.0}
    return scenario.model_copy(update={"mission": scenario.mission | {"current": current}})


SETTINGS = (
    Setting(VIRTUAL_BEAM_FACTOR, (1.0, 3.0, 6.0, 10.0, 30.0), ("vb",), _filter("virtual_beam_factor")),
    Setting(
        "ε of NSV, m²/s²",
        (1e-6, 1e-4, 1e-3, 1e-2, 1.0),
        ("nsv", "elc"),
        _filter("nullified_sway_var_m2ps2"),
    ),
    Setting("gate", ("joint", "per_row", "off"), ("tc", "vb", "nsv", "vhv", "elc"), _filter("gate")),
    Setting(
        "inflate after rejections",
        (0, 5),
        ("lc", "tc", "vb", "nsv", "vhv", "elc", "consistent"),
        _filter("inflate_after_rejections"),
    ),
    Setting(
        "initial attitude, times Table 2", (0.5, 1.0, 2.0), ("ins", "tc", "nsv", "plcf"), _initial_attitude
    ),
    Setting(CURRENT, (0.0, 0.1, 0.3), ("tc", "nsv", "elc", "weak_sway"), _cross_current),
)
"""n_f, ε, gate, initial covariance and, by a current, sway."""


def run_sweep(
    scenarios: Sequence[Scenario],
    *,
    runs: int,
    threads: int = 0,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> pl.DataFrame:
    """Runs every value of every setting on scenarios with a vehicle, with the same sensor errors for all.

    Returns:
        `tables.studies.SWEEP`: RMS over runs at the end, mean NEES, rejected fraction of the fixes.

    Raises:
        As `run_campaign`.
    """
    # A value of one chunk a trajectory leaves cores idle while its tables are made.
    at_once, threads_each = halves(threads)

    def part(name: str, setting: Setting, value: float | str) -> pl.DataFrame:
        changed = [setting.change(scenario, value) for scenario in scenarios]
        results = run_campaign(
            changed,
            runs=runs,
            methods=setting.methods,
            threads=threads_each,
            progress=lambda state: progress(replace(state, trajectory=f"sweep {name} {state.trajectory}")),
        )
        return _rows(setting.parameter, value, results.summary)

    pool = ThreadPoolExecutor(max_workers=at_once)
    try:
        parts = [pool.submit(part, *cell) for cell in _cells()]
        return pl.concat([part.result() for part in parts])
    finally:
        # After a failure or an interruption the parts under way, of a second or two, end first.
        pool.shutdown(cancel_futures=True)


def _rows(parameter: str, value: float | str, summary: pl.DataFrame) -> pl.DataFrame:
    label = value if isinstance(value, str) else f"{value:g}"
    return summary.with_columns(
        pl.lit(parameter).alias("parameter"),
        pl.lit(label).alias("value"),
        pl.col("rejected_fraction").fill_nan(None),
    ).select(list(SWEEP))


def sweep_cells() -> int:
    """Number of values of a sweep."""
    return sum(1 for _ in _cells())


def _cells() -> Iterator[tuple[str, Setting, float | str]]:
    for number, setting in enumerate(SETTINGS, start=1):
        for value in setting.values:
            yield f"{number}-{value}", setting, value
