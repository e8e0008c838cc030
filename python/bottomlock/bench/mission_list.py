"""The list of missions: factors and split of each, and what is fixed for each level of a factor (missions.toml)."""

from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

from bottomlock.config.toml_file import parse_toml
from bottomlock.errors import DataError

SPLITS = ("train", "validation", "test")
FACTORS = ("vehicle", "imu", "seabed", "current", "dvl", "loss", "noise")
"""What a name states of a mission, in this order, before path and duration."""


@dataclass(frozen=True)
class MissionSpec:
    """A mission of the list: its split, the level of each factor, the kind of its path, and its duration."""

    split: str
    vehicle: str
    imu: str
    seabed: str
    current: str
    dvl: str
    loss: str
    noise: str
    path: str
    duration_s: float

    @property
    def name(self) -> str:
        """The factors' levels, the path and the duration.

        >>> mission_list()[1].name
        'tauv-mems-rough-none-janus30-recorded-student_t3-lawn-250s'
        """
        levels = [str(getattr(self, factor)) for factor in FACTORS]
        return "-".join([*levels, self.path, f"{self.duration_s:g}s"])


@lru_cache(maxsize=1)
def levels() -> dict[str, Any]:
    """What is fixed for each level of a factor, by factor and level."""
    return {key: value for key, value in _content().items() if key not in {"missions", "columns", "version"}}


@lru_cache(maxsize=1)
def mission_list() -> tuple[MissionSpec, ...]:
    """Every simulated mission, in the order of the list."""
    content = _content()
    return tuple(
        MissionSpec(**dict(zip(content["columns"], row, strict=True))) for row in content["missions"]
    )


def missions_of(
    splits: tuple[str, ...] | None = None, names: tuple[str, ...] | None = None
) -> tuple[MissionSpec, ...]:
    """The missions of some splits, or of these names.

    Raises:
        DataError: for a split or a name that is not in the list.
    """
    for split in splits or ():
        if split not in SPLITS:
            raise DataError(f"no split is called '{split}' (known: {', '.join(SPLITS)})")
    known = {spec.name: spec for spec in mission_list()}
    for name in names or ():
        if name not in known:
            raise DataError(f"no mission is called '{name}'; `bottomlock bench list` lists them")
    return tuple(
        spec
        for spec in mission_list()
        if (splits is None or spec.split in splits) and (names is None or spec.name in names)
    )


@lru_cache(maxsize=1)
def recorded() -> dict[str, Any]:
    """Shape of beam noise and pattern of loss from recordings (recorded.toml)."""
    return _read("recorded.toml")


def _content() -> dict[str, Any]:
    return _read("missions.toml")


def _read(name: str) -> dict[str, Any]:
    text = (resources.files("bottomlock.bench") / name).read_text(encoding="utf-8")
    return parse_toml(text, place=f"bench/{name}")
