"""One set of equations for one vehicle (plain floats) and for many (arrays).

The equations of motion are written once, on components. With `SCALAR` they run on Python floats, which is
four to six times faster than numpy for a single vehicle; with `ARRAY` the same lines run on arrays of shape
(runs,) or (N,).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
Lane = TypeVar("Lane", float, FloatArray)

_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Maths(Generic[Lane]):
    """Elementary functions on one lane type: a float or an array."""

    sqrt: Callable[[Lane], Lane]
    sin: Callable[[Lane], Lane]
    cos: Callable[[Lane], Lane]
    asin: Callable[[Lane], Lane]
    atan2: Callable[[Lane, Lane], Lane]
    tanh: Callable[[Lane], Lane]
    clip: Callable[[Lane, float, float], Lane]
    wrap: Callable[[Lane], Lane]


def _clip_scalar(value: float, low: float, high: float) -> float:
    return low if value < low else (min(value, high))


def _clip_array(value: FloatArray, low: float, high: float) -> FloatArray:
    return np.minimum(np.maximum(value, low), high)


def _wrap_scalar(angle: float) -> float:
    return angle - _TURN * round(angle / _TURN)


def _wrap_array(angle: FloatArray) -> FloatArray:
    return angle - _TURN * np.round(angle / _TURN)


def _atan2_array(y: FloatArray, x: FloatArray) -> FloatArray:
    angle: FloatArray = np.arctan2(y, x)
    return angle


SCALAR: Maths[float] = Maths(
    sqrt=math.sqrt,
    sin=math.sin,
    cos=math.cos,
    asin=math.asin,
    atan2=math.atan2,
    tanh=math.tanh,
    clip=_clip_scalar,
    wrap=_wrap_scalar,
)
ARRAY: Maths[FloatArray] = Maths(
    sqrt=np.sqrt,
    sin=np.sin,
    cos=np.cos,
    asin=np.arcsin,
    atan2=_atan2_array,
    tanh=np.tanh,
    clip=_clip_array,
    wrap=_wrap_array,
)
