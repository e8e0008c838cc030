"""What the reference of the A-KIT sections can judge: its positions, velocities and altitudes against the DVL."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tools.akit import SECTIONS
from tools.akit_reference import ReferenceQuality, innovations, reference_quality

pytestmark = pytest.mark.recordings

VELOCITY_SCALE = 1.002
"""By which the cases divide the DVL's readings."""
STRAIGHT = 12
"""A section without turns, on which a shift of the stamps does not show in the path."""


@pytest.fixture(scope="module")
def sections(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[int, ReferenceQuality]:
    if not (recordings / "akit_snapir").is_dir():
        pytest.skip(f"no recording {recordings / 'akit_snapir'}")
    scratch = tmp_path_factory.mktemp("akit")
    return {section: reference_quality(recordings, scratch, section) for section in SECTIONS}


def test_positions_fit_a_dvl_stamped_earlier(sections: dict[int, ReferenceQuality]) -> None:
    """By 0.45 to 0.55 s, on every section with turns; the velocities fit the stamps as they are."""
    for section, found in sections.items():
        assert abs(found.velocities.shift_s) < 0.05
        if section != STRAIGHT:
            assert 0.40 < found.positions.shift_s < 0.60
            assert found.positions.rms < 0.65 * found.positions.rms_unshifted


def test_scale_of_the_dvl_is_that_of_the_positions(sections: dict[int, ReferenceQuality]) -> None:
    """1.000 against the positions, as the DVL gives it; against the velocities it scatters by 0.3 %."""
    positions = np.array([found.positions.scale for found in sections.values()]) / VELOCITY_SCALE
    velocities = np.array([found.velocities.scale for found in sections.values()]) / VELOCITY_SCALE
    assert positions.mean() == pytest.approx(1.0, abs=0.0005)
    assert positions.std(ddof=1) < 0.0014
    assert velocities.std(ddof=1) > 0.002


def test_velocity_is_not_the_derivative_of_the_position(sections: dict[int, ReferenceQuality]) -> None:
    """The two part by 0.3 to 2 m in 400 s: errors of position below that are not judged."""
    apart = [found.own_velocity_rms_m for found in sections.values()]
    assert min(apart) > 0.3
    assert max(apart) < 2.0


def test_altitude_follows_the_dvl(sections: dict[int, ReferenceQuality]) -> None:
    """Within 3 cm about a drift of less than 0.5 mm/s, but as a walk, not as white noise: 2 to 6 cm in 100 s."""
    for found in sections.values():
        assert abs(found.altitude_drift_mps) < 5e-4
        assert found.altitude_rms_m < 0.03
        second, ten_seconds, hundred_seconds = found.altitude_step_rms_m
        assert second < 0.005
        assert hundred_seconds > 2.0 * ten_seconds > 4.0 * second


def test_velocity_differs_from_the_dvl_by_a_correlated_error(sections: dict[int, ReferenceQuality]) -> None:
    """White noise, which the cases assume, has none: its correlation over 5 s would be within 0.1 in 400 readings."""
    for section, found in sections.items():
        assert 0.005 < found.surge_sd_mps < 0.015
        if section != STRAIGHT:
            assert found.surge_correlation_5s > 0.25


def test_beams_agree_with_our_own_ins_and_the_reference_with_neither(
    recordings: Path, tmp_path: Path
) -> None:
    """On section 6, whose claim is 2.4 times too small, 4 mm/s of a beam are 5 of surge, and the error is 15."""
    if not (recordings / "akit_snapir").is_dir():
        pytest.skip(f"no recording {recordings / 'akit_snapir'}")
    found = innovations(recordings, tmp_path, 6)
    assert found.sd_mps == pytest.approx(0.0038, abs=0.0003)
    assert found.nis_per_degree < 0.2
    assert found.surge_error_mps > 2.0 * np.sqrt(2.0) * found.sd_mps
    assert max(found.correlation) < 0.3
