"""Libraries that are imported at their first use, and those that an extra installs.

What starts in a second must not load what only tables need: Polars takes a quarter of the start of `bottomlock live`,
which reads no table. A module that needs it at times says `from bottomlock.libraries import pl` in place of
`import polars as pl`, and leaves its annotations unevaluated. So with the rotations of scipy, which only a vehicle
without inertial readings needs live.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl
    from scipy.spatial import transform

__all__ = ["install", "mavlink", "pl", "transform"]


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


def install(extra: str) -> str:
    """The command that installs an extra; from the sources, because bottomlock is on no package index.

    >>> install("mavlink")
    "`pip install '.[mavlink]'` in the folder of bottomlock's sources"
    """
    return f"`pip install '.[{extra}]'` in the folder of bottomlock's sources"


def mavlink(error: type[Exception]) -> Any:  # noqa: ANN401 - the library is not typed
    """The messages of pymavlink's dialect "ardupilotmega", version 2; the error where it is not installed."""
    try:
        from pymavlink.dialects.v20 import ardupilotmega  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise error(f"MAVLink needs the library pymavlink: {install('mavlink')}") from missing
    return ardupilotmega
