"""Errors that a first case states: of the IMU and of the attitude sensor, and the prior of the velocity."""

from collections.abc import Iterator, Mapping
from math import isfinite

import numpy as np

from bottomlock.config.instrument_grades import Grade, grades
from bottomlock.errors import DataError
from bottomlock.recordings.attitude_fit import GyroErrors
from bottomlock.recordings.pings import LAGS
from bottomlock.replay.init.entries import Entry, remark
from bottomlock.replay.init.guess import Guess, round_up, white_noise
from bottomlock.replay.init.rig import Parts
from bottomlock.replay.vehicle_motion import vehicle_motion

PER_HOUR = 3600.0
PER_RT_HOUR = 60.0
LEAST_BIAS_DEG_PER_H = 1.0
EARTH_DEG_PER_H = 15.04
TOLD = 3.0
"""Sigmas from which an offset is one."""
LEAST_BIAS_MG, MOST_BIAS_MG = 1.0, 50.0
GYROS, FORCE = "gyro_noise_deg_per_rt_h", "accel_noise_mps_per_rt_h"
_FACTOR = {GYROS: float(np.rad2deg(PER_RT_HOUR)), FORCE: PER_RT_HOUR}
"""From rad/√s and m/s/√s."""

MAGNETIC = "mti_ahrs"
"""Gyros that agree with an attitude show a good IMU. They say nothing of north, so no gyrocompass follows from them."""


def imu_errors(parts: Parts) -> Iterator[Entry]:
    """The section `[imu.errors]`."""
    imu = parts.imu
    scatter = {
        key: white_noise(imu.time_ns, of)
        for key, of in ((GYROS, imu.omega_s_radps), (FORCE, imu.force_s_mps2))
    }
    floor = {key: density * _FACTOR[key] for key, density in scatter.items()}
    found = _evidence(parts) | _noise(parts, scatter)
    covers = {key: min(value, found[key].value) if key in found else value for key, value in floor.items()}
    bias = found.get("gyro_bias_deg_per_h")
    if bias is not None:
        covers["gyro_bias_deg_per_h"] = bias.value
    grade = nearest_grade(covers)
    words = ", ".join(f"{_NAMES[key]} {value:.2g} {_UNITS[key]}" for key, value in covers.items())
    yield remark(
        "imu.errors",
        "1 sigma; the data sheet of the IMU knows better. Keys below the grade are what the log says beyond it",
    )
    why = f"the best that covers {words}: {grade.title}"
    yield Entry("imu.errors.grade", grade.name, why, known=bias is not None, asks="instrument")
    for key, one in found.items():
        if key in _ALWAYS or one.value > grade.keys[key]:
            yield Entry(f"imu.errors.{key}", float(f"{one.value:.2g}"), one.why)
        else:
            yield remark("imu.errors", f"{key}: the log says {one.value:.2g}, within the grade ({one.why})")
    for key, value in floor.items():
        if key not in found and value > grade.keys[key]:
            why = "scatter from reading to reading, vibration included"
            yield Entry(f"imu.errors.{key}", float(f"{value:.2g}"), why)


_NAMES = {
    "gyro_noise_deg_per_rt_h": "gyro noise", "accel_noise_mps_per_rt_h": "accelerometer noise",
    "gyro_bias_deg_per_h": "gyro bias",
}  # fmt: skip
_UNITS = {
    "gyro_noise_deg_per_rt_h": "deg/√h",
    "accel_noise_mps_per_rt_h": "m/s/√h",
    "gyro_bias_deg_per_h": "deg/h",
}
_ALWAYS = {"gyro_bias_deg_per_h", "accel_bias_mg"}
"""Keys that are measured: the log's value replaces the grade's also where it is smaller."""


def nearest_grade(covers: dict[str, float]) -> Grade:
    """The best packaged grade whose errors are at least these; else the one that covers the bias, or the coarsest."""
    known = list(grades("imu").values())
    by_bias = sorted(known, key=lambda one: one.keys["gyro_bias_deg_per_h"])
    for wanted in (covers, {k: v for k, v in covers.items() if k == "gyro_bias_deg_per_h"}):
        for grade in by_bias:
            if wanted and all(grade.keys[key] >= value for key, value in wanted.items()):
                return grade
    return by_bias[-1]


def _evidence(parts: Parts) -> dict[str, Guess]:
    """What the log says, by key of the case."""
    found: dict[str, Guess] = {}
    gyros, latitude_known = parts.gyros, isfinite(parts.latitude_rad)
    match = parts.dvl.match if parts.dvl.match is not None and parts.dvl.match.plausible else None
    if match is not None:
        excess = abs(match.gravity - 9.80665) / 9.80665 * 1e3
        value = round_up(min(max(excess, LEAST_BIAS_MG), MOST_BIAS_MG))
        found["accel_bias_mg"] = Guess(value, f"gravity as integrated is {match.gravity:.3f} m/s²")
    if gyros is not None:
        offsets = np.rad2deg(gyros.offset_radps) * PER_HOUR
        sd = float(np.rad2deg(gyros.offset_sd_radps).max()) * PER_HOUR
        # Without a latitude the Earth's rate is in them.
        most = float(np.abs(offsets).max()) - (0.0 if latitude_known else EARTH_DEG_PER_H)
        axes = ", ".join(f"{x:.3g}" for x in offsets)
        if most > TOLD * sd:
            found["gyro_bias_deg_per_h"] = Guess(
                float(f"{1.05 * max(most, LEAST_BIAS_DEG_PER_H):.2g}"),
                f"the gyros are {axes} deg/h (± {sd:.2g}) off the recorded attitude's turns",
            )
        wander = float(np.rad2deg(gyros.wander_radps_rts))
        if wander > 0.0:
            found["gyro_bias_walk_deg_per_s_per_rt_s"] = Guess(
                wander, "their offset from the attitude wanders so much between the segments of the dive"
            )
    if match is not None and "gyro_bias_deg_per_h" not in found:
        off = float(np.rad2deg(np.abs(match.part("gyro_bias")[:2]).max()) * PER_HOUR)
        sd = float(np.rad2deg(match.part_sd("gyro_bias")[:2].max()) * PER_HOUR)
        found["gyro_bias_deg_per_h"] = Guess(
            round_up(max(2.0 * off, 2.0 * sd, LEAST_BIAS_DEG_PER_H)),
            f"against the DVL's velocity the level gyros are {off:.3g} deg/h off",
        )
    return found


def _noise(parts: Parts, scatter: Mapping[str, float]) -> dict[str, Guess]:
    """Noise of what the readings integrate to, 1 sigma above its estimate: a small claim makes a filter overconfident.

    Args:
        parts: as compared.
        scatter: density of the readings' noise from one to the next.
    """
    gyros, pings, found = parts.gyros, parts.pings, {}
    if gyros is not None and gyros.noise is not None:
        words = f"over up to {gyros.lag_s:.2g} s the integrated gyros part from the attitude so"
        found[GYROS] = gyros.noise, f"{words}, scale and low rate included"
    if pings is not None:
        words = f"over one to {LAGS[-1]} pings ({pings.differences} of them) the integrated force parts so"
        found[FORCE] = pings.force, f"{words} from their velocity"
    return {
        key: Guess(_FACTOR[key] * most, f"{words}: {_FACTOR[key] * value:.2g}, and 1 sigma")
        for key, (walk, words) in found.items()
        for value, most in [walk.density(scatter[key])]
    }


def attitude_noise(gyros: GyroErrors | None) -> Iterator[Entry]:
    """The grade of the instrument, with its white noise, offset and walk as the filter then estimates them.

    Args:
        gyros: against the attitude, whose white noise replaces the grade's where it exceeds that; None without one.
    """
    grade = grades("attitude")[MAGNETIC]
    keys = grade.keys
    yield Entry("attitude.grade", grade.name, grade.title, known=False, asks="instrument")
    yield remark(
        "attitude",
        f"white noise {keys['roll_pitch_sd_deg']:g} deg (yaw {keys['yaw_sd_deg']:g}), offset "
        f"{keys['roll_pitch_offset_sd_deg']:g} ({keys['yaw_offset_sd_deg']:g}), walk "
        f"{keys['roll_pitch_walk_sd_deg']:g} ({keys['yaw_walk_sd_deg']:g}) of {keys['walk_time_s']:g} s: a key written "
        "here replaces the grade's",
    )
    white_deg = np.zeros(3) if gyros is None else np.rad2deg(gyros.white_rad)
    for key, sd_deg in (("roll_pitch_sd_deg", white_deg[:2].max()), ("yaw_sd_deg", white_deg[2])):
        if sd_deg > keys[key]:
            why = "it scatters so about the turns of the gyros"
            yield Entry(f"attitude.{key}", float(f"{sd_deg:.2g}"), why)


OUTAGE_S = 60.0
"""Time without the bottom over which the accelerometers are compared with the vehicle."""


def vehicle_prior(parts: Parts) -> Iterator[Entry]:
    """`[filter.motion]` where the accelerometers drift further in a minute than the vehicle changes its velocity.

    Without inertial readings a replay measures the same by itself.
    """
    if parts.imu.made or parts.pings is None:
        return
    drift_mps = parts.pings.force.density()[0] * np.sqrt(OUTAGE_S)
    try:
        motion = vehicle_motion(parts.dvl.time_ns, parts.dvl.velocity_p_mps)
    except DataError:
        return
    change_mps = float(np.sqrt((motion.fluctuation_sd_mps**2).sum()))
    if drift_mps <= change_mps:
        return
    yield remark(
        "filter.motion",
        f"the accelerometers drift by {drift_mps:.2g} m/s in a minute, the vehicle changes its velocity by "
        f"{change_mps:.2g} m/s: without the bottom the velocity goes back to its mean (docs/no_imu.md)",
    )
    prior = motion.prior
    yield Entry("filter.motion.mean_sd_mps", rounded(prior.mean_sd_mps), "the size of the speed")
    why = f"on {motion.pings} pings with a whole velocity"
    yield Entry("filter.motion.change_sd_mps", rounded(prior.change_sd_mps), why)
    yield Entry("filter.motion.change_time_s", rounded(prior.change_time_s))


def rounded(values: object) -> list[float]:
    """Two digits."""
    return [float(f"{value:.2g}") for value in np.asarray(values, dtype=np.float64)]
