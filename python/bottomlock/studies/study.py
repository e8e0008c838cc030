"""One study: methods under sets of returning beams and sets of sensors, on the same runs, with one verdict each."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import polars as pl

from bottomlock.campaign.run import CampaignProgress, Results, run_campaign
from bottomlock.config.scenario import Scenario
from bottomlock.files.columns import CONSISTENCY_MEANS, STUDY
from bottomlock.statistics.campaign import judge
from bottomlock.statistics.chi_squared import OVERCONFIDENT
from bottomlock.studies import cases

BLIND = ("ins", "lc")
"""Methods whose beams do not depend on the mask: flown once, with all beams."""

AS_CONFIGURED = "as configured"
"""In place of a set of beams or sensors: those of the scenario."""

_PLACE = ("trajectory", "beams", "sensors", "method")


@dataclass(frozen=True)
class Cell:
    """A method on a trajectory, with the beams that return and the sensors beside them.

    None for either: as the scenario has them.
    """

    scenario: Scenario
    mask: tuple[int, ...] | None
    sensors: tuple[str, ...] | None
    method: str

    @property
    def beams_text(self) -> str:
        """The beams in words: `1,2`."""
        return AS_CONFIGURED if self.mask is None else ",".join(map(str, self.mask))

    @property
    def sensors_text(self) -> str:
        """The sensors in words: `depth+gps`, or `none`."""
        return AS_CONFIGURED if self.sensors is None else "+".join(self.sensors) or "none"

    def flown(self) -> Scenario:
        """The scenario with these beams and sensors.

        Raises:
            ScenarioError: for a beam or sensor that is not there.
        """
        aided = self.scenario if self.sensors is None else cases.aided_by(self.scenario, self.sensors)
        return aided if self.mask is None else cases.masked(aided, self.mask)


def cells(
    scenarios: Iterable[Scenario],
    *,
    masks: Sequence[tuple[int, ...] | None] | None = None,
    sensors: Sequence[tuple[str, ...] | None] = (None,),
) -> list[Cell]:
    """Every combination, with the methods of each scenario.

    Args:
        scenarios: of different names.
        masks: sets of returning beams; every one of the instrument by default.
        sensors: sets of sensors beside the beams; those of the scenario by default.
    """
    chosen = []
    for scenario in scenarios:
        sets: Sequence[tuple[int, ...] | None] = cases.masks(scenario.dvl.beams) if masks is None else masks
        for mask in sets:
            # A method that does not look at the mask is flown under the first one.
            methods = [name for name in scenario.campaign.methods if name not in BLIND or mask == sets[0]]
            chosen += [Cell(scenario, mask, aiding, method) for aiding in sensors for method in methods]
    return chosen


def study(
    cells: Sequence[Cell],
    *,
    runs: int | None = None,
    seed: int | None = None,
    folder: str | Path | None = None,
    threads: int = 0,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> pl.DataFrame:
    """Flies every cell; cells of one trajectory have the same sensor errors, run by run.

    Args:
        cells: in any order; methods that share a scenario, beams and sensors are flown together.
        runs: of each cell; the scenario's own by default.
        seed: the scenario's own by default.
        folder: where each combination is a campaign of its own, kept and not run again; nothing is kept by default.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        force: start over in folders of other campaigns.
        progress: called with the combination as trajectory, and as runs of the campaign those of the whole study.

    Returns:
        `files.columns.STUDY`, a row a cell; its verdicts are one family.

    Raises:
        As `run_campaign`.
    """
    together: dict[tuple[str, str, str], list[Cell]] = {}
    for cell in cells:
        together.setdefault((cell.scenario.name, cell.beams_text, cell.sensors_text), []).append(cell)
    total = sum(runs or group[0].scenario.campaign.runs for group in together.values())
    errors, means = [], []
    for place, group in together.items():

        def report(state: CampaignProgress, place: Sequence[str] = place) -> None:
            progress(replace(state, trajectory=" ".join(place), campaign_runs=total))

        results = run_campaign(
            group[0].flown(),
            None if folder is None else Path(folder) / "-".join(place).replace(" ", "_"),
            runs=runs,
            seed=seed,
            methods=[cell.method for cell in group],
            threads=threads,
            force=force,
            progress=report,
        )
        where = [pl.lit(text).alias(name) for name, text in zip(_PLACE, place, strict=False)]
        errors.append(_errors(results).with_columns(*where))
        means.append(results.consistency.select(list(CONSISTENCY_MEANS)).with_columns(*where))
    return _with_verdicts(pl.concat(errors), judge(pl.concat(means)))


def _errors(results: Results) -> pl.DataFrame:
    """Errors at the end and what the gate did, a row a method."""
    runs = results.runs.group_by("method").agg(
        pl.len().cast(pl.Int64).alias("runs"),
        pl.col("velocity_final_mps").max().alias("velocity_greatest_mps"),
    )
    table = results.summary.join(runs, on="method", maintain_order="left")
    return table.with_columns(pl.col("rejected_fraction").fill_nan(None)).rename(
        {"nis_mean_over_runs_and_fixes": "nis"}
    )


def _with_verdicts(errors: pl.DataFrame, judged: pl.DataFrame) -> pl.DataFrame:
    """A row a cell, from its errors and the two rows of its NEES."""
    table = errors
    for quantity, part in (("nees_velocity_attitude", "velocity_attitude"), ("nees", "whole_state")):
        names = {"mean": quantity, "least": f"{quantity}_least", "greatest": f"{quantity}_greatest"}
        names |= {"band_lo": f"{quantity}_lo", "band_hi": f"{quantity}_hi", "verdict": f"verdict_{part}"}
        of_quantity = (
            judged.filter(pl.col("quantity") == quantity).rename(names).select(*_PLACE, *names.values())
        )
        table = table.join(of_quantity, on=_PLACE, how="left", maintain_order="left")
    over = pl.col("verdict_whole_state") == OVERCONFIDENT
    verdict = (
        pl.when(over).then(pl.lit(OVERCONFIDENT)).otherwise("verdict_velocity_attitude").alias("verdict")
    )
    return table.with_columns(verdict).select(list(STUDY)).cast(dict(STUDY))  # type: ignore[arg-type]
