"""Error messages for settings files: place, key, value found, value expected, unit."""

from collections.abc import Iterator

from pydantic import BaseModel, ValidationError

from bottomlock.config.key_reference import key_of, model_at, section_models, section_paths
from bottomlock.config.unit_of_key import unit_of
from bottomlock.support.nearest import nearest

_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}
_UNPARSED = ", unable to parse string as a number"
"""What pydantic adds of a text in place of a number, which says no more."""


def _missing(key: str, model: type[BaseModel], path: tuple[int | str, ...]) -> str:
    """What a missing key is: type, unit, range, meaning; of a section its own required keys."""
    section = model_at(model, path[:-1])
    field = section.model_fields.get(str(path[-1]))
    if field is None:
        return f"'{key}' is missing"
    inner = section_models(field.annotation)
    if inner:
        needed = [name for name, one in inner[0].model_fields.items() if one.is_required()]
        return f"'{key}' is missing, expected a section [{key}] with {', '.join(needed) or 'any of its keys'}"
    try:
        found = key_of(section, str(path[-1]), field)
    except LookupError:
        return f"'{key}' is missing"
    unit = f" in {found.unit}" if found.unit not in {"", "1"} else ""
    span = "" if found.range in {"", "any", "finite", "each any", "each finite"} else f", {found.range}"
    kind = "one of" if found.type == "choice" else found.type
    return f"'{key}' is missing, expected {kind}{unit}{span}: {found.meaning}".replace("one of,", "one of")


def _unknown(key: str, model: type[BaseModel], path: tuple[int | str, ...]) -> str:
    """The nearest key of the section, or the section that has the very key."""
    name, known = str(path[-1]), list(model_at(model, path[:-1]).model_fields)
    close = nearest(name, known)
    # Of a section that may be one of several models, another one may have the key: that is not its place.
    own = ".".join(part for part in map(str, path[:-1]) if not part[:1].isupper())
    elsewhere = [
        place for place, one in section_paths(model) if place not in {"", own} and name in one.model_fields
    ]
    if close and (not elsewhere or nearest(name, [close], alike=0.8)):
        return f"unknown key '{key}', did you mean '{close}'?"
    if elsewhere:
        places = " or ".join(f"[{place}]" for place in elsewhere[:3])
        return f"unknown key '{key}', '{name}' is a key of {places}"
    return f"unknown key '{key}' (known: {', '.join(known)})"


def explain(error: ValidationError, place: str, model: type[BaseModel]) -> str:
    """One line per fault: place, key, value found, what was expected, unit."""
    return "\n".join(dict.fromkeys(f"{place}: {words}" for _, words in faults(error, model)))


def faults(error: ValidationError, model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    """Each fault: its key, "" for one of the whole, and a line with key, value found, what was expected, unit."""
    for fault in error.errors():
        location = tuple(part for part in fault["loc"] if part not in {"normal", "constrained-float"})
        # Of a section that may be one of several models, the model is part of the place, but not of the key.
        shown = [str(part) for part in location if not str(part)[:1].isupper()]
        key = ".".join(part for part in shown if not part.startswith(("literal", "function")))
        value, kind, context = fault.get("input"), fault["type"], fault.get("ctx", {})
        unit = f" {unit_of(key)}" if unit_of(key) else ""
        if kind == "extra_forbidden":
            words = _unknown(key, model, location)
        elif kind == "missing":
            words = _missing(key, model, location)
        elif kind in _BOUNDS:
            name, sign = _BOUNDS[kind]
            words = f"'{key}' is {value}, expected {sign} {context[name]}{unit}"
        elif kind == "value_error":
            words = f"{key + ': ' if key else ''}{context['error']}"
        else:
            expected = fault["msg"].removeprefix("Input should be ").removesuffix(_UNPARSED)
            words = f"'{key}' is {value!r}, expected {expected}{unit}"
        yield key, words
