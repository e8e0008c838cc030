"""A campaign's `manifest.json`: what decided the numbers, how the runs were cut into chunks, and how long it took."""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from bottomlock import kernel
from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.chunk_files import Identity
from bottomlock.campaign.partition import Partition, Shard
from bottomlock.simulation.build import Simulation, trajectory_key
from bottomlock.tables.versions import bit_versions, library_versions


@dataclass
class Clock:
    """Wall time, and the time of all chunks inside and outside the kernel; the times of merged shards come first."""

    started: float = field(default_factory=time.perf_counter)
    earlier_s: float = 0.0
    kernel_s: float = 0.0
    batch_s: float = 0.0

    def times(self) -> dict[str, Any]:
        """The manifest's entries, s."""
        return {
            "wall_time_s": round(self.earlier_s + time.perf_counter() - self.started, 3),
            "kernel_time_s": round(self.kernel_s, 3),
            "batch_time_s": round(self.batch_s, 3),
            "python_share_of_batch": round(1.0 - self.kernel_s / self.batch_s, 4)
            if self.batch_s > 0.0
            else None,
        }


def identity_of(simulations: Sequence[Simulation]) -> Identity:
    """What decides the numbers of a campaign, apart from the number of runs; known before any truth is computed."""
    content = [
        (one.scenario.name, one.fingerprint(), list(one.scenario.campaign.methods)) for one in simulations
    ]
    return {
        "configuration_hash": hashlib.sha256(json.dumps(content).encode()).hexdigest(),
        "versions": bit_versions(),
    }


def describe(
    built: Sequence[BuiltScenario],
    partitions: Sequence[Partition],
    identity: Identity,
    *,
    threads: int,
    engine: str,
    shard: Shard | None,
) -> dict[str, Any]:
    """The manifest's entries that are known before the first chunk: versions, seeds, every setting, the partition."""
    described: dict[str, Any] = {
        "version": kernel.kernel_version(),
        "versions": library_versions() | identity["versions"],
        "configuration_hash": identity["configuration_hash"],
        "engine": engine,
        "threads": threads,
        "nees_degrees": {partition.scenario: partition.nees_degrees for partition in partitions},
        "scenarios": {
            one.scenario.name: {
                "seed": one.scenario.campaign.seed,
                "runs": one.scenario.campaign.runs,
                "runs_per_chunk": partition.runs_per_chunk,
                "methods": list(one.scenario.campaign.methods),
                "trajectory_key": str(trajectory_key(one.scenario.name)),
                "configuration": one.scenario.model_dump(mode="json"),
                "options": one.scenario.kernel_options().as_dict(),
            }
            for one, partition in zip(built, partitions, strict=True)
        },
        # JSON objects are written in the order of their keys: the order of the scenarios stands apart.
        "order": [partition.scenario for partition in partitions],
    }
    if shard is not None:
        described["shard"] = {"k": shard.k, "n": shard.n}
    return described
