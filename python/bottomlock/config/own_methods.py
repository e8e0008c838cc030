"""Methods of one's own in a scenario or a case: where they come from, and their names among the methods."""

from pathlib import Path
from typing import Any

from pydantic import BaseModel, SerializerFunctionWrapHandler, model_serializer, model_validator

from bottomlock import own_method


class OwnMethods(BaseModel):
    """`own_methods` are "module:Class" or "file.py:Class".

    `methods` may hold these too, and has the names of the classes afterwards.
    """

    own_methods: tuple[str, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _loaded(cls, data: Any) -> Any:  # noqa: ANN401 - whatever a file holds
        """Loads every method, so that a fault shows before anything runs."""
        if not isinstance(data, dict):
            return data
        own, methods = data.get("own_methods", ()), data.get("methods", ())
        lists = [part for part in (own, methods) if isinstance(part, list | tuple)]
        if len(lists) < 2 or not all(isinstance(name, str) for part in lists for name in part):
            return data
        places = list(dict.fromkeys([*own, *(name for name in methods if ":" in name)]))
        if not places:
            return data
        names = {place: own_method.load(place) for place in places}
        changed = data | {"own_methods": tuple(places)}
        if "methods" in data:
            changed["methods"] = tuple(names.get(name, name) for name in methods)
        return changed

    @model_serializer(mode="wrap")
    def _without_none(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leaves the key out where there are none."""
        dumped: dict[str, Any] = handler(self)
        return {key: value for key, value in dumped.items() if key != "own_methods" or value}


def own_methods_from(section: Any, folder: Path | None) -> None:  # noqa: ANN401 - whatever a file holds
    """Makes the files of a section's methods relative to the folder of the file that names them, in place."""
    if folder is None or not isinstance(section, dict):
        return
    for key in ("methods", "own_methods"):
        names = section.get(key)
        if isinstance(names, list):
            section[key] = [
                str(folder / name) if isinstance(name, str) and ".py:" in name else name for name in names
            ]
