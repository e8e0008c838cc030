"""Log-likelihood of innovations, its gradient and Fisher information; outliers count as in Huber's loss."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.tune.passes import Group

TAIL = 1e-3
"""Probability beyond which an innovation squared counts as an outlier."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Negative log-likelihood (n,) of innovations, NIS, rows, times, horizons, and which sensor's each is.

    Attributes:
        sensors: names of the sensors.
        sensor: (n,) places in them.
    """

    value: Floats
    nis: Floats
    rows: NDArray[np.intp]
    time_ns: Times
    horizon: NDArray[np.intp]
    sensors: tuple[str, ...]
    sensor: NDArray[np.intp]

    @property
    def terms(self) -> dict[tuple[str, int], NDArray[np.bool_]]:
        """Innovations (n,) of each sensor and horizon that has some."""
        pairs = np.unique(np.stack([self.sensor, self.horizon], axis=1), axis=0)
        return {
            (self.sensors[sensor], int(horizon)): (self.sensor == sensor) & (self.horizon == horizon)
            for sensor, horizon in pairs
        }


Part = tuple[Floats, Floats, NDArray[np.intp], Times, NDArray[np.intp]]
"""The columns of `Scores` of a group: value, NIS, rows, times, horizons."""


def scores(groups: Sequence[Group], parts: Sequence[Part]) -> Scores:
    """The scores of all innovations of a candidate, of those of each group."""
    sensors = tuple(sorted({group.sensor for group in groups}))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    sensor = np.concatenate([np.full(len(group.time_ns), sensors.index(group.sensor)) for group in groups])
    value, nis, rows, time_ns, horizon = columns
    return Scores(value, nis, rows, time_ns, horizon, sensors, sensor)


def part_of(group: Group) -> Part:
    """The scores of a group."""
    rows = group.residual.shape[1]
    factor = np.linalg.cholesky(group.covariance)
    white = _solved(np.asarray(factor), group.residual)
    nis = np.einsum("ni,ni->n", white, white)
    half_log_det = np.log(np.einsum("nii->ni", factor)).sum(axis=1)
    value = 0.5 * (loss(nis, rows) + rows * np.log(2.0 * np.pi)) + half_log_det
    return value, nis, np.full(len(nis), rows, dtype=np.intp), group.time_ns, group.horizon


def white_residuals(group: Group) -> Floats:
    """Innovations (n, k) of unit covariance, independent where the model is right."""
    return _solved(np.asarray(np.linalg.cholesky(group.covariance)), group.residual)


def _solved(factor: Floats, residual: Floats) -> Floats:
    return np.asarray(np.linalg.solve(factor, residual[..., None])[..., 0])


def loss(nis: Floats, rows: int) -> Floats:
    """The NIS; beyond the bound that good innovations exceed once in 1/TAIL, its tangent in the root of the NIS."""
    bound = chi2.isf(TAIL, rows)
    return np.where(nis <= bound, nis, 2.0 * np.sqrt(bound * np.maximum(nis, bound)) - bound)


def derivatives(
    groups: Sequence[Group],
    stepped: Sequence[Sequence[Group]],
    step: float,
    executor: Executor,
) -> tuple[Floats, Floats]:
    """Gradient (n, P) of each innovation's score and its Fisher information (n, P, P) by parameters.

    From the innovations of candidates a step away in one parameter each; the information is the gradient's expected
    square.
    """

    def of_group(k: int) -> tuple[Floats, Floats]:
        group = groups[k]
        inverse = np.asarray(np.linalg.inv(group.covariance))
        rows = group.residual.shape[1]
        scaled = np.einsum("nij,nj->ni", inverse, group.residual)
        nis = np.einsum("ni,ni->n", scaled, group.residual)
        weight = np.sqrt(np.minimum(1.0, chi2.isf(TAIL, rows) / np.maximum(nis, 1e-300)))
        dz, ds = _slopes(group, [one[k] for one in stepped], step)
        relative = np.einsum("nij,pnjk->pnik", inverse, ds)
        fit = np.einsum("ni,pni->np", scaled, dz) - 0.5 * np.einsum("ni,pnij,nj->np", scaled, ds, scaled)
        gradient = weight[:, None] * fit + 0.5 * np.einsum("pnii->np", relative)
        return gradient, _information(dz, inverse, relative)

    gradients, information = zip(*executor.map(of_group, range(len(groups))), strict=True)
    return np.concatenate(gradients), np.concatenate(information)


def _slopes(group: Group, stepped: Sequence[Group], step: float) -> tuple[Floats, Floats]:
    """(P, n, k) and (P, n, k, k): by how much innovations and their covariances change."""
    return (
        np.stack([one.residual - group.residual for one in stepped]) / step,
        np.stack([one.covariance - group.covariance for one in stepped]) / step,
    )


def _information(dz: Floats, inverse: Floats, relative: Floats) -> Floats:
    """(n, P, P) of the slopes (P, n, k) of the innovations and the relative ones (P, n, k, k) of their covariances."""
    mean = np.einsum("pni,nij,qnj->npq", dz, inverse, dz, optimize=True)
    return np.asarray(mean + 0.5 * np.einsum("pnij,qnji->npq", relative, relative, optimize=True))
