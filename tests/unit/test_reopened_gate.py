"""When the covariance is inflated after consecutive rejections, and when not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel import Method
from tests.property import settings

JANUS = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
LEVEL = [0.0, 0.0, -settings.GRAVITY]
AWAY_MPS = [2.0 * second for second in range(1, 13)]


def navigator(fixes: int, method: Method = "lc") -> bottomlock.Navigator:
    """At rest and level to a centiradian; the covariance is so small that a drift of 2 m/s each second is rejected."""
    initial: Any = {
        "time_ns": 0,
        "position_t_m": np.zeros(3),
        "attitude_t_p": np.array([1.0, 0.0, 0.0, 0.0]),
        "velocity_p_mps": np.zeros(3),
    }
    options = settings.options(gate="joint", inflate_after_rejections=fixes)
    return bottomlock.Navigator(JANUS, settings.table_2(), options, initial, method=method)


def push_speeds(
    nav: bottomlock.Navigator, speeds_mps: list[float], beam_4_mps: float = 0.0
) -> list[dict[str, Any]]:
    """A ping a second of a vehicle that the beams see at these speeds; the reports of the beams."""
    reports: list[dict[str, Any]] = []
    for k in range(10 * len(speeds_mps) + 1):
        nav.push_imu(k * 100_000_000, omega_p_radps=np.zeros(3), force_p_mps2=np.array(LEVEL))
        if k and k % 10 == 0:
            y = JANUS.beam_velocities(np.array([[speeds_mps[k // 10 - 1], 0.0, 0.0]]))[0]
            y[3] += beam_4_mps
            heard: Any = nav.push_beams(k * 100_000_000, y, np.ones(4, dtype=bool), sd_mps=np.full(4, 0.042))
            reports += [report for report in heard if report["sensor"] == "beams"]
    return reports


def test_consecutive_rejections_inflate_by_what_they_showed() -> None:
    """The third of three is tested again after the inflation, and accepted: its error is then of the order of sigma."""
    reports = push_speeds(navigator(3), [3.0] * 4)
    assert [report["verdict"] for report in reports] == ["rejected"] * 2 + ["accepted"] * 2
    assert [report["inflation"] is None for report in reports] == [True, True, False, True]
    assert 0.1 < reports[2]["nis"] / reports[2]["degrees"] < 3.0


def test_a_fix_in_between_starts_anew() -> None:
    reports = push_speeds(navigator(3), [2.0, 4.0, 0.0, 8.0, 10.0, 0.0])
    assert [report["verdict"][:3] for report in reports] == ["rej", "rej", "acc"] * 2
    assert all(report["inflation"] is None for report in reports)


def test_fixes_that_do_not_agree_are_noise() -> None:
    """Wrong by metres per second to either side by turns: no error of the filter does that."""
    reports = push_speeds(navigator(3), [4.0, -4.0] * 3)
    assert {report["verdict"] for report in reports} == {"rejected"}


def test_never_is_never() -> None:
    reports = push_speeds(navigator(0), AWAY_MPS)
    assert {report["verdict"] for report in reports} == {"rejected"}


def test_beams_that_contradict_each_other_stay_refused() -> None:
    """One beam off by 3 m/s: no velocity explains four such beams, so no width of the covariance lets them in."""
    reports = push_speeds(navigator(3, method="tc"), [0.0] * 30, beam_4_mps=3.0)
    assert {report["verdict"] for report in reports} == {"rejected"}


@pytest.mark.parametrize(
    ("fixes", "message"), [(1, "inflate_after_rejections"), (-1, "whole number"), (2.5, "whole number")]
)
def test_settings_that_make_no_sense(fixes: Any, message: str) -> None:  # noqa: ANN401 - wrong on purpose
    with pytest.raises(bottomlock.KernelError, match=message):
        navigator(fixes)
