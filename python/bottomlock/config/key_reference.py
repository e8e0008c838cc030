"""Every key of a settings file, from its pydantic model: type, unit, default, range, meaning and example."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import PydanticOmit

from bottomlock.config.section import unit_of
from bottomlock.config.toml_file import toml_value

REQUIRED = "required"
_WORDS = {
    "number": "number", "integer": "whole number", "boolean": "true or false", "string": "text", "any": "any value",
}  # fmt: skip
_BOUNDS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}


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
    below = {name: section_models(field.annotation) for name, field in model.model_fields.items()}
    keys = tuple(key_of(model, name) for name, inner in below.items() if not inner)
    yield KeySection(path, repeated, model, _first_sentence(model), left_out, keys)
    for name, inner in below.items():
        field = model.model_fields[name]
        for one in inner:
            key, value = kind_of(one) if len(inner) > 1 else ("", "")
            words = f"for {key} = {toml_value(value)}" if key else _left_out(field)
            inside, many = f"{path}.{name}" if path else name, is_list(field.annotation)
            yield from _sections(one, inside, repeated=many, left_out=words)


class _AsDeclared(GenerateJsonSchema):
    """A JSON schema whose keys are in the order of the models, without those that no file states: a port's geometry."""

    def sort(self, value: Any, parent_key: str | None = None) -> Any:  # noqa: ANN401, ARG002 - of pydantic
        """The schema as it is."""
        return value

    def handle_invalid_for_json_schema(self, schema: Any, error_info: str) -> Any:  # noqa: ANN401, ARG002 - of pydantic
        """Leaves it out."""
        raise PydanticOmit


@cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema(schema_generator=_AsDeclared)


def _unit_in(node: dict[str, Any]) -> str:
    """The unit that is stated of a key, or of one of its values."""
    within = (
        *node.get("anyOf", ()),
        *node.get("prefixItems", ()),
        *([node["items"]] if "items" in node else ()),
    )
    return node.get("unit") or next(filter(None, map(_unit_in, within)), "")


def key_of(model: type[BaseModel], name: str) -> Key:
    """The description of one key, from the JSON schema of its section.

    Raises:
        LookupError: for a key without a meaning or an example, or a number without a unit.
    """
    node = _schema(model)["properties"][name]
    kind, span = describe(node)
    unit = _unit_in(node) or unit_of(name)
    if "description" not in node:
        raise LookupError(f"{model.__name__}.{name} has no meaning: add a docstring below the attribute")
    if not unit and "number" in kind:
        raise LookupError(f"{model.__name__}.{name} is a number without a unit")
    default = REQUIRED
    if name not in _schema(model).get("required", ()):
        default = "none" if node.get("default", {}) is None else toml_value(node.get("default", {}))
    return Key(
        name=name,
        type=kind,
        unit=unit,
        default=default,
        range=node.get("range", span),
        meaning=" ".join(node["description"].split()),
        example=f"{name} = {toml_value(_example(name, node))}",
    )


def _example(name: str, node: dict[str, Any]) -> Any:  # noqa: ANN401 - of any key
    """The value of the example: the stated one, else the default, else the first of a choice."""
    for value in (
        *node.get("examples", ())[:1],
        node.get("default"),
        *node.get("enum", ())[:1],
        node.get("const"),
    ):
        if value not in (None, [], {}):
            return value
    raise LookupError(f"'{name}' has no example, and its default is none")


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


def is_list(annotation: Any) -> bool:  # noqa: ANN401 - a type
    """Whether a type is a list of others, or may be one."""
    if get_origin(annotation) in {tuple, list}:
        return True
    return any(is_list(inner) for inner in get_args(annotation))


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


def describe(node: dict[str, Any]) -> tuple[str, str]:
    """Type and permitted range of a key in words, from its JSON schema."""
    if "enum" in node or "const" in node:
        return "choice", ", ".join(toml_value(value) for value in node.get("enum", [node.get("const")]))
    if "anyOf" in node:
        parts = [describe(one) for one in node["anyOf"] if one != {"type": "null"}]
        kinds = dict.fromkeys(kind for kind, _ in parts)
        return " or ".join(kinds), " or ".join(dict.fromkeys(span for _, span in parts if span))
    kind = node.get("type", "any")
    if kind == "array":
        return _list_words(node)
    if kind == "object":
        names = ", ".join(node.get("properties", ()))
        return f"{{ {names} }}" if names else "table", node.get("range", "")
    return "file" if node.get("format") == "path" else _WORDS[kind], _range(kind, node)


def _list_words(node: dict[str, Any]) -> tuple[str, str]:
    each = node.get("prefixItems")
    word, span = describe(each[0] if each else node["items"])
    plural = {"text": "texts", "choice": "choices"}.get(word, re.sub("number$", "numbers", word))
    plural = re.sub("^3 numbers$", "lists of 3 numbers", plural)
    least = "" if each or "minItems" not in node else f"{node['minItems']} or more"
    spans = span if span.startswith("each") or span == "any" else f"each {span}"
    count = f"{len(each)}" if each else "list of"
    return f"{count} {plural}", ", ".join(filter(None, (least, spans)))


def _range(kind: str, node: dict[str, Any]) -> str:
    """The bounds of a number, the pattern or length of a text."""
    words = [f"{sign} {toml_value(node[key])}" for key, sign in _BOUNDS.items() if key in node]
    words += [f"matches {node['pattern']}"] if "pattern" in node else []
    words += ["not empty"] if "minLength" in node else []
    return ", ".join(words) or {"number": "finite", "integer": "whole", "boolean": ""}.get(kind, "any")
