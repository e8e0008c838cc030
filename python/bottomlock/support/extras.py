"""How a library that only some need is installed with bottomlock."""


def install(extra: str) -> str:
    """The command that installs an extra; from the sources, because bottomlock is on no package index.

    >>> install("mavlink")
    "`pip install '.[mavlink]'` in the folder of bottomlock's sources"
    """
    return f"`pip install '.[{extra}]'` in the folder of bottomlock's sources"
