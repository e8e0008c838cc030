"""Ensembles of the packaged scenarios, run once per process and kept for every test that judges them."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import bottomlock
from bottomlock.kernel import Method
from tests.analytic import analytic_simulation, batch_of
from tests.oracle.rotations import Array

# Fixed before the first run: the day the paper appeared.
SEED = 20170222
RUNS = 200


@dataclass(frozen=True)
class Ensemble:
    """Runs of one scenario: methods in order, (runs, methods, T) NEES and the batch itself."""

    methods: tuple[Method, ...]
    batch: dict[str, Any]

    def nees(self, method: str) -> Array:
        """NEES of velocity and attitude, (runs, T)."""
        nees: Array = self.batch["nees_velocity_attitude"][:, self.methods.index(method)]
        return nees

    def errors(self, method: str) -> Array:
        """True minus estimate of position, misalignment and velocity, (runs, T, 9)."""
        errors: Array = self.batch["error"][:, self.methods.index(method)]
        return errors


@lru_cache(maxsize=8)
def run_ensemble(name: str, methods: tuple[Method, ...], runs: int = RUNS, every_s: int = 5) -> Ensemble:
    """Flies a packaged scenario on its analytic truth."""
    work = batch_of(analytic_simulation(name, imu_hz=50.0), slice(every_s - 1, None, every_s)) | {
        "seed": SEED,
        "trajectory_key": 17,
    }
    batch: Any = bottomlock.run_batch(**work, methods=methods, runs=runs, threads=1)
    return Ensemble(methods, batch)
