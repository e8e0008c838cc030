"""Sphinx extension: signatures on the page of the Python API, with the types as the sources write them.

Those of the compiled kernel are read from its stub; a class of fields is shown with its fields.
"""

import ast
import copy
import dataclasses
import inspect
import textwrap
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

import bottomlock

Function = ast.FunctionDef
Signature = tuple[str, str]
"""Parameters in brackets, and the type of what is returned, empty for none."""


@cache
def stub() -> dict[str, Function]:
    """Functions of the compiled kernel by name, methods and properties by "Class.name"."""
    text = (Path(bottomlock.__file__).parent / "_kernel.pyi").read_text(encoding="utf-8")
    body = ast.parse(text).body
    found = {node.name: node for node in body if isinstance(node, Function)}
    for owner in body:
        if isinstance(owner, ast.ClassDef):
            methods = [node for node in owner.body if isinstance(node, Function)]
            found |= {f"{owner.name}.{node.name}": node for node in methods}
    return found


def words(annotation: ast.expr | None) -> str:
    """An annotation, without the quotes of one that is read late."""
    if annotation is None:
        return ""
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        return annotation.value
    return ast.unparse(annotation)


def of_function(node: Function, *, method: bool) -> Signature:
    """Parameters, without the object or class of a method, and what is returned."""
    arguments = copy.deepcopy(node.args)
    for one in (*arguments.args, *arguments.kwonlyargs):
        one.annotation = None if one.annotation is None else ast.Name(words(one.annotation))
    static = any(isinstance(one, ast.Name) and one.id == "staticmethod" for one in node.decorator_list)
    if method and not static:
        del arguments.args[0]
    return f"({ast.unparse(arguments)})", words(node.returns)


def of_python(function: Any, *, method: bool) -> Signature:  # noqa: ANN401 - any function
    """The signature of a function by its text."""
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(function)))).body
    assert isinstance(node, Function)
    return of_function(node, method=method)


def of_fields(cls: Any) -> Signature:  # noqa: ANN401 - a dataclass
    """The fields of a dataclass as parameters, inherited ones too, with the values of their defaults."""
    stated: dict[str, str] = {}
    bases: list[Any] = [base for base in reversed(cls.__mro__) if dataclasses.is_dataclass(base)]
    for base in bases:
        (node,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        assert isinstance(node, ast.ClassDef)
        stated |= {
            str(part.target.id): words(part.annotation)
            for part in node.body
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
        }
    fields = dataclasses.fields(cls)
    parts = ["*"] if any(field.kw_only for field in fields) else []
    for field in fields:
        if not field.name.startswith("_"):
            default = "" if field.default is dataclasses.MISSING else f" = {field.default!r}"
            parts.append(f"{field.name}: {stated[field.name]}{default}")
    return f"({', '.join(parts)})", ""


def signature_of(what: str, documented: Any) -> Signature | None:  # noqa: ANN401 - whatever is documented
    """Parameters and result of what is documented; None to leave it as it is.

    Raises:
        KeyError: for a part of the kernel that its stub lacks.
    """
    method = what == "method"
    if inspect.isclass(documented):
        if documented.__module__ == "bottomlock._kernel":
            return of_function(stub()[f"{documented.__name__}.__new__"], method=True)[0], ""
        if issubclass(documented, BaseModel):
            # Its keys have a page of their own.
            return "", ""
        return of_fields(documented) if dataclasses.is_dataclass(documented) else None
    if inspect.isfunction(documented) or inspect.ismethod(documented):
        return of_python(documented, method=method)
    return of_function(stub()[documented.__qualname__], method=method) if callable(documented) else None


def type_of_property(documented: Any) -> str | None:  # noqa: ANN401 - whatever is documented
    """The type of a property of the kernel's classes; None for all else."""
    if not inspect.isgetsetdescriptor(documented):
        return None
    return words(stub()[documented.__qualname__].returns)


def setup(app: Any) -> dict[str, bool]:  # noqa: ANN401 - Sphinx's application
    """Connects both to autodoc."""

    def write_signature(_app: Any, what: str, _name: str, documented: Any, *_: Any) -> Signature | None:  # noqa: ANN401
        return signature_of(what, documented)

    def write_type(_app: Any, _what: str, _name: str, documented: Any, _: Any, lines: list[str]) -> None:  # noqa: ANN401
        kind = type_of_property(documented)
        if kind is not None:
            lines += ["", f":type: `{kind}`"]

    app.connect("autodoc-process-signature", write_signature)
    app.connect("autodoc-process-docstring", write_type)
    return {"parallel_read_safe": True}
