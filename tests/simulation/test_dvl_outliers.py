"""Outliers among simulated beams: their own random stream, none by default, and the noise of the surveys."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, norm

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams

SECONDS = 60.0


def scenario(seconds: float = SECONDS, **keys: Any) -> Scenario:  # noqa: ANN401 - any key of [dvl]
    """The straight way with every beam and these keys."""
    packaged = load_scenario("straight").with_trajectory(duration_s=seconds)
    dvl = packaged.dvl.model_copy(update={"beams_lost": ()} | keys)
    return packaged.model_copy(update={"dvl": dvl})


def test_outliers_are_a_fraction_of_the_readings_and_shift_no_other() -> None:
    """Every other table and every good reading keep their bits; an outlier's error is so many times as large."""
    plain, some, all_of_them, silent = (
        build_simulation(scenario(**keys))
        for keys in (
            {},
            {"outlier_fraction": 0.2, "outlier_factor": 12.0},
            {"outlier_fraction": 1.0, "outlier_factor": 12.0},
            {"outlier_fraction": 1.0, "outlier_factor": 1.0},
        )
    )
    truth = plain.truth()
    clean, dirty, wild, same = (
        sensor_streams(one, truth, run=3) for one in (plain, some, all_of_them, silent)
    )
    for name in set(clean) - {"beams"}:
        assert clean[name].equals(dirty[name]), name
    assert clean["beams"].equals(same["beams"])
    names = [f"beam{k}_mps" for k in (1, 2, 3, 4)]
    good, found, worst = (table["beams"].select(names).to_numpy() for table in (clean, dirty, wild))
    outlier = found != good
    # 240 readings: 48 with a standard deviation of 6.2; five of them either way.
    assert 17 <= outlier.sum() <= 79
    assert outlier.any(axis=0).all()
    assert (found[outlier] == worst[outlier]).all()
    assert np.std(worst - good) == pytest.approx(11 * 0.042, rel=0.2)


def test_none_by_default_and_the_hash_is_that_of_before() -> None:
    """Keys that decide nothing do not change what a scenario is."""
    plain = load_scenario("straight")
    assert plain.dvl.outlier_fraction == 0.0
    assert scenario(outlier_factor=5.0).content_hash() == scenario().content_hash()
    assert scenario(outlier_fraction=0.01).content_hash() != scenario().content_hash()


@pytest.mark.parametrize("name", ["survey", "survey_table2"])
def test_the_surveys_noise_has_the_measured_closure(name: str) -> None:
    """The half-widths of the closure on the recorded log of docs/robust.md: 23 mm/s, 4.1 times that, and 0.27 m/s.

    With k of four beams outliers, (e1 - e2 + e3 - e4)/2 has the variance σ² (1 + k (f² - 1)/4).
    """
    dvl = load_scenario(name).dvl
    k = np.arange(5)
    weights = binom.pmf(k, 4, dvl.outlier_fraction)
    sd_mps = dvl.beam_noise_mps * np.sqrt(1 + k * (dvl.outlier_factor**2 - 1) / 4)
    widths_mps = np.array([0.023, 4.1 * 0.023, 0.27])
    covered = (weights * (2 * norm.cdf(widths_mps[:, None] / sd_mps) - 1)).sum(axis=1)
    # Half-widths are stated in two digits.
    assert covered == pytest.approx([0.683, 0.954, 0.997], abs=0.01)
    assert covered[2] == pytest.approx(0.997, abs=0.001)
