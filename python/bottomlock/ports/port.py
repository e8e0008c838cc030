"""What the ports share: order of the estimates, the rate, and the sequence of checks before a message."""

from collections.abc import Callable
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from bottomlock.errors import DataError, ScenarioError
from bottomlock.ports.estimate import SILENT, Estimate
from bottomlock.units import ns_from_s


def _frame(name: str) -> str:
    if not name or "\x00" in name:
        raise ValueError(f"'{name}' is no name of a frame")
    return name


FrameName = Annotated[str, AfterValidator(_frame)]
"""Name of axes in a message of ROS 2."""


RateHz = Annotated[float, Field(ge=1e-3, allow_inf_nan=False)]
"""Of messages: one in a thousand seconds at least."""
Answers = Callable[[bytes], bytes]
"""What to send back on bytes of a client."""


class Port(BaseModel):
    """One kind of message to one receiver, at most `max_rate_hz` a second; None for one an estimate.

    A port that sends increments or a limited rate keeps state: make one for each receiver.

    Attributes:
        name: in the registry.
        ros_type: type of a message of ROS 2; "" of another.
    """

    model_config = ConfigDict(
        extra="forbid", strict=True, use_attribute_docstrings=True, arbitrary_types_allowed=True
    )
    name: ClassVar[str]
    ros_type: ClassVar[str] = ""

    max_rate_hz: RateHz | None = None
    """most messages a second; None for one an estimate"""

    def model_post_init(self, _context: Any, /) -> None:  # noqa: ANN401 - pydantic's
        """Begins with nothing sent."""
        self._period_ns = 0 if self.max_rate_hz is None else ns_from_s(1.0 / self.max_rate_hz)
        self._last_ns: int | None = None
        self._sent_ns: int | None = None
        self._reason: str | None = None
        self._waited = False

    @property
    def reason(self) -> str | None:
        """Why `encode` gave nothing the last time; None if it gave bytes."""
        return self._reason

    @property
    def waits(self) -> bool:
        """Whether that was only because a message was sent just before: the port is not silent."""
        return self._waited

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
        self._reason = refusal or self._waits(estimate)
        self._waited = refusal is None and self._reason is not None
        data = None if self._reason else self._message(estimate)
        self._observe(estimate, sent=data is not None)
        if data is not None:
            self._sent_ns = estimate.time_ns
        return data

    def answers(self) -> Answers | None:
        """What answers a client that asks something of an instrument in whose place the port is; None for nothing."""
        return None

    def wrong(self, key: str, expected: str, given: str = "") -> ScenarioError:
        """The error of a setting whose value does not go with the others."""
        what = f"is {getattr(self, key)!r}{given}"
        return ScenarioError(what, place=f"port {self.name}", key=key, expected=expected)

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


def incomplete(estimate: Estimate) -> str | None:
    """Why a receiver that needs three components gets nothing: below rank 3, and no inertial estimate fills it."""
    if estimate.complete:
        return None
    return f"the beams determine {estimate.rank} of 3 axes, and no inertial estimate fills the rest"
