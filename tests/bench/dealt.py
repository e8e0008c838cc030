"""The missions of version 1.1 with slip, those of a vehicle that hovers and the test split, dealt by their rule.

The rule stands in words above their list in missions.toml.
"""

from dataclasses import replace

import numpy as np

from partialdvl_bench.mission_list import MissionSpec, missions_of
from partialdvl_bench.seeds import PUBLIC_SEED

SLIPS = tuple(f"slip_{size}cm_{time}s" for size in (5, 10, 20) for time in (5, 60))
IMU_OF = {"magnetic": "mems", "mti_ahrs": "tactical", "gyrocompass": "fibre_optic"}
SEABEDS = ("flat", "slope", "rough", "drop_off")
CURRENTS = ("none", "steady", "tidal", "sheared")
DVLS = ("janus20", "janus30", "three_beams")
LOSSES = ("schedule", "geometric", "markov", "recorded", "fish")
NOISES = ("gaussian", "student_t3", "recorded")
PATHS = ("line", "zigzag", "lawn", "box")


def dealt(draw: np.random.Generator, named: tuple[str, ...], count: int) -> list[str]:
    """Each once before any twice."""
    rounds = [draw.permutation(named) for _ in range(-(-count // len(named)))]
    return [str(one) for one in np.concatenate(rounds)[:count]]


def group(
    draw: np.random.Generator,
    count: int,
    *,
    split: str,
    slips: tuple[str, ...] = (),
    headings: tuple[str, ...] = (),
    hovers: bool = False,
    hours: int = 0,
) -> list[MissionSpec]:
    """The missions of one kind; of the public ones each third is of the validation split."""
    vehicle = ["bluerov2_heavy"] * count if hovers else dealt(draw, ("remus100", "tauv"), count)
    imu = [IMU_OF[one] for one in headings] or dealt(draw, tuple(IMU_OF.values()), count)
    seabed, dvl, noise, path = (dealt(draw, named, count) for named in (SEABEDS, DVLS, NOISES, PATHS))
    current = ["inshore"] * count if hovers else dealt(draw, CURRENTS, count)
    loss = dealt(draw, LOSSES, count)
    while ("flat", "geometric") in zip(seabed, loss, strict=True):
        loss = dealt(draw, LOSSES, count)
    path[:hours] = dealt(draw, ("box", "lawn"), hours) if hours else []
    validation = set(draw.permutation(count)[: count // 3].tolist())
    return [
        MissionSpec(
            split="test" if split == "test" else "validation" if k in validation else "train",
            vehicle=vehicle[k], imu=imu[k], seabed=seabed[k], current=current[k], dvl=dvl[k], loss=loss[k],
            noise=noise[k], path=path[k], duration_s=3600.0 if k < hours else 250.0,
            heading=headings[k] if headings else "", slip=slips[k] if slips else "", version="1.1",
        )
        for k in range(count)
    ]  # fmt: skip


def second_list() -> list[MissionSpec]:
    """The whole list, in order; a group that repeats a name is dealt again."""
    draw = np.random.default_rng([PUBLIC_SEED, 2])
    # Names of version 1, and of version 1.1 those that were there before.
    taken = {spec.name for spec in missions_of()}
    found: list[MissionSpec] = []
    for settings in (
        {"count": 6, "split": "public", "slips": SLIPS},
        {"count": 3, "split": "public", "hovers": True},
        {"count": 6, "split": "test", "hours": 2},
        {"count": 3, "split": "test", "headings": tuple(IMU_OF), "hours": 1},
        {"count": 6, "split": "test", "slips": SLIPS},
        {"count": 3, "split": "test", "hovers": True},
    ):
        while True:
            part = group(draw, **settings)  # type: ignore[arg-type]
            names = {replace(spec, version="1").name for spec in part}
            if not names & taken:
                break
        taken |= names
        found += part
    return found


def water_list() -> list[MissionSpec]:
    """The missions of version 1.2."""
    draw, count = np.random.default_rng([PUBLIC_SEED, 3]), 6
    vehicle, imu = dealt(draw, ("remus100", "tauv"), count), dealt(draw, tuple(IMU_OF.values()), count)
    seabed, current, dvl, noise, path = (
        dealt(draw, named, count) for named in (SEABEDS[:3], (*CURRENTS[1:], "turning"), DVLS, NOISES, PATHS)
    )
    validation = set(draw.permutation(count)[: count // 3].tolist())
    return [
        MissionSpec(
            split="validation" if k in validation else "train",
            vehicle=vehicle[k], imu=imu[k], seabed=seabed[k], current=current[k], dvl=dvl[k], loss="blackout",
            noise=noise[k], path=path[k], duration_s=900.0, water="water_track", version="1.2",
        )
        for k in range(count)
    ]  # fmt: skip
