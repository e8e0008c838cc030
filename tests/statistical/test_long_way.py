"""50 km on the ellipsoid with a fibre-optic INS: the filter claims what it achieves, far from its origin.

Constant heading and depth at 5 m/s (`long_way`), four beams and depth. Seed, runs, latitudes and headings were fixed
before the first run. Means over time and runs have a band from the spread between runs; each test judges nine errors
and the NEES.
"""

from __future__ import annotations

import pytest

from tests.oracle import chi_squared
from tools.long_way import HEADINGS_DEG, LATITUDES_DEG, PAGE, RUNS, fly, row
from tools.score_recorded import marked, same_numbers

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

FAST = [(85.0, 90.0)]
WAYS = [(latitude, heading) for latitude in LATITUDES_DEG for heading in HEADINGS_DEG]


@pytest.mark.long
@pytest.mark.parametrize(
    ("latitude_deg", "heading_deg"),
    [way if way in FAST else pytest.param(*way, marks=pytest.mark.long) for way in WAYS],
)
def test_claims_hold_after_fifty_kilometres(latitude_deg: float, heading_deg: float) -> None:
    """NEES of velocity and attitude in its band; no error of position, misalignment or velocity beyond its claim.

    Band of NEES at 99.8 %, of each error above at 99.9 %.
    """
    batch = fly(latitude_deg, heading_deg, RUNS)
    nees = batch["nees_velocity_attitude"][:, 0]
    low, high = chi_squared.mean_band(nees.mean(axis=1), 6, 0.998)
    assert low < nees.mean() < high
    squares = (batch["error"][:, 0] / batch["sd"][:, 0])[..., :9] ** 2
    for state in range(9):
        most = chi_squared.mean_band(squares[..., state].mean(axis=1), 1.0, 0.998)[1]
        assert squares[..., state].mean() < most, f"state {state}"


def test_the_plane_of_the_paper_does_not_hold() -> None:
    """The same readings in a filter on the tangent plane: what this is for."""
    batch = fly(45.0, 0.0, 4, "tangent_plane")
    assert batch["nees_velocity_attitude"][:, 0, -1].min() > 50.0


@pytest.mark.long
def test_the_page_has_these_numbers() -> None:
    """One row of the page's table again."""
    page = marked(PAGE.read_text(encoding="utf-8"), "long-way").group(2)
    (there,) = [line for line in page.splitlines() if line.startswith("| 45° | 0° |")]
    assert same_numbers(there, "| " + " | ".join(row(45.0, 0.0)) + " |")
