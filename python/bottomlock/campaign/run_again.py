"""A run of a finished campaign once more, for what its tables leave out: the true motion and the beams that returned.

A run's numbers depend on nothing but the seed, the trajectory's name and its number, so its samples come out again, bit
for bit; where they do not, nothing is returned.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import ValidationError

from bottomlock.campaign.build import BuiltScenario, build_scenarios, build_simulations
from bottomlock.campaign.chunk import run_chunk
from bottomlock.campaign.chunk_files import Identity, read_chunk
from bottomlock.campaign.directory import MANIFEST
from bottomlock.campaign.manifest import identity_of
from bottomlock.campaign.partition import Chunk, Partition
from bottomlock.config.scenario import Scenario
from bottomlock.config.validation import explain
from bottomlock.errors import DataError, ScenarioError
from bottomlock.simulation.build import Simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.tables.results import CampaignTables

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """A vehicle at the times of the samples, and which of its beams returned.

    Attributes:
        position_t_m: (n, 3) true position, tangent frame.
        attitude_t_p: (n, 4) true attitude, unit quaternions, scalar first.
        velocity_p_mps: (n, 3) true velocity, platform frame.
        ping_ns: (p,) times of the pings.
        beam_valid: (p, beams) which beams returned.
    """

    position_t_m: Floats
    attitude_t_p: Floats
    velocity_p_mps: Floats
    ping_ns: NDArray[np.int64]
    beam_valid: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RunAgain:
    """A run.

    Attributes:
        scenario: its settings.
        run: its number.
        samples: `tables.campaign.SAMPLES` of the run.
        time_ns: (n,) times of its samples.
        vehicles: the one vehicle of all methods; one for each method where each steers its own.
    """

    scenario: Scenario
    run: int
    samples: pl.DataFrame
    time_ns: NDArray[np.int64]
    vehicles: tuple[Motion, ...]


def simulations_of(campaign: CampaignTables) -> list[Simulation]:
    """The scenarios of a campaign as its manifest states them, with the files that they name.

    Raises:
        ScenarioError: for a scenario that this version rejects, or a file that is gone.
        DataError: for files that have changed since the campaign.
    """
    place = campaign.folder / MANIFEST
    simulations = build_simulations(
        [scenario_of(campaign.configuration(name), place) for name in campaign.trajectories]
    )
    if identity_of(simulations)["configuration_hash"] != campaign.manifest["configuration_hash"]:
        raise DataError(
            f"{campaign.folder}: a file that its scenarios name (trajectory, seabed, vehicle, a method of one's own) "
            "has changed since, so that its runs cannot be made again; run the campaign again"
        )
    return simulations


def scenario_of(stated: Mapping[str, Any], place: Path) -> Scenario:
    """A scenario as a manifest states it, with every default.

    Raises:
        DataError: for what is no scenario of this version.
    """
    try:
        # What is left out follows the trajectory's file, so what is only the default is left out again.
        sparse = Scenario.model_validate(stated).model_dump(mode="json", exclude_defaults=True)
        return Scenario.model_validate(sparse)
    except ValidationError as error:
        raise DataError(explain(error, str(place), Scenario)) from error


def check_run(campaign: CampaignTables, run: int) -> None:
    """Checks that every trajectory has a run of this number.

    Raises:
        ScenarioError: naming the first that has not.
    """
    for name in campaign.trajectories:
        runs = campaign.manifest["scenarios"][name]["runs"]
        if not 0 <= run < runs:
            raise ScenarioError(
                f"--run is {run}, and {name} has {runs} runs in {campaign.folder}, expected 0 to {runs - 1}"
            )


def runs_again(campaign: CampaignTables, run: int, *, threads: int = 0) -> list[RunAgain]:
    """Run `run` of every trajectory of a campaign.

    Raises:
        ScenarioError: as `check_run` and `simulations_of`.
        DataError: as `simulations_of` and `read_chunk`, and for samples that come out otherwise than those on the disk.
    """
    check_run(campaign, run)
    simulations = simulations_of(campaign)
    identity = identity_of(simulations)
    return [_again(campaign, built, run, identity, threads) for built in build_scenarios(simulations)]


def _again(
    campaign: CampaignTables, built: BuiltScenario, run: int, identity: Identity, threads: int
) -> RunAgain:
    name, parts = built.scenario.name, _Parts()
    chunk = Chunk(name, run, 1)
    samples = run_chunk(built, chunk, threads=threads, observe=parts.add).samples
    if not samples.equals(_recorded(campaign, name, run, identity)):
        raise DataError(
            f"{campaign.folder}: run {run} of {name} comes out otherwise than in its tables, as on another machine; "
            "run the campaign again here"
        )
    time_ns = np.unique(samples["time_ns"].to_numpy())
    if not built.closed_loop:
        schedule = measurement_schedule(
            built.simulation, built.truth, trajectory_key=trajectory_key(name), first_run=run
        )
        truth = built.truth.kernel_arrays()
        parts.add({key: value if key == "time_ns" else value[None] for key, value in truth.items()}, schedule)
    return RunAgain(built.scenario, run, samples, time_ns, parts.motions(time_ns))


def _recorded(campaign: CampaignTables, name: str, run: int, identity: Identity) -> pl.DataFrame:
    """The samples of a run on the disk."""
    partition = Partition.from_manifest(name, campaign.manifest)
    chunk = next(one for one in partition.chunks() if one.first_run <= run < one.first_run + one.runs)
    return read_chunk(campaign.folder, chunk, partition, identity).samples.filter(pl.col("run") == run)


class _Parts:
    """Truth and schedule, block by block."""

    def __init__(self) -> None:
        self._truth: list[dict[str, Any]] = []
        self._schedule: list[dict[str, Any]] = []

    def add(self, truth: dict[str, Any], schedule: dict[str, Any]) -> None:
        """Takes a block: the truth (vehicles, times, ...) and the schedule along it."""
        self._truth.append(truth)
        self._schedule.append(schedule)

    def motions(self, time_ns: NDArray[np.int64]) -> tuple[Motion, ...]:
        """Every vehicle at these times."""
        ping_ns = np.concatenate([one["dvl_time_ns"] for one in self._schedule])
        times = np.concatenate([one["time_ns"] for one in self._truth])
        # A block begins with the last time of the one before: the first of equal times is as good as the second.
        rows = np.searchsorted(times, time_ns)
        vehicles = self._truth[0]["position_t_m"].shape[0]
        values = {
            key: np.concatenate([one[key] for one in self._truth], axis=1)[:, rows]
            for key in ("position_t_m", "attitude_t_p", "velocity_p_mps")
        }
        beams = self._schedule[0]["beam_valid"].shape[-1]
        # Beams that do not depend on vehicle or chance stand once for all.
        valid = np.concatenate(
            [
                np.broadcast_to(one["beam_valid"], (vehicles, len(one["dvl_time_ns"]), beams))
                for one in self._schedule
            ],
            axis=1,
        )
        return tuple(
            Motion(ping_ns=ping_ns, beam_valid=valid[k], **{key: value[k] for key, value in values.items()})
            for k in range(vehicles)
        )
