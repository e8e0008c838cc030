"""A finding about a recording: of an audit, or of a replay."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

Severity = Literal["fault", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("fault", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Attributes:
        kind: stable name for programs.
        severity: "fault" (the result is wrong), "warning" (it is worse than it looks), "note" (worth knowing).
        weight: ranks findings of one severity. In an audit the share of the log or of the velocity that is touched,
            0 to 1; in a replay the chi-squared that the cause explains.
        text: the finding in one sentence.
        evidence: the numbers behind it.
        hint: what to do.
        key: of a case, to change; "" for none.
        expected: what a right recording shows in its place; "" where the text says it.
        size: magnitude, in `unit`.
        unit: of `size`.
        beams: numbers of the beams concerned, from 1.
        sd: 1 sigma of `size`; NaN where it has none.
    """

    kind: str
    severity: Severity
    weight: float
    text: str
    evidence: str
    hint: str
    key: str = ""
    size: float = 0.0
    unit: str = ""
    beams: tuple[int, ...] = ()
    expected: str = ""
    sd: float = math.nan

    @property
    def place(self) -> str:
        """The section of the key, or the beams concerned; "" for the whole recording."""
        return self.key.partition(".")[0] or ", ".join(f"beam {beam}" for beam in self.beams)

    def to_json(self) -> dict[str, Any]:
        """As the manifest of a replay holds it."""
        return {
            "kind": self.kind, "severity": self.severity, "score": self.weight, "text": self.text,
            "evidence": self.evidence, "hint": self.hint, "key": self.key,
            "place": self.place, "expected": self.expected,
        }  # fmt: skip


def beam_words(beams: Iterable[int]) -> str:
    """Names of beams by their number from 0.

    >>> beam_words([0, 2])
    'beams 1 and 3'
    """
    names = [str(beam + 1) for beam in beams]
    if len(names) < 2:
        return f"beam {''.join(names)}"
    return f"beams {', '.join(names[:-1])} and {names[-1]}"


def ranked(findings: Iterable[Finding]) -> list[Finding]:
    """Faults first, then warnings, then notes; within each the weightiest first."""
    return sorted(
        findings, key=lambda one: (SEVERITIES.index(one.severity), -one.weight, one.kind, one.beams)
    )
