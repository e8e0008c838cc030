"""Beam loss: limits by hand, Markov chains by their law, independence of run order, recordings."""

import numpy as np
import pytest

from bottomlock.config.scenario_sections import Dropout, Dvl, Outage
from bottomlock.errors import ScenarioError
from bottomlock.plant.beam_loss import combine, markov_valid, replayed, returning, scheduled
from bottomlock.plant.seabed import Footprints

PINGS_NS = np.arange(250, dtype=np.int64) * 1_000_000_000
KEYS = {"seed": 7, "trajectory_key": 2**63 + 11}


def test_limits_cut_near_far_oblique_and_missing() -> None:
    prints = Footprints(
        range_m=np.array([[0.2, 10.0, 90.0, 30.0, np.nan]]),
        incidence_rad=np.array([[0.1, 0.1, 0.1, 1.3, np.nan]]),
    )
    limits = Dvl(beam_noise_mps=0.004, min_range_m=0.5, max_range_m=80.0, max_incidence_deg=57.3)
    assert returning(prints, limits).tolist() == [[False, True, False, False, False]]


@pytest.mark.statistical
@pytest.mark.parametrize("period_s", [0.2, 1.0])
def test_markov_dropout_has_its_means_at_any_ping_rate(period_s: float) -> None:
    """Availability up / (up + down) and mean outage length.

    Bounds: 5 sigma of the correlated mean, and 5 % on the length.
    """
    dropout = Dropout(beams=(1,), mean_up_s=20.0, mean_down_s=8.0)
    times = (np.arange(3000) * period_s * 1e9).astype(np.int64)
    valid = markov_valid(times, 1, [dropout], first_run=0, runs=200, **KEYS)[:, :, 0]
    share, correlation_s = 20.0 / 28.0, 1.0 / (1 / 20.0 + 1 / 8.0)
    spread = np.sqrt(share * (1 - share) * 2.0 * max(correlation_s, period_s) / (200 * 3000 * period_s))
    assert valid.mean() == pytest.approx(share, abs=5.0 * spread)
    falls = (~valid[:, 1:] & valid[:, :-1]).sum()
    outage_s = (~valid).sum() * period_s / falls
    memory = np.exp(-period_s / correlation_s)
    by_hand = period_s / ((1.0 - memory) * share)
    assert outage_s == pytest.approx(by_hand, rel=0.05)


def test_switching_one_beam_off_moves_no_other() -> None:
    first, second = (Dropout(beams=(beam,), mean_up_s=10.0, mean_down_s=5.0) for beam in (1, 2))
    both = markov_valid(PINGS_NS, 2, [first, second], first_run=0, runs=2, **KEYS)
    one = markov_valid(PINGS_NS, 2, [second], first_run=0, runs=2, **KEYS)
    assert one[:, :, 0].all()
    assert (both[:, :, 1] == one[:, :, 1]).all()


@pytest.mark.parametrize(
    ("stamps", "pattern", "words"),
    [
        ([0, 1], np.ones((3, 4), bool), r"2 times and a pattern of shape \(3, 4\)"),
        ([0, 2, 1], np.ones((3, 4), bool), "row 3 is not after that of row 2"),
    ],
)
def test_bad_recordings_are_named(stamps: list[int], pattern: np.ndarray, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        replayed(PINGS_NS, np.array(stamps, dtype=np.int64), pattern)


def test_rules_combine_by_and() -> None:
    fixed = scheduled(PINGS_NS, 4, (), [Outage(beams=(1,), from_s=0.0, to_s=9.0)])
    dropout = Dropout(beams=(2,), mean_up_s=5.0, mean_down_s=5.0)
    chance = markov_valid(PINGS_NS, 4, [dropout], first_run=0, runs=2, **KEYS)
    both = combine(fixed, chance)
    assert both.shape == (2, 250, 4)
    assert both.flags.c_contiguous
    assert (both == (fixed[None] & chance)).all()
