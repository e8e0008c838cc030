"""The errors of a finished campaign run by run, from its samples, and what they say against the claimed deviations."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.campaign_tables import CampaignTables, read_samples
from bottomlock.files.columns import COMPONENTS, SAMPLES, UNITS
from bottomlock.statistics.rms import Array, combined_rms, mean_square, rms
from bottomlock.units import DEGREES_PER_RADIAN


@dataclass(frozen=True)
class RunErrors:
    """Errors of one trajectory: for each method a matrix (runs, times), with runs and times in one order for all.

    Attributes:
        time_s: (times,).
        velocity_mps, attitude_deg: norms of the error of velocity and of the misalignment.
        heading_deg: size of the misalignment about the vertical.
        velocity_sd_mps: root of the sum of the three claimed variances.
        nees: of the whole state.
        normalised_rms: (9,) RMS over runs and times of error/σ, for each of `files.columns.COMPONENTS`.
    """

    time_s: Array
    velocity_mps: Mapping[str, Array]
    attitude_deg: Mapping[str, Array]
    heading_deg: Mapping[str, Array]
    velocity_sd_mps: Mapping[str, Array]
    nees: Mapping[str, Array]
    normalised_rms: Mapping[str, Array]

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(next(iter(self.nees.values())).shape[0])

    def of(self, quantity: str) -> Mapping[str, Array]:
        """The norms of "velocity" (m/s) or "attitude" (deg), for each method."""
        return {"velocity": self.velocity_mps, "attitude": self.attitude_deg}[quantity]

    def final_rms(self, quantity: str, method: str) -> float:
        """RMS over runs at the last time of "velocity" (m/s), "attitude" or "heading" (deg)."""
        norms = self.heading_deg if quantity == "heading" else self.of(quantity)
        return float(rms(norms[method][:, -1]))


def read_run_errors(campaign: CampaignTables, trajectory: str) -> RunErrors:
    """The errors of one trajectory from its chunks; only norms are held in memory.

    Raises:
        DataError: for a chunk that is missing, damaged or incomplete, or sampled at other times than the first.
    """
    methods = sorted(campaign.methods(trajectory))
    total = int(campaign.manifest["scenarios"][trajectory]["runs"])
    times: list[Array] = []
    norms: dict[str, list[Array]] = {}
    mean_squares, weights = [], []
    for samples, runs in read_samples(campaign, trajectory):
        time_ns = samples["time_ns"].unique().sort()
        shape = (runs, len(methods), len(time_ns))
        times.append(time_ns.to_numpy() * 1e-9)
        if not np.array_equal(times[0], times[-1]):
            place = campaign.folder / "chunks" / trajectory
            raise DataError("the chunks were sampled at different times", place=place)
        for name, values in _norms(samples, shape).items():
            norms.setdefault(name, []).append(values)
        mean_squares.append(_normalised_mean_squares(samples, shape))
        weights.append(runs / total)
    stacked = {name: np.concatenate(parts, axis=0) for name, parts in norms.items()}
    by_method = {
        name: {method: np.ascontiguousarray(values[:, k]) for k, method in enumerate(methods)}
        for name, values in stacked.items()
    }
    normalised = combined_rms(np.stack(mean_squares), np.array(weights))
    return RunErrors(
        time_s=times[0],
        **by_method,
        normalised_rms={method: normalised[k] for k, method in enumerate(methods)},
    )


def velocity_calibration(errors: RunErrors, method: str) -> tuple[Array, Array]:
    """Claimed standard deviation and error of velocity at each time, RMS over runs, m/s, (times,) each."""
    return rms(errors.velocity_sd_mps[method], axis=0), rms(errors.velocity_mps[method], axis=0)


def _norms(samples: pl.DataFrame, shape: tuple[int, int, int]) -> dict[str, Array]:
    """Runs × methods × times of each norm."""

    def norm(prefix: str) -> Array:
        names = [name for name in SAMPLES if name.startswith(prefix)]
        return np.sqrt(sum((_cube(samples, name, shape) ** 2 for name in names), np.zeros(shape)))

    heading = np.abs(_cube(samples, "err_misalignment_down_rad", shape))
    return {
        "velocity_mps": norm("err_velocity_"),
        "attitude_deg": norm("err_misalignment_") * DEGREES_PER_RADIAN,
        "heading_deg": heading * DEGREES_PER_RADIAN,
        "velocity_sd_mps": norm("sd_velocity_"),
        "nees": _cube(samples, "nees", shape),
    }


def _normalised_mean_squares(samples: pl.DataFrame, shape: tuple[int, int, int]) -> Array:
    """(methods, 9) mean over runs and times of (error/σ)², for each of `COMPONENTS`."""
    columns = []
    for component in COMPONENTS:
        unit = UNITS[component.split("_")[0]]
        error = _cube(samples, f"err_{component}_{unit}", shape)
        sd = _cube(samples, f"sd_{component}_{unit}", shape)
        columns.append(mean_square(error / sd, axis=(0, 2)))
    return np.stack(columns, axis=-1)


def _cube(samples: pl.DataFrame, name: str, shape: tuple[int, int, int]) -> Array:
    return np.asarray(samples[name].to_numpy().reshape(shape), dtype=np.float64)
