"""Mountings on dives of the plant, beside an IMU or a velocity: what is told is right, and nothing else is told."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock.audit.mounting import Mounting
from bottomlock.audit.run import Audit
from tools.audit_defects import audited, lever_arm_of, scaled, yawed
from tools.audit_dives import BESIDE, KINDS, PLANTS, SCENARIOS, Count, add, dives, of_another
from tools.audit_worlds import World, flown

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

SEEDS = (21, 22, 23)
SOME_SEEDS = [SEEDS[0], *(pytest.param(seed, marks=pytest.mark.long) for seed in SEEDS[1:])]


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
        assert not of_mounting(audited(of_another(world, other))), seed


@pytest.mark.long
@pytest.mark.first_cases(2, later="deep")
@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_cell_of_the_table(scenario: str, beside: str) -> None:
    """What is observable is told, within four standard deviations, and alone."""
    counts: dict[str, Count] = {name: Count() for name in PLANTS}
    besides: set[str] = set()
    worlds: list[World] = list(dives(scenario, BESIDE[beside], SEEDS))
    for world in worlds:
        clean = audited(world)
        for name, plant in PLANTS.items():
            besides |= add(counts[name], plant, clean, world)
    assert not besides
    assert all(count.told >= count.observable and count.worst < 4.0 for count in counts.values()), counts
