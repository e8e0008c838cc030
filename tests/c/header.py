"""The C header read for ctypes: structures, constants, functions with their types. A test calls what C calls."""

import ctypes
import re
from pathlib import Path
from typing import Any

SCALARS: dict[str, Any] = {
    "double": ctypes.c_double,
    "int64_t": ctypes.c_int64,
    "uint64_t": ctypes.c_uint64,
    "uint32_t": ctypes.c_uint32,
    "uint8_t": ctypes.c_uint8,
    "size_t": ctypes.c_size_t,
    "char": ctypes.c_char,
    "void": None,
}
"""Types of C by their names; enumerations are int."""


def _without_comments(text: str) -> str:
    return re.sub(r"//[^\n]*", "", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))


class Header:
    """What `bottomlock.h` declares.

    Attributes:
        constants: numbers of `#define` and of enumerations, by name.
        structures: ctypes structures, by name.
        functions: result and argument types, by name.
    """

    def __init__(self, path: Path) -> None:
        text = _without_comments(path.read_text(encoding="utf-8"))
        defined = re.findall(r"#define (BL_\w+) (-?\d+)", text)
        defined += re.findall(r"(BL_\w+) = (\d+),", text)
        self.constants: dict[str, int] = {name: int(value) for name, value in defined}
        self.types: dict[str, Any] = dict(SCALARS)
        for name in re.findall(r"typedef enum \w* ?\{[^}]*\} (\w+);", text):
            self.types[name] = ctypes.c_int
        self.structures: dict[str, type[ctypes.Structure]] = {}
        for fields, name in re.findall(r"typedef struct \w* ?\{([^}]*)\} (\w+);", text):
            made = [self._field(line.strip()) for line in fields.split(";") if line.strip()]
            self.structures[name] = type(name, (ctypes.Structure,), {"_fields_": made})
            self.types[name] = self.structures[name]
        self.functions: dict[str, tuple[Any, list[Any]]] = {}
        for result, name, arguments in re.findall(
            r"^((?:\w+ )+\**)(bl_\w+)\(([^)]*)\);", text, flags=re.MULTILINE
        ):
            types = [self._type(one) for one in arguments.split(",") if one.strip() != "void"]
            self.functions[name] = self._type(f"{result} result"), types

    def _field(self, text: str) -> tuple[str, Any]:
        match = re.fullmatch(r"((?:\w+ )+\**)(\w+)((?:\[\w+\])*)", text)
        assert match, text
        kind: Any = self._type(f"{match[1]} {match[2]}")
        for size in reversed(re.findall(r"\[(\w+)\]", match[3])):
            kind *= self.constants.get(size) or int(size)
        return match[2], kind

    def _type(self, text: str) -> Any:  # noqa: ANN401 - types of ctypes have no common one
        """The type of an argument or result: `const double *values`."""
        words = [word for word in re.findall(r"\w+", text)[:-1] if word not in ("const", "enum", "struct")]
        if "*" not in text:
            return self.types[words[0]]
        return ctypes.c_char_p if words == ["char"] and text.count("*") == 1 else ctypes.c_void_p

    def load(self, library: Path) -> ctypes.CDLL:
        """The library with every function of the header.

        Raises:
            AttributeError: for a function that the library lacks.
        """
        loaded = ctypes.CDLL(str(library))
        for name, (result, arguments) in self.functions.items():
            function = getattr(loaded, name)
            function.restype, function.argtypes = result, arguments
        return loaded
