"""Ten minutes of the soak, and that it would see what it looks for."""

from typing import Any

import numpy as np
import pytest

from tools import soak


@pytest.mark.long
def test_ten_minutes_of_every_method_are_sound() -> None:
    """90,000 inertial steps a method with every sensor, the first five minutes without bottom lock."""
    ten_minutes = soak.soak(1.0 / 6.0, seed=16)
    assert ten_minutes["faults"] == []
    assert ten_minutes["steps"] == 90_000
    assert sum(words.endswith("accepted") for words in ten_minutes["verdicts"]["tc"]) == 7, "of each sensor"
    for name, figures in ten_minutes["worst"].items():
        assert figures["quaternion_norm_error"] < 1e-12, name
        assert 0.0 < figures["least_eigenvalue"] < 1.0, name


class _Navigator:
    """What a navigator says of itself, changed."""

    def __init__(self, covariance: np.ndarray[Any, Any], **state: Any) -> None:  # noqa: ANN401 - any field
        rest = {
            "position_t_m": np.zeros(3),
            "attitude_t_p": np.array([1.0, 0, 0, 0]),
            "velocity_p_mps": np.zeros(3),
        }
        self._state, self._covariance = rest | state, covariance

    def state(self) -> dict[str, Any]:
        return self._state

    def covariance(self) -> np.ndarray[Any, Any]:
        return self._covariance


SKEW = np.eye(3) + np.array([[0, 1e-9, 0], [0, 0, 0], [0, 0, 0]])
SINGULAR = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) * 1e-12


@pytest.mark.parametrize(
    ("navigator", "words"),
    [
        (_Navigator(np.eye(3), attitude_t_p=np.array([1.0 + 1e-11, 0, 0, 0])), "quaternion_norm_error"),
        (_Navigator(np.eye(3), position_t_m=np.array([101.0, 0, 0])), "position_m"),
        (_Navigator(SKEW), "asymmetry"),
        (_Navigator(SINGULAR * np.array([[1, 1.1, 1], [1.1, 1, 1], [1, 1, 1]])), "positive definite"),
        (_Navigator(np.full((3, 3), np.nan)), "positive numbers"),
    ],
)
def test_a_fault_of_a_navigator_is_told(navigator: Any, words: str) -> None:  # noqa: ANN401 - stands for one
    """Each judgement fails on what it is for."""
    true = _Navigator(np.eye(3)).state()
    _, faults = soak.judge(navigator, true)
    assert len(faults) == 1
    assert words in faults[0]
