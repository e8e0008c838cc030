"""A grammar of values: what a valid argument becomes under attack, by what it was.

Every choice comes from the generator given, so that a case is made again from its seed.
"""

import copy
import math
import warnings
from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

import numpy as np

Path = tuple[Any, ...]


class Spoilt(NamedTuple):
    """A value in the place of a valid one.

    Attributes:
        value: what is passed instead.
        wrong: why no call may accept it; None where a call may.
    """

    value: Any
    wrong: str | None = None


NAN, INFINITY = float("nan"), float("inf")
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
TYPES = (
    "float32", "float16", "longdouble", "int64", "int8", "uint64", "complex128", "bool", "S8", "U8", "object",
    "timedelta64[ns]", "datetime64[ns]",
)  # fmt: skip
WORDS = ("", " ", "\x00", "TC", "tc ", "ünter", "x" * 5000, "[/red]", "nan", "0", "../../etc", "\U0001f41f")


class Number:
    """What is not a float and says that it is one."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __float__(self) -> float:
        return self.value


def _of_other_type(rng: Random) -> Any:  # noqa: ANN401 - anything
    return rng.choice(
        (None, "1.0", b"\x00", [], (), {}, [[]], object, Ellipsis, 1j, range(3), slice(None), {"a": 1}, [None, 1.0],
         np.datetime64("2024-01-01"), np.array("x"), np.array(None, dtype=object), lambda: 1.0)
    )  # fmt: skip


def _number(value: float, rng: Random) -> Spoilt:
    """A number that is not finite, far from the valid one, or of another type."""
    if rng.random() < 0.15:
        bad = rng.choice((NAN, INFINITY, -INFINITY))
        return Spoilt(rng.choice((bad, np.float64(bad), Number(bad))), "a number that is not finite")
    others = (
        value * 10.0 ** rng.randint(-12, 12), -value, np.float32(value), np.array(value), np.array([value]),
        Number(value), str(value), True, rng.choice((*INTEGERS, *BEYOND)), rng.choice(NUMBERS), rng.choice(NUMBERS),
        _of_other_type(rng),
    )  # fmt: skip
    return Spoilt(rng.choice(others))


def _integer(value: int, rng: Random) -> Spoilt:
    """A count, key or time: negative, beyond 64 bits, or no integer."""
    others = (
        True, float(value), NAN, INFINITY, str(value), np.uint64(2**64 - 1), np.int8(-1), _of_other_type(rng),
        value + rng.choice((-1, 1, 1000, -(10**9))), rng.choice(INTEGERS), rng.choice(INTEGERS), rng.choice(BEYOND),
    )  # fmt: skip
    return Spoilt(rng.choice(others))


def _word(value: str, rng: Random) -> Spoilt:
    """Another name, or none."""
    if rng.random() < 0.25:
        return Spoilt(_of_other_type(rng))
    return Spoilt(rng.choice((f"{value}_", value[:-1], *WORDS)), "a name that is not known")


def _stored_otherwise(array: np.ndarray[Any, Any], rng: Random) -> Any:  # noqa: ANN401 - array or list
    """Another shape, type or layout."""
    deep = array.ndim > 0
    name = rng.choice(TYPES)
    choices: tuple[Callable[[], Any], ...] = (
        lambda: array[:-1] if deep else array,
        lambda: array[..., :-1] if deep else array,
        lambda: array[None],
        lambda: array.T,
        array.ravel,
        lambda: array[:0] if deep else array,
        lambda: np.concatenate([array, array]) if deep else array,
        # Of no memory of its own; a copy of it would need terabytes.
        lambda: np.broadcast_to(np.zeros((), array.dtype), (2**40, *array.shape[1:])),
        lambda: np.broadcast_to(np.zeros((), array.dtype), (*array.shape, 0)),
        lambda: [*array.tolist(), []] if deep else [],
        lambda: np.zeros((1,) * 40, array.dtype),
        array.tolist,
        lambda: np.asfortranarray(array),
        lambda: np.repeat(array, 2, axis=0)[::2] if deep else array,
        lambda: array.astype(array.dtype.newbyteorder(">")),
        lambda: np.ma.masked_array(array, mask=rng.random() < 0.5),
        lambda: array.astype(name),
        lambda: array.astype(name),
    )
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return rng.choice(choices)()
        except (TypeError, ValueError, OverflowError):
            return array.astype(object)


def _array(array: np.ndarray[Any, Any], rng: Random) -> Spoilt:
    """Values, shape, type or storage other than those of the valid array."""
    kind = rng.randrange(8)
    if kind == 0:
        return Spoilt(_of_other_type(rng))
    if kind < 5 or not array.size:
        return Spoilt(_stored_otherwise(array, rng))
    changed = array.copy()
    flat, place = changed.reshape(-1), rng.randrange(array.size)
    with np.errstate(all="ignore"):
        if array.dtype.kind == "f" and kind == 5:
            flat *= rng.choice((-1.0, 0.0, 10.0 ** rng.randint(-12, 12), 1e150, 1e300))
        elif array.dtype.kind == "f":
            flat[place] = rng.choice((*NUMBERS, NAN, INFINITY, -INFINITY))
        elif array.dtype.kind == "i" and kind == 5:
            return Spoilt(changed.astype(np.uint64) + np.uint64(2**63), "times beyond int64")
        elif array.dtype.kind == "i":
            flat[place] = rng.choice(INTEGERS)
        else:
            flat[place] = not flat[place]
    return Spoilt(changed)


def _dict(value: dict[str, Any], rng: Random) -> Spoilt:
    """A key less, a slip in a key, or no dict at all."""
    kind = rng.randrange(3)
    if kind == 0 or not value:
        return Spoilt(_of_other_type(rng))
    key = rng.choice(list(value))
    changed = {name: one for name, one in value.items() if name != key}
    slip = key[:-2] + key[-1:] + key[-2:-1]
    if kind == 1 or slip in value:
        return Spoilt(changed)
    return Spoilt(changed | {slip: value[key]}, "an unknown key")


SPOILERS: tuple[tuple[type, Callable[[Any, Random], Spoilt]], ...] = (
    (int, _integer), (float, _number), (str, _word), (np.ndarray, _array), (dict, _dict),
)  # fmt: skip


def spoil(value: Any, rng: Random) -> Spoilt:  # noqa: ANN401 - any argument
    """What a valid value becomes."""
    if isinstance(value, bool):
        return Spoilt(rng.choice((0, 2, -1, NAN, np.True_, _of_other_type(rng))))
    if isinstance(value, list) and value and isinstance(value[0], float):
        value = np.array(value)
    if isinstance(value, list):
        return Spoilt(rng.choice((_of_other_type(rng), [], value * 2, value * 40, [*value, 1], value[:-1])))
    for kind, spoilt in SPOILERS:
        if isinstance(value, kind):
            return spoilt(value, rng)
    return Spoilt(_of_other_type(rng))


def places(value: Any, at: Path = ()) -> list[Path]:  # noqa: ANN401 - any arguments
    """Where a value may be spoilt: the arguments themselves, every dict in them and everything that a dict holds."""
    found = [at] if at else []
    if isinstance(value, dict):
        for key in value:
            found += places(value[key], (*at, key))
    if isinstance(value, list) and value and not isinstance(value[0], float):
        for k in range(len(value)):
            found += places(value[k], (*at, k))
    return found


class Arguments(NamedTuple):
    """Arguments of a call.

    Attributes:
        values: by name.
        changed: the spoilt places and what stands there.
        wrong: why the call may not be accepted, by place.
    """

    values: dict[str, Any]
    changed: tuple[tuple[str, Any], ...] = ()
    wrong: tuple[str, ...] = ()


def spoilt_arguments(arguments: dict[str, Any], rng: Random, most: int = 2) -> Arguments:
    """Arguments with one to `most` places spoilt; they share what is not spoilt."""
    chosen: list[Path] = []
    changed: list[tuple[str, Any]] = []
    wrong: list[str] = []
    out = arguments
    for _ in range(rng.randint(1, most)):
        at = rng.choice(places(arguments))
        # A place within one that is spoilt, or round it, need not be there any more.
        if any(at[: len(other)] == other[: len(at)] for other in chosen):
            continue
        chosen.append(at)
        new = spoil(_value(out, at), rng)
        out = _replaced(out, at, new.value)
        name = ".".join(map(str, at))
        changed.append((name, new.value))
        if new.wrong is not None:
            wrong.append(f"{name}: {new.wrong}")
    return Arguments(out, tuple(changed), tuple(wrong))


def _value(arguments: Any, at: Path) -> Any:  # noqa: ANN401 - any place
    for key in at:
        arguments = arguments[key]
    return arguments


def _replaced(arguments: Any, at: Path, value: Any) -> Any:  # noqa: ANN401 - any place
    if not at:
        return value
    changed = copy.copy(arguments)
    changed[at[0]] = _replaced(arguments[at[0]], at[1:], value)
    return changed
