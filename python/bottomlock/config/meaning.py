"""What each key of a settings file means: read from `meanings/`, a file a module, a table a model, an entry a key."""

from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from pydantic import BaseModel

from bottomlock.config.toml_file import parse_toml

_ROOT = "bottomlock."


@dataclass(frozen=True)
class Meaning:
    """What a key is, and what its model does not say: a unit that is not in its name, an example, a range in words."""

    text: str
    unit: str = ""
    range: str = ""
    example: Any = None


@cache
def meanings_of(module: str) -> dict[str, dict[str, Any]]:
    """The entries of a module by model and key; none for a module without a file.

    >>> meanings_of("bottomlock.config.sensors")["Heading"]["rate_hz"]
    'rate of the readings'
    """
    file = resources.files("bottomlock.config") / "meanings" / f"{module.removeprefix(_ROOT)}.toml"
    return parse_toml(file.read_text(encoding="utf-8"), place=file.name) if file.is_file() else {}


def meaning_of(model: type[BaseModel], key: str) -> Meaning:
    """The meaning of a key, of the model itself or the one that it inherits the key from.

    Raises:
        LookupError: for a key without an entry.
    """
    for one in model.__mro__:
        entry = meanings_of(one.__module__).get(one.__name__, {}).get(key)
        if entry is not None:
            return Meaning(entry) if isinstance(entry, str) else Meaning(**entry)
    raise LookupError(
        f"{model.__name__}.{key} has no meaning: add it to "
        f"config/meanings/{model.__module__.removeprefix(_ROOT)}.toml"
    )
