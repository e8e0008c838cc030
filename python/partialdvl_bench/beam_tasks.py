"""The tasks T1 and T5: a velocity from the beams of one ping, and real pings with beams left out.

Both ask an answer for every set of beams that could be left, a mask: "1100" leaves beams 1 and 2.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from itertools import product

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock import BeamGeometry, DvlModel, read_geometry, solve_velocity
from bottomlock.kernel import FixMethod
from bottomlock.recordings.closure import closure_rows
from bottomlock.replay.leave_out import VelocityWalk, random_walk
from bottomlock.statistics.rms import rms
from partialdvl_bench.mission import Mission
from partialdvl_bench.scores import energy_score, nees, negative_log_likelihood
from partialdvl_bench.tables import SCORES
from partialdvl_bench.tasks import RANKED, climatology

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Times = NDArray[np.int64]

VELOCITY_TASK, PINGS_TASK = "T1 velocity from beams", "T5 real pings"
STRIDE = 5
"""T1 takes every fifth ping with all beams, which keeps a mission of an hour small."""
RECORDING = "riverpro"
"""The recording of T5: a Teledyne RiverPro, BSD-3 (recorded.toml names the source)."""

Answer = tuple[Floats, Floats]
"""Values (n, d) and covariances (n, d, d), NaN where there is no answer."""


@dataclass(frozen=True, eq=False)
class MaskedPings:
    """Pings as an estimator may use them: beams (n, B), NaN where left out; which are left (n, B); noise 1 sigma."""

    geometry: BeamGeometry
    time_ns: Times
    velocity_mps: Floats
    valid: Flags
    sd_mps: float

    @property
    def masks(self) -> list[str]:
        """The mask of each row."""
        return ["".join("1" if one else "0" for one in row) for row in self.valid]


def every_mask(beams: int) -> list[tuple[bool, ...]]:
    """All sets of one beam or more.

    >>> len(every_mask(4)), every_mask(2)
    (15, [(False, True), (True, False), (True, True)])
    """
    return [mask for mask in product((False, True), repeat=beams) if any(mask)]


def masked_pings(mission: Mission) -> tuple[MaskedPings, Floats | None]:
    """The pings of T1, with every mask, and the true velocities (n, 3), None where they are sealed."""
    whole = np.flatnonzero(mission.pings.valid.all(axis=1))[::STRIDE]
    masks = np.array(every_mask(mission.geometry.beams))
    rows, valid = np.repeat(whole, len(masks)), np.tile(masks, (len(whole), 1))
    times = mission.pings.time_ns[rows]
    pings = MaskedPings(
        mission.geometry,
        times,
        np.where(valid, mission.pings.velocity_mps[rows], np.nan),
        valid,
        mission.model.of(DvlModel).beam_noise_sd_mps,
    )
    truth = mission.truth
    if truth is None:
        return pings, None
    return pings, truth.velocity_p_mps[np.searchsorted(truth.time_ns, times)]


def _alone(pings: MaskedPings, method: FixMethod) -> Answer:
    """A velocity from each ping alone."""
    fix = solve_velocity(
        pings.geometry,
        np.nan_to_num(pings.velocity_mps),
        pings.valid,
        method=method,
        beam_sd_mps=pings.sd_mps,
    )
    return fix.velocity_p_mps, fix.cov_m2ps2


def _with_prior(pings: MaskedPings, mean: Floats, cov: Floats) -> Answer:
    """Bayes' rule for Gaussian beams and a prior (n, 3), (n, 3, 3): P⁺ = (P⁻¹ + BᵀB/σ²)⁻¹."""
    fix = solve_velocity(
        pings.geometry, np.nan_to_num(pings.velocity_mps), pings.valid, method="info", beam_sd_mps=pings.sd_mps,
        prior_velocity_p_mps=mean, prior_cov_m2ps2=cov,
    )  # fmt: skip
    information = fix.information_s2pm2
    posterior = np.linalg.inv(np.linalg.inv(cov) + information)
    gain = posterior @ information
    velocity = mean + np.einsum("nij,nj->ni", gain, fix.observed_velocity_p_mps - mean)
    return velocity, np.asarray(posterior, dtype=np.float64)


def _usual(count: int) -> Answer:
    mean, cov = climatology()["velocity"]
    return np.tile(mean, (count, 1)), np.tile(cov, (count, 1, 1))


VELOCITY_ENTRANTS: dict[str, Callable[[MaskedPings], Answer]] = {
    "climatology": lambda pings: _usual(len(pings.time_ns)),
    "least_squares": lambda pings: _alone(pings, "lc"),
    "nsv": lambda pings: _alone(pings, "nsv"),
    "weak_sway": lambda pings: _alone(pings, "weak_sway"),
    "bayes": lambda pings: _with_prior(pings, *_usual(len(pings.time_ns))),
}
"""Our entrants of T1; `bayes` combines the beams with the climatology of the train split."""


def velocity_scores(mission: Mission, answer: Answer, method: str) -> pl.DataFrame:
    """The scores of T1 on one mission (`tables.SCORES`), over all masks and by the number of beams left."""
    pings, truth = masked_pings(mission)
    if truth is None or not len(truth):
        return pl.DataFrame(schema=dict(SCORES))
    usual = _usual(len(truth))
    answered = _answered(answer)
    error = np.where(answered[:, None], answer[0], usual[0]) - truth
    cov = np.where(answered[:, None, None], answer[1], usual[1])
    left = pings.valid.sum(axis=1)
    rows = [("", np.ones(len(truth), dtype=np.bool_))]
    rows += [(f", {count} beams" if count > 1 else ", 1 beam", left == count) for count in np.unique(left)]
    table = []
    for words, part in rows:
        for score, value in _scores(error[part], cov[part], answered[part]):
            table.append((method, mission.name, VELOCITY_TASK, score + words, value, int(part.sum())))
    return pl.DataFrame(table, schema=dict(SCORES), orient="row")


@lru_cache(maxsize=1)
def recorded_pings() -> tuple[BeamGeometry, Times, Floats]:
    """The complete pings of T5: geometry, times (n,) and readings (n, 4)."""
    with resources.as_file(resources.files("partialdvl_bench") / f"{RECORDING}.csv") as path:
        frame = pl.read_csv(path, comment_prefix="#")
    return (
        read_geometry("teledyne_20").geometry,
        frame["time_ns"].to_numpy(),
        frame.select(f"beam{k}_mps" for k in range(1, 5)).to_numpy(),
    )


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Rows of T5: ping, mask (n, 4) of the beams left, and the beam (n,) that is left out and asked."""

    ping: NDArray[np.int64]
    mask: Flags
    beam: NDArray[np.int64]


def left_out(pings: int, beams: int = 4) -> LeftOut:
    """Every ping, mask and beam left out."""
    one = [(mask, beam) for mask in every_mask(beams) for beam in range(beams) if not mask[beam]]
    masks, asked = np.array([mask for mask, _ in one]), np.array([beam for _, beam in one])
    return LeftOut(np.repeat(np.arange(pings), len(one)), np.tile(masks, (pings, 1)), np.tile(asked, pings))


def noise_so_far(geometry: BeamGeometry, readings: Floats, first_sd_mps: float, least: int = 20) -> Floats:
    """(n,) noise of a beam before each ping: robust σ of the closures of the pings before; at first the file's."""
    closure = readings @ closure_rows(geometry.directions_p)[0]
    return np.array(
        [1.4826 * np.median(np.abs(closure[:k])) if k >= least else first_sd_mps for k in range(len(closure))]
    )


def _reading(rows: LeftOut, velocity: Floats, cov: Floats, sd_mps: Floats) -> Answer:
    """What the beam that is asked reads, from a velocity (n, 3): b·v with bᵀPb + σ²."""
    directions = np.asarray(recorded_pings()[0].directions_p)[rows.beam]
    value = np.einsum("ni,ni->n", directions, velocity)
    variance = np.einsum("ni,nij,nj->n", directions, cov, directions) + sd_mps**2
    return value[:, None], variance[:, None, None]


def _from_ping(rows: LeftOut, method: FixMethod | None) -> Answer:
    """From the beams left, by a method of single pings; without one, with the random walk of the pings before."""
    geometry, time_ns, readings = recorded_pings()
    sd = noise_so_far(geometry, readings, read_geometry("teledyne_20").beam_sd_mps[0])
    velocity, cov = np.full((len(rows.ping), 3), np.nan), np.full((len(rows.ping), 3, 3), np.nan)
    prior = random_walk(
        geometry, time_ns, readings, np.ones(readings.shape, dtype=np.bool_), np.tile(sd[:, None], (1, 4)),
        VelocityWalk(),
    )  # fmt: skip
    for ping in range(len(readings)):
        mine = rows.ping == ping
        part = MaskedPings(
            geometry, time_ns[rows.ping[mine]], np.where(rows.mask[mine], readings[ping], np.nan), rows.mask[mine],
            float(sd[ping]),
        )  # fmt: skip
        if method is None:
            count = int(mine.sum())
            mean, spread = prior.velocity_p_mps[ping], prior.cov_m2ps2[ping]
            velocity[mine], cov[mine] = _with_prior(
                part, np.tile(mean, (count, 1)), np.tile(spread, (count, 1, 1))
            )
        else:
            velocity[mine], cov[mine] = _alone(part, method)
    return _reading(rows, velocity, cov, sd[rows.ping])


def _last_reading(rows: LeftOut) -> Answer:
    """The beam's reading of the ping before; its σ is the robust one of such differences so far."""
    _, _, readings = recorded_pings()
    steps = np.diff(readings, axis=0)
    sd = np.array([1.4826 * np.median(np.abs(steps[:k])) if k >= 5 else 1.0 for k in range(len(readings))])
    value = readings[np.maximum(rows.ping - 1, 0), rows.beam]
    first = rows.ping == 0
    return np.where(first, np.nan, value)[:, None], (sd[rows.ping] ** 2)[:, None, None]


PING_ENTRANTS: dict[str, Callable[[LeftOut], Answer]] = {
    "last_reading": _last_reading,
    "least_squares": lambda rows: _from_ping(rows, "lc"),
    "nsv": lambda rows: _from_ping(rows, "nsv"),
    "weak_sway": lambda rows: _from_ping(rows, "weak_sway"),
    "random_walk": lambda rows: _from_ping(rows, None),
}
"""Our entrants of T5; `random_walk` combines the beams left with a filter of the velocity over the pings before."""


def ping_scores(answer: Answer, method: str) -> pl.DataFrame:
    """The scores of T5 (`tables.SCORES`); blocks of thirty pings stand in place of missions.

    A row without an answer is scored as the readings of the whole recording are spread: mean and variance of them all.
    """
    _, _, readings = recorded_pings()
    rows = left_out(len(readings))
    answered = _answered(answer)
    target = readings[rows.ping, rows.beam][:, None]
    error = np.where(answered[:, None], answer[0], readings.mean()) - target
    cov = np.where(answered[:, None, None], answer[1], readings.var())
    table = []
    for block in range(-(-len(readings) // 30)):
        part = rows.ping // 30 == block
        for score, value in _scores(error[part], cov[part], answered[part]):
            table.append((method, f"{RECORDING} {block + 1}", PINGS_TASK, score, value, int(part.sum())))
    return pl.DataFrame(table, schema=dict(SCORES), orient="row")


def _answered(answer: Answer) -> Flags:
    return np.asarray(np.isfinite(answer[0]).all(axis=1) & np.isfinite(answer[1]).all(axis=(1, 2)))


def _scores(error: Floats, cov: Floats, answered: Flags) -> Iterator[tuple[str, float]]:
    size = error.shape[1]
    yield RANKED, float(negative_log_likelihood(error, cov).mean()) / size
    yield "energy score, m/s", float(energy_score(error, cov).mean())
    yield "RMS, m/s", float(rms(np.linalg.norm(error, axis=1)))
    yield "NEES a component", float(nees(error, cov).mean()) / size
    yield "availability", float(answered.mean())
