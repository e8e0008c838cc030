"""Error messages for settings files: place, key, value found, value expected, unit."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from bottomlock.config.key_reference import is_list, key_of, kind_of, located, section_models, section_paths
from bottomlock.config.section import unit_of
from bottomlock.errors import ScenarioError
from bottomlock.text import guess, nearest

Model = TypeVar("Model", bound=BaseModel)
_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}
_OF_TYPES = ("normal", "constrained-float", "literal", "function")
"""What pydantic puts into the path of a key for one of its types."""


def _expected(key: str, section: type[BaseModel]) -> str:
    """What is expected of a key: type, unit, range, meaning; of a section its own required keys."""
    name = key.rpartition(".")[2]
    field = section.model_fields.get(name)
    if field is None:
        return ""
    inner = section_models(field.annotation)
    if inner:
        needed = [name for name, one in inner[0].model_fields.items() if one.is_required()]
        head = f"[[{key}]]" if is_list(field.annotation) else f"[{key}]"
        return f"a section {head} with {', '.join(needed) or 'any of its keys'}"
    try:
        found = key_of(section, name)
    except LookupError:
        return ""
    unit = f" in {found.unit}" if found.unit not in {"", "1"} else ""
    span = "" if found.range in {"", "any", "finite", "each any", "each finite"} else f", {found.range}"
    kind = "one of" if found.type == "choice" else found.type
    return f"{kind}{unit}{span}: {found.meaning}".replace("one of,", "one of")


def _unknown(key: str, model: type[BaseModel], section: type[BaseModel]) -> ScenarioError:
    """The nearest key of the section, or the section that has the very key."""
    own, _, name = key.rpartition(".")
    known = list(section.model_fields)
    close = nearest(name, known)
    # Of a section that may be one of several models, another one may have the key: that is not its place.
    elsewhere = [
        place for place, one in section_paths(model) if place not in {"", own} and name in one.model_fields
    ]
    if close and (not elsewhere or nearest(name, [close], alike=0.8)):
        hint = f"did you mean '{close}'?"
    else:
        places = " or ".join(f"[{place}]" for place in dict.fromkeys(elsewhere[:3]))
        hint = f"'{name}' is a key of {places}" if places else ""
    words = f", {hint}" if hint else f" (known: {', '.join(known)})"
    return _fault(key, f"unknown key '{key}'{words}", f"one of {', '.join(known)}", hint)


def refusal(error: ValidationError, place: str, model: type[BaseModel]) -> ScenarioError:
    """The error of a settings file: a line per fault; its key, expectation and hint are of the first."""
    found = list(faults(error, model))
    lines = dict.fromkeys(f"{place}: {fault}" for fault in found)
    refused = ScenarioError("\n".join(lines))
    refused.place, refused.key = place, found[0].key
    refused.expected, refused.hint = found[0].expected, found[0].hint
    return refused


def checked(model: type[Model], content: Mapping[str, Any], place: str, folder: Path | None = None) -> Model:
    """The content of a settings file as its model; `folder` is where the files are that it names.

    Raises:
        ScenarioError: a line per fault.
    """
    try:
        return model.model_validate(content, context={"folder": folder})
    except ValidationError as error:
        raise refusal(error, place, model) from error


def _fault(key: str, words: str, expected: str = "", hint: str = "") -> ScenarioError:
    fault = ScenarioError(words)
    fault.key, fault.expected, fault.hint = key, expected, hint
    return fault


def faults(error: ValidationError, model: type[BaseModel]) -> Iterator[ScenarioError]:
    """Each fault of the content that pydantic refuses."""
    for fault in error.errors():
        path = [part for part in fault["loc"] if not str(part).startswith(_OF_TYPES)]
        section, key = located(model, path)
        value, kind, context = fault.get("input"), fault["type"], fault.get("ctx", {})
        unit = f" {unit_of(key)}" if unit_of(key) else ""
        if kind == "extra_forbidden":
            yield _unknown(key, model, section)
        elif kind == "missing" and isinstance(path[-1], str):
            yield ScenarioError("is missing", key=f"'{key}'", expected=_expected(key, section))
        elif kind.startswith("union_tag"):
            inner = section_models(section.model_fields[key.rpartition(".")[2]].annotation)
            name, tags = kind_of(inner[0])[0], [kind_of(one)[1] for one in inner]
            own, expected = value.get(name), f"one of {', '.join(tags)}"
            yield ScenarioError(
                f"is {own!r}", key=f"'{key}.{name}'", expected=expected, hint=guess(own, tags)
            )
        elif kind == "value_error":
            yield _fault(key, f"{key + ': ' if key else ''}{context['error']}")
        elif kind in _BOUNDS:
            name, sign = _BOUNDS[kind]
            yield ScenarioError(f"is {value}", key=f"'{key}'", expected=f"{sign} {context[name]}{unit}")
        else:
            if kind == "missing":  # of a list that is too short
                path = path[:-1]
            yield _of_another_type(model, path, value, fault)


def _of_another_type(
    model: type[BaseModel],
    path: list[int | str],
    value: Any,  # noqa: ANN401 - what a file holds
    fault: Any,  # noqa: ANN401 - of pydantic
) -> ScenarioError:
    """The error of a value that is none of its key; of a list it says what all of it should be."""
    if not path:
        expected = f"an object with keys of {', '.join(model.model_fields)}"
        return _fault("", f"the whole is {value!r}, expected {expected}", expected)
    key, whole = located(model, path)[1], path
    while isinstance(whole[-1], int):
        whole = whole[:-1]
    section, name = located(model, whole)
    expected = _expected(name, section) or fault["msg"].removeprefix("Input should be ")
    own = section.model_fields.get(name.rpartition(".")[2])
    choices = [] if own is None else [str(one) for one in get_args(own.annotation)]
    hint = guess(value, choices) if fault["type"] == "literal_error" else ""
    return ScenarioError(f"is {value!r}", key=f"'{key}'", expected=expected, hint=hint)
