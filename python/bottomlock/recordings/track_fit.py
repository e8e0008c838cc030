"""A track turned and shifted onto recorded positions."""

from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.streams import Floats, Integers, Times

SIGMAS = 5.0
LEAST_EXTENT_M = 5.0
FEWEST = 10
PARTS, SHORTEST_S, LONGEST_S = 4, 30.0, 60.0
"""Windows of a track, as many at least for a sigma, and their lengths: long against the noise of positions, short
against a walk of the heading."""
LEAST_SD_RAD = float(np.deg2rad(0.3))
UNLIKE, BEYOND, WANDER_M = 0.15, 5.0, 3.0
"""Part of the extent, multiple of the claimed error, and error of good positions that lasts, m: no turn and shift of a
track leaves more than all three on its own dive."""


@dataclass(frozen=True)
class TrackFit:
    """A track against positions.

    Attributes:
        name: of the positions.
        angle_rad, sd_rad: turn of the track by which its ways over windows fit best, and its 1 sigma by their scores;
            infinite for too few of them.
        agreement: correlation of these ways after it.
        before_m, after_m, lasting_m: RMS distance before and after it, and after it without what is white.
        extent_m, own_extent_m: RMS extent of the positions and of the track.
        claimed_m: RMS σ that the track claims.
    """

    name: str
    angle_rad: float
    sd_rad: float
    agreement: float
    before_m: float
    after_m: float
    lasting_m: float
    extent_m: float
    own_extent_m: float
    claimed_m: float

    @property
    def whole_sd_rad(self) -> float:
        """1 sigma of the turn of the whole track, with errors that last, as of a position that drifts."""
        return max(LEAST_SD_RAD, self.after_m / self.extent_m)

    @property
    def turned(self) -> bool:
        """Whether the track is turned as a whole and fits after it."""
        least = max(SIGMAS * self.whole_sd_rad, float(np.deg2rad(2.0)))
        return abs(self.angle_rad) > least and self.after_m < 0.5 * self.before_m

    @property
    def unlike(self) -> bool:
        """Whether no turn and no shift makes one of the other."""
        least = max(UNLIKE * max(self.extent_m, self.own_extent_m), BEYOND * self.claimed_m)
        return self.lasting_m > max(least, WANDER_M)


def fit_track(
    name: str, time_ns: Times, track_t_m: Floats, times: Times, place_t_m: Floats, claimed_m: float = 0.0
) -> TrackFit | None:
    """The turn about the vertical and the shift of a track; None for too few positions or too short a way.

    Args:
        name: of the positions.
        time_ns, track_t_m: (n,), (n, 2 or more), north and east first.
        times, place_t_m: (k,), (k, 2 or more).
        claimed_m: RMS σ that the track claims.
    """
    inside = (times >= time_ns[0]) & (times <= time_ns[-1]) & np.isfinite(place_t_m[:, :2]).all(axis=1)
    if inside.sum() < FEWEST:
        return None
    times, place = times[inside], place_t_m[inside]
    # North + i east: a turn is a factor.
    own, other = (
        one - one.mean()
        for one in (
            np.interp(times - time_ns[0], time_ns - time_ns[0], track_t_m[:, 0] + 1j * track_t_m[:, 1]),
            place[:, 0] + 1j * place[:, 1],
        )
    )
    own_extent, extent = _rms(own), _rms(other)
    if extent < LEAST_EXTENT_M:
        return None
    marks = _marks(times)
    gone, moved = np.diff(own[marks]), np.diff(other[marks])
    product = np.conj(gone) * moved
    size = max(abs(product.sum()), 1e-12)
    turn = product.sum() / size
    left = turn * own - other
    after = _rms(left)
    white = 0.5 * _rms(np.diff(left)) ** 2
    sd = float(np.linalg.norm((product * np.conj(turn)).imag) / size)
    return TrackFit(
        name, float(np.angle(turn)), sd if len(product) >= PARTS else np.inf,
        float(size / max(np.linalg.norm(gone) * np.linalg.norm(moved), 1e-12)), _rms(own - other), after,
        float(np.sqrt(max(after**2 - white, 0.0))), extent, own_extent, claimed_m,
    )  # fmt: skip


def _marks(times: Times) -> Integers:
    """Rows about a window apart."""
    window_s = np.clip((times[-1] - times[0]) * 1e-9 / PARTS, SHORTEST_S, LONGEST_S)
    return np.flatnonzero(np.diff((times - times[0]) // round(window_s * 1e9), prepend=-1))


def _rms(values: np.ndarray[tuple[int], np.dtype[np.complex128]]) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))
