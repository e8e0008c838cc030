"""What the reference of the A-KIT recordings can judge: its positions, velocities and altitudes against the DVL.

And which of the two is at fault where they differ: the innovations of the beams against our own INS say.

The DVL's velocity is turned to the tangent frame with the reference's attitude and integrated. A shift of its stamps, a
scale and a constant yaw are fitted to the reference's horizontal positions, and to its velocities.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Slerp

from bottomlock.recordings.axes import from_angles
from bottomlock.recordings.streams import Times
from bottomlock.replay.compare import innovations_table, samples_table
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import prepare, run_methods
from bottomlock.statistics.rms import rms
from tools.akit import DVL_LEVER_M, akit_case

Array = NDArray[np.float64]
SHIFTS_S = np.arange(-1.0, 1.01, 0.05)
SETTLED_PINGS = 50
"""Pings at the beginning that are left out of the innovations."""
RATE_WINDOW = 51
"""Readings of the gyros, 0.5 s, that are averaged for the lever arm of the DVL."""


@dataclass(frozen=True)
class Fit:
    """The DVL fitted to the reference: stamps are late by `shift_s`, readings times `scale` turned by `yaw_deg`.

    `rms` is the residual, m or m/s; `rms_unshifted` the residual of a fit with the stamps as they are.
    """

    shift_s: float
    scale: float
    yaw_deg: float
    rms: float
    rms_unshifted: float


@dataclass(frozen=True)
class ReferenceQuality:
    """A section's reference against the DVL and against itself.

    Attributes:
        section: its number.
        positions, velocities: the DVL fitted to either.
        own_velocity_rms_m: horizontal positions against the integral of the reference's own velocity, RMS about the
            mean.
        surge_sd_mps, surge_correlation_5s: the DVL's surge less the reference's, about its mean: standard deviation and
            autocorrelation over 5 s.
        altitude_drift_mps, altitude_rms_m: altitude against the integrated velocity of the DVL: slope, and RMS about
            it.
        altitude_step_rms_m: RMS change of that difference in 1 s, 10 s and 100 s.
    """

    section: int
    positions: Fit
    velocities: Fit
    own_velocity_rms_m: float
    surge_sd_mps: float
    surge_correlation_5s: float
    altitude_drift_mps: float
    altitude_rms_m: float
    altitude_step_rms_m: tuple[float, float, float]


@dataclass(frozen=True)
class Innovations:
    """What the beams of a section differ from our own INS by, and its velocity from the reference.

    Attributes:
        section: its number.
        sd_mps: of a beam, about its mean.
        correlation: autocorrelation over 1 s, 5 s and 10 s.
        nis_per_degree: 1 if the beams' noise is as stated.
        surge_error_mps: velocity ahead against the reference, RMS.
        surge_sd_mps: what the filter claims of it, RMS.
    """

    section: int
    sd_mps: float
    correlation: tuple[float, float, float]
    nis_per_degree: float
    surge_error_mps: float
    surge_sd_mps: float


@dataclass(frozen=True, eq=False)
class SectionPath:
    """The DVL and the reference of a section in the tangent frame.

    Attributes:
        time_s, position, velocity: (n,) and (n, 3) of the reference, at the IMU.
        attitude: of the reference, interpolated.
        stamps_s, velocity_p: (m,) and (m, 3) of the DVL, in the platform frame at the DVL.
        imu_s, omega: (k,) and (k, 3) rates of the platform, averaged.
    """

    time_s: Array
    position: Array
    velocity: Array
    attitude: Slerp
    stamps_s: Array
    velocity_p: Array
    imu_s: Array
    omega: Array

    def dvl(self, shift_s: float) -> tuple[Array, Array]:
        """Times within the reference, and the DVL's velocity of the IMU in the tangent frame, if stamps are late."""
        times = self.stamps_s - shift_s
        inside = (times > self.time_s[0]) & (times < self.time_s[-1])
        times = times[inside]
        lever = np.cross(columns_at(times, self.imu_s, self.omega), np.array(DVL_LEVER_M))
        return times, np.asarray(self.attitude(times).apply(self.velocity_p[inside] - lever))


def columns_at(times: Array, own: Array, values: Array) -> Array:
    """Columns of values (n, k) at their `own` times (n,), interpolated to other times."""
    return np.stack([np.interp(times, own, column) for column in values.T], axis=1)


def integral(velocity: Array, time_s: Array) -> Array:
    """Integral of velocities (n, k) from the first time on, by trapezia."""
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time_s)[:, None]
    return np.concatenate([np.zeros((1, velocity.shape[1])), np.cumsum(steps, axis=0)])


def section_path(data: Path, scratch: Path, section: int) -> SectionPath:
    """Reads the DVL and the reference of a section."""
    streams = read_streams(akit_case(data, scratch, section))
    reference, inertial, beams = streams.reference, streams.inertial, streams.beams
    assert reference is not None
    assert reference.position_t_m is not None
    assert reference.velocity_p_mps is not None
    assert reference.attitude is not None
    assert beams.velocity_d_mps is not None
    window = np.ones(RATE_WINDOW) / RATE_WINDOW
    return SectionPath(
        time_s=_seconds(reference.time_ns),
        position=reference.position_t_m,
        velocity=np.asarray(reference.attitude.apply(reference.velocity_p_mps)),
        attitude=Slerp(_seconds(reference.time_ns), reference.attitude),
        stamps_s=_seconds(beams.time_ns),
        velocity_p=np.asarray(from_angles(*streams.instrument.mounting_rpy_rad).apply(beams.velocity_d_mps)),
        imu_s=_seconds(inertial.time_ns),
        omega=np.stack([np.convolve(axis, window, "same") for axis in inertial.omega_p_radps.T], axis=1),
    )


def _seconds(time_ns: Times) -> Array:
    return np.asarray(time_ns * 1e-9, dtype=np.float64)


def reference_quality(data: Path, scratch: Path, section: int) -> ReferenceQuality:
    """Compares the reference of a section with its DVL.

    Args:
        data: folder of the recordings.
        scratch: folder that the geometry file may be written to.
        section: its number.
    """
    path = section_path(data, scratch, section)

    def to_positions(shift_s: float) -> tuple[float, float, float]:
        times, v_t = path.dvl(shift_s)
        there = columns_at(times, path.time_s, path.position)
        return _similarity(integral(v_t, times), there, offset=True)

    def to_velocities(shift_s: float) -> tuple[float, float, float]:
        times, v_t = path.dvl(shift_s)
        return _similarity(v_t, columns_at(times, path.time_s, path.velocity), offset=False)

    own = path.position - integral(path.velocity, path.time_s)
    times, v_t = path.dvl(0.0)
    depth = columns_at(times, path.time_s, path.position)[:, 2] - integral(v_t, times)[:, 2]
    slope, start = np.polyfit(times, depth, 1)
    apart = path.attitude(times).inv().apply(v_t - columns_at(times, path.time_s, path.velocity))[:, 0]
    apart = apart - apart.mean()
    second, ten_seconds, hundred_seconds = (float(rms(depth[k:] - depth[:-k])) for k in (1, 10, 100))
    return ReferenceQuality(
        section=section,
        positions=_best(to_positions),
        velocities=_best(to_velocities),
        own_velocity_rms_m=float(np.sqrt(2.0) * rms((own - own.mean(axis=0))[:, :2])),
        surge_sd_mps=float(rms(apart)),
        surge_correlation_5s=float(np.mean(apart[5:] * apart[:-5]) / np.mean(apart**2)),
        altitude_drift_mps=float(slope),
        altitude_rms_m=float(rms(depth - slope * times - start)),
        altitude_step_rms_m=(second, ten_seconds, hundred_seconds),
    )


def _similarity(moved: Array, target: Array, *, offset: bool) -> tuple[float, float, float]:
    """RMS residual, scale and yaw (rad) of the horizontal similarity that turns `moved` to `target`, (n, 3) each."""
    z, y = moved[:, 0] + 1j * moved[:, 1], target[:, 0] + 1j * target[:, 1]
    if offset:
        z, y = z - z.mean(), y - y.mean()
    factor = np.vdot(z, y) / np.vdot(z, z)
    return float(np.sqrt(np.mean(np.abs(y - factor * z) ** 2))), float(abs(factor)), float(np.angle(factor))


def _best(fit: Callable[[float], tuple[float, float, float]]) -> Fit:
    """The fit at the shift of the least residual, by a parabola through the mean squares about the best of a grid."""
    squares = np.array([fit(shift)[0] ** 2 for shift in SHIFTS_S])
    least = int(np.clip(np.argmin(squares), 2, len(squares) - 3))
    near = slice(least - 2, least + 3)
    a, b, _ = np.polyfit(SHIFTS_S[near], squares[near], 2)
    shift_s = float(-b / (2.0 * a))
    residual, scale, yaw = fit(shift_s)
    return Fit(shift_s, scale, float(np.rad2deg(yaw)), residual, fit(0.0)[0])


def innovations(data: Path, scratch: Path, section: int) -> Innovations:
    """Runs `tc` with every beam of a section as recorded, from a drawn start.

    Args:
        data: folder of the recordings.
        scratch: folder that the geometry file may be written to.
        section: its number.
    """
    case = akit_case(data, scratch, section, drawn=True, replay='runs = 1\nmethods = ["tc"]')
    prepared = prepare(case, read_streams(case), 0)
    rerun = run_methods(case, prepared, None)
    pings = innovations_table(case, "recorded", rerun)[SETTLED_PINGS:]
    beams = pings.select(f"beam{k}_innovation_mps" for k in range(1, 5)).to_numpy()
    beams = beams - np.nanmean(beams, axis=0)
    square = np.nanmean(beams**2)
    second, five, ten = (float(np.nanmean(beams[k:] * beams[:-k]) / square) for k in (1, 5, 10))
    samples = samples_table(case, "recorded", rerun).filter(pl.col("pass") == "forward")
    error, sd = (samples[f"{kind}_velocity_surge_mps"].to_numpy() for kind in ("err", "sd"))
    return Innovations(
        section=section,
        sd_mps=float(np.sqrt(square)),
        correlation=(second, five, ten),
        nis_per_degree=float((pings["nis"] / pings["degrees"]).mean()),  # type: ignore[arg-type]
        surge_error_mps=float(rms(error)),
        surge_sd_mps=float(rms(sd)),
    )
