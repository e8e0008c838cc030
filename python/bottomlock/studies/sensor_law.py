"""Whether a further sensor makes an estimate worse: methods under every mask, with every set of sensors.

Every set of sensors meets the same runs and is compared, run by run, with every smaller set that it contains: by the
median over runs, and by the run whose error grows most.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.config import sensors as config_sensors
from bottomlock.config.scenario import Scenario
from bottomlock.config.sensors import AcousticPosition, Depth, Gps, Heading, Magnetometer
from bottomlock.errors import ScenarioError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.kernel import Method
from bottomlock.pages.page import write_pages
from bottomlock.simulation.build import build_simulation
from bottomlock.statistics import chi_squared
from bottomlock.statistics.rms import rms
from bottomlock.studies import cases, study_folder
from bottomlock.studies.consistency import FALSE_ALARM, run_judged
from bottomlock.studies.sensor_law_page import page
from bottomlock.support.nearest import did_you_mean
from bottomlock.tables.studies import SENSOR_LAW

KIND = "sensor_law"
PARTS = ("cells", "sensor_law.parquet", "sensor_law.md", "sensor_law.html", study_folder.MANIFEST)
METHODS: tuple[Method, ...] = ("tc", "info", "sway_current", "consistent")
SENSORS: dict[str, dict[str, Any]] = {
    "depth": {"depth": Depth()},
    "heading": {"heading": Heading()},
    "attitude": {"magnetometer": Magnetometer()},
    "gps": {"gps": Gps(antenna_depth_m=1000.0)},
    "acoustic": {"acoustic_position": AcousticPosition()},
}
"""The GPS antenna is on a float, or the vehicle at the surface: fixes are received at any depth of the trajectory."""

SENSOR_SETS = (
    (),
    ("depth",),
    ("heading",),
    ("depth", "heading"),
    ("attitude",),
    ("depth", "attitude"),
    ("gps",),
    ("acoustic",),
    ("depth", "acoustic"),
)
"""Smaller sets come first."""

CROSS_CURRENT_MPS = 0.3
RESAMPLES = 1000


def variant(
    scenario: Scenario, mask: tuple[int, ...], sensors: Sequence[str], current_mps: float
) -> Scenario:
    """The scenario with these beams, these sensors and no others, and a current that sets to the east.

    Raises:
        ScenarioError: for a mask or sensor that is not known, and a current where the truth is analytic.

    >>> from bottomlock.config.scenario import load_scenario
    >>> found = variant(load_scenario("straight"), (1, 3), ("depth",), 0.3)
    >>> found.depth.enabled, found.magnetometer.enabled, found.mission["current"]["speed_mps"]
    (True, False, 0.3)
    """
    unknown = [name for name in sensors if name not in SENSORS]
    if unknown:
        hint = did_you_mean(unknown[0], SENSORS)
        raise ScenarioError(f"unknown sensor '{unknown[0]}'{hint} (known: {', '.join(SENSORS)})")
    if current_mps and scenario.trajectory.source != "vehicle":
        raise ScenarioError(
            f'scenario {scenario.name}: a current needs a vehicle, trajectory.source = "vehicle"'
        )
    off = {
        section: getattr(scenario, section).model_copy(update={"enabled": False})
        for section in (sensor.name for sensor in config_sensors.SENSORS)
    }
    on: dict[str, Any] = {key: section for name in sensors for key, section in SENSORS[name].items()}
    mission = {"mission": scenario.mission | {"current": {"speed_mps": current_mps, "towards_deg": 90.0}}}
    return cases.masked(scenario, mask).scenario.model_copy(
        update=off | on | (mission if current_mps else {})
    )


def configuration(scenarios: Sequence[Scenario], masks: Sequence[tuple[int, ...]]) -> str:
    """Hash of what decides the study."""
    content = [
        (s.name, build_simulation(s).fingerprint(), s.campaign.runs, s.campaign.seed) for s in scenarios
    ]
    sets = [list(sensors) for sensors in SENSOR_SETS]
    return study_folder.configuration_hash([content, [list(mask) for mask in masks], sets, list(METHODS)])


def run_sensor_law(
    scenarios: Sequence[Scenario],
    masks: Sequence[tuple[int, ...]],
    out: str | Path,
    *,
    command: str = "",
    threads: int = 0,
    progress: Callable[[str, int, int], None] = lambda _cell, _done, _total: None,
) -> pl.DataFrame:
    """Runs every cell and writes `sensor_law` as Parquet, Markdown and HTML to `out`; finished cells there are kept.

    Args:
        scenarios: trajectories, of different names; their runs and seed count, the methods are `METHODS`.
        masks: sets of returning beams, as `cases.masks` gives them.
        out: directory, claimed by the caller (`study_folder.claimed`).
        command: the command that reproduces the study, for the page.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        progress: called after each cell with its name, the number of finished cells and of all cells.

    Returns:
        The table `tables.studies.SENSOR_LAW`.

    Raises:
        ScenarioError: as `variant`.
        OutputError: where `out` cannot be written.
        KernelError: for input that the kernel rejects, naming run and method.
    """
    out = Path(out)
    cells = [
        (scenario, mask, current)
        for scenario in scenarios
        for mask in masks
        for current in (0.0, CROSS_CURRENT_MPS)
    ]
    tests = len(cells) * len(SENSOR_SETS) * len(METHODS) * 2
    parts = []
    hashed = configuration(scenarios, masks)
    for scenario, mask, current in cells:
        name = f"{scenario.name}-{''.join(map(str, mask))}-{'current' if current else 'still'}"
        path = out / "cells" / f"{name}.parquet"
        cell = partial(run_cell, scenario, mask, current, tests=tests, threads=threads)
        parts.append(study_folder.finished_part(path, hashed, cell))
        progress(name, len(parts), len(cells))
    table = pl.concat(parts)
    write_parquet(out / "sensor_law.parquet", table)
    facts = {
        "runs": study_folder.campaign_values(scenarios, "runs"),
        "seed": study_folder.campaign_values(scenarios, "seed"),
        "false_alarm": FALSE_ALARM,
        "made_with": study_folder.made_with(),
        "command": command,
    }
    write_pages(out / "sensor_law", page(table, summary(table), facts))
    return table


def run_cell(
    scenario: Scenario, mask: tuple[int, ...], current_mps: float, *, tests: int, threads: int = 0
) -> pl.DataFrame:
    """Every set of sensors under one mask, each against every smaller set that it contains.

    Args:
        scenario: its runs and seed count.
        mask: beams that return.
        current_mps: speed of a current that sets to the east.
        tests: number of means that the whole study judges, for the width of the bands.
        threads: 0 for as many as there are cores.
    """
    rows: list[tuple[Any, ...]] = []
    done: list[tuple[tuple[str, ...], _Runs]] = []
    for sensors in SENSOR_SETS:
        simulation = build_simulation(variant(scenario, mask, sensors, current_mps))
        times_s, batch = run_judged(simulation, METHODS, threads=threads)
        velocity = _Runs(batch["error"][..., 6:9], batch["sd"][..., 6:9])
        smaller = [(names, runs) for names, runs in done if set(names) < set(sensors)]
        done.append((sensors, velocity))
        for index, method in enumerate(METHODS):
            error = velocity.final(index)
            runs = len(error)
            medians = [name(names) for names, less in smaller if _median_rises(less.final(index), error)]
            tails = [
                name(names) for names, less in smaller if _a_run_rises(less, velocity, index, tests=tests)
            ]
            each = chi_squared.each_probability(FALSE_ALARM, tests * len(times_s))
            verdicts = []
            for quantity, degrees in (("nees_velocity_attitude", 6), ("nees", scenario.filter.states)):
                means = batch[quantity][:, index].mean(axis=0)
                low, high = chi_squared.mean_band(degrees, runs, each)
                verdicts += [
                    float(means.mean()),
                    chi_squared.verdict(low, float(means.min()), float(means.max()), high),
                ]
            place = (scenario.name, cases.beam_list(mask), current_mps, name(sensors), method)
            rows.append(
                (
                    *place,
                    runs,
                    float(np.median(error)),
                    float(rms(error)),
                    float(error.max()),
                    ", ".join(medians),
                    ", ".join(tails),
                    *verdicts,
                )
            )
    return pl.DataFrame(rows, schema=dict(SENSOR_LAW), orient="row")


@dataclass(frozen=True)
class _Runs:
    """Velocity errors of a cell and what the filter claims of them, m/s: arrays (runs, methods, times, 3)."""

    error: np.ndarray
    sd: np.ndarray

    def final(self, method: int) -> np.ndarray:
        """Norm of the error at the end, (runs,)."""
        norms: np.ndarray = np.linalg.norm(self.error[:, method, -1], axis=-1)
        return norms


def name(sensors: Sequence[str]) -> str:
    """A set of sensors in words.

    >>> name(("depth", "gps")), name(())
    ('depth+gps', 'none')
    """
    return "+".join(sensors) or "none"


def _a_run_rises(less: _Runs, more: _Runs, method: int, *, tests: int) -> bool:
    """True where a component of the velocity error of some run, at some time, grows with the sensors beyond chance.

    The estimates with fewer and with more sensors differ by what the sensors correct, whose variance is the difference
    of theirs (the correction and the error that it leaves are uncorrelated): not above the variance with fewer. A
    growth beyond the quantile of that σ is no chance, however great the error with fewer sensors is.

    Args:
        less: the runs with fewer sensors.
        more: the same runs with more.
        method: place of the method.
        tests: number of comparisons of the study, for one false-alarm rate.
    """
    before, after = np.abs(less.error[:, method]), np.abs(more.error[:, method])
    growth = float(((after - before) / less.sd[:, method]).max())
    each = chi_squared.each_probability(FALSE_ALARM, tests * after.size)
    return growth > math.sqrt(chi_squared.mean_band(1, 1, each)[1])


def _median_rises(without: np.ndarray, error: np.ndarray) -> bool:
    """True where the median error is greater with more sensors than `without` them, beyond chance.

    The lower end of the 99.9 % bootstrap interval of the difference of medians lies above zero; runs are resampled in
    pairs, with a fixed seed.
    """
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(error), (RESAMPLES, len(error)))
    difference = np.median(error[picks], axis=1) - np.median(without[picks], axis=1)
    return bool(np.quantile(difference, 0.0005) > 0.0)


def summary(table: pl.DataFrame) -> pl.DataFrame:
    """A row per method and set of sensors: counts of cells, median and greatest error.

    A cell becomes worse where its median velocity error rises beyond chance above that of a smaller set of sensors, and
    has a runaway where the error of a run does. It leaves its band where a NEES is overconfident and was not with a
    smaller set.
    """
    overconfident = (pl.col("verdict_velocity_attitude") == chi_squared.OVERCONFIDENT).alias("overconfident")
    keys = ["trajectory", "beams", "current_mps", "method"]
    sets = pl.DataFrame(
        [(name(more), name(less)) for more in SENSOR_SETS for less in SENSOR_SETS if set(less) < set(more)],
        schema={"sensors": pl.String(), "fewer": pl.String()},
        orient="row",
    )
    before = (
        table.select(*keys, pl.col("sensors").alias("fewer"), ~overconfident)
        .join(sets, on="fewer")
        .group_by(*keys, "sensors")
        .agg(pl.col("overconfident").any().alias("was_in_band"))
    )
    return (
        table.with_columns(overconfident)
        .join(before, on=[*keys, "sensors"], how="left", maintain_order="left")
        .group_by("method", "sensors", maintain_order=True)
        .agg(
            pl.len().alias("cells"),
            (pl.col("median_rises_above") != "").sum().alias("worse"),
            (pl.col("run_rises_above") != "").sum().alias("runaways"),
            (pl.col("overconfident") & pl.col("was_in_band").fill_null(value=False)).sum().alias("left_band"),
            pl.col("overconfident").sum(),
            pl.col("velocity_median_mps").median().alias("velocity_median_mps"),
            pl.col("velocity_greatest_mps").max().alias("velocity_greatest_mps"),
        )
    )
