"""What the ports share: order of the estimates, the rate, and the sequence of checks before a message."""

import math
from dataclasses import dataclass
from typing import ClassVar

from bottomlock.errors import DataError, ScenarioError
from bottomlock.ports.estimate import SILENT, Estimate
from bottomlock.support.nearest import did_you_mean
from bottomlock.units import ns_from_s


@dataclass(kw_only=True, eq=False)
class Port:
    """One kind of message to one receiver, at most `max_rate_hz` a second; None for one an estimate.

    A port that sends increments or a limited rate keeps state: make one for each receiver.

    Attributes:
        max_rate_hz: most messages a second; None for one an estimate.
        name: in the registry.
        ros_type: type of a message of ROS 2; "" of another.
        reason: why `encode` gave nothing the last time; None if it gave bytes.
        waits: whether that was only because a message was sent just before: the port is not silent.
    """

    name: ClassVar[str]
    ros_type: ClassVar[str] = ""

    max_rate_hz: float | None = None

    def __post_init__(self) -> None:
        rate = self._positive_or_none("max_rate_hz", self.max_rate_hz)
        self._period_ns = 0 if rate is None else ns_from_s(1.0 / rate)
        self._last_ns: int | None = None
        self._sent_ns: int | None = None
        self.reason: str | None = None
        self.waits = False

    def sends(self, estimate: Estimate) -> str | None:
        """Why nothing would be sent for this estimate now, in one line; None if `encode` would give bytes."""
        return self._refusal(estimate) or self._waits(estimate)

    def encode(self, estimate: Estimate) -> bytes | None:
        """The bytes of the message; None if nothing is sent, for the reason that `reason` then has.

        Estimates are given in order of time, each once.

        Raises:
            DataError: for an estimate that is not later than the one before.
        """
        if self._last_ns is not None and estimate.time_ns <= self._last_ns:
            raise DataError(
                f"is {estimate.time_ns}",
                place=f"port {self.name}",
                key="time_ns",
                expected=f"later than the estimate before, {self._last_ns}",
            )
        self._last_ns = estimate.time_ns
        refusal = self._refusal(estimate)
        self.reason = refusal or self._waits(estimate)
        self.waits = refusal is None and self.reason is not None
        data = None if self.reason else self._message(estimate)
        self._observe(estimate, sent=data is not None)
        if data is not None:
            self._sent_ns = estimate.time_ns
        return data

    def _refusal(self, estimate: Estimate) -> str | None:
        """Why the estimate cannot be sent, whatever was sent before."""
        if estimate.state in SILENT:
            return f"state is {estimate.state}"
        return self._refuses(estimate)

    def _waits(self, estimate: Estimate) -> str | None:
        """Why it is not sent now, because of what was sent before."""
        if self._sent_ns is not None and estimate.time_ns - self._sent_ns < self._period_ns:
            return f"at most one message in {self._period_ns / 1e9:.3f} s"
        return None

    def _refuses(self, estimate: Estimate) -> str | None:
        """Why this port's message cannot hold the estimate."""
        raise NotImplementedError

    def _message(self, estimate: Estimate) -> bytes:
        """The bytes of an estimate that is not refused."""
        raise NotImplementedError

    def _observe(self, estimate: Estimate, *, sent: bool) -> None:
        """Takes notice of an estimate once it has been encoded or not."""

    def _positive(self, key: str, value: object) -> float:
        """A setting that is a positive number.

        Raises:
            ScenarioError: naming port, key and value.
        """
        number = self._finite(key, value)
        if number <= 0.0:
            raise ScenarioError(f"{key} is {value}", place=f"port {self.name}", expected="> 0")
        return number

    def _positive_or_none(self, key: str, value: float | None) -> float | None:
        """A setting that is a positive number where it is given, as `_positive`."""
        return None if value is None else self._positive(key, value)

    def _finite(self, key: str, value: object) -> float:
        """A setting that is a number.

        Raises:
            ScenarioError: naming port, key and value.
        """
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ScenarioError(f"{key} is {value!r}", place=f"port {self.name}", expected="a finite number")
        return float(value)

    def _word(self, key: str, value: object) -> str:
        """A setting that is the name of a frame.

        Raises:
            ScenarioError: naming port, key and value.
        """
        if not isinstance(value, str) or not value or "\x00" in value:
            raise ScenarioError(
                f"{key} is {value!r}", place=f"port {self.name}", expected="the name of a frame"
            )
        return value

    def _whole(self, key: str, value: object, least: int, most: int) -> int:
        """A setting that is an integer in a range.

        Raises:
            ScenarioError: naming port, key and value.
        """
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise ScenarioError(
                f"{key} is {value!r}",
                place=f"port {self.name}",
                expected=f"an integer from {least} to {most}",
            )
        return value

    def _one_of(self, key: str, value: str, known: tuple[str, ...]) -> str:
        """A setting that is one of several words.

        Raises:
            ScenarioError: naming port, key and value.
        """
        if value not in known:
            hint = did_you_mean(str(value), known) or ","
            raise ScenarioError(
                f"{key} is {value!r}{hint} expected one of {', '.join(known)}", place=f"port {self.name}"
            )
        return value


def incomplete(estimate: Estimate) -> str | None:
    """Why a receiver that needs three components gets nothing: below rank 3, and no inertial estimate fills it."""
    if estimate.complete:
        return None
    return f"the beams determine {estimate.rank} of 3 axes, and no inertial estimate fills the rest"
