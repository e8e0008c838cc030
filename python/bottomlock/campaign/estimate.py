"""How long a campaign takes and what it writes, before it begins: an estimate, for who waits."""

import os
from collections.abc import Sequence
from dataclasses import dataclass

from bottomlock.config.scenario import Scenario

STEP_S = 2.5e-7
"""Time of one filter step of one method on one core, s, samples written: 150 to 350 ns on machines of 2020 to 2025."""

SAMPLE_BYTES = 55
"""Size on the disk of a method's sample at one second of one run; `tables.campaign.SAMPLES`, compressed."""

LONG_S, LARGE_BYTES = 60.0, 1e9
"""Above these a campaign says so before it begins."""


@dataclass(frozen=True)
class Cost:
    """What a campaign is estimated to take."""

    seconds: float
    size_bytes: float

    @property
    def is_worth_saying(self) -> bool:
        """Whether someone would wait for it, or look for room."""
        return self.seconds > LONG_S or self.size_bytes > LARGE_BYTES

    def __str__(self) -> str:
        time = f"{self.seconds / 60.0:.0f} min" if self.seconds < 5400.0 else f"{self.seconds / 3600.0:.1f} h"
        return f"about {time} and {self.size_bytes / 1e9:.1f} GB on the disk, within a factor of two"


def estimate(scenarios: Sequence[Scenario], *, threads: int = 0) -> Cost:
    """The time and the size of a campaign's runs.

    Args:
        scenarios: of the campaign.
        threads: 0 for as many as there are cores.

    >>> from bottomlock.config.scenario import load_scenario
    >>> cost = estimate([load_scenario("straight").with_overrides(runs=10_000)], threads=4)
    >>> cost.is_worth_saying, str(cost)
    (True, 'about 5 min and 1.8 GB on the disk, within a factor of two')
    """
    cores = threads or os.cpu_count() or 1
    steps = samples = 0.0
    for scenario in scenarios:
        flights = scenario.campaign.runs * len(scenario.campaign.methods)
        steps += flights * scenario.trajectory.duration_s * scenario.imu.rate_hz
        samples += flights * (scenario.trajectory.duration_s + 1.0)
    return Cost(steps * STEP_S / cores, samples * SAMPLE_BYTES)
