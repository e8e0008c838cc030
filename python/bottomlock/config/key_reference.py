"""Every key of a settings file, from its pydantic model: type, unit, default, range, meaning and example."""

import re
import types
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo

from bottomlock.config.section import unit_of
from bottomlock.config.toml_value import toml_value

REQUIRED = "required"
_WORDS = {
    float: "number", int: "whole number", bool: "true or false", str: "text", Path: "file", Any: "any value",
}  # fmt: skip
_NUMBERS = {float, int}


@dataclass(frozen=True)
class Key:
    """A key: words for people, "" where one does not apply (the unit of a text, the example of a table)."""

    name: str
    type: str
    unit: str
    default: str
    range: str
    meaning: str
    example: str


@dataclass(frozen=True)
class KeySection:
    """A section: its path in the file ("" at the top), what it is, whether it may be left out, and its keys."""

    path: str
    repeated: bool
    model: type[BaseModel]
    meaning: str
    left_out: str
    keys: tuple[Key, ...]

    @property
    def title(self) -> str:
        """The path as TOML writes it."""
        return f"[[{self.path}]]" if self.repeated else f"[{self.path}]" if self.path else "(top of the file)"


def sections_of(model: type[BaseModel], *, path: str = "") -> list[KeySection]:
    """The sections of a file in the order of the model, each followed by its own sub-sections, equal ones once."""
    found = _sections(model, path, repeated=False, left_out="")
    return list({(one.path, one.model): one for one in found}.values())


def _sections(model: type[BaseModel], path: str, *, repeated: bool, left_out: str) -> Iterator[KeySection]:
    keys, below = [], []
    for name, field in model.model_fields.items():
        inner = section_models(field.annotation)
        if not inner:
            keys.append(key_of(model, name, field))
            continue
        inside = f"{path}.{name}" if path else name
        for one in inner:
            key, value = kind_of(one) if len(inner) > 1 else ("", "")
            words = f"for {key} = {toml_value(value)}" if key else _left_out(field)
            below.append((one, inside, _is_list(field.annotation), words))
    yield KeySection(path, repeated, model, _first_sentence(model), left_out, tuple(keys))
    for one, inside, many, words in below:
        yield from _sections(one, inside, repeated=many, left_out=words)


def key_of(model: type[BaseModel], name: str, field: FieldInfo) -> Key:
    """The description of one key.

    Raises:
        LookupError: for a key without a meaning, or a number without a unit.
    """
    kind, span = describe(field.annotation, tuple(field.metadata))
    if not field.description:
        raise LookupError(f"{model.__name__}.{name} has no meaning: add a docstring below the attribute")
    return Key(
        name=name,
        type=kind,
        unit=_unit(model, name, field),
        default=_default(field),
        range=_stated(field, "range") or span,
        meaning=" ".join(field.description.split()),
        example=f"{name} = {toml_value(_example(model, name, field))}",
    )


def _stated(field: FieldInfo, name: str) -> str:
    extra = field.json_schema_extra
    return str(extra.get(name, "")) if isinstance(extra, dict) else ""


def _example(model: type[BaseModel], name: str, field: FieldInfo) -> Any:  # noqa: ANN401 - of any key
    """The value of the example: the stated one, that of a packaged file, else the default, else the first of a choice.

    Raises:
        LookupError: for a key that has none of them.
    """
    if field.examples:
        return field.examples[0]
    if of_packaged := getattr(model, "example_of", None):
        return of_packaged(name)
    default = None if field.is_required() else field.get_default(call_default_factory=True)
    if default is not None and default not in ((), {}):
        return default
    if get_origin(field.annotation) is Literal:
        return get_args(field.annotation)[0]
    raise LookupError(f"'{name}' has no example, and its default is none")


def _unit(model: type[BaseModel], name: str, field: FieldInfo) -> str:
    """The unit: stated, of a coefficient, or that of the key's ending; "1" of a number without dimension."""
    units = [list(one.units) for one in _coefficients(field.annotation, tuple(field.metadata))]
    unit = _stated(field, "unit") or (" or ".join(units[0]) if units else unit_of(name))
    if not unit and _has_numbers(field.annotation):
        raise LookupError(f"{model.__name__}.{name} is a number without a unit")
    return unit


def _coefficients(annotation: Any, metadata: tuple[Any, ...]) -> list[Any]:  # noqa: ANN401 - a type
    """The checks of a vehicle's coefficient among a key's validators: those that know their units."""
    here = [one.func for one in metadata if isinstance(one, BeforeValidator) and hasattr(one.func, "units")]
    for inner in get_args(annotation):
        here += _coefficients(inner, getattr(inner, "__metadata__", ()))
    return here


def _has_numbers(annotation: Any) -> bool:  # noqa: ANN401 - a type
    return annotation in _NUMBERS or any(_has_numbers(inner) for inner in get_args(annotation))


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return REQUIRED
    value = field.get_default(call_default_factory=True)
    return "none" if value is None else toml_value(value)


def section_models(annotation: Any) -> list[type[BaseModel]]:  # noqa: ANN401 - a type
    """The models in an annotation: of an optional section, of a list of them, of one of several."""
    if isinstance(annotation, type) and not get_args(annotation) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in section_models(inner)]


def section_paths(model: type[BaseModel], path: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Path and model of every section, the top of the file first."""
    yield path, model
    for name, field in model.model_fields.items():
        for one in section_models(field.annotation):
            yield from section_paths(one, f"{path}.{name}" if path else name)


def located(model: type[BaseModel], path: Sequence[int | str]) -> tuple[type[BaseModel], str]:
    """The section that the last part of a pydantic path is in, and the key, without which of several models it is."""
    choice: dict[str, type[BaseModel]] = {}
    section, keys = model, []
    for part in map(str, path):
        if part in choice:
            model = choice[part]
            continue
        keys.append(part)
        section = model
        inner = section_models(model.model_fields[part].annotation) if part in model.model_fields else []
        model = inner[0] if inner else model
        choice = {tag: one for one in inner for tag in (one.__name__, kind_of(one)[1])}
    return section, ".".join(keys)


def kind_of(model: type[BaseModel]) -> tuple[str, str]:
    """The key that says which of several sections it is, and its value; "" for none."""
    key = next((key for key in ("kind", "source") if key in model.model_fields), "")
    return key, get_args(model.model_fields[key].annotation)[0] if key else ""


def _is_list(annotation: Any) -> bool:  # noqa: ANN401 - a type
    if get_origin(annotation) in {tuple, list}:
        return True
    return any(_is_list(inner) for inner in get_args(annotation))


def _left_out(field: FieldInfo) -> str:
    """What it means that a section is not in the file."""
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if default is None or default == ():
        return "may be left out: there is none"
    names = sorted(default.model_fields_set) if isinstance(default, BaseModel) else []
    stated = ", ".join(f"{name} = {toml_value(getattr(default, name))}" for name in names)
    return f"may be left out: {stated}" if stated else "may be left out: the defaults below"


def _first_sentence(model: type[BaseModel]) -> str:
    text = " ".join((model.__doc__ or "").split())
    end = re.search(r"\.(\s|$)", text)
    return text if end is None else text[: end.start() + 1]


def describe(annotation: Any, metadata: tuple[Any, ...] = ()) -> tuple[str, str]:  # noqa: ANN401 - a type
    """Type and permitted range of an annotation with its constraints, in words."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return describe(inner[0], (*inner[1:], *metadata))
    checks = _coefficients(annotation, metadata) if annotation is float else []
    if checks:
        return "{ value, unit, source }", checks[0].range
    if origin is Literal:
        return "choice", ", ".join(toml_value(value) for value in inner)
    if origin in {Union, types.UnionType}:
        parts = [describe(one, metadata) for one in inner if one is not type(None)]
        kinds = list(dict.fromkeys(kind for kind, _ in parts))
        return " or ".join(kinds), " or ".join(dict.fromkeys(span for _, span in parts if span))
    if origin in {tuple, list}:
        return _list_words(inner, metadata)
    if origin is dict or annotation is dict:
        return "table", ""
    word = _WORDS.get(annotation, getattr(annotation, "__name__", str(annotation)))
    return word, _range(annotation, metadata)


def _list_words(inner: tuple[Any, ...], metadata: tuple[Any, ...]) -> tuple[str, str]:
    count = "list" if len(inner) == 1 or inner[-1] is Ellipsis else str(len(inner))
    word, span = describe(inner[0])
    plural = {"text": "texts", "choice": "choices", "true or false": "true or false"}.get(
        word, re.sub("number$", "numbers", word)
    )
    plural = re.sub("^3 numbers$", "lists of 3 numbers", plural)
    least = next((one.min_length for one in metadata if isinstance(one, annotated_types.MinLen)), 0)
    each = span if span.startswith("each") or span == "any" else f"each {span}"
    words = ", ".join(filter(None, (f"{least} or more" if least else "", each)))
    return (f"list of {plural}" if count == "list" else f"{count} {plural}"), words


def _range(annotation: Any, metadata: tuple[Any, ...]) -> str:  # noqa: ANN401 - a type
    """The bounds of a number, the pattern or length of a text."""
    low = high = ""
    words = []
    for one in _flat(metadata):
        if isinstance(one, annotated_types.Gt):
            low = f"> {toml_value(one.gt)}"
        elif isinstance(one, annotated_types.Ge):
            low = f"≥ {toml_value(one.ge)}"
        elif isinstance(one, annotated_types.Lt):
            high = f"< {toml_value(one.lt)}"
        elif isinstance(one, annotated_types.Le):
            high = f"≤ {toml_value(one.le)}"
        elif getattr(one, "pattern", None):
            words.append(f"matches {one.pattern}")
        elif isinstance(one, annotated_types.MinLen):
            words.append("not empty")
    bounds = ", ".join(filter(None, (low, high)))
    if annotation in _NUMBERS and not bounds:
        return "finite" if annotation is float else "whole"
    return ", ".join(filter(None, (bounds, *words))) or ("any" if annotation in {str, Path, Any} else "")


def _flat(metadata: tuple[Any, ...]) -> Iterator[Any]:
    for one in metadata:
        if isinstance(one, FieldInfo):
            yield from _flat(tuple(one.metadata))
        else:
            yield one
