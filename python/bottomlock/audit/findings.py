"""What an audit says: one finding a fault, with its numbers and what to do about it."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np
import polars as pl

from bottomlock.tables.audit import FINDINGS

Weight = Literal["fault", "warning", "note"]
WEIGHTS: tuple[Weight, ...] = ("fault", "warning", "note")

SIGNIFICANCE = 1e-5
"""Every test's chance to cry wolf in a clean log. An audit makes fewer than 50: 1 in 2000 clean logs is accused."""

SIGMAS = 5.0
MATERIAL_RAD, MATERIAL_SCALE, MATERIAL_MPS = np.deg2rad(0.5), 0.005, 0.002
"""What is smaller is left unsaid, however sure: 0.5° of tilt is 2 % of surge at 25°; 0.5 % of scale; 2 mm/s of bias."""


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Attributes:
        kind: stable name for programs.
        weight: "fault" (velocities are wrong), "warning" (they are worse than they look), "note" (worth knowing).
        size: how much, in `unit`; findings of one weight are ranked by `part`.
        part: share of the log or of the velocity that it touches, 0 to 1.
        words: what was found, in one sentence.
        evidence: the numbers it rests on.
        advice: what to do.
        beams: numbers of the beams concerned, from 1.
    """

    kind: str
    weight: Weight
    size: float
    unit: str
    part: float
    words: str
    evidence: str
    advice: str
    beams: tuple[int, ...] = ()


def ranked(findings: Iterable[Finding]) -> list[Finding]:
    """Faults first, then warnings, then notes; within each by the part that they touch."""
    return sorted(findings, key=lambda one: (WEIGHTS.index(one.weight), -one.part, one.kind, one.beams))


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
