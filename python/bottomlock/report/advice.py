"""Which method to use: of those consistent in the campaign and in the published studies, the ones of least error.

A campaign tests the assumptions of a method in its own water alone. In still water a method that sets the sway to zero
has the least error; whether it holds elsewhere is read off the published studies (docs/evidence.md).
`python -m tools.evidence --publish` writes the packaged table; its metadata name commits and commands.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.campaign_tables import CampaignTables
from bottomlock.files.columns import CURRENT, PUBLISHED, check
from bottomlock.statistics.campaign import runs_mostly_rejected
from bottomlock.statistics.chi_squared import CONSISTENT, OVERCONFIDENT
from bottomlock.statistics.run_errors import RunErrors

FILE = "published.parquet"

IN_CURRENT = ("survey", "hovering")
"""Worlds whose water moves; that of the paper is still."""

INSTRUMENT = {"configuration": "x", "tilt_deg": 20.0}
"""Keys of `[dvl]` of the paper's world; for another instrument the numbers of beams can mean another geometry, and a
campaign is compared with all cells."""

CHANGING = ("outages", "dropouts", "altitude_loss", "replay_validity")
"""Keys of `[dvl]` by which the returning beams change with time."""


@dataclass(frozen=True)
class Standing:
    """How a method did in the published studies, counted in cells (world, trajectory and set of beams).

    Attributes:
        cells: number of cells.
        consistent: cells whose verdict is that.
        overconfident: cells whose verdict is that: in velocity and attitude, or in the whole state.
        overconfident_core: those of them in velocity and attitude.
    """

    cells: int
    consistent: int
    overconfident: int
    overconfident_core: int


def load_published() -> pl.DataFrame:
    """The packaged table, `files.columns.PUBLISHED`.

    >>> load_published().columns[:4]
    ['world', 'method', 'trajectory', 'beams']
    """
    content = (resources.files("bottomlock.report") / FILE).read_bytes()
    return check(pl.read_parquet(content), PUBLISHED, place=FILE)


def returning_beams(configuration: Mapping[str, Any]) -> str | None:
    """The beams that return from first to last, as the published studies write them.

    None where they change with time, or belong to another instrument than the studies'.

    Args:
        configuration: of a scenario, as the manifest records it.

    >>> x = {"configuration": "x", "tilt_deg": 20.0}
    >>> returning_beams({"dvl": x | {"beams_lost": [3, 4]}}), returning_beams({"dvl": x | {"dropouts": [{}]}})
    ('1,2', None)
    """
    dvl = configuration["dvl"]
    another = any(dvl.get(key) != value for key, value in INSTRUMENT.items())
    if another or configuration.get("seabed") or any(dvl.get(key) for key in CHANGING):
        return None
    lost = set(dvl.get("beams_lost", ()))
    return ",".join(str(beam) for beam in range(1, 5) if beam not in lost)


def standing(published: pl.DataFrame, method: str) -> Standing:
    """The counts of a method in these cells.

    Raises:
        DataError: for a method without a cell.
    """
    chosen = published.filter(pl.col("method") == method)
    if chosen.is_empty():
        raise DataError(f"holds no cell of method '{method}'", place=FILE)
    verdict = pl.col("verdict")
    counts = chosen.select(
        (verdict == CONSISTENT).sum().alias("consistent"),
        (verdict == OVERCONFIDENT).sum().alias("overconfident"),
        (pl.col("verdict_velocity_attitude") == OVERCONFIDENT).sum().alias("overconfident_core"),
    ).row(0, named=True)
    return Standing(chosen.height, **counts)


REFERENCES = {"ins": "no beams", "lc": "all beams, none lost"}
"""Methods that bound the comparison and are not recommended."""

ZERO_SWAY = ("nsv", "elc", "weak_sway")
"""Methods that assume no sway over ground: `elc` by its choice of `nsv`, `weak_sway` with a large variance."""

CLOSE = 1.05
"""Methods within 5 % of the best are named with it."""


@dataclass(frozen=True)
class Advice:
    """One trajectory: the error of each method at the end, and what follows from it.

    Attributes:
        trajectory: its name.
        velocity_rms_mps: RMS over runs of the velocity error at the end, by method.
        attitude_rms_deg: the same of the misalignment.
        consistent: methods that are not overconfident in velocity and attitude and whose gate rejects most fixes in
            no run; without references, the smallest error first.
        recommended: those of them that are consistent on every other trajectory of the campaign, too, and overconfident
            in no cell of the published studies with the same beams.
        consistent_here_only: the others of them, and why they are not recommended.
        beams: the returning beams of those cells; None for all cells, where the beams change or no study has them.
        overconfident: without references, the smallest error first.
        mostly_rejected: number of runs in which the gate rejects more than half of the fixes, for the methods to which
            that happens.
    """

    trajectory: str
    velocity_rms_mps: Mapping[str, float]
    attitude_rms_deg: Mapping[str, float]
    consistent: tuple[str, ...]
    recommended: tuple[str, ...]
    consistent_here_only: Mapping[str, str]
    beams: str | None
    overconfident: tuple[str, ...]
    mostly_rejected: Mapping[str, int]

    @property
    def best(self) -> tuple[str, ...]:
        """The recommended method of least velocity error, and those within `CLOSE` of it."""
        if not self.recommended:
            return ()
        least = self.velocity_rms_mps[self.recommended[0]]
        return tuple(method for method in self.recommended if self.velocity_rms_mps[method] <= CLOSE * least)

    @property
    def attitude_range_deg(self) -> tuple[float, float]:
        """Least and greatest misalignment of the consistent methods."""
        values = [self.attitude_rms_deg[method] for method in self.consistent]
        return min(values), max(values)


@dataclass(frozen=True)
class Choice:
    """The method to take when the trajectory is not known beforehand.

    Attributes:
        recommended: methods that are recommended on every trajectory.
        best: those whose worst ratio is least.
        worst_ratio: greatest ratio over the trajectories of its error to that of the best recommended method there.
        worst_trajectory: where that is.
    """

    recommended: tuple[str, ...]
    best: tuple[str, ...]
    worst_ratio: float
    worst_trajectory: str


def advise(
    campaign: CampaignTables, errors: Mapping[str, RunErrors], published: pl.DataFrame | None = None
) -> list[Advice]:
    """Recommendations for each trajectory.

    Args:
        campaign: its tables.
        errors: the errors run by run of each trajectory, by its name.
        published: `files.columns.PUBLISHED`; the packaged one by default.
    """
    published = load_published() if published is None else published
    judged = [_judge(campaign, name, errors[name]) for name in campaign.trajectories]
    return [_with_recommended(campaign, advice, judged, published) for advice in judged]


def _judge(campaign: CampaignTables, name: str, errors: RunErrors) -> Advice:
    """One trajectory of the campaign by itself, on which nothing is recommended yet."""
    table = campaign.consistency.filter(
        (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
    )
    verdict = dict(zip(table["method"], table["verdict"], strict=True))
    velocity, attitude = (
        {method: errors.final_rms(quantity, method) for method in campaign.methods(name)}
        for quantity in ("velocity", "attitude")
    )
    # What has no verdict is no filter.
    filters = (method for method in velocity if method not in REFERENCES and verdict[method] is not None)
    methods = sorted(filters, key=velocity.__getitem__)
    counts = {
        method: runs_mostly_rejected(campaign.runs.filter(trajectory=name, method=method))
        for method in methods
    }
    rejected = {method: count for method, count in counts.items() if count}
    overconfident = tuple(method for method in methods if verdict[method] == OVERCONFIDENT)
    consistent = tuple(m for m in methods if m not in overconfident and m not in rejected)
    return Advice(name, velocity, attitude, consistent, (), {}, None, overconfident, rejected)


def _with_recommended(
    campaign: CampaignTables, advice: Advice, judged: Sequence[Advice], published: pl.DataFrame
) -> Advice:
    """With what is recommended, or why not, by the other trajectories and the published studies."""
    beams = returning_beams(campaign.configuration(advice.trajectory))
    here = published.filter(pl.col("beams") == beams)
    if here.is_empty():
        beams, here = None, published
    moves = _current_mps(campaign, advice.trajectory) > 0.0
    moves |= not set(IN_CURRENT).isdisjoint(published["world"])
    known = {method: standing(here, method) for method in advice.consistent if method in set(here["method"])}
    doubts = {
        method: _failed(method, judged) or _doubt(method, known.get(method), beams, water_moves=moves)
        for method in advice.consistent
    }
    return replace(
        advice,
        recommended=tuple(method for method, doubt in doubts.items() if not doubt),
        consistent_here_only={method: doubt for method, doubt in doubts.items() if doubt},
        beams=beams,
    )


def _failed(method: str, judged: Sequence[Advice]) -> str:
    """Where in the campaign a method is overconfident or rejects most fixes; empty where nowhere.

    The filter does not know which trajectory it is on: what fails on one is recommended on none.
    """
    over = [advice.trajectory for advice in judged if method in advice.overconfident]
    rejected = [advice.trajectory for advice in judged if method in advice.mostly_rejected]
    return "; ".join(
        f"{fault} on {', '.join(names).replace('_', ' ')}"
        for fault, names in (("overconfident", over), ("most fixes rejected", rejected))
        if names
    )


def _doubt(method: str, known: Standing | None, beams: str | None, *, water_moves: bool) -> str:
    """Why a method that is consistent in the campaign is not recommended; empty where it is."""
    if known is None:
        return "in no published study"
    if known.overconfident:
        where = f" with beams {beams}" if beams else ""
        return (
            f"overconfident in {known.overconfident} of {known.cells} published cells{where} "
            f"(velocity and attitude: {known.overconfident_core})"
        )
    if method in ZERO_SWAY and not water_moves:
        return "assumes no sway over ground, which neither this campaign nor a published study tests in a current"
    return ""


def _current_mps(campaign: CampaignTables, trajectory: str) -> float:
    mission = campaign.configuration(trajectory).get("mission") or {}
    return float(mission.get("current", {}).get("speed_mps", 0.0))


def untested_in_current(campaign: CampaignTables) -> list[str]:
    """Methods of `ZERO_SWAY` in a campaign whose water is still on every trajectory."""
    if any(_current_mps(campaign, name) for name in campaign.trajectories):
        return []
    methods = {method for name in campaign.trajectories for method in campaign.methods(name)}
    return [method for method in ZERO_SWAY if method in methods]


def swept_current(sweep: pl.DataFrame | None, trajectory: str) -> dict[str, tuple[float, float, float]]:
    """The strongest current of a sweep, and how each method did in it.

    Returns:
        By method the current (m/s), the velocity error (m/s, RMS over runs at the end) and the mean NEES; empty where
        the campaign has no sweep of the current.
    """
    if sweep is None:
        return {}
    rows = sweep.filter((pl.col("parameter") == CURRENT) & (pl.col("trajectory") == trajectory))
    speeds = [float(value) for value in rows["value"]]
    strongest = max(speeds, default=0.0)
    return {
        row["method"]: (speed, row["velocity_rms_over_runs_mps"], row["nees_mean_over_runs_and_time"])
        for speed, row in zip(speeds, rows.iter_rows(named=True), strict=True)
        if speed == strongest > 0.0
    }


def choose(advice: list[Advice]) -> Choice | None:
    """The methods that are recommended on every trajectory and nowhere far from the best; None where there is none."""
    common = [m for m in advice[0].velocity_rms_mps if all(m in part.recommended for part in advice)]
    if not common:
        return None
    ratios = {
        method: [
            part.velocity_rms_mps[method] / part.velocity_rms_mps[part.recommended[0]] for part in advice
        ]
        for method in common
    }
    least = min(max(of_method) for of_method in ratios.values())
    best = tuple(method for method in common if max(ratios[method]) <= CLOSE * least)
    worst_ratio = max(ratios[best[0]])
    return Choice(tuple(common), best, worst_ratio, advice[ratios[best[0]].index(worst_ratio)].trajectory)
