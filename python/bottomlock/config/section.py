"""A section of a settings file: its base, what a key means, and the unit that its name ends in."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo

from bottomlock import units
from bottomlock.kernel.models import Finite, NonNegative, Positive, Real, Settings

Fraction = Annotated[Real, Field(ge=0, le=1)]
Triple = tuple[NonNegative, NonNegative, NonNegative]
Vector = tuple[Finite, Finite, Finite]
Named = TypeVar("Named", str, Path)
Kernel = TypeVar("Kernel", bound=Settings)


def _rad_rts_from_deg_per_rt_h(density: float) -> float:
    return units.rad_from_deg(units.per_rt_s_from_per_rt_h(density))


_UNITS: dict[str, tuple[str, str, Callable[[float], float] | None]] = {
    "_percent_of_range": ("% of range", "_per_range", units.fraction_from_percent),
    "_deg_per_s_per_rt_s": ("deg/s/√s", "_radps_rts", units.rad_from_deg),
    "_percent_per_rt_s": ("%/√s", "_rts", units.fraction_from_percent),
    "_mps2_per_rt_s": ("m/s²/√s", "_mps2_rts", None),
    "_mps_per_rt_s": ("m/s/√s", "_mps_rts", None),
    "_mps_per_m": ("m/s/m", "_mps_per_m", None),
    "_mps_per_rt_h": ("m/s/√h", "_mps_rts", units.per_rt_s_from_per_rt_h),
    "_deg_per_rt_h": ("deg/√h", "_rad_rts", _rad_rts_from_deg_per_rt_h),
    "_deg_per_h_per_g": (
        "deg/h/g",
        "_radps_per_mps2",
        lambda rate: units.radps_from_deg_per_h(rate) / units.STANDARD_GRAVITY_MPS2,
    ),
    "_deg_per_h": ("deg/h", "_radps", units.radps_from_deg_per_h),
    "_deg_per_s": ("deg/s", "_radps", units.rad_from_deg),
    "_kg_per_m3": ("kg/m³", "_kgpm3", None),
    "_kg_per_m": ("N s²/m²", "_kgpm", None),
    "_kg_per_s": ("N s/m", "_kgps", None),
    "_m2ps2": ("m²/s²", "_m2ps2", None),
    "_percent": ("%", "", units.fraction_from_percent),
    "_mps2": ("m/s²", "_mps2", None),
    "_mrad": ("mrad", "_rad", lambda angle: angle * 1e-3),
    "_ppm": ("ppm", "", lambda part: part * 1e-6),
    "_mps": ("m/s", "_mps", None),
    "_deg": ("deg", "_rad", units.rad_from_deg),
    "_mg": ("mg", "_mps2", units.mps2_from_mg),
    "_hz": ("Hz", "_hz", None),
    "_pa": ("Pa", "_pa", None),
    "_kg": ("kg", "_kg", None),
    "_n": ("N", "_n", None),
    "_s": ("s", "_s", None),
    "_m": ("m", "_m", None),
}
"""Endings of keys, longer ones first: the unit, the ending of the kernel's name, and how SI is made of a value."""


def unit_of(key: str) -> str:
    """The unit that a key's name ends in, "" for none.

    >>> unit_of("gyro_bias_deg_per_h")
    'deg/h'
    """
    return next((unit for ending, (unit, *_) in _UNITS.items() if key.endswith(ending)), "")


def in_si(keys: Mapping[str, Any], settings: type[Kernel], **others: Any) -> Kernel:  # noqa: ANN401
    """The kernel's settings out of a section's keys, each of the same name but for its unit.

    A 1 sigma that a key names without saying so, or as noise, is the kernel's `sd`, and a place is one in the tangent
    frame. What is computed otherwise is given; a setting that no key has keeps its default.

    >>> from bottomlock.kernel.models import HeadingModel
    >>> in_si({"noise_deg": 180.0, "offset_sd_deg": 0.0, "walk_time_s": 60.0}, HeadingModel)
    HeadingModel(sd_rad=3.141592653589793, walk_time_s=60.0)
    """
    values: dict[str, Any] = {}
    for key, value in keys.items():
        names, convert = _settings_of(key)
        for name in names:
            # A key of the very name comes before one that is like it.
            if name in settings.model_fields and (name == names[0] or name not in values):
                values[name] = value if convert is None else convert(value)
                default = settings.model_fields[name].default
                if convert is not None and _is_but_for_rounding(values[name], default):
                    values[name] = default
    return settings(**values | others)


def _is_but_for_rounding(value: float, default: object) -> bool:
    """Whether a value that was a default in degrees is that default."""
    return isinstance(default, float) and math.isclose(value, default, rel_tol=1e-14)


def _settings_of(key: str) -> tuple[tuple[str, ...], Callable[[float], float] | None]:
    """The names that a key's setting may have in the kernel, its own first, and how SI is made of the key's value."""
    end = next((end for end in _UNITS if key.endswith(end)), "")
    _, ending, convert = _UNITS.get(end, ("", "", None))
    stem = key.removesuffix(end)
    likes = (stem, f"{stem}_sd", stem.replace("noise", "sd"), f"{stem}_t")
    return tuple(f"{like}{ending}" for like in likes), convert


def in_folder(named: Named, info: ValidationInfo) -> Named:
    """A file as it is found from the folder of the file that names it, where one does.

    Raises:
        ValueError: for a name that no file has.
    """
    if "\0" in str(named):
        raise ValueError(f"{str(named)!r} is no name of a file, expected one without a character of code 0")
    folder = (info.context or {}).get("folder")
    return named if folder is None else type(named)(folder / named)


def _in_folder_if_file(named: Named, info: ValidationInfo) -> Named:
    return in_folder(named, info) if Path(named).suffix else named


InFolder = AfterValidator(in_folder)
"""Of a key that names a file."""
PackagedOrFile = AfterValidator(_in_folder_if_file)
"""Of a key that names a file, with a suffix, or what is packaged."""


def shown(*, unit: str = "", range: str = "", example: Any = None) -> Any:  # noqa: A002, ANN401 - of any key
    """What the key reference and the schema show of a key: a unit not in its name, a range in words, an example.

    The example is needed where the default is none; of a choice it is the first.
    """
    stated = {"unit": unit, "range": range}
    return Field(
        examples=None if example is None else [example],
        json_schema_extra={name: words for name, words in stated.items() if words},
    )


class Section(BaseModel):
    """A section: unknown keys are errors, values are kept as read.

    A key without a docstring means what it does in the class that it is from, or the kernel's setting of its name.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
    kernel: ClassVar[type[Settings] | None] = None
    """The kernel's settings among the keys, by name and unit."""

    def __init_subclass__(cls, kernel: type[Settings] | None = None, **others: Any) -> None:  # noqa: ANN401
        """A section states the kernel's settings; those derived from it have the same."""
        super().__init_subclass__(**others)
        if kernel is not None:
            cls.kernel = kernel

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:  # noqa: ANN401
        """Gives the keys their meanings."""
        silent = {key: field for key, field in cls.model_fields.items() if field.description is None}
        above = [getattr(one, "model_fields", {}) for one in cls.__mro__[1:]]
        settings = cls.kernel.model_fields if cls.kernel else {}
        for key, field in silent.items():
            same = [one[key] for one in above if key in one]
            same += [settings[name] for name in _settings_of(key)[0] if name in settings]
            field.description = next((one.description for one in same if one.description), None)
        if silent:
            cls.model_rebuild(force=True)


class Earth(Section):
    """The Earth that a vehicle is on."""

    gravity: Annotated[Literal["normal"] | Positive, shown(unit="m/s²")] = "normal"
    """gravity: normal (WGS 84, of the place), or a number"""
    earth: Literal["ellipsoid", "tangent_plane"] = "ellipsoid"
    """the Earth: the ellipsoid of WGS 84, or a plane with gravity, level and north of the origin everywhere"""


class Outliers(Section):
    """Outliers among simulated readings."""

    outlier_fraction: Annotated[Fraction, shown(unit="1")] = 0.0
    """part of the readings that are outliers; the filter does not model them"""
    outlier_factor: Annotated[Real, Field(ge=1, allow_inf_nan=False), shown(unit="1")] = 10.0
    """noise of an outlier over that of a good reading"""


class SensorErrors(Section):
    """Errors of a sensor as a filter assumes them; most are the kernel's own, by name and unit."""

    kernel: ClassVar[type[Settings]]

    def si(self) -> dict[str, Any]:
        """Those of the kernel's settings that no key of the same name has, by their names there."""
        return {}

    def kernel_models(self, gravity_mps2: float = math.nan) -> dict[str, Settings]:  # noqa: ARG002
        """Section of the kernel's model, SI; gravity is needed by a pressure alone."""
        return {self.kernel.place: in_si(dict(self), self.kernel, **self.si())}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options: the place of the sensor, where it matters."""
        place = getattr(self, "lever_arm_m", None)
        return {} if place is None else {"levers": {f"{self.kernel.place}_p_m": place}}


class Mounting(Section):
    """How a sensor's axes stand to those of the platform."""

    mounting_roll_deg: Annotated[Real, Field(ge=-180, le=180)] = 0.0
    """rotation from instrument to platform axes: roll"""
    mounting_pitch_deg: Annotated[Real, Field(ge=-90, le=90)] = 0.0
    """rotation from instrument to platform axes: pitch"""
    mounting_yaw_deg: Annotated[Real, Field(ge=-360, le=360)] = 0.0
    """rotation from instrument to platform axes: yaw"""

    @property
    def mounting_rpy_rad(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw, rad."""
        roll, pitch, yaw = self.mounting_roll_deg, self.mounting_pitch_deg, self.mounting_yaw_deg
        return units.rad_from_deg(roll), units.rad_from_deg(pitch), units.rad_from_deg(yaw)
