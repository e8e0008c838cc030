"""Named grades, packaged with sources: errors of IMUs and attitude references, motion of vehicles in the water."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Literal, Self

from pydantic import BaseModel, ModelWrapValidatorHandler, model_validator

from bottomlock.config.packaged import packaged_text
from bottomlock.config.section import in_si
from bottomlock.config.toml_file import parse_toml
from bottomlock.errors import ScenarioError
from bottomlock.kernel import models
from bottomlock.text import did_you_mean

Kind = Literal["imu", "attitude", "water"]
KINDS: dict[Kind, str] = {
    "imu": "IMUs, 1 sigma per axis",
    "attitude": "attitude and heading references, 1 sigma per axis",
    "water": "motion through the water by vehicle, 1 sigma",
}
_WORDS = ("title", "source", "derived")


@dataclass(frozen=True)
class Grade:
    """A grade of an instrument.

    Attributes:
        name, title: as files name it, and what it is.
        keys: keys of a case or scenario with their values, in the units of their names; 1 sigma, and the full scales of
            an IMU, which a section does not take.
        source: data sheet or paper.
        derived: what the source does not state, and how it was found.
    """

    name: str
    title: str
    keys: Mapping[str, float]
    source: str
    derived: str


@cache
def grades(kind: Kind) -> dict[str, Grade]:
    """The packaged grades of a kind of instrument, the coarsest first.

    >>> list(grades("imu"))
    ['phone', 'autopilot', 'mti', 'tactical', 'fibre_optic', 'ring_laser']
    """
    found = {}
    for name, entry in parse_toml(packaged_text("grades", kind), place=f"{kind}.toml").items():
        numbers = {key: float(value) for key, value in entry.items() if key not in _WORDS}
        found[name] = Grade(name, entry["title"], numbers, entry["source"], entry["derived"])
    return found


def grade_of(kind: Kind, name: str) -> Grade:
    """A packaged grade.

    Raises:
        ScenarioError: for an unknown name.
    """
    known = grades(kind)
    if name not in known:
        what = "vehicle" if kind == "water" else "grade"
        raise ScenarioError(
            f"{what} is '{name}'{did_you_mean(name, known) or ','} expected {one_of(kind)}",
            hint="bottomlock list grades lists them",
        )
    return known[name]


def one_of(kind: Kind) -> str:
    """The packaged grades in words, for the key that names one."""
    return f"one of {', '.join(grades(kind))}"


def imu(name: str) -> models.ImuModel:
    """Errors of an IMU of a packaged grade, SI units, 1 sigma per axis.

    Raises:
        ScenarioError: for an unknown name.

    Examples:
        >>> round(imu("mti").accel_bias_sd_mps2, 4)
        0.0196
    """
    return in_si(grade_of("imu", name).keys, models.ImuModel)


def vehicle_water(name: str) -> models.Water:
    """Prior of the motion through the water of a kind of vehicle, a packaged one of `bottomlock list grades`.

    Raises:
        ScenarioError: for an unknown name.

    Examples:
        >>> vehicle_water("hovering").slip_sd_mps
        0.3
    """
    return models.Water(**grade_of("water", name).keys)


class Graded(BaseModel):
    """A section with a key that gives the keys left out, of a packaged grade."""

    of_grade: ClassVar[tuple[Kind, str]]
    """The kind of grade, and the key that names it."""

    @model_validator(mode="wrap")
    @classmethod
    def _of_grade(cls, content: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:  # noqa: ANN401
        """Only what was written counts as set, so that another grade can take its place (`Scenario.replace`)."""
        kind, key = cls.of_grade
        if not isinstance(content, dict) or content.get(key) is None:
            return handler(content)
        try:
            own = grade_of(kind, str(content[key])).keys
        except ScenarioError as error:
            raise ValueError(str(error)) from None
        filled = handler({key: value for key, value in own.items() if key in cls.model_fields} | content)
        object.__setattr__(filled, "__pydantic_fields_set__", set(content) & set(cls.model_fields))
        return filled


def listing(kind: Kind) -> Iterator[str]:
    """Lines that describe every grade of a kind."""
    for one in grades(kind).values():
        yield f"{one.name}: {one.title}"
        values = [f"{key} = {value:g}" for key, value in one.keys.items()]
        for first in range(0, len(values), 2):
            yield "    " + "; ".join(values[first : first + 2])
        yield f"  source: {one.source}"
        yield f"  derived: {one.derived}"
        yield ""
