"""The clock of an instrument mapped to that of the host.

A report that was sent at the instrument's time s arrives at the host's time a after an unknown delay, which is never
negative. With o the offset of the clocks, a - s = o + delay, so a - s is an upper bound of o, and the least of these
bounds is the best: the lower envelope. The clocks may drift by `DRIFT` at most: so much does a bound rise with its age.

A report far above the envelope was delayed, or the instrument's clock was set back; one far below has a wrong stamp, or
the clock was set forward. A clock set back is known only after some reports in a row, one set forward after two that
agree; until then their times are unsure, and they are not used.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

DRIFT = 50e-6
"""Largest drift of an instrument's clock against the host's: a crystal without temperature control."""

CONFIRM_REPORTS, CONFIRM_NS = 5, 1_000_000_000
"""Reports in a row above the envelope, and the time they span, from which on the clock was set back."""

Verdict = Literal["good", "late", "stepped"]


@dataclass
class ClockMap:
    """Lower envelope of arrival minus transmission.

    Args:
        step_ns: distance from the envelope beyond which a report is late, or the clock has stepped.

    Attributes:
        steps: how often the instrument's clock was set.
        last_step_ns: by how much the last time, positive forward.
        late: reports whose time was not used.
    """

    step_ns: int
    steps: int = 0
    last_step_ns: int = 0
    late: int = 0
    _offset_ns: int | None = None
    _at_ns: int = 0
    _reports: int = 0
    _above: list[tuple[int, int]] = field(default_factory=list)
    _below: int | None = None
    """Bound of the report before, if it was far below the envelope."""

    def observe(self, transmission_ns: int, arrival_ns: int, *, waited: bool = False) -> Verdict:
        """Takes a report: when it was sent (instrument) and when it came (host; never falling).

        `waited`: it may have waited for this process, so that a delay says nothing of the instrument's clock.

        Returns:
            "late" for a report whose time of validity must not be used, "stepped" for the first after a step.
        """
        bound = arrival_ns - transmission_ns
        self._reports += 1
        if self._offset_ns is None:
            self._set(bound, arrival_ns)
            return "good"
        # Rounded up: bounds that are rounded down would add up to a time that is early.
        envelope = self._offset_ns + math.ceil(DRIFT * (arrival_ns - self._at_ns))
        if bound - envelope > self.step_ns and waited:
            return "good"
        # The first reports may all have been delayed: what follows them is then no step.
        stepped = envelope - bound > self.step_ns and self._reports > CONFIRM_REPORTS
        before, self._below = self._below, bound if stepped else None
        if stepped and (before is None or abs(bound - before) > self.step_ns):
            self.late += 1
            return "late"
        if bound - envelope > self.step_ns:
            return self._far_above(bound, arrival_ns, envelope)
        self._above.clear()
        if stepped:
            self._below = None
            self._step(envelope - bound)
        self._set(min(bound, envelope), arrival_ns)
        return "stepped" if stepped else "good"

    def host_ns(self, instrument_ns: int) -> int:
        """A time of the instrument on the host's clock, after the first report.

        Raises:
            ValueError: before it.
        """
        if self._offset_ns is None:
            raise ValueError("no report has come yet, expected one before a time is mapped")
        return instrument_ns + self._offset_ns

    def _far_above(self, bound: int, arrival_ns: int, envelope: int) -> Verdict:
        self._above.append((bound, arrival_ns))
        del self._above[:-1000]
        if len(self._above) < CONFIRM_REPORTS or arrival_ns - self._above[0][1] < CONFIRM_NS:
            self.late += 1
            return "late"
        least = min(one for one, _ in self._above)
        self._step(envelope - least)
        self._above.clear()
        self._reports = 0
        self._set(least, arrival_ns)
        # The report itself may be delayed against the new envelope.
        if bound - least > self.step_ns:
            self.late += 1
            return "late"
        return "stepped"

    def _set(self, offset_ns: int, at_ns: int) -> None:
        self._offset_ns, self._at_ns = offset_ns, at_ns

    def _step(self, by_ns: int) -> None:
        self.steps += 1
        self.last_step_ns = by_ns
