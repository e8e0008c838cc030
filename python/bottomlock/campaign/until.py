"""A campaign that ends when an interval is narrow enough: whole chunks, each with the bits of the whole campaign."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import polars as pl

from bottomlock.campaign.directory import MANIFEST
from bottomlock.campaign.partition import Partition
from bottomlock.campaign.run import CampaignProgress, Results, run_campaign
from bottomlock.config.scenario import Scenario
from bottomlock.errors import ScenarioError
from bottomlock.files.records import DIGESTS, read_record, write_record
from bottomlock.support.nearest import did_you_mean

QUANTITIES = {
    "velocity_rms": "velocity_rms_over_runs{}_mps",
    "attitude_rms": "attitude_rms_over_runs{}_deg",
}
"""Errors at the end with an interval in `tables.campaign.ENSEMBLE`, and their columns."""

_FORM = re.compile(r"\s*(?P<method>.+)\.(?P<quantity>[a-z_]+)\s*<\s*(?P<percent>\d+(\.\d*)?)\s*%\s*")


@dataclass(frozen=True)
class Until:
    """Half of the 95 % interval of one method's error at the end, below a part of the error, on every trajectory."""

    method: str
    quantity: str
    percent: float

    def __str__(self) -> str:
        return f"{self.method}.{self.quantity}<{self.percent:g}%"

    @classmethod
    def parse(cls, text: str) -> Self:
        """A condition from its text.

        >>> Until.parse("tc.velocity_rms<2%")
        Until(method='tc', quantity='velocity_rms', percent=2.0)

        Raises:
            ScenarioError: for any other form, or an unknown quantity.
        """
        found = _FORM.fullmatch(text)
        if found is None or found["quantity"] not in QUANTITIES or not 0.0 < float(found["percent"]) < 100.0:
            raise ScenarioError(
                f"--until is '{text}', expected METHOD.QUANTITY<PERCENT%, such as 'tc.velocity_rms<2%' (in quotes, for "
                f"the shell); a quantity is {' or '.join(QUANTITIES)}"
            )
        return cls(found["method"], found["quantity"], float(found["percent"]))

    def check(self, scenarios: Sequence[Scenario]) -> None:
        """Rejects a method that a scenario is not run with.

        Raises:
            ScenarioError: naming the scenario and its methods.
        """
        for scenario in scenarios:
            known = scenario.campaign.methods
            if self.method not in known:
                raise ScenarioError(
                    f"--until names method '{self.method}'{did_you_mean(self.method, known) or ','} "
                    f"{scenario.name} is run with {', '.join(known)}"
                )

    def half_width_percent(self, ensemble: pl.DataFrame, trajectory: str) -> float:
        """Half of the interval in percent of the error, on one trajectory at its last second.

        Args:
            ensemble: `tables.campaign.ENSEMBLE`.
            trajectory: its name.
        """
        column = QUANTITIES[self.quantity]
        last = (
            ensemble.filter((pl.col("trajectory") == trajectory) & (pl.col("method") == self.method))
            .sort("time_s")
            .row(-1, named=True)
        )
        value, low, high = (last[column.format(end)] for end in ("", "_lo", "_hi"))
        return 50.0 * (high - low) / value if value > 0.0 else math.inf


def run_until(
    scenarios: Sequence[Scenario],
    out: str | Path,
    until: Until,
    *,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
    **settings: Any,  # noqa: ANN401 - as `run_campaign` takes them
) -> Results:
    """Runs whole chunks of each scenario until its interval is narrow enough, at most all of its runs.

    The runs are the first ones of the whole campaign, cut at its chunks, so that every finished chunk has the bits of
    the whole, and the same command without `until` goes on with them. The manifest states under `until` the condition,
    and for each scenario the runs asked for and whether it was reached.

    Args:
        scenarios: as for `run_campaign`; their runs are the most.
        out: as for `run_campaign`.
        until: the condition; it is judged at the ends of chunks alone.
        progress: as for `run_campaign`.
        settings: further arguments of `run_campaign`.

    Raises:
        ScenarioError: for a method that a scenario does not fly; and as `run_campaign`.
    """
    out = Path(out)
    until.check(scenarios)
    sizes = {one.name: Partition.of(one).runs_per_chunk for one in scenarios}
    runs = {one.name: min(sizes[one.name], one.campaign.runs) for one in scenarios}
    while True:
        partial = [one.with_overrides(runs=runs[one.name]) for one in scenarios]
        results = run_campaign(partial, out, progress=progress, **settings)
        settings["force"] = False
        widths = {name: until.half_width_percent(results.ensemble, name) for name in runs}
        more = {
            one.name: next_runs(
                runs[one.name], sizes[one.name], one.campaign.runs, widths[one.name] / until.percent
            )
            for one in scenarios
        }
        if more == runs:
            return _recorded(results, scenarios, out, until, widths)
        runs = more


def next_runs(runs: int, chunk: int, most: int, ratio: float) -> int:
    """Runs of the next step: as many whole chunks as an interval needs that narrows with the root of the runs.

    At most twice as many, so that a chance wide interval does not cost much; no more where the ratio is below 1.

    >>> next_runs(300, 300, 5000, 1.5), next_runs(300, 300, 5000, 9.0), next_runs(300, 300, 5000, 0.9)
    (600, 600, 300)
    >>> next_runs(900, 300, 1000, 2.0), next_runs(1200, 300, 5000, 1.1)
    (1000, 1500)
    """
    if ratio < 1.0:
        return runs
    wanted = min(2.0 * runs, runs * ratio**2)
    return min(most, max(runs + chunk, chunk * math.ceil(wanted / chunk)))


def _recorded(
    results: Results, scenarios: Sequence[Scenario], out: Path, until: Until, widths: dict[str, float]
) -> Results:
    """The results, with the condition in their manifest."""
    stated = {
        "condition": str(until),
        "scenarios": {
            one.name: {
                "runs_at_most": one.campaign.runs,
                "half_width_percent": round(widths[one.name], 4) if math.isfinite(widths[one.name]) else None,
                "reached": widths[one.name] < until.percent,
            }
            for one in scenarios
        },
    }
    written = read_record(out / MANIFEST)
    assert written is not None
    digests = written.pop(DIGESTS)
    write_record(out / MANIFEST, written | {"until": stated}, digests)
    return replace(results, manifest=results.manifest | {"until": stated})
