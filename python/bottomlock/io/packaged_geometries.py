"""Names of the packaged DVL geometries."""

from importlib import resources


def packaged_geometries() -> list[str]:
    """Names of the packaged geometries, sorted.

    >>> "waterlinked_a50" in packaged_geometries()
    True
    """
    folder = resources.files("bottomlock.config") / "geometries"
    return sorted(one.name.removesuffix(".toml") for one in folder.iterdir() if one.name.endswith(".toml"))
