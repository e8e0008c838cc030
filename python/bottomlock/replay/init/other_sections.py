"""Sections of a first case beyond those of its files: errors, start, prior of the velocity, water track."""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from bottomlock.config.instrument_grades import Grade, grades
from bottomlock.errors import DataError
from bottomlock.io.beam_table import water_file
from bottomlock.replay.init.draft import Section
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.files import Files
from bottomlock.replay.init.guess import round_up, white_noise
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.sources import Sources
from bottomlock.replay.motion.gyros import GyroMatch
from bottomlock.replay.motion.ping_noise import PingNoise
from bottomlock.replay.vehicle_motion import vehicle_motion

PER_HOUR = 3600.0
PER_RT_HOUR = 60.0
LEAST_BIAS_DEG_PER_H = 1.0
EARTH_DEG_PER_H = 15.04
TOLD = 3.0
"""Sigmas from which an offset is one."""
LEAST_BIAS_MG, MOST_BIAS_MG = 1.0, 50.0

MAGNETIC = "mti_ahrs"
"""Gyros that agree with an attitude show a good IMU. They say nothing of north, so no gyrocompass follows from them."""


@dataclass(frozen=True)
class _Found:
    """What a log says of a key: its value, and how it was found."""

    value: float
    why: str


def put_errors(parts: Parts) -> Section:
    """The section `[imu.errors]`."""
    imu, dvl = parts.imu, parts.dvl
    section = Section("imu.errors")
    found = _evidence(dvl, parts.gyros, parts.pings, latitude_known=isfinite(parts.latitude_rad))
    floor = {
        "gyro_noise_deg_per_rt_h": float(np.rad2deg(white_noise(imu.time_ns, imu.omega_s_radps)))
        * PER_RT_HOUR,
        "accel_noise_mps_per_rt_h": white_noise(imu.time_ns, imu.force_s_mps2) * PER_RT_HOUR,
    }
    covers = {key: min(value, found[key].value) if key in found else value for key, value in floor.items()}
    bias = found.get("gyro_bias_deg_per_h")
    if bias is not None:
        covers["gyro_bias_deg_per_h"] = bias.value
    grade = nearest_grade(covers)
    words = ", ".join(f"{_NAMES[key]} {value:.2g} {_UNITS[key]}" for key, value in covers.items())
    section.say(
        "1 sigma; the data sheet of the IMU knows better. Keys below the grade are what the log says beyond it"
    )
    section.put("grade", grade.name, f"the best that covers {words}: {grade.title}", known=bias is not None)
    for key, one in found.items():
        stays = key not in _ALWAYS and one.value <= grade.keys[key]
        if not stays:
            section.put(key, float(f"{one.value:.2g}"), one.why)
        else:
            section.say(f"{key}: the log says {one.value:.2g}, within the grade ({one.why})")
    for key, value in floor.items():
        if key not in found and value > grade.keys[key]:
            section.put(key, float(f"{value:.2g}"), "scatter from reading to reading, vibration included")
    return section


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


def _evidence(
    dvl: DvlPart, gyros: GyroMatch | None, pings: PingNoise | None, *, latitude_known: bool
) -> dict[str, _Found]:
    """What the log says, by key of the case."""
    found: dict[str, _Found] = {}
    match = dvl.match if dvl.match is not None and dvl.match.plausible else None
    if match is not None:
        excess = abs(match.gravity - 9.80665) / 9.80665 * 1e3
        value = round_up(min(max(excess, LEAST_BIAS_MG), MOST_BIAS_MG))
        found["accel_bias_mg"] = _Found(value, f"gravity as integrated is {match.gravity:.3f} m/s²")
    if gyros is not None:
        offsets = np.rad2deg(gyros.offset_radps) * PER_HOUR
        sd = float(np.rad2deg(gyros.offset_sd_radps).max()) * PER_HOUR
        # Without a latitude the Earth's rate is in them.
        most = float(np.abs(offsets).max()) - (0.0 if latitude_known else EARTH_DEG_PER_H)
        axes = ", ".join(f"{x:.3g}" for x in offsets)
        if most > TOLD * sd:
            found["gyro_bias_deg_per_h"] = _Found(
                float(f"{1.05 * max(most, LEAST_BIAS_DEG_PER_H):.2g}"),
                f"the gyros are {axes} deg/h (± {sd:.2g}) off the recorded attitude's turns",
            )
        if gyros.noise_rad_rts > 0.0:
            found["gyro_noise_deg_per_rt_h"] = _Found(
                float(np.rad2deg(gyros.noise_rad_rts)) * PER_RT_HOUR,
                f"over up to {gyros.lag_s:.2g} s the integrated gyros part from the attitude so, scale and low rate "
                "included",
            )
        wander = float(np.rad2deg(gyros.wander_radps_rts))
        if wander > 0.0:
            found["gyro_bias_walk_deg_per_s_per_rt_s"] = _Found(
                wander, "their offset from the attitude wanders so much between the segments of the dive"
            )
    if match is not None and "gyro_bias_deg_per_h" not in found:
        off = float(np.rad2deg(np.abs(match.part("gyro_bias")[:2]).max()) * PER_HOUR)
        sd = float(np.rad2deg(match.part_sd("gyro_bias")[:2].max()) * PER_HOUR)
        found["gyro_bias_deg_per_h"] = _Found(
            round_up(max(2.0 * off, 2.0 * sd, LEAST_BIAS_DEG_PER_H)),
            f"against the DVL's velocity the level gyros are {off:.3g} deg/h off",
        )
    if pings is not None and pings.force_mps_rts > 0.0:
        found["accel_noise_mps_per_rt_h"] = _Found(
            pings.force_mps_rts * PER_RT_HOUR,
            f"over one to eight pings ({pings.differences} of them) the integrated force parts so from their velocity",
        )
    return found


def put_attitude_noise(section: Section, gyros: GyroMatch | None) -> None:
    """The grade of the instrument, with its white noise, offset and walk as the filter then estimates them.

    Args:
        section: of the attitude.
        gyros: against the attitude, whose white noise replaces the grade's where it exceeds that; None without one.
    """
    grade = grades("attitude")[MAGNETIC]
    section.put("grade", grade.name, f"which instrument is it? {grade.title}", known=False)
    keys = grade.keys
    section.say(
        f"white noise {keys['roll_pitch_sd_deg']:g} deg (yaw {keys['yaw_sd_deg']:g}), offset "
        f"{keys['roll_pitch_offset_sd_deg']:g} ({keys['yaw_offset_sd_deg']:g}), walk "
        f"{keys['roll_pitch_walk_sd_deg']:g} ({keys['yaw_walk_sd_deg']:g}) of {keys['walk_time_s']:g} s: a key written "
        "here replaces the grade's"
    )
    white_deg = np.zeros(3) if gyros is None else np.rad2deg(gyros.white_rad)
    for key, sd_deg in (("roll_pitch_sd_deg", white_deg[:2].max()), ("yaw_sd_deg", white_deg[2])):
        if sd_deg > keys[key]:
            section.put(key, float(f"{sd_deg:.2g}"), "it scatters so about the turns of the gyros")


OUTAGE_S = 60.0
"""Time without the bottom over which the accelerometers are compared with the vehicle."""


def motion_section(parts: Parts) -> list[Section]:
    """`[filter.motion]` where the accelerometers drift further in a minute than the vehicle changes its velocity.

    Without inertial readings a replay measures the same by itself.
    """
    if parts.imu.made or parts.pings is None:
        return []
    drift_mps = parts.pings.force_mps_rts * np.sqrt(OUTAGE_S)
    try:
        motion = vehicle_motion(parts.dvl.time_ns, parts.dvl.velocity_p_mps)
    except DataError:
        return []
    change_mps = float(np.sqrt((motion.fluctuation_sd_mps**2).sum()))
    if drift_mps <= change_mps:
        return []
    section = Section("filter.motion")
    section.say(
        f"the accelerometers drift by {drift_mps:.2g} m/s in a minute, the vehicle changes its velocity by "
        f"{change_mps:.2g} m/s: without the bottom the velocity goes back to its mean (docs/no_imu.md)"
    )
    prior = motion.prior
    section.put("mean_sd_mps", rounded(prior.mean_sd_mps), "the size of the speed")
    section.put(
        "change_sd_mps", rounded(prior.change_sd_mps), f"on {motion.pings} pings with a whole velocity"
    )
    section.put("change_time_s", rounded(prior.change_time_s))
    return [section]


def rounded(values: object) -> list[float]:
    """Two digits."""
    return [float(f"{value:.2g}") for value in np.asarray(values, dtype=np.float64)]


def water_section(dvl: DvlPart, sources: Sources, files: Files) -> list[Section]:
    """`[water_track]` with the water table beside the beams of the case, or beside the log that they are from."""
    if dvl.recording is None or sources.log is None:
        return []
    own, given = water_file(files.beside("beams")), water_file(sources.log)
    is_own = dvl.recording.water is not None or own.is_file()
    if not is_own and not given.is_file():
        return []
    section = Section("water_track")
    section.say(
        f"{(own if is_own else given).name} has beams that the water returned: the current is a state of the filter"
    )
    if not is_own:
        section.put("file", files.relative(given))
    section.ask(
        "is the nearest cell in the vehicle's own wake? cells = [2, 3] leaves it out (docs/howto/water_track.md)"
    )
    return [section]


WINDOW_S = 10.0
SHORT_WINDOW_S = 2.0
UNKNOWN_DEG = 180.0
"""1 sigma of a heading that nothing tells. A heading, positions or gyros better than the Earth's rate find it."""
UNDER_WAY_MPS = [2.0, 0.5, 0.5]
"""1 sigma of a velocity of which nothing is known."""


def put_start(section: Section, parts: Parts) -> None:
    """Sources of the start, and a time at which each of them has data."""
    imu, attitude = parts.imu, parts.attitude
    begin = int(imu.time_ns[0])
    length_s = float(imu.time_ns[-1] - begin) * 1e-9
    from_attitude = attitude is not None and attitude.frame.known and attitude.offset.known
    window_s = WINDOW_S if length_s > 6.0 * WINDOW_S else SHORT_WINDOW_S
    earliest_s = 0.5 if from_attitude else window_s
    if attitude is not None and from_attitude:
        times = attitude.found.times.time_ns
        assert times is not None  # guessed from them
        earliest_s = max(earliest_s, (int(times[0]) - begin) * 1e-9 + attitude.offset.seconds + 0.02)
    pings_s = (parts.dvl.time_ns - begin) * 1e-9 + parts.dvl.offset.seconds
    later = pings_s[(pings_s >= earliest_s) & (pings_s < length_s)]
    has_ping = bool(later.size)
    at_s = float(later[0]) + 0.02 if has_ping else earliest_s
    section.put(
        "at_s",
        round(at_s, 3),
        "the first ping with a whole velocity after the sensors have begun" if has_ping else "",
    )
    if from_attitude:
        section.put("level", "attitude")
        section.put("heading", "attitude")
    else:
        section.put(
            "level",
            "levelling",
            "the mean specific force before the start; is the vehicle calm then?",
            known=False,
        )
        section.put("window_s", window_s)
        section.put(
            "heading", "given", "nothing in the files gives it: the whole track turns with it", known=False
        )
        section.put("heading_deg", 0.0)
        section.put(
            "heading_sd_deg", UNKNOWN_DEG, "unknown: the track is relative until something observes it"
        )
    if has_ping:
        section.put("velocity", "beams")
    else:
        why = (
            "no ping there gives a whole velocity: is it at rest? The sigma below covers a vehicle under way"
        )
        section.put("velocity_mps", [0.0, 0.0, 0.0], why, known=False)
    section.put("velocity_sd_mps", [0.1, 0.1, 0.1] if has_ping else UNDER_WAY_MPS)
    _position(section, parts, at_s)


def _position(section: Section, parts: Parts, at_s: float) -> None:
    reference = parts.reference
    if reference is not None:
        section.put("position", "reference")
        sd = reference.sd_m
        section.put("position_sd_m", [sd, sd, sd], "how good is the reference?", known=False)
        return
    down = 0.0
    if parts.depth is not None:
        times = parts.depth.found.times.time_ns
        assert times is not None  # guessed from them
        seconds = (times - int(parts.imu.time_ns[0])) * 1e-9 + parts.depth.offset.seconds
        good = np.isfinite(parts.depth.depth_m)
        if good.any():
            nearest = np.flatnonzero(good)[int(np.argmin(np.abs(seconds[good] - at_s)))]
            down = float(parts.depth.depth_m[nearest])
    section.put(
        "position_m",
        [0.0, 0.0, round(down, 3)],
        "where it starts is the origin" + ("; depth by its sensor" if down else ""),
    )
    section.put("position_sd_m", [1.0, 1.0, 0.5])
