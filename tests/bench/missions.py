"""Short missions of the benchmark, made once for the tests of a process."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from partialdvl_bench.load import load_mission
from partialdvl_bench.make import make_missions
from partialdvl_bench.mission import Mission
from partialdvl_bench.mission_list import MissionSpec, mission_list

SEED = 4711
"""Neither the public nor the sealed one."""


def short_specs(count: int = 3, duration_s: float = 90.0) -> list[MissionSpec]:
    """The first missions of each split, shortened."""
    every = [replace(spec, duration_s=duration_s) for spec in mission_list()]
    return [
        spec
        for split in ("train", "validation", "test")
        for spec in [s for s in every if s.split == split][:count]
    ]


@cache
def made() -> Path:
    """A folder with the short missions."""
    out = Path(mkdtemp(prefix="bench"))
    make_missions(short_specs(), lambda _: SEED, out)
    return out


@cache
def missions() -> dict[str, list[Mission]]:
    """The short missions by split, with truth."""
    return {
        split: [load_mission(made() / split / s.name) for s in short_specs() if s.split == split]
        for split in ("train", "validation", "test")
    }
