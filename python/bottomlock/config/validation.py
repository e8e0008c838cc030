"""Error messages for settings files: place, key, value found, value expected, unit."""

import difflib
from typing import get_args

from pydantic import BaseModel, ValidationError

_UNITS = (
    ("_deg_per_s_per_rt_s", "deg/s/√s"), ("_percent_per_rt_s", "%/√s"), ("_mps2_per_rt_s", "m/s²/√s"),
    ("_mps_per_rt_s", "m/s/√s"), ("_mps_per_rt_h", "m/s/√h"), ("_deg_per_rt_h", "deg/√h"), ("_deg_per_h", "deg/h"),
    ("_deg_per_s", "deg/s"), ("_kg_per_m3", "kg/m³"), ("_m2ps2", "m²/s²"), ("_percent", "%"), ("_mps", "m/s"),
    ("_deg", "deg"), ("_mg", "mg"), ("_hz", "Hz"), ("_pa", "Pa"), ("_s", "s"), ("_m", "m"),
)  # fmt: skip
_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}


def _unit_of(key: str) -> str:
    return next((f" {unit}" for ending, unit in _UNITS if key.endswith(ending)), "")


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    for part in path:
        field = model.model_fields.get(str(part))
        kinds = () if field is None else (field.annotation, *get_args(field.annotation))
        section = next(
            (kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None
        )
        if section is None:
            break
        model = section
    return list(model.model_fields)


def explain(error: ValidationError, place: str, model: type[BaseModel]) -> str:
    """One line per fault: place, key, value found, what was expected, unit."""
    lines = []
    for fault in error.errors():
        location = tuple(part for part in fault["loc"] if part not in {"normal", "constrained-float"})
        key = ".".join(str(part) for part in location if not str(part).startswith(("literal", "function")))
        value, kind, context = fault.get("input"), fault["type"], fault.get("ctx", {})
        unit = _unit_of(key)
        if kind == "extra_forbidden":
            known = _known_keys(model, location[:-1])
            close = difflib.get_close_matches(str(location[-1]), known, n=1, cutoff=0.4)
            hint = f", did you mean '{close[0]}'?" if close else f" (known: {', '.join(known)})"
            lines.append(f"{place}: unknown key '{key}'{hint}")
        elif kind == "missing":
            lines.append(f"{place}: '{key}' is missing{', expected in' + unit if unit else ''}")
        elif kind in _BOUNDS:
            name, sign = _BOUNDS[kind]
            lines.append(f"{place}: '{key}' is {value}, expected {sign} {context[name]}{unit}")
        elif kind == "value_error":
            lines.append(f"{place}: {key + ': ' if key else ''}{context['error']}")
        else:
            lines.append(
                f"{place}: '{key}' is {value!r}, expected {fault['msg'].removeprefix('Input should be ')}{unit}"
            )
    return "\n".join(dict.fromkeys(lines))
