"""Recovery when beams return: the step of a method's velocity and its innovations at the first fixes of full lock.

Two beams return for one minute at mid-run; before and after it all beams return. With a consistent filter the step of
the velocity estimate stays within three of its claimed standard deviations, and the NIS is chi-squared from the first
fix on.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np
import polars as pl
from scipy.stats import binom, chi2, norm

from bottomlock.config.scenario import Scenario
from bottomlock.errors import ScenarioError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.kernel import kernel_version
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.own_path import resolved
from bottomlock.simulation.run_events import Fix, Readings
from bottomlock.statistics import chi_squared
from bottomlock.studies import cases, study_folder
from bottomlock.tables.studies import RECOVERY, RECOVERY_EPOCHS, RECOVERY_SUMMARY
from bottomlock.truth.truth import Truth

OUTAGE_S = 60.0
SIGMAS = 3.0
FALSE_ALARM = 0.01
"""Probability that the summary of consistent filters has any false "no"."""

RUN_BAND = 0.9973
"""Probability of the band of one NIS of one run; that of the gate."""

BLOCK = 10
"""Runs per file, a few seconds of work, so that an interruption loses little."""


def two_beam_outages(scenario: Scenario) -> list[cases.Case]:
    """The scenario with only two beams for a minute at mid-run, for every pair.

    Raises:
        ScenarioError: if the trajectory is too short for it, or the instrument has fewer than three beams.
    """
    scenario = resolved(scenario)
    duration_s = scenario.trajectory.duration_s
    after_s = RECOVERY_EPOCHS / scenario.dvl.rate_hz
    if duration_s < OUTAGE_S + 2.0 * after_s:
        raise ScenarioError(
            f"scenario {scenario.name}: lasts {duration_s:g} s, expected {OUTAGE_S + 2.0 * after_s:g} s or more: "
            f"an outage of {OUTAGE_S:g} s at mid-run and {RECOVERY_EPOCHS} pings after it"
        )
    pairs = [mask for mask in cases.masks(scenario.dvl.beams, whole=False) if len(mask) == 2]
    if not pairs:
        raise ScenarioError(
            f"scenario {scenario.name}: an instrument of {scenario.dvl.beams} beams, expected three or more: "
            "with two there is nothing to recover from"
        )
    begin_s = 0.5 * (duration_s - OUTAGE_S)
    return [cases.outage(scenario, pair, from_s=begin_s, to_s=begin_s + OUTAGE_S) for pair in pairs]


def run_recovery(
    scenarios: Sequence[Scenario],
    out: str | Path,
    *,
    progress: Callable[[str, int], None] = lambda _trajectory, _runs: None,
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Runs the outages and writes `recovery.parquet` and `recovery_summary.parquet`; finished parts in `out` are kept.

    Args:
        scenarios: trajectories with runs, seed and methods ("ins" is left out, since it has no fixes).
        out: directory, claimed by the caller (`study_folder.claimed`).
        progress: called with the trajectory and the number of its runs that are done.

    Returns:
        The tables `tables.studies.RECOVERY` and `RECOVERY_SUMMARY`.

    Raises:
        ScenarioError: as `two_beam_outages` and `Readings`.
        OutputError: if `out` cannot be written.
    """
    out = Path(out)
    parts = []
    for scenario in scenarios:
        outages = two_beam_outages(scenario)
        simulations = [build_simulation(case.scenario) for case in outages]
        settings = scenario.campaign
        hashed = study_folder.configuration_hash(
            [kernel_version(), simulations[0].fingerprint(), settings.methods]
        )
        truth = cache(simulations[0].truth)
        for first in range(0, settings.runs, BLOCK):
            runs = range(first, min(first + BLOCK, settings.runs))
            path = out / "recovery" / scenario.name / f"{hashed[:12]}-{runs[0]:06d}-{runs[-1]:06d}.parquet"
            block = partial(_block, simulations, outages, truth, runs)
            parts.append(study_folder.finished_part(path, hashed, block))
            progress(scenario.name, runs[-1] + 1)
    table = pl.concat(parts)
    judged = summary(table)
    write_parquet(out / "recovery.parquet", table)
    write_parquet(out / "recovery_summary.parquet", judged)
    return table, judged


def _block(
    simulations: Sequence[Simulation], outages: Sequence[cases.Case], truth: Callable[[], Truth], runs: range
) -> pl.DataFrame:
    """Some runs with every mask and method (`tables.studies.RECOVERY`)."""
    rows = [row for run in runs for row in _rows(simulations, outages, truth(), run)]
    return pl.DataFrame(rows, schema=dict(RECOVERY), orient="row")


def _rows(
    simulations: Sequence[Simulation], outages: Sequence[cases.Case], truth: Truth, run: int
) -> Iterator[tuple[object, ...]]:
    """One run, drawn once, with every mask and method."""
    readings = Readings(simulations[0], truth, run=run)
    times = readings.ping_time_ns
    for simulation, case in zip(simulations, outages, strict=True):
        rule = simulation.scenario.dvl.outages[0]
        lost = (times >= rule.from_s * 1e9) & (times < rule.to_s * 1e9)
        valid = np.ones((len(times), simulation.geometry.beams), dtype=np.bool_)
        for beam in rule.beams:
            valid[lost, beam - 1] = False
        first = int(np.flatnonzero(lost)[-1]) + 1
        for method in simulation.scenario.campaign.methods:
            if method == "ins":
                continue
            fixes = readings.fixes(method, valid, range(first, first + RECOVERY_EPOCHS))
            for fix in fixes:
                epoch = int(np.searchsorted(times, fix.time_ns)) - first + 1
                yield (simulation.scenario.name, case.name, case.beams, method, run, epoch, *_measures(fix))


def _measures(fix: Fix) -> tuple[object, ...]:
    low, high = chi2.ppf([0.5 * (1.0 - RUN_BAND), 0.5 * (1.0 + RUN_BAND)], fix.degrees)
    ratio = np.abs(fix.step_p_mps) / fix.before_sd_mps
    return (
        fix.time_ns * 1e-9,
        *(float(step) for step in fix.step_p_mps),
        *(float(sd) for sd in fix.before_sd_mps),
        float(ratio.max()),
        jump_chance(fix),
        fix.nis,
        fix.degrees,
        float(low),
        float(high),
        bool(low <= fix.nis <= high),
        fix.used,
    )


def jump_chance(fix: Fix) -> float:
    """Upper bound of the probability that a consistent filter's velocity steps by more than 3σ on any axis.

    The step of an optimal update has the covariance P⁻ − P⁺, so an axis exceeds 3σ of P⁻ with probability
    2 Φ(−3 / √(1 − P⁺/P⁻)), at most 0.27 %. The sum over the axes bounds the probability of any.
    """
    if not fix.used:
        return 0.0
    share = np.clip(1.0 - (fix.after_sd_mps / fix.before_sd_mps) ** 2, 1e-12, 1.0)
    return float(np.sum(2.0 * norm.sf(SIGMAS / np.sqrt(share))))


def summary(table: pl.DataFrame) -> pl.DataFrame:
    """A row per trajectory, mask and method (`tables.studies.RECOVERY_SUMMARY`).

    The bands are widened so that the false-alarm rate holds for the whole table.
    """
    keys = ["trajectory", "case", "beams", "method"]
    groups = list(table.group_by(keys, maintain_order=True))
    each = chi_squared.each_probability(FALSE_ALARM, len(groups) * (RECOVERY_EPOCHS + 1))
    rows = []
    for key, group in groups:
        by_run = group.group_by("run").agg(
            pl.col("step_sigmas").max(), pl.col("jump_chance").sum().clip(0.0, 1.0)
        )
        runs = by_run.height
        jumps = by_run.filter(pl.col("step_sigmas") > SIGMAS).height
        allowed = int(binom.ppf(each, runs, by_run["jump_chance"].mean()))
        nis = group.group_by("epoch").agg(pl.col("nis").mean(), pl.col("degrees").mean()).sort("epoch")
        degrees = round(float(nis["degrees"].to_numpy().mean()))
        low, high = chi_squared.mean_band(degrees, runs, each)
        means = dict(zip(nis["epoch"].to_list(), nis["nis"].to_list(), strict=True))
        back = _back_at([low <= means.get(epoch, np.nan) <= high for epoch in range(1, RECOVERY_EPOCHS + 1)])
        rows.append(
            (
                *key,
                runs,
                by_run["step_sigmas"].max(),
                jumps,
                allowed,
                *(means.get(epoch) for epoch in range(1, RECOVERY_EPOCHS + 1)),
                degrees,
                low,
                high,
                back,
                1.0 - float(group["used"].to_numpy().mean()),
                jumps <= allowed and back is not None,
            )
        )
    return pl.DataFrame(rows, schema=dict(RECOVERY_SUMMARY), orient="row")


def _back_at(inside: Sequence[bool]) -> int | None:
    """The epoch, from 1, from which all are inside; None where the last is not."""
    outside = [epoch for epoch, within in enumerate(inside, start=1) if not within]
    if not outside:
        return 1
    return None if outside[-1] == len(inside) else outside[-1] + 1
