"""Findings of an audit: one per fault, with its numbers and the recommended action."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np
import polars as pl

from bottomlock.tables.audit import FINDINGS

Severity = Literal["fault", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("fault", "warning", "note")

SIGNIFICANCE = 1e-5
"""False-alarm probability of each test. An audit makes fewer than 50: 1 clean log in 2000 gets a false finding."""

SIGMAS = 5.0
MATERIAL_RAD, MATERIAL_SCALE, MATERIAL_MPS = np.deg2rad(0.5), 0.005, 0.002
"""Smaller errors are not reported, however significant: 0.5° of tilt is 2 % of surge at 25°; 0.5 % of scale; 2 mm/s."""


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Attributes:
        kind: stable name for programs.
        severity: "fault" (velocities are wrong), "warning" (they are worse than they look), "note" (worth knowing).
        size: magnitude, in `unit`; findings of one severity are ranked by `fraction`.
        fraction: share of the log or of the velocity that it touches, 0 to 1.
        text: the finding in one sentence.
        evidence: the numbers behind it.
        advice: recommended action.
        beams: numbers of the beams concerned, from 1.
    """

    kind: str
    severity: Severity
    size: float
    unit: str
    fraction: float
    text: str
    evidence: str
    advice: str
    beams: tuple[int, ...] = ()


def ranked(findings: Iterable[Finding]) -> list[Finding]:
    """Faults first, then warnings, then notes; within each by the fraction affected."""
    return sorted(
        findings, key=lambda one: (SEVERITIES.index(one.severity), -one.fraction, one.kind, one.beams)
    )


def findings_table(findings: list[Finding]) -> pl.DataFrame:
    """A row per finding, in the order given."""
    rows = [{"rank": k + 1, **asdict(one), "beams": list(one.beams)} for k, one in enumerate(findings)]
    return pl.DataFrame(rows, schema=dict(FINDINGS))


def beam_words(beams: Iterable[int]) -> str:
    """Names of beams by their number from 0.

    >>> beam_words([0, 2])
    'beams 1 and 3'
    """
    names = [str(beam + 1) for beam in beams]
    if len(names) == 1:
        return f"beam {names[0]}"
    return f"beams {', '.join(names[:-1])} and {names[-1]}"
