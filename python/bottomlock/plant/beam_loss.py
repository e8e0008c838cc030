"""Beam validity: range and incidence, schedules, Markov dropouts, altitude loss and recorded patterns.

Every rule gives a validity array; rules combine by "and". Random rules are drawn per run and beam from their own
stream, so that run k alone equals run k in the campaign.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import ScenarioError
from bottomlock.plant.maths import FloatArray, IntArray
from bottomlock.plant.seabed import Footprints

BoolArray = NDArray[np.bool_]

_MARKOV_STREAM = 0xB1
_ALTITUDE_STREAM = 0xA1
_RANGE_STREAM = 0xD1
_FOREVER_S = 9e9


@dataclass(frozen=True)
class ReturnLimits:
    """Ranges (m) and greatest angle of incidence (rad) at which a beam returns."""

    min_range_m: float
    max_range_m: float
    max_incidence_rad: float = 0.5 * np.pi

    def __post_init__(self) -> None:
        if not 0.0 <= self.min_range_m < self.max_range_m or not 0.0 < self.max_incidence_rad <= 0.5 * np.pi:
            raise ScenarioError(
                f"range {self.min_range_m:g} to {self.max_range_m:g} m, incidence "
                f"{self.max_incidence_rad:g} rad",
                place="beam limits",
                expected="0 <= min < max range and an incidence within 0 to 90 deg",
            )

    def valid(self, footprints: Footprints) -> BoolArray:
        """(E, B): True where the beam meets the bottom within the limits of range and incidence."""
        hit = np.isfinite(footprints.range_m)
        range_m = np.where(hit, footprints.range_m, np.inf)
        incidence_rad = np.where(hit, footprints.incidence_rad, np.pi)
        return (
            hit
            & (range_m >= self.min_range_m)
            & (range_m <= self.max_range_m)
            & (incidence_rad <= self.max_incidence_rad)
        )


@dataclass(frozen=True)
class Outage:
    """Beams (1 to B) lost from start_s (included) to end_s (excluded)."""

    beams: tuple[int, ...]
    start_s: float
    end_s: float


def scheduled(time_ns: IntArray, beams: int, outages: Sequence[Outage]) -> BoolArray:
    """(E, B) validity under outages, at times (E,) ns from the start.

    Raises:
        ScenarioError: naming the outage, for a beam that does not exist or an end that is not after its start.
    """
    valid = np.ones((len(time_ns), beams), dtype=np.bool_)
    for number, outage in enumerate(outages, start=1):
        for beam in outage.beams:
            if not 1 <= beam <= beams:
                raise ScenarioError(
                    f"beam {beam} does not exist", place=f"outage {number}", expected=f"1 to {beams}"
                )
        if not outage.end_s > outage.start_s:
            raise ScenarioError(
                f"end_s {outage.end_s:g} must be after start_s {outage.start_s:g}", place=f"outage {number}"
            )
        within = (time_ns >= round(outage.start_s * 1e9)) & (
            time_ns < round(min(outage.end_s, _FOREVER_S) * 1e9)
        )
        for beam in outage.beams:
            valid[within, beam - 1] = False
    return valid


@dataclass(frozen=True)
class MarkovDropout:
    """A two-state Markov chain: a beam is up for mean_up_s and down for mean_down_s on average."""

    mean_up_s: float
    mean_down_s: float

    def __post_init__(self) -> None:
        if not (self.mean_up_s > 0.0 and self.mean_down_s > 0.0):
            raise ScenarioError(
                f"is {self.mean_up_s:g}, mean_down_s {self.mean_down_s:g}",
                place="Markov dropout",
                key="mean_up_s",
                expected="both above 0 s",
            )

    @property
    def availability(self) -> float:
        """Fraction of the time that the beam is up."""
        return self.mean_up_s / (self.mean_up_s + self.mean_down_s)

    def states(self, time_ns: IntArray, uniforms: FloatArray) -> BoolArray:
        """True where the beam is up at times (E,), from uniforms (..., E); the chain begins in its steady state.

        The exact two-state chain: P(up | up, dt) = a + (1 - a) exp(-dt (1/up + 1/down)), so that the means hold at any
        ping rate.
        """
        steady = self.availability
        rate = 1.0 / self.mean_up_s + 1.0 / self.mean_down_s
        memory = np.exp(-np.diff(time_ns) * 1e-9 * rate)
        up = np.empty(uniforms.shape, dtype=np.bool_)
        up[..., 0] = uniforms[..., 0] < steady
        for index, kept in enumerate(memory, start=1):
            probability = steady + np.where(up[..., index - 1], 1.0 - steady, -steady) * kept
            up[..., index] = uniforms[..., index] < probability
        return up


def markov_valid(
    time_ns: IntArray,
    dropouts: Sequence[MarkovDropout | None],
    *,
    seed: int,
    trajectory_key: int,
    first_run: int,
    runs: int,
) -> BoolArray:
    """(runs, E, B) validity of independent beams; None for a beam that never drops out."""
    valid = np.ones((runs, len(time_ns), len(dropouts)), dtype=np.bool_)
    for beam, dropout in enumerate(dropouts):
        if dropout is not None:
            draws = _uniforms(time_ns, seed, trajectory_key, first_run, runs, _MARKOV_STREAM, beam)
            valid[:, :, beam] = dropout.states(time_ns, draws)
    return valid


def altitude_loss(
    time_ns: IntArray,
    beams: int,
    dropout: MarkovDropout,
    *,
    seed: int,
    trajectory_key: int,
    first_run: int,
    runs: int,
) -> BoolArray:
    """(runs, E, B) validity when all beams are lost together."""
    draws = _uniforms(time_ns, seed, trajectory_key, first_run, runs, _ALTITUDE_STREAM, 0)
    return np.repeat(dropout.states(time_ns, draws)[:, :, None], beams, axis=2)


def replayed(time_ns: IntArray, recorded_time_ns: IntArray, recorded_valid: BoolArray) -> BoolArray:
    """(E, B) validity of the latest recorded ping at each time; a record that is too short is repeated end to end.

    Raises:
        ScenarioError: for a record with fewer than two pings, times that do not rise, or a pattern of another shape.
    """
    stamps, pattern = np.asarray(recorded_time_ns), np.asarray(recorded_valid, dtype=np.bool_)
    if pattern.ndim != 2 or len(stamps) != len(pattern) or len(stamps) < 2:
        raise ScenarioError(
            f"{len(stamps)} times and a pattern of shape {pattern.shape}",
            place="recorded validity",
            expected="(pings, beams)",
        )
    steps = np.diff(stamps)
    if (steps <= 0).any():
        row = int(np.flatnonzero(steps <= 0)[0]) + 2
        raise ScenarioError(
            f"the time of row {row} is not after that of row {row - 1}", place="recorded validity"
        )
    period = int(stamps[-1] - stamps[0] + np.median(steps))
    phase = (np.asarray(time_ns) - int(time_ns[0])) % period + int(stamps[0])
    return np.asarray(pattern[np.searchsorted(stamps, phase, side="right") - 1])


def combine(*rules: BoolArray) -> BoolArray:
    """Validity under all rules: (E, B) and (runs, E, B) arrays joined by "and"."""
    valid = rules[0]
    for rule in rules[1:]:
        valid = valid & rule
    return np.ascontiguousarray(valid)


def noisy_ranges(range_m: FloatArray, sd_m: float, *, seed: int, trajectory_key: int, run: int) -> FloatArray:
    """Measured ranges (E, B), m: white noise of standard deviation sd_m added, drawn per run and beam."""
    noise = [
        generator(seed, trajectory_key, run, _RANGE_STREAM, beam).standard_normal(len(range_m))
        for beam in range(range_m.shape[1])
    ]
    return np.asarray(range_m + sd_m * np.stack(noise, axis=1))


def generator(seed: int, trajectory_key: int, run: int, stream: int, beam: int) -> np.random.Generator:
    """Random generator of one stream of one beam of one run."""
    key = [seed, trajectory_key & 0xFFFFFFFF, trajectory_key >> 32, run, stream, beam]
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(key)))


def _uniforms(
    time_ns: IntArray, seed: int, trajectory_key: int, first_run: int, runs: int, stream: int, beam: int
) -> FloatArray:
    numbers = range(first_run, first_run + runs)
    return np.stack(
        [generator(seed, trajectory_key, run, stream, beam).random(len(time_ns)) for run in numbers]
    )
