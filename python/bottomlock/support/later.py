"""Modules that are imported at their first use: what starts in a second must not load what only tables need.

Polars takes a quarter of the start of `bottomlock live`, which reads no table. A module that needs it at times says
`from bottomlock.support.later import pl` in place of `import polars as pl`, and leaves its annotations unevaluated. So
with the rotations of scipy, which only a vehicle without inertial readings needs live.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl
    from scipy.spatial import transform

__all__ = ["pl", "transform"]


class _Later:
    """Stands for a module; the first use of a name in it imports it.

    >>> _Later("math").sqrt(4.0)
    2.0
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the module has
        return getattr(importlib.import_module(self._name), name)


if not TYPE_CHECKING:
    pl = _Later("polars")
    transform = _Later("scipy.spatial.transform")
