"""A vehicle that sways, which the default prior excludes: `consistent` claims no more than the data allow.

NEES is compared with that of `tc` on the same streams, run by run, because both have the errors of attitude and start
in common; the mean difference may not exceed three of its standard errors.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.oracle import chi_squared
from tests.statistical import swaying

WANDERING = ("tactical, 20 s", "MEMS, 20 s", "tactical, 120 s", "MEMS, diagonal pair", "four beams for 60 s")
RAMPS = ("ramp", "MEMS, ramp", "ramp to the other side", "ramp after 60 s of four beams")


def check_swaying(name: str, runs: int) -> None:
    """NEES in its band or not above tc's, and no velocity RMS above tc's."""
    batch = swaying.run(name, runs)
    ours, tight = swaying.nees(batch, "consistent"), swaying.nees(batch, "tc")
    excess = ours - tight
    assert ours.mean() < chi_squared.mean_band(ours, 6)[1] or excess.mean() < 3 * excess.std(
        ddof=1
    ) / np.sqrt(runs), f"{ours.mean():.2f}, tc {tight.mean():.2f}"
    assert swaying.rms_mps(batch, "consistent") < 1.05 * swaying.rms_mps(batch, "tc")


def test_a_swaying_vehicle_in_short() -> None:
    """Six runs of one world."""
    check_swaying("tactical, 20 s", 6)


@pytest.mark.first_cases(1)
@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("name", [*WANDERING, *RAMPS])
def test_claims_no_more_than_the_data_allow(name: str) -> None:
    check_swaying(name, 30)


def test_a_published_cell_of_slip_comes_out_again() -> None:
    """The cell with the greatest NEES at one time, as the method's page has it."""
    name = "Table 2, 20 cm/s for 5 s"
    page = Path(__file__).parents[2] / "docs" / "methods" / "sway_current.md"
    (published,) = [line for line in page.read_text("utf-8").splitlines() if line.startswith(f"| {name} |")]
    flown = swaying.table(60, [name])
    numbers = [[float(number) for number in re.findall(r"\d+\.\d+", row)] for row in (published, flown)]
    assert numbers[1] == pytest.approx(numbers[0], rel=0.05)


@pytest.mark.long
@pytest.mark.statistical
@pytest.mark.slow
def test_the_gain_stays_where_the_prior_holds() -> None:
    """Slips as assumed: half of tc's velocity RMS or less, and consistent."""
    batch = swaying.run("as assumed", 30)
    assert swaying.rms_mps(batch, "sway_current") < 0.55 * swaying.rms_mps(batch, "tc")
    ours = swaying.nees(batch, "sway_current")
    assert ours.mean() < chi_squared.mean_band(ours, 6)[1]
