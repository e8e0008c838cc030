"""What an audit tells of a mounting on dives of the plant, beside the velocity of another instrument or an IMU alone.

    python tools/audit_dives.py --seeds 2 --write docs/audit.md

The dives are flown in packaged scenarios, with their losses, outliers and noise; each defect is planted by itself. Also
counted: dives with nothing planted, and with the recordings of another dive beside them. Without `--write` it prints.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.audit.mounting import Mounting
from bottomlock.audit.robust import sigmas_for
from bottomlock.audit.run import Audit
from tools.audit_defects import audited, clock_behind, lever_arm_of, scaled, yawed
from tools.audit_worlds import World, flown
from tools.score_recorded import print_or_write

SCENARIOS = ("survey", "survey_table2", "hovering", "slope", "long_way")
"""Those whose vehicles keep three beams; the paper's three have two by design."""
BESIDE: dict[str, float | None] = {"velocity, 5 mm/s": 0.005, "velocity, 20 mm/s": 0.02, "IMU": None}
"""What stands beside the log, and an attitude with either: a velocity with this noise, or an IMU."""
KINDS = frozenset({"misalignment", "lever_arm", "velocity_scale", "clock_offset", "left_handed"})


@dataclass(frozen=True)
class Plant:
    """A defect: how it is planted, its finding, its size, and where an audit has that and its standard deviation."""

    plant: Callable[[World], World]
    kind: str
    size: float
    value: Callable[[Mounting], tuple[float, float]]


PLANTS = {
    "yaw 5°": Plant(
        lambda world: yawed(world, 5.0), "misalignment", np.deg2rad(5.0),
        lambda m: (float(m.rpy_rad[2]), float(m.misalignment_sd_rad[2])),
    ),
    "lever arm 1 m": Plant(
        lambda world: lever_arm_of(world, -1.0), "lever_arm", -1.0,
        lambda m: (float(m.lever_arm_p_m[0]), float(m.lever_arm_sd_m[0])),
    ),
    "scale 2 %": Plant(
        lambda world: scaled(world, 1.02), "velocity_scale", 0.02, lambda m: (m.scale, m.scale_sd)
    ),
    "clock 0.2 s": Plant(
        lambda world: clock_behind(world, 0.2), "clock_offset", 0.2,
        lambda m: (m.clock_offset_s, m.clock_offset_sd_s),
    ),
}  # fmt: skip


@dataclass
class Count:
    """Of the dives with a defect: how many, in how many the log shows it, and told; worst error.

    Shown is a size that is significant even where its estimate is two standard deviations too small.
    """

    dives: int = 0
    observable: int = 0
    told: int = 0
    worst: float = 0.0

    @property
    def words(self) -> str:
        """The cell of the table."""
        return f"{self.told} / {self.observable} / {self.dives}"


def dives(scenario: str, reference_sd_mps: float | None, seeds: Sequence[int]) -> Iterator[World]:
    """The logs of a cell."""
    for seed in seeds:
        yield flown(scenario, seed, reference_sd_mps=reference_sd_mps)


def add(count: Count, plant: Plant, clean: Audit, world: World) -> set[str]:
    """Plants a defect in a dive and counts what is told of it; other findings that the clean dive has not."""
    made = audited(plant.plant(world))
    kinds = {one.kind for one in made.findings}
    count.dives += 1
    count.told += plant.kind in kinds
    if made.mounting is not None and clean.mounting is not None and made.mounting.follows:
        (value, sd), (before, _) = plant.value(made.mounting), plant.value(clean.mounting)
        if abs(plant.size) > (sigmas_for(made.mounting.blocks) + 2.0) * sd:
            count.observable += 1
            count.worst = max(count.worst, abs(value - before - plant.size) / sd)
    return (kinds & KINDS) - {plant.kind} - {one.kind for one in clean.findings}


def of_another(world: World, other: World) -> World:
    """The log with what stood beside another dive."""
    return replace(world, reference=other.reference, imu=other.imu, depths=other.depths)


def table(seeds: Sequence[int]) -> str:
    """The table in Markdown, and the sentences below it."""
    lines = [
        "| Dive | Beside it | " + " | ".join(PLANTS) + " |",
        "|---|---|" + "---|" * len(PLANTS),
    ]
    flights = 0
    accused: list[str] = []
    besides: list[str] = []
    foreign: list[str] = []
    worst = dict.fromkeys(PLANTS, 0.0)
    another = {sd_mps: flown("hovering", 99, reference_sd_mps=sd_mps) for sd_mps in BESIDE.values()}
    for scenario in SCENARIOS:
        for beside, sd_mps in BESIDE.items():
            counts = {name: Count() for name in PLANTS}
            for world in dives(scenario, sd_mps, seeds):
                clean = audited(world)
                flights += 1
                accused += [one.kind for one in clean.findings if one.kind in KINDS]
                for name, plant in PLANTS.items():
                    besides += sorted(add(counts[name], plant, clean, world))
                mixed = audited(of_another(world, another[sd_mps]))
                foreign += [one.kind for one in mixed.findings if one.kind in KINDS]
            worst = {name: max(worst[name], counts[name].worst) for name in PLANTS}
            row = " | ".join(counts[name].words for name in PLANTS)
            lines.append(f"| {scenario} | {beside} | {row} |")
            print(lines[-1], file=sys.stderr, flush=True)
    largest = ", ".join(f"{name} {value:.1f}" for name, value in worst.items())
    return "\n".join(lines) + (
        f"\n\nTold / observable / dives. Of {flights} dives with nothing planted: {_listed(accused)}. Findings of the "
        f"mounting besides what was planted: {_listed(besides)}. Beside the recordings of another dive, of {flights}: "
        f"{_listed(foreign)}. Largest error of an observable size, in its standard deviations: {largest}.\n"
    )


def _listed(kinds: Sequence[str]) -> str:
    return ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds))) or "none"


def main() -> None:
    """Prints the table, or writes it between its marks in a page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2, help="dives of a cell")
    parser.add_argument("--write", type=Path, help="page to write to, between its marks")
    arguments = parser.parse_args()
    print_or_write(arguments.write, {"dives": table(range(1, arguments.seeds + 1))})


if __name__ == "__main__":
    main()
