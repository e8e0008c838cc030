"""Types of the coefficients in a vehicle file: a value, its unit, and its source.

In the file every coefficient is an inline table `{ value = 20, unit = "deg", source = "..." }`. The types below check
the unit against the dimension that the model needs, and convert the value to a float in SI.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

_DEGREE = math.pi / 180.0
_RPM = 1.0 / 60.0

UNITS: dict[str, dict[str, float]] = {
    "number": {"1": 1.0, "percent": 0.01},
    "length": {"m": 1.0, "mm": 1e-3},
    "area": {"m2": 1.0, "cm2": 1e-4},
    "volume": {"m3": 1.0, "l": 1e-3},
    "mass": {"kg": 1.0},
    "added mass moment": {"kg m": 1.0},
    "inertia": {"kg m2": 1.0},
    "density": {"kg/m3": 1.0},
    "quadratic drag": {"kg/m": 1.0},
    "quadratic rotary drag": {"kg m2": 1.0},
    "angle": {"rad": 1.0, "deg": _DEGREE},
    "angular rate": {"rad/s": 1.0, "deg/s": _DEGREE},
    "slope per angle": {"1/rad": 1.0, "1/deg": 1.0 / _DEGREE},
    "shaft speed": {"rev/s": 1.0, "rpm": _RPM},
    "shaft acceleration": {"rev/s2": 1.0, "rpm/s": _RPM},
    "speed": {"m/s": 1.0},
    "time": {"s": 1.0},
    "per time": {"1/s": 1.0},
    "per time squared": {"1/s2": 1.0},
    "fin angle per angle": {"1": 1.0},
    "fin angle per angle second": {"1/s": 1.0},
    "fin angle per angular rate": {"s": 1.0},
    "shaft speed per speed": {"rev/m": 1.0},
    "shaft speed per distance": {"rev/(m s)": 1.0},
    "shaft speed per acceleration": {"rev s/m": 1.0},
    "force": {"N": 1.0},
    "moment": {"N m": 1.0},
    "force per speed": {"N s/m": 1.0},
    "force per distance": {"N/m": 1.0},
    "moment per angle": {"N m/rad": 1.0},
    "moment per angle second": {"N m/(rad s)": 1.0},
    "moment per angular rate": {"N m s/rad": 1.0},
}


@dataclass(frozen=True)
class Check:
    """The check of a coefficient: its dimension, and its bounds in SI."""

    dimension: str
    minimum: float | None = None
    exclusive: bool = False
    maximum: float | None = None

    @property
    def units(self) -> dict[str, float]:
        """The units that are read, and their factors to SI."""
        return UNITS[self.dimension]

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
        raise ValueError(
            f"unit '{unit}' is not a unit of {check.dimension}; expected {' or '.join(check.units)}"
        )
    if not isinstance(source, str) or not source.strip():
        raise ValueError("'source' is empty, expected the origin of the value")
    return float(value), unit


def _positive(dimension: str, maximum: float | None = None) -> Check:
    return Check(dimension, 0.0, exclusive=True, maximum=maximum)


def _not_negative(dimension: str, maximum: float | None = None) -> Check:
    return Check(dimension, 0.0, maximum=maximum)


Number = Annotated[float, Check("number")]
PositiveNumber = Annotated[float, _positive("number")]
NotNegativeNumber = Annotated[float, _not_negative("number")]
Fraction = Annotated[float, _not_negative("number", maximum=1.0)]
Length = Annotated[float, Check("length")]
PositiveLength = Annotated[float, _positive("length")]
PositiveArea = Annotated[float, _positive("area")]
PositiveVolume = Annotated[float, _positive("volume")]
Mass = Annotated[float, Check("mass")]
PositiveMass = Annotated[float, _positive("mass")]
AddedMassMoment = Annotated[float, Check("added mass moment")]
Inertia = Annotated[float, Check("inertia")]
PositiveInertia = Annotated[float, _positive("inertia")]
PositiveDensity = Annotated[float, _positive("density")]
QuadraticDrag = Annotated[float, _not_negative("quadratic drag")]
RotaryDrag = Annotated[float, _not_negative("quadratic rotary drag")]
Angle = Annotated[float, Check("angle")]
PositiveAngle = Annotated[float, _positive("angle", maximum=math.pi)]
PositiveAngularRate = Annotated[float, _positive("angular rate")]
PositiveSlope = Annotated[float, _positive("slope per angle")]
PositiveShaftSpeed = Annotated[float, _positive("shaft speed")]
PositiveShaftAcceleration = Annotated[float, _positive("shaft acceleration")]
PositiveSpeed = Annotated[float, _positive("speed")]
PositiveTime = Annotated[float, _positive("time")]
PerTime = Annotated[float, _positive("per time")]
PerTimeSquared = Annotated[float, _positive("per time squared")]
FinPerAngle = Annotated[float, _positive("fin angle per angle")]
FinPerAngleSecond = Annotated[float, _positive("fin angle per angle second")]
FinPerRate = Annotated[float, _not_negative("fin angle per angular rate")]
ShaftPerSpeed = Annotated[float, _positive("shaft speed per speed")]
ShaftPerDistance = Annotated[float, _positive("shaft speed per distance")]
ShaftPerAcceleration = Annotated[float, _not_negative("shaft speed per acceleration")]
PositiveForce = Annotated[float, _positive("force")]
PositiveMoment = Annotated[float, _positive("moment")]
LinearDrag = Annotated[float, _not_negative("force per speed")]
LinearRotaryDrag = Annotated[float, _not_negative("moment per angular rate")]
ForcePerSpeed = Annotated[float, _positive("force per speed")]
ForcePerDistance = Annotated[float, _positive("force per distance")]
MomentPerAngle = Annotated[float, _positive("moment per angle")]
MomentPerAngleSecond = Annotated[float, _positive("moment per angle second")]
MomentPerRate = Annotated[float, _positive("moment per angular rate")]
