"""A finding of a replay."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

Severity = Literal["fault", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Attributes:
        kind: stable name for programs.
        severity: "fault" (the result is wrong), "warning" (it is worse than it looks), "note" (worth knowing).
        score: chi-squared that the cause explains; findings are ranked by it.
        text: the finding in one sentence.
        evidence: the numbers behind it.
        advice: what to do.
        key: of the case, to change; "" for none.
    """

    kind: str
    severity: Severity
    score: float
    text: str
    evidence: str
    advice: str
    key: str = ""

    def to_json(self) -> dict[str, Any]:
        """The finding in the types of JSON."""
        return asdict(self)


def ranked(findings: list[Finding]) -> list[Finding]:
    """Faults first, then warnings, then notes; within each by what they explain."""
    order = {"fault": 0, "warning": 1, "note": 2}
    return sorted(findings, key=lambda one: (order[one.severity], -one.score, one.kind))
