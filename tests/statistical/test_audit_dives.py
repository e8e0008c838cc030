"""Mountings on dives of the plant, beside an IMU or a velocity: what is told is right, and nothing else is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock.audit.mounting import Mounting
from bottomlock.audit.robust import sigmas_for
from bottomlock.audit.run import Audit
from tests.audit.worlds import World, audited, clock_behind, flown, lever_arm_of, scaled, yawed

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

SEEDS = (21, 22, 23)
SOME_SEEDS = [SEEDS[0], *(pytest.param(seed, marks=pytest.mark.long) for seed in SEEDS[1:])]

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


def of_mounting(audit: Audit) -> set[str]:
    return {one.kind for one in audit.findings} & KINDS


def in_deviations(mounting: Mounting) -> NDArray[np.float64]:
    """Angles, lever arm, clock and scale of a mounting without a defect, in their standard deviations."""
    sizes = [*mounting.rpy_rad, *mounting.lever_arm_p_m, mounting.clock_offset_s, mounting.scale]
    sds = [
        *mounting.misalignment_sd_rad,
        *mounting.lever_arm_sd_m,
        mounting.clock_offset_sd_s,
        mounting.scale_sd,
    ]
    deviations: NDArray[np.float64] = np.asarray(sizes) / np.asarray(sds)
    return deviations


@pytest.mark.long
@pytest.mark.parametrize("seed", SOME_SEEDS)
def test_an_imu_alone_on_a_survey(seed: int) -> None:
    """Roll and pitch were 3 degrees and ten deviations off: the DVL's level noise passed for them."""
    world = flown("survey", seed, reference_sd_mps=None)
    clean = audited(world)
    assert not of_mounting(clean)
    assert clean.mounting is not None
    assert np.abs(in_deviations(clean.mounting)).max() < 4.0
    assert of_mounting(audited(yawed(world, 5.0))) == {"misalignment"}
    assert of_mounting(audited(lever_arm_of(world, -1.0))) == {"lever_arm"}


@pytest.mark.long
@pytest.mark.parametrize("seed", SOME_SEEDS)
def test_a_straight_course_shows_yaw_and_scale_alone(seed: int) -> None:
    """A roll of 39 +- 0.1 degrees was told of one: neither roll, lever arm nor clock changes what is read there."""
    world = flown("long_way", seed, reference_sd_mps=0.005)
    clean = audited(world)
    assert not of_mounting(clean)
    assert clean.mounting is not None
    assert clean.mounting.misalignment_sd_rad[0] > np.deg2rad(50.0)
    assert (clean.mounting.lever_arm_sd_m > 4.0).all()
    assert of_mounting(audited(yawed(world, 5.0))) == {"misalignment"}
    findings = audited(scaled(world, 1.02)).findings
    assert [one.kind for one in findings if one.severity != "note"] == ["velocity_scale"]


@pytest.mark.long
@pytest.mark.parametrize("beside", BESIDE)
def test_what_is_of_another_dive_tells_nothing(beside: str) -> None:
    for seed in SEEDS:
        world, other = (flown(name, seed, reference_sd_mps=BESIDE[beside]) for name in ("survey", "hovering"))
        foreign = replace(world, reference=other.reference, imu=other.imu, depths=other.depths)
        assert not of_mounting(audited(foreign)), seed


@pytest.mark.long
@pytest.mark.first_cases(2, later="deep")
@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_cell_of_the_table(scenario: str, beside: str) -> None:
    """What is observable is told, within four standard deviations, and alone."""
    counts: dict[str, Count] = {name: Count() for name in PLANTS}
    besides: set[str] = set()
    for seed in SEEDS:
        world = flown(scenario, seed, reference_sd_mps=BESIDE[beside])
        clean = audited(world)
        for name, plant in PLANTS.items():
            besides |= add(counts[name], plant, clean, world)
    assert not besides
    assert all(count.told >= count.observable and count.worst < 4.0 for count in counts.values()), counts
