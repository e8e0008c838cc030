"""How a campaign is cut: runs into chunks, chunks into shards. The scenario decides, and nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from bottomlock.config.scenario import Scenario
from bottomlock.errors import DataError, ScenarioError

CHUNK_STEPS = 12_000_000
"""Filter steps of one kernel call: a second or two of one core, so that progress and interruption stay lively."""

EVEN_RUNS = 16
"""Chunks of more runs hold a multiple of it: full lanes, and as much work for each thread."""

CLOSED_LOOP_VEHICLES = 512
"""Vehicles that fly on estimates side by side: more cost less each, and more is lost with an unfinished chunk."""


@dataclass(frozen=True)
class RunRange:
    """Runs that are flown and written together."""

    first_run: int
    runs: int

    @property
    def stem(self) -> str:
        """What the names of its files end with."""
        return f"{self.first_run:08d}-{self.first_run + self.runs - 1:08d}.parquet"


@dataclass(frozen=True)
class Partition:
    """What the tables of one scenario are made of; it can be read back from a manifest."""

    name: str
    methods: tuple[str, ...]
    runs: int
    runs_per_chunk: int
    nees_degrees: int

    def spans(self) -> list[RunRange]:
        """The chunks, in the order of their runs."""
        size = self.runs_per_chunk
        return [RunRange(first, min(size, self.runs - first)) for first in range(0, self.runs, size)]

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The plan of a scenario.

        >>> from bottomlock.config.scenario import load_scenario
        >>> plan = Partition.of(load_scenario("straight").with_overrides(runs=500, methods=["tc"]))
        >>> [span.runs for span in plan.spans()]
        [304, 196]
        """
        trajectory, settings = scenario.trajectory, scenario.campaign
        steps = round(trajectory.duration_s * scenario.imu.rate_hz) + 1
        size = CHUNK_STEPS // (steps * len(settings.methods))
        if trajectory.feedback == "estimate":
            size = CLOSED_LOOP_VEHICLES // (len(settings.methods) if trajectory.pilot == "own" else 1)
        return cls(
            name=scenario.name,
            methods=tuple(settings.methods),
            runs=settings.runs,
            runs_per_chunk=max(1, size if size < EVEN_RUNS else size - size % EVEN_RUNS),
            nees_degrees=20 if scenario.filter.estimate_dvl else 15,
        )

    @classmethod
    def from_manifest(cls, name: str, manifest: Mapping[str, Any]) -> Self:
        """The plan that a campaign's manifest tells of one of its scenarios.

        Raises:
            DataError: for a manifest without it.
        """
        try:
            scenario = manifest["scenarios"][name]
            return cls(
                name=name,
                methods=tuple(scenario["methods"]),
                runs=int(scenario["runs"]),
                runs_per_chunk=int(scenario["runs_per_chunk"]),
                nees_degrees=int(manifest["nees_degrees"][name]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"the manifest does not tell how scenario {name} was cut ({error!r})") from error


@dataclass(frozen=True)
class Shard:
    """The k-th of n parts of a campaign, k from 1: every n-th chunk, counted through all scenarios."""

    k: int
    n: int

    def __str__(self) -> str:
        return f"{self.k}/{self.n}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """A shard from "k/n".

        >>> Shard.parse("2/3")
        Shard(k=2, n=3)

        Raises:
            ScenarioError: for anything else than 1 <= k <= n.
        """
        first, slash, last = text.partition("/")
        if slash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last):
            return cls(int(first), int(last))
        raise ScenarioError(f"shard '{text}': expected k/n with 1 <= k <= n, such as 2/3")

    def takes(self, number: int) -> bool:
        """Whether the chunk of this number, from 0, is its own."""
        return number % self.n == self.k - 1
