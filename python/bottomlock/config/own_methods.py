"""Methods of one's own in a scenario or a case: where they come from, and their names among the methods."""

from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import SerializerFunctionWrapHandler, ValidationInfo, model_serializer, model_validator

from bottomlock import own_method
from bottomlock.config.section import Section, in_folder, shown
from bottomlock.kernel import METHODS
from bottomlock.own_method import known_names
from bottomlock.text import did_you_mean


class OwnMethods(Section):
    """Methods of one's own; `methods` may name or hold them too, and has their names afterwards."""

    own_methods: Annotated[tuple[str, ...], shown(example=["partial_loose.py:PartialLoose"])] = ()
    """methods of your own, as module:Class or file.py:Class; a name of this form among the methods is put here by
    itself"""

    @model_validator(mode="before")
    @classmethod
    def _loaded(cls, data: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - whatever a file holds
        """Loads every method, so that a fault shows before anything runs; files from the folder of the settings."""
        if not isinstance(data, dict):
            return data
        own, methods = data.get("own_methods", ()), data.get("methods", ())
        if not isinstance(own, list | tuple) or not isinstance(methods, list | tuple):
            return data
        are_methods = all(isinstance(one, str) or own_method.is_method(one) for one in methods)
        if not are_methods or not all(isinstance(place, str) for place in own):
            return data
        own, methods = ([_found(one, info) for one in named] for named in (own, methods))
        names = [own_method.name_of(method) for method in methods]
        there = {own_method.load(place) for place in own}
        others = [own_method.place_of(name) for name in names if name not in there]
        places = [*own, *(place for place in others if place is not None)]
        changed = data | ({"own_methods": tuple(dict.fromkeys(places))} if places else {})
        if "methods" in data:
            changed["methods"] = tuple(names)
        return changed

    @model_serializer(mode="wrap")
    def _without_none(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leaves the key out where there are none."""
        dumped: dict[str, Any] = handler(self)
        return {key: value for key, value in dumped.items() if key != "own_methods" or value}


def _found(method: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - a name, a place or a class
    return in_folder(method, info) if isinstance(method, str) and ".py:" in method else method


def check_methods(methods: Iterable[str]) -> None:
    """Rejects unknown and repeated methods and an empty list.

    Raises:
        ValueError: naming the known methods.
    """
    seen: set[str] = set()
    for method in methods:
        if method not in known_names():
            hint = did_you_mean(method, known_names())
            raise ValueError(
                f"unknown method '{method}'{hint} (known: {', '.join(known_names())}; your own: MODULE:CLASS)"
            )
        if method in seen:
            raise ValueError(f"method '{method}' is named twice")
        seen.add(method)
    if not seen:
        raise ValueError(f"no method is named, expected one or more of {', '.join(METHODS)}")


def known_methods(methods: Any) -> Any:  # noqa: ANN401 - what a file or a call names
    """The methods, if they are a list of texts that `check_methods` accepts."""
    if isinstance(methods, list | tuple) and all(isinstance(method, str) for method in methods):
        check_methods(methods)
    return methods
