"""What a valid value becomes under attack, by what it was."""

import copy
import math
import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

Path = tuple[Any, ...]


class Spoilt(NamedTuple):
    """A value in the place of a valid one, and why no call may accept it; None where a call may."""

    value: Any
    wrong: str | None = None


NOT_FINITE = (float("nan"), float("inf"), float("-inf"))
NUMBERS = (
    0.0, -0.0, 5e-324, 1e-308, 1e-30, -1e-9, 1e-6, -1.0, 1.0, math.pi / 2, -math.pi / 2, 20.0, 90.0, 300.0, 1e6, -1e6,
    1e9, 1e12, 1e30, 1e100, 1e150, -1e150, 1e154, 1e200, 1e300, 1.7976931348623157e308, -1e308, 2.0**53, 2.0**63,
    2.0**64,
)  # fmt: skip
INTEGERS = (
    0, 1, -1, 2, 3, 255, 256, 30_000, 2**31 - 1, 2**31, -(2**31), 2**32, 2**40, 2**53 + 1, 2**62, -(2**62), 2**63 - 1,
    -(2**63),
)  # fmt: skip
BEYOND = (2**63, -(2**63) - 1, 2**64 - 1, 2**64, 10**30)
FACTORS = (-1.0, 0.0, 1e-12, 1e-6, 1e-3, 1e3, 1e6, 1e12, 1e150, 1e300)
TYPES = (
    "float32", "float16", "int64", "int8", "uint64", "complex128", "bool", "S8", "U8", "object",
    "timedelta64[ns]", "datetime64[ns]", "longdouble",
)  # fmt: skip
WORDS = ("", " ", "\x00", "TC", "tc ", "ünter", "x" * 5000, "[/red]", "nan", "0", "../../etc", "\U0001f41f")


class Number:
    """What is not a float and says that it is one."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __float__(self) -> float:
        return self.value


OTHERS: tuple[Any, ...] = (
    None, "1.0", b"\x00", [], (), {}, [[]], object, Ellipsis, 1j, range(3), slice(None), {"a": 1}, [None, 1.0],
    np.datetime64("2024-01-01"), np.array("x"), np.array(None, dtype=object), abs,
)  # fmt: skip
"""Of other types than any argument."""


def _number(value: float) -> Iterator[Spoilt]:
    """A number that is not finite, far from the valid one, or of another type."""
    for bad in NOT_FINITE:
        yield from (Spoilt(one, "a number that is not finite") for one in (bad, np.float64(bad), Number(bad)))
    same = (np.float32(value), np.array(value), np.array([value]), Number(value), str(value), True)
    yield from map(Spoilt, (*same, *(value * one for one in FACTORS), *NUMBERS, *INTEGERS, *BEYOND))


def _integer(value: int) -> Iterator[Spoilt]:
    """A count, key or time: negative, beyond 64 bits, or no integer."""
    near = (value - 1, value + 1, value + 1000, value - 10**9)
    other = (True, float(value), *NOT_FINITE, str(value), np.uint64(2**64 - 1), np.int8(-1))
    yield from map(Spoilt, (*near, *other, *INTEGERS, *BEYOND))


def _word(value: str) -> Iterator[Spoilt]:
    """Another name."""
    yield from (Spoilt(one, "a name that is not known") for one in (f"{value}_", value[:-1], *WORDS))


def _array(array: np.ndarray[Any, Any]) -> Iterator[Spoilt]:
    """Values, shape, type or storage other than those of the valid array."""
    deep = array.ndim > 0
    forms: list[Callable[[], Any]] = [
        lambda: array[None], lambda: array.T, array.ravel, array.tolist, lambda: np.asfortranarray(array),
        # Of no memory of its own; a copy of it would need terabytes.
        lambda: np.broadcast_to(np.zeros((), array.dtype), (2**40, *array.shape[1:])),
        lambda: np.broadcast_to(np.zeros((), array.dtype), (*array.shape, 0)),
        lambda: np.zeros((1,) * 40, array.dtype), lambda: array.astype(array.dtype.newbyteorder(">")),
        lambda: np.ma.masked_array(array, mask=True), lambda: np.ma.masked_array(array, mask=False),
        *((lambda name=name: array.astype(name)) for name in TYPES),
    ]  # fmt: skip
    if deep:
        forms += [
            lambda: array[:-1], lambda: array[..., :-1], lambda: array[:0], lambda: np.concatenate([array, array]),
            lambda: [*array.tolist(), []], lambda: np.repeat(array, 2, axis=0)[::2],
        ]  # fmt: skip
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for form in forms:
            try:
                yield Spoilt(form())
            except (TypeError, ValueError, OverflowError):
                continue
        if not array.size:
            return
        if array.dtype.kind == "f":
            yield from (Spoilt(array * factor) for factor in FACTORS)
        if array.dtype.kind == "i":
            yield Spoilt(array.astype(np.uint64) + np.uint64(2**63), "times beyond int64")
        entries = {"f": (*NUMBERS, *NOT_FINITE), "i": INTEGERS, "b": (True, False)}.get(array.dtype.kind, ())
        for entry in entries:
            changed = array.copy()
            changed.reshape(-1)[array.size // 2] = entry
            yield Spoilt(changed)


def _dict(value: dict[str, Any]) -> Iterator[Spoilt]:
    """A key less, or a slip in a key."""
    for key, kept in value.items():
        fewer = {name: one for name, one in value.items() if name != key}
        yield Spoilt(fewer)
        slip = key[:-2] + key[-1:] + key[-2:-1]
        if slip not in value:
            yield Spoilt(fewer | {slip: kept}, "an unknown key")


def _flag(_: bool) -> Iterator[Spoilt]:
    yield from map(Spoilt, (0, 2, -1, float("nan"), np.True_))


def _list(value: list[Any]) -> Iterator[Spoilt]:
    yield from map(Spoilt, ([], value * 2, value * 40, [*value, 1], value[:-1]))


SPOILERS: tuple[tuple[type, Callable[[Any], Iterator[Spoilt]]], ...] = (
    (bool, _flag), (int, _integer), (float, _number), (str, _word), (np.ndarray, _array), (dict, _dict), (list, _list),
)  # fmt: skip


def spoilt(value: Any) -> Iterator[Spoilt]:  # noqa: ANN401 - any argument
    """All that a valid value may become."""
    if isinstance(value, list) and value and isinstance(value[0], float):
        value = np.array(value)
    yield from map(Spoilt, OTHERS)
    for kind, spoil in SPOILERS:
        if isinstance(value, kind):
            yield from spoil(value)
            return


def places(value: Any, at: Path = ()) -> Iterator[Path]:  # noqa: ANN401 - any arguments
    """Where a value may be spoilt: the arguments themselves, every dict in them and everything that a dict holds."""
    if at:
        yield at
    if isinstance(value, dict):
        for key in value:
            yield from places(value[key], (*at, key))
    if isinstance(value, list) and value and not isinstance(value[0], float):
        for k in range(len(value)):
            yield from places(value[k], (*at, k))


def value_at(arguments: Any, at: Path) -> Any:  # noqa: ANN401 - any place
    """The value at a place."""
    for key in at:
        arguments = arguments[key]
    return arguments


def replaced(arguments: Any, at: Path, value: Any) -> Any:  # noqa: ANN401 - any place
    """The arguments with another value at a place; they share what is not spoilt."""
    if not at:
        return value
    changed = copy.copy(arguments)
    changed[at[0]] = replaced(arguments[at[0]], at[1:], value)
    return changed
