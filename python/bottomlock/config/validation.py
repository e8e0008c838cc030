"""Error messages for settings files: place, key, value found, value expected, unit."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from bottomlock.config.key_reference import key_of, model_at, section_models, section_paths
from bottomlock.config.section import unit_of
from bottomlock.errors import ScenarioError
from bottomlock.support.nearest import nearest

Model = TypeVar("Model", bound=BaseModel)
_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}
_UNPARSED = ", unable to parse string as a number"
"""What pydantic adds of a text in place of a number, which says no more."""


@dataclass(frozen=True)
class Fault:
    """A fault of a settings file.

    Attributes:
        key: with its sections; "" for a fault of the whole.
        words: key, value found, what was expected, unit, likely mistake in one line.
        expected: what was expected.
        hint: the likely mistake; "" for none.
    """

    key: str
    words: str
    expected: str = ""
    hint: str = ""


def _missing(key: str, model: type[BaseModel], path: tuple[int | str, ...]) -> str:
    """What is expected of a missing key: type, unit, range, meaning; of a section its own required keys."""
    section = model_at(model, path[:-1])
    field = section.model_fields.get(str(path[-1]))
    if field is None:
        return ""
    inner = section_models(field.annotation)
    if inner:
        needed = [name for name, one in inner[0].model_fields.items() if one.is_required()]
        return f"a section [{key}] with {', '.join(needed) or 'any of its keys'}"
    try:
        found = key_of(section, str(path[-1]), field)
    except LookupError:
        return ""
    unit = f" in {found.unit}" if found.unit not in {"", "1"} else ""
    span = "" if found.range in {"", "any", "finite", "each any", "each finite"} else f", {found.range}"
    kind = "one of" if found.type == "choice" else found.type
    return f"{kind}{unit}{span}: {found.meaning}".replace("one of,", "one of")


def _unknown(key: str, model: type[BaseModel], path: tuple[int | str, ...]) -> Fault:
    """The nearest key of the section, or the section that has the very key."""
    name, known = str(path[-1]), list(model_at(model, path[:-1]).model_fields)
    close = nearest(name, known)
    # Of a section that may be one of several models, another one may have the key: that is not its place.
    own = ".".join(part for part in map(str, path[:-1]) if not part[:1].isupper())
    elsewhere = [
        place for place, one in section_paths(model) if place not in {"", own} and name in one.model_fields
    ]
    if close and (not elsewhere or nearest(name, [close], alike=0.8)):
        return _unknown_with(key, known, f", did you mean '{close}'?")
    if elsewhere:
        places = " or ".join(f"[{place}]" for place in elsewhere[:3])
        return _unknown_with(key, known, f", '{name}' is a key of {places}")
    return Fault(key, f"unknown key '{key}' (known: {', '.join(known)})", f"one of {', '.join(known)}")


def _unknown_with(key: str, known: list[str], hint: str) -> Fault:
    return Fault(key, f"unknown key '{key}'{hint}", f"one of {', '.join(known)}", hint.removeprefix(", "))


def refusal(error: ValidationError, place: str, model: type[BaseModel], *others: str) -> ScenarioError:
    """The error of a settings file: a line per fault, then `others`; its key, expectation and hint are of the first."""
    found = list(faults(error, model))
    lines = dict.fromkeys(f"{place}: {fault.words}" for fault in found)
    refused = ScenarioError("\n".join([*lines, *others]))
    refused.place, refused.key = place, found[0].key
    refused.expected, refused.hint = found[0].expected, found[0].hint
    return refused


def checked(model: type[Model], content: Mapping[str, Any], place: str, *others: str) -> Model:
    """The content of a settings file as its model.

    Raises:
        ScenarioError: a line per fault, then `others`.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise refusal(error, place, model, *others) from error


def faults(error: ValidationError, model: type[BaseModel]) -> Iterator[Fault]:
    """Each fault of the content that pydantic refuses."""
    for fault in error.errors():
        location = tuple(part for part in fault["loc"] if part not in {"normal", "constrained-float"})
        # Of a section that may be one of several models, the model is part of the place, but not of the key.
        shown = [str(part) for part in location if not str(part)[:1].isupper()]
        key = ".".join(part for part in shown if not part.startswith(("literal", "function")))
        value, kind, context = fault.get("input"), fault["type"], fault.get("ctx", {})
        unit = f" {unit_of(key)}" if unit_of(key) else ""
        if kind == "extra_forbidden":
            yield _unknown(key, model, location)
        elif kind == "missing":
            expected = _missing(key, model, location)
            yield Fault(key, f"'{key}' is missing" + (f", expected {expected}" if expected else ""), expected)
        elif kind == "value_error":
            yield Fault(key, f"{key + ': ' if key else ''}{context['error']}")
        else:
            name, sign = _BOUNDS.get(kind, ("", ""))
            said = fault["msg"].removeprefix("Input should be ").removesuffix(_UNPARSED)
            expected = f"{sign} {context[name]}{unit}" if name else f"{said}{unit}"
            shown_value = value if name else repr(value)
            yield Fault(key, f"'{key}' is {shown_value}, expected {expected}", expected)
