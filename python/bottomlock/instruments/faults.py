"""Faults of an instrument and its line, drawn from a seed: which ping has which."""

import math
from dataclasses import dataclass, fields

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.text import did_you_mean


@dataclass(frozen=True)
class Faults:
    """Fractions of the pings with a fault, each drawn on its own.

    Attributes:
        drops: the record is never sent.
        duplicates: it is sent twice.
        stale: its beams repeat those of the ping before, under the new times.
        half_lines: it is cut off within, and the next record follows at once.
        clock_steps: the instrument's clock steps, forward or back, and stays there.
        reconnects: after it the instrument closes its connection, and takes a new one.
        clock_step_s: size of a step of the clock, s.
    """

    drops: float = 0.0
    duplicates: float = 0.0
    stale: float = 0.0
    half_lines: float = 0.0
    clock_steps: float = 0.0
    reconnects: float = 0.0
    clock_step_s: float = 1.0


NONE = Faults()
KINDS = tuple(one.name for one in fields(Faults) if one.name != "clock_step_s")
"""Kinds of faults; the place of each is the number of its random stream."""


def parse_faults(text: str | None) -> Faults:
    """Faults from "drops=0.05,stale=0.02"; None and "" for none.

    Raises:
        ScenarioError: for an unknown or repeated key, with the nearest one, and a value out of range.

    >>> parse_faults("drops=0.05, clock_step_s=0.5").drops
    0.05
    """
    known = [one.name for one in fields(Faults)]
    values: dict[str, float] = {}
    for part in (text or "").split(","):
        if not part.strip():
            continue
        key, equals, number = (piece.strip() for piece in part.partition("="))
        if key not in known:
            hint = did_you_mean(key, known)
            raise ScenarioError(
                f"is unknown{hint} (known: {', '.join(known)})", place="--faults", key=f"'{key}'"
            )
        if key in values:
            raise ScenarioError("is given twice", place="--faults", key=f"'{key}'")
        try:
            value = float(number) if equals else math.nan
        except ValueError:
            value = math.nan
        most = 100_000.0 if key == "clock_step_s" else 1.0
        if not 0.0 <= value <= most:
            unit = "seconds" if key == "clock_step_s" else "a fraction of the pings"
            raise ScenarioError(f"{key} is '{number}'", place="--faults", expected=f"{unit}, 0 to {most:g}")
        values[key] = value
    return Faults(**values)


class FaultDraws:
    """Draws of every ping, a stream a kind, so that switching one kind on or off shifts no other."""

    def __init__(self, faults: Faults, seed: int) -> None:
        self._faults = faults
        self._streams = [np.random.default_rng([seed, k]) for k in range(len(KINDS) + 1)]

    def next(self) -> frozenset[str]:
        """The kinds of the next ping."""
        drawn = [stream.random() for stream in self._streams[: len(KINDS)]]
        return frozenset(
            kind for kind, u in zip(KINDS, drawn, strict=True) if u < getattr(self._faults, kind)
        )

    def detail(self) -> float:
        """A number within a fault of the ping, 0 to 1: where a line is cut, which way a clock steps."""
        return float(self._streams[-1].random())
