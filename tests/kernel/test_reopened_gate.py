"""When the covariance is inflated after consecutive rejections, and when not."""

from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel import Method
from tests.property import settings

JANUS = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
ROBUST = bottomlock.Robust()
LEVEL = [0.0, 0.0, -settings.GRAVITY]


def navigator(fixes: int, method: Method = "lc", **other: Any) -> bottomlock.Navigator:  # noqa: ANN401 - options
    """At rest and level to a centiradian; the covariance is so small that a drift of 2 m/s each second is rejected."""
    initial: Any = settings.start()
    options = settings.options(gate="joint", inflate_after_rejections=fixes, **other)
    return bottomlock.Navigator(JANUS, settings.table_2(), options, initial, method=method)


def push_speeds(nav: bottomlock.Navigator, speeds_mps: list[float]) -> list[Any]:
    """A ping a second of a vehicle that the beams see at these speeds; the reports of the beams."""
    reports: list[Any] = []
    for k in range(10 * len(speeds_mps) + 1):
        nav.push_imu(k * 100_000_000, omega_p_radps=np.zeros(3), force_p_mps2=np.array(LEVEL))
        if k and k % 10 == 0:
            y = JANUS.beam_velocities(np.array([[speeds_mps[k // 10 - 1], 0.0, 0.0]]))[0]
            heard: Any = nav.push_beams(k * 100_000_000, y, np.ones(4, dtype=bool), sd_mps=np.full(4, 0.042))
            reports += [report for report in heard if report.sensor == "beams"]
    return reports


def test_consecutive_rejections_inflate_by_what_they_showed() -> None:
    """The third of three is tested again after the inflation, and accepted: its error is then of the order of sigma."""
    reports = push_speeds(navigator(3), [3.0] * 4)
    assert [report.verdict for report in reports] == ["rejected"] * 2 + ["accepted"] * 2
    assert [report.inflation is None for report in reports] == [True, True, False, True]
    assert [report.charged_to_sensor for report in reports] == [0.0] * 4  # beams without slow errors
    assert 0.1 < reports[2].nis / reports[2].degrees < 3.0


def test_a_fix_in_between_starts_anew() -> None:
    reports = push_speeds(navigator(3), [2.0, 4.0, 0.0, 8.0, 10.0, 0.0])
    assert [report.verdict[:3] for report in reports] == ["rej", "rej", "acc"] * 2
    assert all(report.inflation is None for report in reports)


def push_beams(wrong_mps: list[float], valid: list[bool]) -> list[Any]:
    """Twenty pings of a vehicle at rest, then twenty whose beams read `wrong_mps`; the reports of the last twenty."""
    nav = navigator(3, method="tc", robust=ROBUST)
    reports: list[Any] = []
    for k in range(401):
        nav.push_imu(k * 100_000_000, omega_p_radps=np.zeros(3), force_p_mps2=np.array(LEVEL))
        if k and k % 10 == 0:
            y = np.array(wrong_mps) if k > 200 else np.zeros(4)
            heard: Any = nav.push_beams(k * 100_000_000, y, np.array(valid), sd_mps=np.full(4, 0.042))
            reports += [report for report in heard if report.sensor == "beams"]
    assert {report.verdict for report in reports[:20]} == {"accepted"}
    return reports[20:]


@pytest.mark.parametrize(
    ("wrong_mps", "valid"),
    [
        pytest.param([2.0, 0.0, 0.0, 0.0], [True, True, True, False], id="one of three"),
        pytest.param([2.0, 0.0, 0.0, 0.0], [True, False, False, False], id="one alone"),
        pytest.param([2.0, 2.0, 0.0, 0.0], [True] * 4, id="two of four that agree"),
    ],
)
def test_a_burst_beyond_five_sigma_of_beams_that_were_accepted_does_not_get_in(
    wrong_mps: list[float], valid: list[bool]
) -> None:
    """What else explains the beams is an error of the filter that was not there at the ping before."""
    reports = push_beams(wrong_mps, valid)
    assert all(report.inflation is None for report in reports[:10])


def test_redundant_beams_that_all_disagree_overrule_the_filter() -> None:
    """Forward at 3 m/s say all four, and agree: after three of them the filter goes with them."""
    reports = push_beams(JANUS.beam_velocities(np.array([[3.0, 0.0, 0.0]]))[0].tolist(), [True] * 4)
    assert [report.inflation is None for report in reports[:3]] == [True, True, False]
