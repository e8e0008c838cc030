"""The depth of a first case, and waves above its sensor: its pressure sees them move, the accelerometers do not."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import detrend

from bottomlock.arrays import rising
from bottomlock.recordings.robust import white_sd
from bottomlock.recordings.streams import Floats, Integers
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import Guess, pressure_unit
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.read_tables import LENGTH_SI, PRESSURE_SI
from bottomlock.units import STANDARD_GRAVITY_MPS2

DEEPEST_WAVES_M = 60.0
"""Deeper, even a swell of 15 s leaves less than a third of its height."""
LEAST_HZ, MOST_HZ, WINDOW_S = 0.9, 2.0, 128.0
"""Rates of readings that show waves, and are looked at; length of the spectra."""
LONGEST_S, SHORTEST_S = 20.0, 3.0
"""Periods of waves that reach a sensor below the surface."""
NARROW, MOST = 0.35, 0.5
"""Waves have at least this part of the power within this part of their frequency."""
LEAST_M, LEAST_OVER_NOISE = 0.1, 2.0
"""Standard deviation from which waves are told, and over that of the white noise of a reading."""


@dataclass(frozen=True)
class Waves:
    """1 sigma of what waves add to a depth, m, and their mean period, s."""

    sd_m: float
    period_s: float


def find_waves(
    time_ns: Integers, depth_m: Floats, imu_time_ns: Integers, accel_down_mps2: Floats
) -> Waves | None:
    """Waves in a depth, by the spectrum of what the twice integrated accelerations do not explain; None for none.

    Args:
        time_ns, depth_m: (n,) rising, on the IMU's clock.
        imu_time_ns, accel_down_mps2: (m,) acceleration along the platform's down axis, less a constant.
    """
    begin, end = (max(time_ns[0], imu_time_ns[0]), min(time_ns[-1], imu_time_ns[-1]))
    rate_hz = min(1e9 / float(np.median(np.diff(time_ns))), MOST_HZ)
    if rate_hz < LEAST_HZ or (end - begin) * 1e-9 < WINDOW_S:
        return None
    length = round(WINDOW_S * rate_hz)
    seconds = np.arange(0.0, (end - begin) * 1e-9, 1.0 / rate_hz)
    imu_s = (imu_time_ns - begin) * 1e-9
    gained = cumulative_trapezoid(accel_down_mps2 - accel_down_mps2.mean(), imu_s, initial=0.0)
    depth = np.interp(seconds, (time_ns - begin) * 1e-9, depth_m)
    velocity = np.interp(seconds, imu_s, gained)
    frequency = np.fft.rfftfreq(length, 1.0 / rate_hz)
    band = (frequency > 1.0 / LONGEST_S) & (frequency < 1.0 / SHORTEST_S)
    noisy = frequency > 1.0 / SHORTEST_S
    window = np.hanning(length)
    scale = 2.0 / (window**2).sum() / length
    powers = []
    for first in range(0, len(seconds) - length + 1, length // 2):
        part = slice(first, first + length)
        of_depth, of_velocity = (np.fft.rfft(window * detrend(one[part])) for one in (depth, velocity))
        moved = of_velocity[1:] / (2j * np.pi * frequency[1:])
        powers.append(scale * np.abs(np.concatenate([[0.0], of_depth[1:] - moved])) ** 2)
    power = np.mean(powers, axis=0)
    white = float(np.median(power[noisy]))
    waves = np.where(band, np.maximum(power - white, 0.0), 0.0)
    total = float(waves.sum())
    if total <= max(LEAST_M**2, LEAST_OVER_NOISE**2 * white * len(frequency)):
        return None
    middle = float((waves * frequency).sum()) / total
    if float(waves[np.abs(frequency - middle) < NARROW * middle].sum()) < MOST * total:
        return None
    return Waves(float(np.sqrt(total)), 1.0 / middle)


@dataclass(frozen=True, eq=False)
class DepthPart:
    """A depth or pressure as guessed; `depth_m` (n,) in metres, positive down."""

    found: Found
    unit: Guess
    up: Guess | None
    offset_m: Guess | None
    sd_m: float
    offset: Guess
    depth_m: Floats
    waves: Waves | None


def guess_depth(found: Found, imu: ImuPart, offset: Guess) -> DepthPart | None:
    """Unit and sign of a depth on a clock; None where it has no times."""
    times = found.times.time_ns
    if times is None:
        return None
    values = found.values(*found.columns)[:, 0]
    up = shift = None
    if found.kind == "pressure":
        unit = pressure_unit(values, found.units.get("pressure", ""))
        metres = values * PRESSURE_SI[unit.value] / (1025.0 * STANDARD_GRAVITY_MPS2)
        if np.nanmin(values) * PRESSURE_SI[unit.value] > 0.8e5:
            shift = Guess(
                -10.08, "the pressure is absolute: that of the air, 1013 mbar, is 10.08 m of sea water"
            )
            metres = metres - 10.08
    else:
        hint = found.units.get("depth", "")
        known = hint in LENGTH_SI
        unit = Guess(
            hint if known else "m", "the column's name says so" if known else "metres are usual", known
        )
        metres = values * LENGTH_SI[unit.value]
        if np.nanmedian(metres) < -0.3:
            up = Guess(
                value=True, why=f"its median is {np.nanmedian(values):.3g}, below the surface: positive up"
            )
            metres = -metres
    good = metres[np.isfinite(metres), None]
    sd = float(white_sd(good, 2)[0]) if len(good) > 2 else 0.0
    clock = times + round(offset.value * 1e9)
    used = np.isfinite(metres) & rising(clock)
    waves = None
    if not imu.made and used.sum() > 1 and float(np.median(metres[used])) < DEEPEST_WAVES_M:
        waves = find_waves(clock[used], metres[used], imu.time_ns, imu.force_p_mps2[:, 2])
    return DepthPart(found, unit, up, shift, max(0.02, round(2.0 * sd, 3)), offset, metres, waves)
