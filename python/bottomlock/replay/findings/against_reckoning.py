"""Whether a method stays as near to dead reckoning as both claim, and which of them the reference prefers.

Under the hypothesis that both claims are right, the difference of two positions along an axis has at most the variance
σ² + σ_d² where their errors are not opposed; errors of the DVL, which both have, make it smaller. It is looked at in
`TIMES` places and two axes, each at the probability that keeps all of them with 1 − `FALSE_ALARM` (Bonferroni, for any
dependence): a right pair is reported once in 10,000 dives at most. The threshold is 4.7 σ.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.streams import Floats
from bottomlock.replay.findings.limits import AXES, LIMIT, LOST, TIMES, VAGUE, WORSE
from bottomlock.tables.replay import FORWARD

TRUSTED = ("tc", "info", "lc", "sway_current", "weak_sway")
"""Methods that claim to be consistent; `ins` has no aid and the others are the paper's."""


@dataclass(frozen=True)
class Agreement:
    """A method against dead reckoning, in the horizontal plane.

    Attributes:
        method: the method.
        apart_m: largest distance at the times that are looked at.
        sigmas: largest difference over the combined σ of both.
        own_sigmas: the same over the σ of dead reckoning alone.
        sd_m, reckoned_sd_m: claimed σ at the end, root of the sum over both axes.
        rms_m, reckoned_rms_m: RMS against the reference; None without one.
        reference_sd_m: 1 sigma of the reference, root of the sum over both axes.
    """

    method: str
    apart_m: float
    sigmas: float
    own_sigmas: float
    sd_m: float
    reckoned_sd_m: float
    rms_m: float | None
    reckoned_rms_m: float | None
    reference_sd_m: float = 0.0

    @property
    def leaves(self) -> bool:
        """Whether the method is further off than both claim."""
        return self.sigmas > LIMIT

    @property
    def lost(self) -> bool:
        """Whether it is further off than dead reckoning claims, and says itself that it does not know where it is."""
        return not self.leaves and self.own_sigmas > LIMIT and self.sd_m > LOST * self.reckoned_sd_m

    @property
    def beaten(self) -> bool:
        """Whether the reference prefers dead reckoning."""
        if self.rms_m is None or self.reckoned_rms_m is None:
            return False
        return self.rms_m > WORSE * self.reckoned_rms_m

    @property
    def worse(self) -> bool:
        """Whether it is worse by more than the claims of both and the reference's noise explain."""
        if not self.beaten or self.rms_m is None or self.reckoned_rms_m is None:
            return False
        explained_m = math.hypot(self.sd_m, self.reckoned_sd_m, self.reference_sd_m)
        return math.sqrt(self.rms_m**2 - self.reckoned_rms_m**2) > explained_m

    @property
    def vague(self) -> bool:
        """Whether its claim is so much larger than that of dead reckoning that it is of no use."""
        return self.sd_m > VAGUE * self.reckoned_sd_m

    def words(self) -> str:
        """The comparison in one sentence."""
        alone = f" and {self.own_sigmas:.0f} times what dead reckoning claims" if self.lost else ""
        text = (
            f"{self.method} is at most {metres(self.apart_m)} from dead reckoning: {self.sigmas:.1f} times what both "
            f"claim{alone}, of {LIMIT:.1f} that chance explains."
        )
        if self.rms_m is not None and self.reckoned_rms_m is not None:
            text += (
                f" Position RMS against the reference, horizontally: {self.method} {metres(self.rms_m)}, dead "
                f"reckoning {metres(self.reckoned_rms_m)}."
            )
        return text


def metres(value: float) -> str:
    """A distance with its unit.

    >>> metres(0.1234), metres(1412345.0)
    ('0.123 m', '1,412,345 m')
    """
    return f"{value:.3g} m" if value < 1000.0 else f"{value:,.0f} m"


def agreements(samples: pl.DataFrame, methods: Sequence[str], reference_sd_m: float = 0.0) -> list[Agreement]:
    """Every trusted method against dead reckoning; none where it was not possible.

    Args:
        samples: `tables.replay.REPLAY_SAMPLES` of the recording.
        methods: of the tables.
        reference_sd_m: 1 sigma of the reference along an axis.
    """
    forward = samples.filter(pl.col("pass") == FORWARD)
    reckoned = forward.filter(pl.col("method") == METHOD)
    if reckoned.height < 2:
        return []
    rows = np.unique(np.linspace(0, reckoned.height - 1, TIMES + 1).round().astype(int))[1:]
    place, sd, error = _columns(reckoned)
    found = []
    for method in (one for one in TRUSTED if one in methods):
        own_place, own_sd, own_error = _columns(forward.filter(pl.col("method") == method))
        difference = (own_place - place)[rows]
        found.append(
            Agreement(
                method=method,
                apart_m=float(np.linalg.norm(difference, axis=1).max()),
                sigmas=float((np.abs(difference) / np.hypot(own_sd, sd)[rows]).max()),
                own_sigmas=float((np.abs(difference) / sd[rows]).max()),
                sd_m=float(np.linalg.norm(own_sd[-1])),
                reckoned_sd_m=float(np.linalg.norm(sd[-1])),
                rms_m=_rms(own_error),
                reckoned_rms_m=_rms(error),
                reference_sd_m=float(np.sqrt(len(AXES)) * reference_sd_m),
            )
        )
    return found


def _columns(rows: pl.DataFrame) -> tuple[Floats, Floats, Floats]:
    """Position, σ and error of the horizontal axes, (T, 2) each; NaN for an error that is not known."""
    return (
        rows.select(f"{axis}_m" for axis in AXES).to_numpy(),
        np.maximum(rows.select(f"sd_position_{axis}_m" for axis in AXES).to_numpy(), 1e-3),
        rows.select(pl.col(f"err_position_{axis}_m").fill_null(np.nan) for axis in AXES).to_numpy(),
    )


def _rms(error: Floats) -> float | None:
    known = np.isfinite(error).all(axis=1)
    return float(np.sqrt((error[known] ** 2).sum(axis=1).mean())) if known.any() else None
