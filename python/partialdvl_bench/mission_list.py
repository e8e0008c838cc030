"""The list of missions: factors and split of each, and what is fixed for each level of a factor (missions.toml)."""

from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

from bottomlock import DataError
from bottomlock.config.toml_file import parse_toml
from bottomlock.support.nearest import did_you_mean

SPLITS = ("train", "validation", "test")
FACTORS = ("vehicle", "imu", "heading", "slip", "seabed", "current", "dvl", "loss", "noise", "water")
"""What a name states of a mission, in this order, before path and duration; heading, slip and water where not empty."""


@dataclass(frozen=True)
class MissionSpec:
    """A mission of the list: its split, the level of each factor, the kind of its path, and its duration.

    Since version 1.1 `heading` is a heading reference with slow errors, empty where the heading sensor is the IMU's,
    and `slip` the sway through the water that is added to the vehicle's own, empty for none. Since version 1.2 `water`
    is the DVL's water track, empty where it has none.
    """

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
    heading: str = ""
    slip: str = ""
    water: str = ""
    version: str = "1"

    @property
    def name(self) -> str:
        """The factors' levels, the path and the duration.

        >>> mission_list()[1].name
        'tauv-mems-rough-none-janus30-recorded-student_t3-lawn-250s'
        """
        levels = [level for factor in FACTORS if (level := str(getattr(self, factor)))]
        return "-".join([*levels, self.path, f"{self.duration_s:g}s"])


@lru_cache(maxsize=1)
def levels() -> dict[str, Any]:
    """What is fixed for each level of a factor, by factor and level."""
    return {factor: _content()[factor] for factor in (*FACTORS, "limits")}


@lru_cache(maxsize=1)
def mission_list() -> tuple[MissionSpec, ...]:
    """Every simulated mission of every version, in the order of the list."""
    content = _content()
    return tuple(
        MissionSpec(version=f"{part['version']:g}", **dict(zip(part["columns"], row, strict=True)))
        for part in (content, *content["later"])
        for row in part["missions"]
    )


def missions_of(
    splits: tuple[str, ...] | None = None, names: tuple[str, ...] | None = None, version: str = "1"
) -> tuple[MissionSpec, ...]:
    """The missions of a version, or those of these names, in some splits.

    Raises:
        DataError: for a split, a version or a name that is not in the list, and where no mission is left.
    """
    versions = list(dict.fromkeys(spec.version for spec in mission_list()))
    if version not in versions:
        raise DataError(f"no version is called '{version}' (known: {', '.join(versions)})")
    for split in splits or ():
        if split not in SPLITS:
            hint = did_you_mean(split, SPLITS)
            raise DataError(f"no split is called '{split}'{hint} (known: {', '.join(SPLITS)})")
    known = {spec.name: spec for spec in mission_list()}
    for name in names or ():
        if name not in known:
            hint = did_you_mean(name, known, ";")
            raise DataError(f"no mission is called '{name}'{hint} `bottomlock bench list` lists them")
    chosen = tuple(
        spec
        for spec in mission_list()
        if (splits is None or spec.split in splits)
        and (spec.version == version if names is None else spec.name in names)
    )
    if not chosen:
        of = f"of version {version}" if names is None else "of these"
        raise DataError(
            f"no mission {of} is in the split {' or '.join(splits or SPLITS)}; `bottomlock bench list` lists them"
        )
    return chosen


@lru_cache(maxsize=1)
def recorded() -> dict[str, Any]:
    """Shape of beam noise and pattern of loss from recordings (recorded.toml)."""
    return _read("recorded.toml")


def _content() -> dict[str, Any]:
    return _read("missions.toml")


def _read(name: str) -> dict[str, Any]:
    text = (resources.files("partialdvl_bench") / name).read_text(encoding="utf-8")
    return parse_toml(text, place=f"partialdvl_bench/{name}")
