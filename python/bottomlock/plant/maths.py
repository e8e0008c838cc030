"""Elementary functions on floats and on arrays: one set of equations serves one vehicle and many.

The equations of motion are written once, on components. With `SCALAR` they run on Python floats: for a single vehicle
even vectors and matrices of numpy take more than three times as long. With `ARRAY` the same lines run on arrays of
shape (runs,) or (N,), for many vehicles.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
Number = TypeVar("Number", float, FloatArray)
Three: TypeAlias = tuple[Number, Number, Number]
Four: TypeAlias = tuple[Number, Number, Number, Number]
Six: TypeAlias = tuple[Number, Number, Number, Number, Number, Number]

_FULL_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Maths(Generic[Number]):
    """Elementary functions on one number type: a float or an array; `wrap` brings an angle to [-π, π]."""

    sqrt: Callable[[Number], Number]
    sin: Callable[[Number], Number]
    cos: Callable[[Number], Number]
    asin: Callable[[Number], Number]
    atan2: Callable[[Number, Number], Number]
    tanh: Callable[[Number], Number]
    clip: Callable[[Number, float, float], Number]
    wrap: Callable[[Number], Number]


def _clip_scalar(value: float, low: float, high: float) -> float:
    return low if value < low else (min(value, high))


def _clip_array(value: FloatArray, low: float, high: float) -> FloatArray:
    return np.minimum(np.maximum(value, low), high)


def _wrap_scalar(angle: float) -> float:
    return angle - _FULL_TURN * round(angle / _FULL_TURN)


def _wrap_array(angle: FloatArray) -> FloatArray:
    return angle - _FULL_TURN * np.round(angle / _FULL_TURN)


def _atan2_array(y: FloatArray, x: FloatArray) -> FloatArray:
    angle: FloatArray = np.arctan2(y, x)
    return angle


SCALAR: Maths[float] = Maths(
    math.sqrt, math.sin, math.cos, math.asin, math.atan2, math.tanh, clip=_clip_scalar, wrap=_wrap_scalar
)
ARRAY: Maths[FloatArray] = Maths(
    np.sqrt, np.sin, np.cos, np.arcsin, _atan2_array, np.tanh, clip=_clip_array, wrap=_wrap_array
)
