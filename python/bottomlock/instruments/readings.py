"""What the instruments of a vehicle measure in a run, on one clock, and the velocity that a DVL states itself."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.encoders.ping import Ping
from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry, solve_velocity
from bottomlock.recordings.streams import Depths, Inertial

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

SOUND_SPEED_MPS = 1500.0
LEAST_BEAMS = 3
"""A DVL states its own velocity from three beams on."""


@dataclass(frozen=True, eq=False)
class TrueStates:
    """True states at the pings, where the source is a simulation: position (n, 3), velocity (n, 3), angles (n, 3)."""

    position_t_m: Floats
    velocity_p_mps: Floats
    rpy_rad: Floats


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of a run or recording.

    Attributes:
        name: of the scenario or file.
        geometry: the beams.
        beam_sd_mps: (beams,) noise, 1 sigma, for the covariance that the DVL states.
        time_ns: (n,) times of validity of the pings, rising.
        beam_mps: (n, beams) as drawn or recorded; NaN where the beam is lost.
        range_m: (n, beams) along the beam; NaN where the beam is lost.
        stated: (n,) whether the instrument may state its own velocity; false where a recorded one called it invalid.
        imu: the IMU's readings, or None.
        depth: the depth sensor's readings, or None.
        truth: true states at the pings, or None for a recording.
        water_mps: (n, beams) what the water returned at each ping, as `beam_mps`; None without water.
        water_range_m: along the beams to the middle of its cell.
        water_sd_mps: its noise, 1 sigma.
    """

    name: str
    geometry: BeamGeometry
    beam_sd_mps: Floats
    time_ns: Times
    beam_mps: Floats
    range_m: Floats
    stated: NDArray[np.bool_]
    imu: Inertial | None = None
    depth: Depths | None = None
    truth: TrueStates | None = None
    water_mps: Floats | None = None
    water_range_m: float = 0.0
    water_sd_mps: float = 0.05

    @property
    def first_ns(self) -> int:
        """Time of the first reading of any instrument."""
        others = [one.time_ns[0] for one in (self.imu, self.depth) if one is not None and len(one.time_ns)]
        return int(min([self.time_ns[0], *others]))

    def first_seconds(self, duration_s: float) -> "Readings":
        """The readings of the first seconds.

        Raises:
            DataError: where no ping lies in them.
        """
        last_ns = self.first_ns + round(duration_s * 1e9)
        keep = self.time_ns <= last_ns
        if not keep.any():
            raise DataError(f"no ping in the first {duration_s:g} s", place=self.name)
        imu, depth, truth = self.imu, self.depth, self.truth
        if imu is not None:
            imu = imu.rows(slice(int(np.searchsorted(imu.time_ns, last_ns, side="right"))))
        if depth is not None:
            depth = depth.kept(depth.time_ns <= last_ns)
        if truth is not None:
            truth = TrueStates(truth.position_t_m[keep], truth.velocity_p_mps[keep], truth.rpy_rad[keep])
        parts = {name: getattr(self, name)[keep] for name in ("time_ns", "beam_mps", "range_m", "stated")}
        water = None if self.water_mps is None else self.water_mps[keep]
        return replace(self, **parts, imu=imu, depth=depth, truth=truth, water_mps=water)


def ranges_or_flat(
    range_m: Floats | None, beam_mps: Floats, geometry: BeamGeometry, altitude_m: float
) -> Floats:
    """Ranges (n, beams): as given, else to a flat bottom at an altitude, along each beam; NaN for a lost beam."""
    down = np.maximum(np.asarray(geometry.directions_p)[:, 2], 1e-3)
    flat = np.broadcast_to(altitude_m / down, beam_mps.shape)
    known = flat if range_m is None else np.where(np.isfinite(range_m) & (range_m > 0.0), range_m, flat)
    return np.where(np.isfinite(beam_mps), known, np.nan)


def pings(readings: Readings, *, latency_ns: int, offset_ns: int = 0) -> Iterator[Ping]:
    """The pings, with the velocity that the instrument states where it has three beams that see all axes.

    Args:
        readings: the run.
        latency_ns: the instrument's own time from the last echo to the sending of the record.
        offset_ns: added to every time: the clock of the instruments.

    Yields:
        A ping each. It left the transducer half the longest echo before its time of validity, the reflection at the
        bottom, and is sent half of it and the latency after: the echo's delay is 2R/c. One without an echo listens as
        long as the one before.
    """
    valid = np.isfinite(readings.beam_mps)
    fixes = solve_velocity(
        readings.geometry, readings.beam_mps, valid, method="lc", beam_sd_mps=readings.beam_sd_mps
    )
    known = (
        np.isfinite(fixes.velocity_p_mps).all(axis=1) & (valid.sum(axis=1) >= LEAST_BEAMS) & readings.stated
    )
    down = np.asarray(readings.geometry.directions_p)[:, 2]
    before_ns, half_ns = None, 0
    for k, time in enumerate(readings.time_ns.tolist()):
        ranges = readings.range_m[k]
        there = np.isfinite(ranges)
        if there.any():
            half_ns = round(float(ranges[there].max()) / SOUND_SPEED_MPS * 1e9)
        truth = readings.truth
        yield Ping(
            time_ns=time + offset_ns,
            trigger_ns=time + offset_ns - half_ns,
            transmission_ns=time + offset_ns + half_ns + latency_ns,
            interval_ns=0 if before_ns is None else time - before_ns,
            number=k + 1,
            beam_velocity_mps=readings.beam_mps[k],
            range_m=ranges,
            velocity_p_mps=fixes.velocity_p_mps[k] if known[k] else None,
            covariance_m2ps2=fixes.cov_m2ps2[k] if known[k] else None,
            beam_sd_mps=float(readings.beam_sd_mps.mean()),
            altitude_m=float((ranges * down)[there].mean()) if there.any() else None,
            attitude_rad=None if truth is None else truth.rpy_rad[k],
            sound_speed_mps=SOUND_SPEED_MPS,
            water_velocity_mps=_water_of(readings, k),
            water_range_m=readings.water_range_m,
            water_sd_mps=readings.water_sd_mps,
        )
        before_ns = time


def _water_of(readings: Readings, ping: int) -> Floats | None:
    """(beams,) what the water returned at a ping; None where it returned nothing."""
    if readings.water_mps is None:
        return None
    found: Floats = readings.water_mps[ping]
    return found if np.isfinite(found).any() else None
