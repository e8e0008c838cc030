"""No lock-out: after any disturbance the trusted methods take good measurements again within ten fixes."""

from __future__ import annotations

import numpy as np
import pytest

from bottomlock.kernel import Method
from tests.statistical.disturbances import cases, disturbed

TRUSTED: list[Method] = ["tc", "info", "vb_exact", "weak_sway", "sway_current", "consistent"]
FIXES = 10


def lock_outs(numbers: range, methods: list[Method]) -> list[str]:
    """The cases in which a method rejects more than ten good pings in a row, or ends off along its beams.

    Beams have a noise of 42 mm/s and a bias of 5 mm/s: an RMS of 0.15 m/s over the last thirty pings is far outside.
    """
    found = []
    for number in numbers:
        run = disturbed(number, methods)
        rms = np.sqrt(np.mean(run.beam_error_mps[:, -30:] ** 2, axis=(1, 2)))
        for method, rejections, off in zip(methods, run.longest_rejection(), rms, strict=True):
            if rejections > FIXES or off > 0.15:
                found.append(f"{run.name}: {method} rejects {rejections} in a row, {off:.3f} m/s at the end")
    return found


@pytest.mark.slow
def test_no_disturbance_locks_the_trusted_methods_out() -> None:
    assert lock_outs(range(0, len(cases()), 3), ["tc", "weak_sway", "consistent"]) == []


@pytest.mark.slow
def test_position_fixes_come_back() -> None:
    """After six fixes 100 m off, of which the last two are taken, the good ones are taken again.

    With four beams the velocity hardly notices: a wrong position inflates the position alone.
    """
    numbers = [number for number, case in enumerate(cases()) if case[0] == "position" and case[1] != (1,)]
    for number in numbers[:12]:
        run = disturbed(number, ["tc", "consistent"])
        assert (run.position_error_m[:, -1] < 5.0 * run.position_sd_m[:, -1]).all(), run.name
        assert (run.position_sd_m[:, -1] < 2.5).all(), run.name
        assert np.sqrt(np.mean(run.beam_error_mps[:, 45:] ** 2)) < 0.1, run.name
