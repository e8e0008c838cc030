"""Partition of a campaign: runs into chunks, chunks into shards. It depends on the scenarios only."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from bottomlock.config.scenario import Scenario
from bottomlock.errors import DataError, ScenarioError

CHUNK_STEPS = 12_000_000
"""Filter steps of one kernel call: a second or two of one core, so that progress and interruption stay responsive."""

EVEN_RUNS = 16
"""Larger chunks hold a multiple of this number of runs, which fills the SIMD lanes and shares the threads evenly."""

CLOSED_LOOP_VEHICLES = 512
"""Vehicles simulated side by side in closed loop. More of them cost less each; an unfinished chunk loses more."""


@dataclass(frozen=True)
class Chunk:
    """Runs of one scenario that are computed and written together."""

    scenario: str
    first_run: int
    runs: int

    @property
    def file_ending(self) -> str:
        """The end of its files' names."""
        return f"{self.first_run:08d}-{self.first_run + self.runs - 1:08d}.parquet"


@dataclass(frozen=True)
class Partition:
    """How one scenario is cut into chunks, and what its tables are made of; a manifest holds the same facts."""

    scenario: str
    methods: tuple[str, ...]
    runs: int
    runs_per_chunk: int
    nees_degrees: int

    def chunks(self) -> list[Chunk]:
        """The chunks, in the order of their runs."""
        size = self.runs_per_chunk
        return [
            Chunk(self.scenario, first, min(size, self.runs - first)) for first in range(0, self.runs, size)
        ]

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The partition of a scenario.

        >>> from bottomlock.config.scenario import load_scenario
        >>> partition = Partition.of(load_scenario("straight").with_overrides(runs=500, methods=["tc"]))
        >>> [chunk.runs for chunk in partition.chunks()]
        [304, 196]
        """
        trajectory, settings = scenario.trajectory, scenario.campaign
        steps = round(trajectory.duration_s * scenario.imu.rate_hz) + 1
        size = CHUNK_STEPS // (steps * len(settings.methods))
        if trajectory.feedback == "estimate":
            size = CLOSED_LOOP_VEHICLES // (len(settings.methods) if trajectory.pilot == "own" else 1)
        return cls(
            scenario=scenario.name,
            methods=tuple(settings.methods),
            runs=settings.runs,
            runs_per_chunk=max(1, size if size < EVEN_RUNS else size - size % EVEN_RUNS),
            nees_degrees=scenario.filter.states,
        )

    @classmethod
    def from_manifest(cls, name: str, manifest: Mapping[str, Any]) -> Self:
        """The partition that a campaign's manifest states for one of its scenarios.

        Raises:
            DataError: for a manifest without it.
        """
        try:
            scenario = manifest["scenarios"][name]
            partition = cls(
                scenario=name,
                methods=tuple(str(method) for method in scenario["methods"]),
                runs=int(scenario["runs"]),
                runs_per_chunk=int(scenario["runs_per_chunk"]),
                nees_degrees=int(manifest["nees_degrees"][name]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(
                f"the manifest does not state how scenario {name} was cut into chunks ({error!r})"
            ) from error
        least = min(partition.runs, partition.runs_per_chunk, partition.nees_degrees, len(partition.methods))
        # The name is that of a folder, so it must not lead anywhere else.
        if not re.fullmatch(r"[A-Za-z0-9_\-]+", name) or least < 1:
            raise DataError(f"the manifest states scenario {name!r} in a way that no campaign has")
        return partition


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
            ScenarioError: unless the text is k/n with 1 <= k <= n.
        """
        first, slash, last = text.partition("/")
        if slash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last):
            return cls(int(first), int(last))
        raise ScenarioError(f"shard '{text}': expected k/n with 1 <= k <= n, such as 2/3")

    def contains(self, number: int) -> bool:
        """Whether the chunk of this number, from 0, belongs to the shard."""
        return number % self.n == self.k - 1


def all_chunks(partitions: Sequence[Partition], shard: Shard | None = None) -> list[Chunk]:
    """The chunks of all scenarios in order; those of one shard if it is given."""
    chunks = [chunk for partition in partitions for chunk in partition.chunks()]
    return [chunk for number, chunk in enumerate(chunks) if shard is None or shard.contains(number)]
