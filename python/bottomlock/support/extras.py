"""How a library that only some need is installed with bottomlock."""

from typing import Any


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
