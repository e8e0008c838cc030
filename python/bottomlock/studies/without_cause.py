"""The runs of a trajectory again, without what the paper gives as the cause of a drift.

They have the same sensor errors and last as long as the drift, so they cost a small part of the campaign.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from bottomlock.campaign.run import CampaignProgress, run_campaign
from bottomlock.config.scenario import Scenario
from bottomlock.paper.claims import CauseClaim, load_paper

CHANGES = {"dive": {"dive_rate_mps": 0.0}}
"""Keys of `[mission]` without each cause."""


def variants(scenarios: Sequence[Scenario]) -> dict[str, list[Scenario]]:
    """For each cause in the paper's claims the scenarios without it, with the methods of the claims alone.

    A scenario without a claim on a cause, or without its methods, has no variant.

    >>> from bottomlock.config.scenario import load_scenario
    >>> (one,) = variants([load_scenario("straight"), load_scenario("lawn_mower")])["dive"]
    >>> one.name, one.trajectory.duration_s, one.mission["dive_rate_mps"], one.campaign.methods
    ('lawn_mower', 30.0, 0.0, ('vb', 'plcf'))
    """
    claims = [claim for claim in load_paper().claim if isinstance(claim, CauseClaim)]
    found: dict[str, list[Scenario]] = {}
    for cause, change in CHANGES.items():
        for scenario in scenarios:
            here = [
                claim
                for claim in claims
                if (claim.without, claim.trajectory) == (cause, scenario.name)
                and claim.method in scenario.campaign.methods
            ]
            if here:
                end_s = max(claim.window_s[1] for claim in here)
                short = scenario.with_trajectory(duration_s=end_s)
                short = short.with_overrides(methods=[claim.method for claim in here])
                level = short.model_copy(update={"mission": short.mission | change})
                found.setdefault(cause, []).append(level)
    return found


def run_without_causes(
    scenarios: Sequence[Scenario],
    out: str | Path,
    *,
    threads: int = 0,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> None:
    """Runs the variants, a campaign `without_CAUSE` in `out` for each cause; finished ones are kept.

    Raises:
        As `run_campaign`.
    """
    out = Path(out)
    for cause, changed in variants(scenarios).items():
        run_campaign(
            changed,
            out / f"without_{cause}",
            threads=threads,
            force=force,
            progress=lambda state, cause=cause: progress(  # type: ignore[misc]
                replace(state, trajectory=f"{state.trajectory} without {cause}")
            ),
        )
