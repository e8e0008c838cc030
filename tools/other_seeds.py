"""A plugin of pytest that moves every seed: what the statistical tests claim must hold with other draws too.

`BOTTOMLOCK_SEEDS=1001 python -m pytest -p tools.other_seeds -m "not deep" tests/statistical`. A test that rests on its
own seed (a published cell, the largest error of some runs) may fail; a band of right code fails as often as it says.
"""

import os
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from bottomlock import kernel

MOVED_BY = int(os.environ.get("BOTTOMLOCK_SEEDS", "1"))


def _moved(function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def call(*arguments: Any, seed: int, **others: Any) -> Any:  # noqa: ANN401 - as the kernel has them
        return function(*arguments, seed=(seed + MOVED_BY) % 2**64, **others)

    return call


def _generator(seed: Any = None) -> np.random.Generator:  # noqa: ANN401 - as numpy has it
    if isinstance(seed, int | np.integer):
        return _DRAWN(int(seed) + MOVED_BY)
    return _DRAWN([*seed, MOVED_BY] if isinstance(seed, list | tuple) else seed)


_DRAWN = np.random.default_rng
np.random.default_rng = _generator
for name in ("run_batch", "simulate_sensors"):
    setattr(kernel, name, _moved(getattr(kernel, name)))
