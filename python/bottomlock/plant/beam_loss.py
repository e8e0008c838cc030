"""Beam validity: range and incidence, schedules, Markov dropouts, altitude loss and recorded patterns.

Every rule gives a validity array; rules combine by "and". Random rules are drawn per run and beam from their own
stream, so that run k alone equals run k in the campaign.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.config.scenario_sections import AltitudeLoss, Dropout, Dvl, Outage
from bottomlock.errors import ScenarioError
from bottomlock.plant.maths import FloatArray, IntArray
from bottomlock.plant.seabed import Footprints

BoolArray = NDArray[np.bool_]

_MARKOV_STREAM = 0xB1
_ALTITUDE_STREAM = 0xA1
_RANGE_STREAM = 0xD1


def returning(footprints: Footprints, dvl: Dvl) -> BoolArray:
    """(E, B): True where the beam meets the bottom within the instrument's limits of range and incidence."""
    hit = np.isfinite(footprints.range_m)
    range_m = np.where(hit, footprints.range_m, np.inf)
    incidence_rad = np.where(hit, footprints.incidence_rad, np.pi)
    return (
        hit
        & (range_m >= dvl.min_range_m)
        & (range_m <= dvl.max_range_m)
        & (incidence_rad <= units.rad_from_deg(dvl.max_incidence_deg))
    )


def scheduled(time_ns: IntArray, beams: int, lost: Sequence[int], outages: Sequence[Outage]) -> BoolArray:
    """(E, B) validity at times (E,), ns from the start, where some beams (1 to B) are lost throughout, others at times.

    >>> scheduled(np.array([10**9]), 4, (3, 4), ()).tolist()
    [[True, True, False, False]]
    """
    valid = np.ones((len(time_ns), beams), dtype=np.bool_)
    for beam in lost:
        valid[:, beam - 1] = False
    for outage in outages:
        within = (time_ns >= outage.from_s * 1e9) & (time_ns < outage.to_s * 1e9)
        for beam in outage.beams:
            valid[within, beam - 1] = False
    return valid


def chain(times: Dropout | AltitudeLoss, time_ns: IntArray, uniforms: FloatArray) -> BoolArray:
    """True where a two-state Markov chain is up at times (E,), from uniforms (..., E); it begins in its steady state.

    The exact chain: P(up | up, dt) = a + (1 - a) exp(-dt (1/up + 1/down)) with the availability a, so that the means
    hold at any ping rate.
    """
    steady = times.mean_up_s / (times.mean_up_s + times.mean_down_s)
    rate = 1.0 / times.mean_up_s + 1.0 / times.mean_down_s
    memory = np.exp(-np.diff(time_ns) * 1e-9 * rate)
    up = np.empty(uniforms.shape, dtype=np.bool_)
    up[..., 0] = uniforms[..., 0] < steady
    for index, kept in enumerate(memory, start=1):
        probability = steady + np.where(up[..., index - 1], 1.0 - steady, -steady) * kept
        up[..., index] = uniforms[..., index] < probability
    return up


def markov_valid(
    time_ns: IntArray,
    beams: int,
    losses: Sequence[Dropout | AltitudeLoss],
    *,
    seed: int,
    trajectory_key: int,
    first_run: int,
    runs: int,
) -> BoolArray:
    """(runs, E, B) validity of independent beams, and of all beams together under an altitude loss."""
    valid = np.ones((runs, len(time_ns), beams), dtype=np.bool_)
    numbers = range(first_run, first_run + runs)
    for loss in losses:
        together = isinstance(loss, AltitudeLoss)
        stream = _ALTITUDE_STREAM if together else _MARKOV_STREAM
        for index in (0,) if isinstance(loss, AltitudeLoss) else [beam - 1 for beam in loss.beams]:
            draws = [
                generator(seed, trajectory_key, run, stream, index).random(len(time_ns)) for run in numbers
            ]
            part = slice(None) if together else slice(index, index + 1)
            valid[:, :, part] &= chain(loss, time_ns, np.stack(draws))[:, :, None]
    return valid


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
