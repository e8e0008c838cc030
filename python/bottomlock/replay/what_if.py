"""Section of a case file: what-if beam losses."""

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from bottomlock.config.scenario_sections import Outage
from bottomlock.config.section import Section, shown

Beam = Annotated[int, Field(ge=1, le=8)]


class WhatIf(Section):
    """A what-if case: the beams that are taken to be lost, throughout or in outages.

    Times are seconds from the start of the navigation.
    """

    name: Annotated[
        str,
        Field(pattern=r"^[A-Za-z0-9_\-]+$"),
        shown(range='letters, digits, _ and -; not "recorded"', example="lost_34"),
    ]
    """name of the what-if case in tables"""
    beams_lost: Annotated[tuple[Beam, ...], shown(unit="1", example=[3, 4])] = ()
    """beams lost throughout, numbered from 1"""
    outages: tuple[Outage, ...] = ()

    @model_validator(mode="after")
    def _loses_a_beam(self) -> Self:
        if self.name == "recorded":
            raise ValueError("the name 'recorded' is reserved for the recording without beam losses")
        if not (self.beams_lost or self.outages):
            raise ValueError(f"what_if '{self.name}' loses no beam, expected beams_lost or outages")
        return self

    @property
    def beams_named(self) -> tuple[int, ...]:
        """Every beam that a rule names, from 1."""
        return tuple(beam for beams in (self.beams_lost, *(o.beams for o in self.outages)) for beam in beams)

    def text(self) -> str:
        """The beam losses in one line, for reports."""
        parts = [f"beams {_join(self.beams_lost)} lost throughout"] if self.beams_lost else []
        for outage in self.outages:
            end = "the end" if math.isinf(outage.to_s) else f"{outage.to_s:g} s"
            parts.append(f"beams {_join(outage.beams)} lost from {outage.from_s:g} s to {end}")
        return "; ".join(parts)


def _join(beams: tuple[int, ...]) -> str:
    return ", ".join(str(beam) for beam in beams)
