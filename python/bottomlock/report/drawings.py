"""The figures of a campaign's page, each with its caption, and what page and figures are made from."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import polars as pl

from bottomlock.figures.campaign import (
    HALF,
    LOW,
    THIRD,
    WIDE,
    calibration_of,
    choices_figure,
    errors_of,
    nees_of,
    normalised_of,
    sweep_of,
)
from bottomlock.figures.flight import path_figure
from bottomlock.figures.series import Figure, Panel
from bottomlock.files.campaign_tables import CampaignTables
from bottomlock.files.columns import CURRENT, VIRTUAL_BEAM_FACTOR
from bottomlock.pages.page import Picture, Pictures
from bottomlock.pages.pieces import featured, title_of
from bottomlock.report.advice import Advice, Choice
from bottomlock.statistics.claims import Paper, ValueClaim
from bottomlock.statistics.run_errors import RunErrors, velocity_calibration


@dataclass(frozen=True)
class Content:
    """What the page of a campaign is made from.

    Attributes:
        campaign: its tables.
        errors: the errors run by run of each trajectory.
        paper: its claims.
        in_paper: trajectories that were run as in the paper.
        claims: verdicts on the claims about these.
        advice: recommendations for each trajectory.
        choice: the method for all of them, None where there is none.
        pictures: the figures of the page, which grow as it is laid out.
    """

    campaign: CampaignTables
    errors: Mapping[str, RunErrors]
    paper: Paper
    in_paper: Sequence[str]
    claims: pl.DataFrame
    advice: Sequence[Advice]
    choice: Choice | None
    pictures: Pictures = field(default_factory=Pictures)

    def add(self, panel: Panel, size_in: tuple[float, float], name: str, caption: str) -> Picture:
        """Draws a panel as a figure of the page: three beside one another, or two of the larger sizes."""
        kind = "third" if size_in in (THIRD, LOW) else ""
        return self.pictures.add(Figure("", [panel], size_in=size_in), name, caption, kind)

    @property
    def best(self) -> Sequence[str]:
        """The methods of the headline."""
        return () if self.choice is None else self.choice.best

    def shown(self, name: str) -> list[str]:
        """The methods in the first figures of a trajectory."""
        return featured(self.campaign.methods(name), self.best)


def paths(content: Content) -> Iterator[Picture]:
    """The trajectories, where their truth is there."""
    table = content.campaign.paths
    for name in content.campaign.trajectories:
        if table is not None and name in table["trajectory"]:
            source = " (the paper's Figure 8)" if content.in_paper else ""
            caption = f"{title_of(name)}: plan view and depth{source}."
            yield content.pictures.add(path_figure(table, name), f"trajectory_{name}", caption, "third")


def errors_over_time(content: Content, name: str, quantity: Literal["velocity", "attitude"]) -> Picture:
    """Velocity error or misalignment over the time of a trajectory, beside what the paper prints."""
    shown = content.shown(name)
    # Yaw bounds the attitude of every method alike: more than two bands would be one grey.
    two = [method for method in ("ins", *content.best[:1]) if method in shown] or shown[:2]
    banded = two if quantity == "attitude" else None
    printed = [
        (claim.method, claim.time_s, claim.printed)
        for claim in content.paper.claim
        if isinstance(claim, ValueClaim) and (claim.trajectory, claim.quantity) == (name, quantity)
        if name in content.in_paper and claim.method in shown
    ]
    title = "velocity error" if quantity == "velocity" else "misalignment"
    caption = f"{title_of(name)}: {title}, RMS over runs; shaded: 95 % interval"
    caption += "" if banded is None else f" of {' and '.join(banded)}"
    if name in content.in_paper:
        number = getattr(content.paper.trajectories[name], f"{quantity}_figure")
        caption += f" (the paper's Figure {number})"
    caption += "; hollow: printed in the paper." if printed else "."
    drawn = errors_of(
        content.campaign.ensemble, name, quantity, printed, methods=shown, banded=banded,
        titled=quantity == "velocity",
    )  # fmt: skip
    return content.add(drawn, THIRD, f"{quantity}_{name}", caption)


def consistency(content: Content, name: str) -> Iterator[Picture]:
    """Error against claim, misalignment, and NEES over the time of a trajectory."""
    shown, campaign = content.shown(name), content.campaign
    claims = calibration_of({method: velocity_calibration(content.errors[name], method) for method in shown})
    caption = "Velocity error against its claimed σ, a point per second; the ring is the end."
    yield content.add(claims, THIRD, f"calibration_{name}", caption)
    yield errors_over_time(content, name, "attitude")
    nees = nees_of(campaign.ensemble, campaign.consistency, name, methods=shown)
    caption = "Mean NEES of the whole state; above the grey band a method is overconfident."
    yield content.add(nees, THIRD, f"nees_{name}", caption)


def every_method(content: Content, name: str) -> Iterator[Picture]:
    """Errors of all methods on a trajectory, error over σ by component, and what selectors choose."""
    campaign = content.campaign
    caption = "Velocity error of every method, RMS over runs."
    drawn = errors_of(campaign.ensemble, name, "velocity", banded=[])
    yield content.add(drawn, HALF, f"methods_{name}", caption)
    normalised = {method: content.errors[name].normalised_rms[method] for method in campaign.methods(name)}
    caption = "Error over claimed standard deviation, RMS over runs and times, for the nine components."
    yield content.add(normalised_of(normalised), WIDE, f"normalised_{name}", caption)
    choices = None if campaign.choices is None else campaign.choices.filter(trajectory=name)
    if choices is not None and choices.height:
        caption = "What the selectors choose: share of the runs at each ping."
        yield content.pictures.add(choices_figure(choices), f"choices_{name}", caption, "")


def sweeps(content: Content, number: int, parameter: str, rows: pl.DataFrame) -> Iterator[Picture]:
    """A figure for each trajectory on which a setting was swept; that of n_f has the error of `tc` across.

    Args:
        content: of the page.
        number: of the setting, in the names of the files.
        parameter: the setting.
        rows: of `files.columns.SWEEP`, its own.
    """
    for (trajectory,), here in rows.group_by("trajectory", maintain_order=True):
        error_mps = here["velocity_rms_over_runs_mps"]
        if (
            trajectory not in content.campaign.trajectories
            or not ((error_mps > 0.0) & error_mps.is_finite()).any()
        ):
            continue
        tc = virtual_beam(content.campaign.sweep, str(trajectory)).get("tc")
        level = ("tc", tc["velocity_rms_over_runs_mps"]) if tc and parameter == VIRTUAL_BEAM_FACTOR else None
        methods = here["method"].unique(maintain_order=True).to_list()
        shown = featured(methods, content.best)
        others = ", ".join(method for method in methods if method not in shown)
        caption = f"{title_of(str(trajectory))}: velocity error at the end against {parameter}."
        caption += f" In the rows only: {others}." if others else ""
        panel = sweep_of(here.filter(pl.col("method").is_in(shown)), level)
        yield content.add(panel, LOW, f"sweep_{number}_{trajectory}", caption)


def virtual_beam(sweep: pl.DataFrame | None, trajectory: str) -> dict[str, dict[str, Any]]:
    """Rows of a sweep over n_f on a trajectory: `vb` as `printed`, with n_f = 1, and at its `best`, and `tc`.

    Empty without a sweep over n_f; without `tc` where no sweep of the current has it.
    """
    if sweep is None:
        return {}
    here = sweep.filter(pl.col("trajectory") == trajectory)
    swept = here.filter(parameter=VIRTUAL_BEAM_FACTOR, method="vb").sort("velocity_rms_over_runs_mps")
    printed, still = swept.filter(value="1"), here.filter(parameter=CURRENT, value="0", method="tc")
    rows = {"printed": printed, "best": swept, "tc": still} if printed.height else {}
    return {name: table.row(0, named=True) for name, table in rows.items() if table.height}
