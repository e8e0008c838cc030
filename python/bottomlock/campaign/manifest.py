"""What a campaign says of itself in `manifest.json`."""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from bottomlock import kernel
from bottomlock.campaign.partition import Partition, Shard
from bottomlock.simulation.build import Simulation, trajectory_key
from bottomlock.tables.versions import library_versions


@dataclass
class Clock:
    """Wall time, and the time of all chunks inside and outside the kernel."""

    started: float = field(default_factory=time.perf_counter)
    kernel_s: float = 0.0
    batch_s: float = 0.0

    def times(self) -> dict[str, Any]:
        """As the manifest has them."""
        return {
            "wall_time_s": round(time.perf_counter() - self.started, 3),
            "kernel_time_s": round(self.kernel_s, 3),
            "batch_time_s": round(self.batch_s, 3),
            "python_share_of_batch": round(1.0 - self.kernel_s / self.batch_s, 4)
            if self.batch_s > 0.0
            else None,
        }


def configuration_hash(simulations: Sequence[Simulation]) -> str:
    """SHA-256 of all that decides the numbers of a campaign, apart from the number of runs."""
    content = [
        (w.scenario.name, w.fingerprint(), w.scenario.campaign.seed, list(w.scenario.campaign.methods))
        for w in simulations
    ]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def describe(
    simulations: Sequence[Simulation],
    *,
    status: str,
    threads: int,
    engine: str,
    shard: Shard | None,
    clock: Clock,
) -> dict[str, Any]:
    """The manifest: versions, seeds, every setting, how the runs were cut, and how long it took.

    The status is "running", "complete", or "shard" for a finished shard, which has no tables of its own.
    """
    plans = {simulation.scenario.name: Partition.of(simulation.scenario) for simulation in simulations}
    described: dict[str, Any] = {
        "status": status,
        "version": kernel.kernel_version(),
        "versions": library_versions(),
        "configuration_hash": configuration_hash(simulations),
        "engine": engine,
        "threads": threads,
        **clock.times(),
        "nees_degrees": {name: plan.nees_degrees for name, plan in plans.items()},
        "scenarios": {
            s.name: {
                "seed": s.campaign.seed,
                "runs": s.campaign.runs,
                "runs_per_chunk": plans[s.name].runs_per_chunk,
                "methods": list(s.campaign.methods),
                "trajectory_key": str(trajectory_key(s.name)),
                "configuration": s.model_dump(mode="json"),
                "options": s.kernel_options(),
            }
            for s in (simulation.scenario for simulation in simulations)
        },
    }
    # JSON objects are written in the order of their keys: the order of the scenarios stands apart.
    described["order"] = list(plans)
    if shard is not None:
        described["shard"] = {"k": shard.k, "n": shard.n}
    return described
