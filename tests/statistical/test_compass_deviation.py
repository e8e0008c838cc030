"""A compass that deviates with heading leads no filter astray: its readings are charged to the compass."""

from dataclasses import replace

import numpy as np
import pytest

from bottomlock.kernel.models import MagnetometerModel
from bottomlock.statistics.chi_squared import mean_band
from tests.statistical.compass_worlds import (
    CLAIMED,
    DEGREE,
    SURPRISED,
    WHITE,
    WORLDS,
    World,
    filtered,
    readings,
    reckoned,
)  # fmt: skip

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

RUNS, PAIRS, QUARTERS = 5, 8, 16
MAGNETIC = WHITE.replace(yaw_offset_sd_rad=2.0 * DEGREE, yaw_walk_sd_rad=1.0 * DEGREE, walk_time_s=120.0)
GYROCOMPASS = MagnetometerModel(yaw_sd_rad=0.1 * DEGREE, roll_pitch_sd_rad=0.1 * DEGREE)


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("claimed", [CLAIMED, SURPRISED], ids=["claimed", "surprised"])
@pytest.mark.parametrize(
    "name", ["whole, beams 1234, 1 Hz", "whole, beams 12, 1 Hz", "whole, beams 1234, 5 Hz"]
)
def test_a_compass_that_deviates_is_no_evidence_against_the_filter(
    name: str, claimed: MagnetometerModel
) -> None:
    """At the end at most a fifth worse than without inflation, as consistent, and better than dead reckoning.

    With all of it charged to the heading the position was 35 m off at a claimed 5 m; dead reckoning is 45 m off. With
    the deviation claimed NEES is in its band, with a false-alarm rate of 1e-3. Of 12 runs with each of three seeds the
    ratio is 1.05 to 1.17; of five it is 1.02 to 1.38.
    """
    runs = [readings(WORLDS[name], run, claimed) for run in range(PAIRS)]
    ours, never = ([filtered(read, "tc", after) for read in runs] for after in (5, 0))
    error_m, never_m = (np.mean([one.error_m for one in tracks]) for tracks in (ours, never))
    nees, never_nees = (np.mean([one.nees for one in tracks]) for tracks in (ours, never))
    assert error_m < 1.2 * never_m, (error_m, never_m)
    assert nees < (mean_band(2.0, PAIRS, 0.998)[1] if claimed == CLAIMED else 1.3 * never_nees), (
        nees,
        never_nees,
    )
    if len(WORLDS[name].beams) > 2:
        assert all(one.error_m < reckoned(read).error_m for one, read in zip(ours, runs, strict=True))


@pytest.mark.long
@pytest.mark.parametrize("name", WORLDS)
def test_a_deviation_whatever_the_heading_of_the_first_leg(name: str) -> None:
    """Started from the compass, as a replay starts, with first legs to the four quarters by turns.

    The compass is wrong by up to 4.5°, 2.3 times what its grade claims of a reading, and by 2.4° RMS over the headings,
    1.2 times: NEES may be 1.28 times its band, 5.0 (4.0 of 40 runs), a false alarm of one world in a thousand where it
    is 2.5, as seen. With another seed it was 4.1 where the start was 4.5° off. Run 0 is rare: it has 10 to 16 with a
    compass as claimed, too.
    """
    tracks = []
    for run in range(QUARTERS):
        read = readings(replace(WORLDS[name], heading_deg=90.0 * (run % 4), from_compass=True), run)
        tracks.append([filtered(read, "tc", 5), filtered(read, "tc", 0), reckoned(read)])
    ours, never, floor = (np.mean([one.error_m for one in each]) for each in zip(*tracks, strict=True))
    assert ours < 1.2 * never, (ours, never)
    assert ours < floor, (ours, floor)
    assert np.mean([one.nees for one, _, _ in tracks]) < 1.28 * mean_band(2.0, QUARTERS, 0.998)[1]


@pytest.mark.long
@pytest.mark.parametrize("path", ["lawn_mower", "straight"])
@pytest.mark.parametrize("hz", [1.0, 5.0])
def test_a_magnetic_reference_that_is_taken_for_a_gyrocompass(path: str, hz: float) -> None:
    """An offset of 2° and a walk of 1° over two minutes, claimed as 0.1° of white noise, for 25 minutes.

    At the end never more than three times as far off as dead reckoning is, or says that it may be; with every
    contradiction charged to the heading the position was 6 to 14 km off.
    """
    world = World(
        attitude_hz=hz,
        errors=MAGNETIC,
        path=path,
        duration_s=1500.0,
        semicircular_deg=0.0,
        quadrantal_deg=0.0,
    )
    for run in range(RUNS):
        read = readings(world, run, GYROCOMPASS)
        error_m, floor = filtered(read, "tc", 5).error_m, reckoned(read)
        assert error_m < 3.0 * max(floor.error_m, floor.sd_m), (run, error_m, floor)
