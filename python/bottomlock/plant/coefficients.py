"""Types of the coefficients in a vehicle file: a value, its unit, and its source.

In the file every coefficient is an inline table `{ value = 20, unit = "deg", source = "..." }`. The types below check
the unit against the one that the model needs, and convert the value to a float in SI.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

_DEGREE = math.pi / 180.0
_RPM = 1.0 / 60.0

OTHER_UNITS: dict[str, dict[str, float]] = {
    "1": {"percent": 0.01},
    "m": {"mm": 1e-3},
    "m2": {"cm2": 1e-4},
    "m3": {"l": 1e-3},
    "rad": {"deg": _DEGREE},
    "rad/s": {"deg/s": _DEGREE},
    "1/rad": {"1/deg": 1.0 / _DEGREE},
    "rev/s": {"rpm": _RPM},
    "rev/s2": {"rpm/s": _RPM},
}
"""What may be written in place of an SI unit, with the factor to it."""


@dataclass(frozen=True)
class Check:
    """The check of a coefficient: its SI unit, and its bounds in that unit."""

    unit: str
    minimum: float | None = None
    exclusive: bool = False
    maximum: float | None = None

    @property
    def units(self) -> dict[str, float]:
        """The units that are read, and their factors to SI."""
        return {self.unit: 1.0} | OTHER_UNITS.get(self.unit, {})

    @property
    def range(self) -> str:
        """The bounds in words, in the first unit."""
        low = "" if self.minimum is None else f"{'>' if self.exclusive else '≥'} {self.minimum:g}"
        high = "" if self.maximum is None else f"≤ {self.maximum:g}"
        return ", ".join(filter(None, (low, high))) or "finite"

    def __call__(self, entry: Any) -> float:  # noqa: ANN401 - whatever the file holds
        """The value in SI.

        Raises:
            ValueError: for an entry that is no table of value, unit and source, or is out of bounds.
        """
        value, unit = _value_and_unit(entry, self)
        si = value * self.units[unit]
        low, high = self.minimum, self.maximum
        if low is not None and (si < low or (self.exclusive and si == low)):
            raise ValueError(f"{value:g} {unit} must be {'above' if self.exclusive else 'at least'} {low:g}")
        if high is not None and si > high:
            raise ValueError(f"{value:g} {unit} is above the limit of {high:g} (SI)")
        return si

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        """How pydantic checks a coefficient."""
        return core_schema.no_info_before_validator_function(self, handler(source))

    def __get_pydantic_json_schema__(self, *_: object) -> dict[str, Any]:
        """How an editor does, and what the key reference says."""
        properties = {
            "value": {"type": "number"},
            "unit": {"enum": [*self.units]},
            "source": {"type": "string"},
        }
        words = {"unit": " or ".join(self.units), "range": self.range}
        return {"type": "object", "properties": properties, "required": [*properties], **words}


def _value_and_unit(entry: object, check: Check) -> tuple[float, str]:
    if not isinstance(entry, dict):
        raise ValueError("expected a table { value, unit, source }")  # noqa: TRY004 - pydantic reports ValueError
    unknown = sorted(set(entry) - {"value", "unit", "source"})
    if unknown:
        raise ValueError(f"unknown key '{unknown[0]}'; expected value, unit, source")
    for key in ("value", "unit", "source"):
        if key not in entry:
            raise ValueError(f"'{key}' is missing")
    value, unit, source = entry["value"], entry["unit"], entry["source"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"value {value!r} is not a finite number")
    if unit not in check.units:
        raise ValueError(f"unit '{unit}' is not one of this coefficient, expected {' or '.join(check.units)}")
    if not isinstance(source, str) or not source.strip():
        raise ValueError("'source' is empty, expected the origin of the value")
    return float(value), unit


def _positive(unit: str, maximum: float | None = None) -> Check:
    return Check(unit, 0.0, exclusive=True, maximum=maximum)


def _not_negative(unit: str, maximum: float | None = None) -> Check:
    return Check(unit, 0.0, maximum=maximum)


Number = Annotated[float, Check("1")]
PositiveNumber = Annotated[float, _positive("1")]
NotNegativeNumber = Annotated[float, _not_negative("1")]
Fraction = Annotated[float, _not_negative("1", maximum=1.0)]
Length = Annotated[float, Check("m")]
PositiveLength = Annotated[float, _positive("m")]
PositiveArea = Annotated[float, _positive("m2")]
PositiveVolume = Annotated[float, _positive("m3")]
Mass = Annotated[float, Check("kg")]
PositiveMass = Annotated[float, _positive("kg")]
AddedMassMoment = Annotated[float, Check("kg m")]
Inertia = Annotated[float, Check("kg m2")]
PositiveInertia = Annotated[float, _positive("kg m2")]
PositiveDensity = Annotated[float, _positive("kg/m3")]
QuadraticDrag = Annotated[float, _not_negative("kg/m")]
RotaryDrag = Annotated[float, _not_negative("kg m2")]
Angle = Annotated[float, Check("rad")]
PositiveAngle = Annotated[float, _positive("rad", maximum=math.pi)]
PositiveAngularRate = Annotated[float, _positive("rad/s")]
PositiveSlope = Annotated[float, _positive("1/rad")]
PositiveShaftSpeed = Annotated[float, _positive("rev/s")]
PositiveShaftAcceleration = Annotated[float, _positive("rev/s2")]
PositiveSpeed = Annotated[float, _positive("m/s")]
PositiveTime = Annotated[float, _positive("s")]
PerTime = Annotated[float, _positive("1/s")]
PerTimeSquared = Annotated[float, _positive("1/s2")]
FinPerRate = Annotated[float, _not_negative("s")]
ShaftPerSpeed = Annotated[float, _positive("rev/m")]
ShaftPerDistance = Annotated[float, _positive("rev/(m s)")]
ShaftPerAcceleration = Annotated[float, _not_negative("rev s/m")]
PositiveForce = Annotated[float, _positive("N")]
PositiveMoment = Annotated[float, _positive("N m")]
LinearDrag = Annotated[float, _not_negative("N s/m")]
LinearRotaryDrag = Annotated[float, _not_negative("N m s/rad")]
ForcePerSpeed = Annotated[float, _positive("N s/m")]
ForcePerDistance = Annotated[float, _positive("N/m")]
MomentPerAngle = Annotated[float, _positive("N m/rad")]
MomentPerAngleSecond = Annotated[float, _positive("N m/(rad s)")]
MomentPerRate = Annotated[float, _positive("N m s/rad")]
