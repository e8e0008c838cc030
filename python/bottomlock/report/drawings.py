"""The figures of a campaign's page: which, where on the page, with what caption."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.by_category import sweep_figure
from bottomlock.figures.consistency import calibration_figure, normalised_figure
from bottomlock.figures.curves import draw_nees, draw_rms, own_axes, velocity_multiples
from bottomlock.figures.paths import paths_figure
from bottomlock.figures.selector import choices_figure, shares_table
from bottomlock.pages.pieces import featured
from bottomlock.paper.claims import Paper, ValueClaim
from bottomlock.paper.verdicts import flown
from bottomlock.statistics.run_errors import RunErrors, velocity_calibration
from bottomlock.tables.results import CampaignTables
from bottomlock.tables.studies import CURRENT, VIRTUAL_BEAM_FACTOR


@dataclass(frozen=True)
class VirtualBeam:
    """`vb` on one trajectory as the paper's equation has it, and with the factor of least velocity error.

    Attributes:
        trajectory: its name.
        printed: row of `tables.studies.SWEEP` with n_f = 1.
        best: row of the least velocity error.
        tc: row of `tc` in the same runs, None where the sweep has none.
    """

    trajectory: str
    printed: Mapping[str, Any]
    best: Mapping[str, Any]
    tc: Mapping[str, Any] | None


def virtual_beams(sweep: pl.DataFrame | None, trajectories: Sequence[str]) -> list[VirtualBeam]:
    """`vb` at n_f = 1 and at its best on each trajectory of a sweep over n_f; empty where there is none."""
    found = []
    for name in trajectories:
        if sweep is None:
            break
        here = sweep.filter(pl.col("trajectory") == name)
        rows = here.filter((pl.col("parameter") == VIRTUAL_BEAM_FACTOR) & (pl.col("method") == "vb"))
        printed = rows.filter(pl.col("value") == "1")
        if not printed.height:
            continue
        still = here.filter(
            (pl.col("parameter") == CURRENT) & (pl.col("value") == "0") & (pl.col("method") == "tc")
        )
        found.append(
            VirtualBeam(
                name,
                printed.row(0, named=True),
                rows.sort("velocity_rms_over_runs_mps").row(0, named=True),
                still.row(0, named=True) if still.height else None,
            )
        )
    return found


def sweep_groups(sweep: pl.DataFrame) -> Iterator[tuple[str, str, pl.DataFrame]]:
    """Parameter, trajectory and their rows, in the order of the sweep."""
    for (parameter,), rows in sweep.group_by("parameter", maintain_order=True):
        for (trajectory,), here in rows.group_by("trajectory", maintain_order=True):
            yield str(parameter), str(trajectory), here


Place = Literal["first", "overview", "trajectory", "calibration", "every method", "sweep"]


@dataclass(frozen=True)
class Drawing:
    """A figure of the page.

    Attributes:
        name: of its file.
        caption: below it, and for screen readers.
        figure: itself.
        place: part of the page.
        trajectory: whose it is; None where it shows all of them.
        parameter: swept setting, of a figure of the sweep.
    """

    name: str
    caption: str
    figure: Figure
    place: Place
    trajectory: str | None = None
    parameter: str | None = None


def drawings(
    campaign: CampaignTables, errors: Mapping[str, RunErrors], paper: Paper, recommended: list[str]
) -> Iterator[Drawing]:
    """Every figure of a campaign, in the order of the page, as it is made.

    Args:
        campaign: its tables.
        errors: the errors run by run of each trajectory.
        paper: its claims.
        recommended: methods to use, the best first.
    """
    names = campaign.trajectories
    shown = {name: featured(campaign.methods(name), recommended) for name in names}
    for name in names:
        yield _rms(campaign, name, paper, "velocity", shown[name], banded=None, place="first")
    yield from _paths(campaign, paper)
    for name in names:
        # Yaw bounds the attitude of every method alike: more than two bands would be one grey.
        banded = [method for method in ("ins", *recommended[:1]) if method in shown[name]] or shown[name][:2]
        yield _rms(campaign, name, paper, "attitude", shown[name], banded=banded, place="trajectory")
        yield from _consistency(campaign, name, errors[name], shown[name])
        yield from _choices(campaign, name)
    yield from _sweep(campaign, recommended)


def _paths(campaign: CampaignTables, paper: Paper) -> list[Drawing]:
    """The trajectories, where their truth is there."""
    known = set() if campaign.paths is None else set(campaign.paths["trajectory"])
    names = [name for name in campaign.trajectories if name in known]
    if campaign.paths is None or not names:
        return []
    words = "The trajectories: plan view and depth"
    words += " (the paper's Figure 8)." if flown(campaign, paper) else "."
    return [Drawing("trajectories", words, paths_figure(campaign.paths, names), "overview")]


def _rms(
    campaign: CampaignTables,
    name: str,
    paper: Paper,
    quantity: Literal["velocity", "attitude"],
    methods: list[str],
    *,
    banded: list[str] | None,
    place: Place,
) -> Drawing:
    in_paper = name in flown(campaign, paper)
    printed = [one for one in _printed(paper, name, quantity) if one[0] in methods] if in_paper else []
    title = name.replace("_", " ").capitalize()
    words = "velocity error" if quantity == "velocity" else "misalignment"
    caption = f"{title}: {words}, RMS over runs; shaded: 95 % interval"
    caption += "" if banded is None else f" of {' and '.join(banded)}"
    if in_paper:
        caption += f" (the paper's Figure {getattr(paper.trajectories[name], f'{quantity}_figure')})"
    if printed:
        caption += "; hollow diamonds: printed in the paper"
    first = place == "first"
    figure, axes = own_axes(small=first)
    draw_rms(axes, campaign.ensemble, name, quantity, printed, methods=methods, banded=banded, titled=first)
    return Drawing(f"{quantity}_{name}", f"{caption}.", figure, place, name)


def _consistency(
    campaign: CampaignTables, name: str, errors: RunErrors, shown: list[str]
) -> Iterator[Drawing]:
    nees, axes = own_axes()
    draw_nees(axes, campaign.ensemble, campaign.consistency, name, methods=shown)
    yield Drawing(
        f"nees_{name}",
        "Mean NEES of the whole state; above the grey band a method is overconfident.",
        nees,
        "trajectory",
        name,
    )
    calibration = {method: velocity_calibration(errors, method) for method in shown}
    yield Drawing(
        f"calibration_{name}",
        "Velocity error against its claimed σ, a point per second; the ring is the end.",
        calibration_figure(calibration),
        "calibration",
        name,
    )
    yield Drawing(
        f"methods_{name}",
        "Velocity error of every method, RMS over runs; shaded: 95 % interval; grey: the other methods.",
        velocity_multiples(campaign.ensemble, name),
        "every method",
        name,
    )
    normalised = {method: errors.normalised_rms[method] for method in campaign.methods(name)}
    yield Drawing(
        f"normalised_{name}",
        "Error over claimed standard deviation, RMS over runs and times, for the nine components.",
        normalised_figure(normalised),
        "every method",
        name,
    )


def _choices(campaign: CampaignTables, name: str) -> Iterator[Drawing]:
    """Of a campaign with selectors."""
    if campaign.choices is None:
        return
    shares = shares_table(campaign.choices, name)
    if shares.height:
        words = "What the selectors choose: share of the runs at each ping."
        yield Drawing(f"choices_{name}", words, choices_figure(shares), "every method", name)


def _sweep(campaign: CampaignTables, recommended: list[str]) -> Iterator[Drawing]:
    """A figure for each swept setting and trajectory; that of n_f has the error of `tc` across."""
    if campaign.sweep is None:
        return
    tc = {
        one.trajectory: one.tc["velocity_rms_over_runs_mps"]
        for one in virtual_beams(campaign.sweep, campaign.trajectories)
        if one.tc is not None
    }
    numbers = {
        name: k for k, name in enumerate(campaign.sweep["parameter"].unique(maintain_order=True), start=1)
    }
    for parameter, trajectory, rows in sweep_groups(campaign.sweep):
        if trajectory not in campaign.trajectories or not _drawable(rows):
            continue
        level = ("tc", tc[trajectory]) if parameter == VIRTUAL_BEAM_FACTOR and trajectory in tc else None
        caption = (
            f"{trajectory.replace('_', ' ').capitalize()}: velocity error at the end against {parameter}."
        )
        methods = rows["method"].unique(maintain_order=True).to_list()
        shown = featured(methods, recommended)
        if len(shown) < len(methods):
            caption += f" In the rows only: {', '.join(one for one in methods if one not in shown)}."
        drawn = rows.filter(pl.col("method").is_in(shown))
        figure = sweep_figure(drawn, level=level)
        name = f"sweep_{numbers[parameter]}_{trajectory}"
        yield Drawing(name, caption, figure, "sweep", trajectory, parameter)


def _drawable(rows: pl.DataFrame) -> bool:
    """Whether some error is a number that a logarithmic axis can have."""
    error_mps = rows["velocity_rms_over_runs_mps"]
    return bool(((error_mps > 0.0) & error_mps.is_finite()).any())


def _printed(paper: Paper, trajectory: str, quantity: str) -> list[tuple[str, float, float]]:
    return [
        (claim.method, claim.time_s, claim.printed)
        for claim in paper.claim
        if isinstance(claim, ValueClaim) and claim.trajectory == trajectory and claim.quantity == quantity
    ]
