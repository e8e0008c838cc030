"""The paper's claims judged on campaigns made of whole cloth."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.files.campaign_tables import read_campaign_tables
from bottomlock.statistics.claim_verdicts import claims_table
from bottomlock.statistics.claims import load_paper
from bottomlock.statistics.rms import Array
from bottomlock.statistics.run_errors import read_run_errors
from tests.report.synthetic_campaign import Size, quiet

PAPER = load_paper()


def judged(folder: Path, *claims: str) -> pl.DataFrame:
    """The table of these claims; without any, of all."""
    campaign = read_campaign_tables(folder)
    errors = {name: read_run_errors(campaign, name) for name in campaign.trajectories}
    wanted = [claim for claim in PAPER.claim if not claims or claim.id in claims]
    return claims_table(campaign, errors, PAPER.model_copy(update={"claim": wanted}))


def one(folder: Path, claim: str) -> dict[str, Any]:
    """The row of a claim."""
    return judged(folder, claim).row(0, named=True)


def sized(velocity: dict[tuple[str, str], Any], attitude: dict[tuple[str, str], Any] | None = None) -> Size:
    """The quiet campaign with some methods of some trajectories changed."""

    def size(trajectory: str, method: str, time_s: Array) -> tuple[Any, Any]:
        plain_velocity, plain_attitude = quiet(trajectory, method, time_s)
        here = velocity.get((trajectory, method), plain_velocity)
        there = (attitude or {}).get((trajectory, method), plain_attitude)
        return here(time_s) if callable(here) else here, there(time_s) if callable(there) else there

    return size


def in_dive(time_s: Array) -> Array:
    """Rising for 30 s, then level, m/s."""
    return np.asarray(0.1 + 0.4 * np.minimum(time_s, 30.0) / 30.0)
