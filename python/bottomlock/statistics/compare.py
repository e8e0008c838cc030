"""Campaigns side by side: each quantity with its interval, and its difference to a reference, paired if possible."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.files.campaign_tables import CampaignResults
from bottomlock.files.columns import COMPARISON
from bottomlock.statistics.rms import INTERVAL_PERCENT, bootstrap_weights, combined_rms

Array = NDArray[np.float64]

QUANTITIES: Mapping[str, tuple[str, str, bool]] = {
    "velocity at the end": ("velocity_final_mps", "m/s", True),
    "velocity over time": ("velocity_rms_over_time_mps", "m/s", True),
    "attitude at the end": ("attitude_final_deg", "deg", True),
    "position at the end": ("position_final_m", "m", True),
    "NEES": ("nees_mean_over_time", "1", False),
}
"""Column of `files.columns.RUNS` of each quantity, its unit, and whether it is RMS over runs or a mean."""

SAME_TRUTH = ("trajectory", "mission", "environment", "seabed")
"""Sections of a scenario that decide the true motion and the bottom."""

INDEPENDENT_KEY = 1
"""Key of the resamples of a campaign that is not paired with the reference."""


def comparison_table(campaigns: Mapping[str, CampaignResults], reference: str) -> pl.DataFrame:
    """A row per campaign, trajectory, method and quantity (`files.columns.COMPARISON`)."""
    rows: list[tuple[Any, ...]] = []
    base = campaigns[reference]
    for label, campaign in campaigns.items():
        for trajectory in campaign.trajectories:
            paired = label != reference and not why_unpaired(base, campaign, trajectory)
            for method in campaign.methods(trajectory):
                ours = _runs(campaign, trajectory, method)
                theirs = None if label == reference else _runs(base, trajectory, method)
                for name, (column, unit, is_rms) in QUANTITIES.items():
                    if ours[column].null_count():
                        # Dead reckoning has no NEES.
                        continue
                    value = estimate_of(ours[column].to_numpy(), is_rms=is_rms)
                    head = (label, trajectory, method, name, unit, ours.height, *value, reference)
                    if theirs is None or not theirs.height:
                        rows.append((*head, None, None, None, None))
                        continue
                    pair = (ours[column].to_numpy(), theirs[column].to_numpy())
                    rows.append((*head, paired, *difference_of(*pair, is_rms=is_rms, paired=paired)))
    return pl.DataFrame(rows, schema=dict(COMPARISON), orient="row")


def estimate_of(values: Array, *, is_rms: bool) -> tuple[float, float, float]:
    """RMS or mean over runs (n,), with its 95 % bootstrap interval.

    >>> estimate_of(np.ones(4), is_rms=True)
    (1.0, 1.0, 1.0)
    """
    drawn = _over_runs(values, bootstrap_weights(len(values)), is_rms=is_rms)
    low, high = np.percentile(drawn, INTERVAL_PERCENT)
    return float(_over_runs(values, None, is_rms=is_rms)), float(low), float(high)


def difference_of(ours: Array, theirs: Array, *, is_rms: bool, paired: bool) -> tuple[float, float, float]:
    """Difference of two RMS or means over runs with its 95 % bootstrap interval.

    Paired, run k of one is resampled with run k of the other, of the runs that both have; else each by itself.
    """
    if paired:
        ours, theirs = (values[: min(len(ours), len(theirs))] for values in (ours, theirs))
    weights = bootstrap_weights(len(ours))
    others = weights if paired else bootstrap_weights(len(theirs), INDEPENDENT_KEY)
    middle = _over_runs(ours, None, is_rms=is_rms) - _over_runs(theirs, None, is_rms=is_rms)
    drawn = _over_runs(ours, weights, is_rms=is_rms) - _over_runs(theirs, others, is_rms=is_rms)
    low, high = np.percentile(drawn, INTERVAL_PERCENT)
    return float(middle), float(low), float(high)


def _over_runs(values: Array, weights: Array | None, *, is_rms: bool) -> Array:
    if is_rms:
        return combined_rms(values**2, weights)
    return np.asarray(np.mean(values) if weights is None else weights @ values)


def _runs(campaign: CampaignResults, trajectory: str, method: str) -> pl.DataFrame:
    return campaign.runs.filter((pl.col("trajectory") == trajectory) & (pl.col("method") == method)).sort(
        "run"
    )


def why_unpaired(one: CampaignResults, other: CampaignResults, trajectory: str) -> str:
    """Why run k of one campaign is not paired with run k of the other on a trajectory; "" where it is."""
    if trajectory not in one.trajectories or trajectory not in other.trajectories:
        return "only one of them has this trajectory"
    seeds = [campaign.manifest["scenarios"][trajectory]["seed"] for campaign in (one, other)]
    if seeds[0] != seeds[1]:
        return f"the seeds are {seeds[0]} and {seeds[1]}"
    settings = [campaign.configuration(trajectory) for campaign in (one, other)]
    for section in SAME_TRUTH:
        if settings[0].get(section) != settings[1].get(section):
            return f"[{section}] differs"
    if settings[0]["trajectory"].get("feedback") == "estimate":
        return "each flies its own trajectory, steered by the estimate"
    paths = [_path(campaign, trajectory) for campaign in (one, other)]
    if paths[0] is not None and paths[1] is not None and not paths[0].equals(paths[1]):
        return "the true trajectories differ"
    return ""


def _path(campaign: CampaignResults, trajectory: str) -> pl.DataFrame | None:
    return None if campaign.paths is None else campaign.paths.filter(pl.col("trajectory") == trajectory)


def differing_settings(campaigns: Mapping[str, CampaignResults]) -> list[tuple[str, list[str]]]:
    """Every setting that is not the same in all campaigns, with its value in each; of their first trajectories."""
    flat = [flat_settings(one.configuration(one.trajectories[0])) for one in campaigns.values()]
    keys = dict.fromkeys(key for settings in flat for key in settings if key not in {"name", "description"})
    rows = [(key, [settings.get(key, "–") for settings in flat]) for key in keys]
    return [(key, values) for key, values in rows if len(set(values)) > 1]


def flat_settings(table: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Settings by their dotted names, as a configuration file writes their values."""
    flat: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat |= flat_settings(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = json.dumps(value, ensure_ascii=False).strip('"')
    return flat
