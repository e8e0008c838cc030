"""Error messages for settings files: place, key, value found, value expected, unit."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from bottomlock.config.key_reference import key_of, kind_of, located, section_models, section_paths
from bottomlock.config.section import unit_of
from bottomlock.errors import ScenarioError
from bottomlock.support.nearest import guess, nearest

Model = TypeVar("Model", bound=BaseModel)
_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}
_OF_TYPES = ("normal", "constrained-float", "literal", "function")
"""What pydantic puts into the path of a key for one of its types."""
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


def _missing(key: str, section: type[BaseModel]) -> str:
    """What is expected of a missing key: type, unit, range, meaning; of a section its own required keys."""
    name = key.rpartition(".")[2]
    field = section.model_fields.get(name)
    if field is None:
        return ""
    inner = section_models(field.annotation)
    if inner:
        needed = [name for name, one in inner[0].model_fields.items() if one.is_required()]
        return f"a section [{key}] with {', '.join(needed) or 'any of its keys'}"
    try:
        found = key_of(section, name)
    except LookupError:
        return ""
    unit = f" in {found.unit}" if found.unit not in {"", "1"} else ""
    span = "" if found.range in {"", "any", "finite", "each any", "each finite"} else f", {found.range}"
    kind = "one of" if found.type == "choice" else found.type
    return f"{kind}{unit}{span}: {found.meaning}".replace("one of,", "one of")


def _unknown(key: str, model: type[BaseModel], section: type[BaseModel]) -> Fault:
    """The nearest key of the section, or the section that has the very key."""
    own, _, name = key.rpartition(".")
    known = list(section.model_fields)
    close = nearest(name, known)
    # Of a section that may be one of several models, another one may have the key: that is not its place.
    elsewhere = [
        place for place, one in section_paths(model) if place not in {"", own} and name in one.model_fields
    ]
    if close and (not elsewhere or nearest(name, [close], alike=0.8)):
        return _unknown_with(key, known, f", did you mean '{close}'?")
    if elsewhere:
        places = " or ".join(f"[{place}]" for place in dict.fromkeys(elsewhere[:3]))
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


def _refused(key: str, shown: object, expected: str, hint: str = "") -> Fault:
    return Fault(key, f"'{key}' is {shown}, expected {expected}{hint and f'; {hint}'}", expected, hint)


def faults(error: ValidationError, model: type[BaseModel]) -> Iterator[Fault]:
    """Each fault of the content that pydantic refuses."""
    for fault in error.errors():
        path = [part for part in fault["loc"] if not str(part).startswith(_OF_TYPES)]
        section, key = located(model, path)
        value, kind, context = fault.get("input"), fault["type"], fault.get("ctx", {})
        unit = f" {unit_of(key)}" if unit_of(key) else ""
        if kind == "extra_forbidden":
            yield _unknown(key, model, section)
        elif kind == "missing":
            expected = _missing(key, section)
            yield Fault(key, f"'{key}' is missing" + (f", expected {expected}" if expected else ""), expected)
        elif kind.startswith("union_tag"):
            inner = section_models(section.model_fields[key.rpartition(".")[2]].annotation)
            name, tags = kind_of(inner[0])[0], [kind_of(one)[1] for one in inner]
            own, expected = value.get(name), f"one of {', '.join(tags)}"
            yield _refused(f"{key}.{name}", repr(own), expected, guess(own, tags))
        elif kind == "value_error":
            yield Fault(key, f"{key + ': ' if key else ''}{context['error']}")
        else:
            name, sign = _BOUNDS.get(kind, ("", ""))
            said = fault["msg"].removeprefix("Input should be ").removesuffix(_UNPARSED)
            expected = f"{sign} {context[name]}{unit}" if name else f"{said}{unit}"
            yield _refused(key, value if name else repr(value), expected)
