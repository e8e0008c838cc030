"""What every port has, and how much of an estimate it loses."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bottomlock.ports.estimate import Estimate

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Loss:
    """What a port could not say of an estimate.

    Attributes:
        sd_ratio: (3,) σ that the receiver uses over σ of the estimate, per platform axis, 1 for no loss; NaN for a
            component that is not sent, infinity for one that is sent although the beams do not determine it.
        information_nat: half the logarithm of det(sent covariance) over det(covariance of the same components): the
            information that is lost about them, in nats; 0 for none, infinity if the covariance is singular.
        axes_lost: observable axes of the estimate that the message leaves out.
        reason: why nothing is sent; None if something is.
    """

    sd_ratio: Floats
    information_nat: float
    axes_lost: int
    reason: str | None = None


class Port(Protocol):
    """One kind of message to one receiver.

    A port that sends increments or a limited rate keeps state: make one for each receiver.
    """

    @property
    def name(self) -> str:
        """The name in the registry."""
        ...

    @property
    def ros_type(self) -> str:
        """Type of a message of ROS 2; "" of another."""
        ...

    @property
    def reason(self) -> str | None:
        """Why `encode` gave nothing the last time; None if it gave bytes."""
        ...

    @property
    def waits(self) -> bool:
        """Whether `encode` gave nothing only because a message was sent just before: the port is not silent."""
        ...

    def sends(self, estimate: Estimate) -> str | None:
        """Why nothing would be sent for this estimate now, in one line; None if `encode` would give bytes."""
        ...

    def encode(self, estimate: Estimate) -> bytes | None:
        """The bytes of the message; None if nothing is sent, for the reason that `reason` then has.

        Estimates are given in order of time, each once.

        Raises:
            DataError: for an estimate that is not later than the one before.
        """
        ...

    def loss(self, estimate: Estimate) -> Loss:
        """What the message cannot say of the estimate."""
        ...


def loss_of(estimate: Estimate, sent_m2ps2: Floats | None, reason: str | None = None) -> Loss:
    """Loss of a port whose receiver uses the covariance `sent_m2ps2` (3, 3), platform axes.

    NaN marks components that are not sent; None is for a message that is not sent at all.
    """
    # In mode navigation every axis is estimated, whatever the beams determine.
    known = 3 if estimate.mode == "navigation" else estimate.rank
    if sent_m2ps2 is None:
        return Loss(sd_ratio=np.full(3, np.nan), information_nat=math.nan, axes_lost=known, reason=reason)
    there = estimate.components
    sent = np.isfinite(np.diag(sent_m2ps2))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(np.diag(sent_m2ps2) / np.diag(estimate.covariance_m2ps2))
    ratio = np.where(sent & ~there, np.inf, ratio)
    both = np.ix_(sent & there, sent & there)
    lost = 0.5 * (_log_det(sent_m2ps2[both]) - _log_det(estimate.covariance_m2ps2[both]))
    full = bool((sent & ~there).any())
    return Loss(
        sd_ratio=ratio,
        information_nat=lost,
        axes_lost=0 if full else max(known - int((sent & there).sum()), 0),
        reason=reason,
    )


def _log_det(matrix: Floats) -> float:
    sign, value = np.linalg.slogdet(matrix) if matrix.size else (1.0, 0.0)
    return float(value) if sign > 0.0 else -math.inf
