"""What the benchmark adds to simulated beams: noise of the mission's kind, recorded losses, shoals of fish."""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bottomlock.plant.beam_loss import replayed
from partialdvl_bench.mission_list import MissionSpec, levels, recorded
from partialdvl_bench.seeds import stream

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
Flags = NDArray[np.bool_]

HALF_WIDTH = 0.683
"""Part of the noise within one σ of the data sheet, whatever its distribution."""


def noise(kind: str, sd_mps: float, shape: tuple[int, int], draw: np.random.Generator) -> Floats:
    """Noise (n, beams), m/s, independent between beams and pings, of which 68.3 % lie within `sd_mps`.

    Examples:
        >>> wide = noise("student_t3", 0.02, (20_000, 4), np.random.default_rng(1))
        >>> float(np.mean(np.abs(wide) < 0.02).round(2)), bool(np.abs(wide).max() > 0.2)
        (0.68, True)
    """
    if kind == "gaussian":
        return np.asarray(sd_mps * draw.standard_normal(shape))
    if kind == "student_t3":
        scale = stats.t(3).ppf(0.5 + 0.5 * HALF_WIDTH)
        return np.asarray(sd_mps / scale * draw.standard_t(3, shape))
    return np.asarray(sd_mps * draw.choice(np.array(recorded()["noise"]["residuals"]), shape))


def recorded_pattern(time_ns: Times, beams: int, draw: np.random.Generator) -> Flags:
    """Validity (n, beams) as recorded, from a phase that is drawn; of three beams, the first three recorded ones."""
    loss = recorded()["loss"]
    stamps = np.round(np.array(loss["time_s"]) * 1e9).astype(np.int64)
    pattern = np.array([[mark == "1" for mark in row] for row in loss["beams"]])[:, :beams]
    period = int(stamps[-1] - stamps[0] + np.median(np.diff(stamps)))
    # A ping before the first one sets the phase, as the record begins with the first time given.
    first = np.concatenate([[time_ns[0] - int(draw.integers(period))], time_ns])
    return replayed(first, stamps, pattern)[1:]


def shoals(
    time_ns: Times,
    directions_p: Floats,
    draw: np.random.Generator,
    *,
    mean_apart_s: float,
    mean_lasting_s: float,
    speed_mps: tuple[float, float],
    second_beam: float,
    lost_in_burst: float,
) -> tuple[Floats, Flags]:
    """Errors (n, beams), m/s, and validity (n, beams) of beams that meet fish which swim horizontally.

    A beam whose target has the velocity u reads b · (v - u), so that its error is -b · u while the burst lasts.
    """
    beams = len(directions_p)
    time_s = (time_ns - time_ns[0]) * 1e-9
    error, valid = np.zeros((len(time_s), beams)), np.ones((len(time_s), beams), dtype=np.bool_)
    at = draw.exponential(mean_apart_s)
    while at < time_s[-1]:
        end = at + draw.exponential(mean_lasting_s)
        within = (time_s >= at) & (time_s < end)
        speed, course = draw.uniform(speed_mps[0], speed_mps[1]), draw.uniform(0.0, 2.0 * np.pi)
        swims = speed * np.array([np.cos(course), np.sin(course), 0.0])
        first = int(draw.integers(beams))
        met = [first, (first + 1) % beams] if draw.random() < second_beam else [first]
        others = [beam for beam in range(beams) if beam not in met]
        lost = draw.random() < lost_in_burst
        for beam in met:
            error[within, beam] -= directions_p[beam] @ swims
        for beam in others if lost else ():
            valid[within, beam] = False
        at = end + draw.exponential(mean_apart_s)
    return error, valid


def with_errors(
    spec: MissionSpec, seed: int, time_ns: Times, velocity_mps: Floats, valid: Flags, directions_p: Floats
) -> tuple[Floats, Flags]:
    """Beams (n, B) and validity of a mission with its noise and the losses that a scenario cannot have."""
    beams = velocity_mps.shape[1]
    sd_mps = levels()["dvl"][spec.dvl]["beam_noise_mps"]
    velocity = velocity_mps + noise(spec.noise, sd_mps, velocity_mps.shape, stream(seed, spec.name, "noise"))
    draw = stream(seed, spec.name, "beams")
    if spec.loss == "recorded":
        valid = valid & recorded_pattern(time_ns, beams, draw)
    elif spec.loss == "fish":
        error, returned = shoals(time_ns, directions_p, draw, **levels()["loss"]["fish"])
        velocity, valid = velocity + error, valid & returned
    return np.where(valid, velocity, np.nan), valid
