"""Limits of what an audit calls a finding, and its findings as a table."""

from collections.abc import Iterable

import numpy as np
import polars as pl

from bottomlock.recordings.finding import Finding
from bottomlock.tables.audit import FINDINGS

SIGNIFICANCE = 1e-5
"""False-alarm probability of each test. An audit makes fewer than 50: 1 clean log in 2000 gets a false finding."""

SIGMAS = 5.0
MATERIAL_RAD, MATERIAL_SCALE, MATERIAL_MPS = np.deg2rad(0.5), 0.005, 0.002
"""Smaller errors are not reported, however significant: 0.5° of tilt is 2 % of surge at 25°; 0.5 % of scale; 2 mm/s."""


def findings_table(findings: list[Finding]) -> pl.DataFrame:
    """A row per finding, in the order given."""
    rows = [
        (
            rank, one.kind, one.severity, list(one.beams), one.size, one.unit, one.weight,
            one.text, one.evidence, one.hint, one.place, one.expected,
        )
        for rank, one in enumerate(findings, start=1)
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=dict(FINDINGS), orient="row")


def beam_words(beams: Iterable[int]) -> str:
    """Names of beams by their number from 0.

    >>> beam_words([0, 2])
    'beams 1 and 3'
    """
    names = [str(beam + 1) for beam in beams]
    if len(names) == 1:
        return f"beam {names[0]}"
    return f"beams {', '.join(names[:-1])} and {names[-1]}"
