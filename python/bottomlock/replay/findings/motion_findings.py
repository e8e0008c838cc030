"""Findings from the comparison of the DVL's velocity with the inertial readings, in words and keys of a case."""

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.finding import Finding
from bottomlock.recordings.rotation import Axes
from bottomlock.replay.case import Case
from bottomlock.replay.findings.hypotheses import Cause, Comparison
from bottomlock.replay.init.guess import axis_names

ANEW = "noise and offset of the gyros may be in the wrong unit too; delete grade and its keys, or run --init again"
"""What a wrong unit of the gyros leaves behind."""
SOUND_SPEED = 0.06
"""A larger error of scale is no speed of sound: the geometry has another tilt."""


def motion_findings(case: Case, comparison: Comparison, tilt_rad: float) -> list[Finding]:
    """A finding per cause, the likeliest first.

    Args:
        case: the case.
        comparison: of the velocity with the inertial readings.
        tilt_rad: mean tilt of the stated beams.
    """
    if comparison.unexplained:
        return [_unexplained(comparison)]
    return [_words(case, cause, comparison, tilt_rad) for cause in comparison.causes]


def _unexplained(comparison: Comparison) -> Finding:
    stated = comparison.stated
    return Finding(
        "unexplained", "fault", stated.cost,
        "The DVL's velocity does not follow the inertial readings, and no single mistake explains it.",
        f"It departs by {1e3 * stated.sigma_mps:.0f} mm/s a ping, chi-squared {stated.cost:.0f} of {3 * stated.pings}; "
        "no unit, sign, order of axes, clock, scale, mounting, gyro offset or lever arm alone removes half of that.",
        "More than one is wrong, or something else: check the files one after another, and run replay --init again.",
    )  # fmt: skip


def _words(case: Case, cause: Cause, comparison: Comparison, tilt_rad: float) -> Finding:
    name, _, what = cause.name.partition(":")
    part = 100.0 * cause.drop / max(comparison.stated.cost, 1e-9)
    evidence = (
        "The DVL's velocity departs from the motion that the IMU felt by "
        f"{1e3 * comparison.stated.sigma_mps:.0f} mm/s a "
        f"ping (chi-squared {comparison.stated.cost:.0f} of {3 * comparison.stated.pings}); this explains "
        f"{part:.0f} % of it."
    )
    text, advice, key = {
        "clock": _clock, "scale": _scale, "gyro_bias": _gyro_bias, "rotation": _rotation, "lever": _lever,
        "axes": _axes, "units": _units, "gyros": _gyros,
    }[name](case, cause, what, tilt_rad)  # fmt: skip
    # What turns or scales a track moves it by this part of its extent.
    size = float(np.abs(cause.match.part(name)).max()) if name in {"scale", "rotation"} else 0.0
    return Finding(_KINDS.get(name, name), "fault", cause.drop, text, evidence, advice, key, size, "1")


_KINDS = {
    "rotation": "mounting",
    "gyro_bias": "gyro_offset",
    "lever": "lever_arm",
    "units": "gyro_unit",
    "gyros": "gyro_sign",
}
_Words = tuple[str, str, str]


def _clock(case: Case, cause: Cause, _: str, __: float) -> _Words:
    value, sd = float(cause.match.part("clock")[0]), float(cause.match.part_sd("clock")[0])
    late = "late" if value < 0.0 else "early"
    total = case.dvl.clock.offset_s + value
    return (
        f"The clock of the DVL is {abs(value):.3f} ± {sd:.2g} s {late} against the IMU's.",
        f"Set dvl.clock.offset_s = {total:.3f} (now {case.dvl.clock.offset_s:.3f}).",
        "dvl.clock.offset_s",
    )


def _scale(_: Case, cause: Cause, __: str, tilt_rad: float) -> _Words:
    value, sd = float(cause.match.part("scale")[0]), float(cause.match.part_sd("scale")[0])
    way = "larger" if value > 0.0 else "smaller"
    if abs(value) > SOUND_SPEED:
        sine = np.sin(tilt_rad) / (1.0 + value)
        tilt = (
            f"; beams tilted by {np.rad2deg(np.arcsin(sine)):.1f} deg would give it"
            if 0.0 < sine < 1.0
            else ""
        )
        return (
            (
                f"The geometry is not this instrument's: its velocities have to be {100 * abs(value):.1f} ± "
                f"{100 * sd:.2g} % {way}{tilt}."
            ),
            (
                f"State the tilt of this DVL in dvl.geometry (now {np.rad2deg(tilt_rad):.1f} deg); `bottomlock "
                "geometries` lists "
                "packaged ones."
            ),
            "dvl.geometry",
        )
    return (
        f"The scale of the DVL is off: its velocities have to be {100 * abs(value):.2f} ± {100 * sd:.2g} % {way}.",
        "Set sound_speed_scale in the geometry file, or for a velocity dvl.velocity_scale; is the salinity right?",
        "dvl.geometry: sound_speed_scale",
    )


def _gyro_bias(case: Case, cause: Cause, _: str, __: float) -> _Words:
    value = np.rad2deg(cause.match.part("gyro_bias")) * 3600.0
    sd = np.rad2deg(cause.match.part_sd("gyro_bias")) * 3600.0
    k = int(np.argmax(np.abs(value) / sd))
    claimed = case.readings.errors.gyro_bias_deg_per_h
    words = ", ".join(f"{v:+.4g} ± {s:.2g}" for v, s in zip(value, sd, strict=True))
    return (
        (
            f"The gyros are off by {abs(value[k]):.4g} deg/h ({'xyz'[k]}), {abs(value[k]) / max(claimed, 1e-9):.0f} "
            "times the bias "
            "that the case claims."
        ),
        (
            f"Offsets about forward, right, down: {words} deg/h. Set imu.errors.gyro_bias_deg_per_h to their size (now "
            f"{claimed:g}), or subtract them from the readings."
        ),
        "imu.errors.gyro_bias_deg_per_h",
    )


def _rotation(_: Case, cause: Cause, __: str, ___: float) -> _Words:
    yaw, pitch, roll = Rotation.from_matrix(cause.match.rotation).as_euler("ZYX", degrees=True)
    sd = np.rad2deg(cause.match.part_sd("rotation"))
    parts = {"yaw": (yaw, sd[2]), "pitch": (pitch, sd[1]), "roll": (roll, sd[0])}
    words = ", ".join(f"{name} {v:+.1f} ± {s:.1g}" for name, (v, s) in parts.items())
    main = max(parts, key=lambda name: abs(parts[name][0]))
    return (
        f"The mounting of the DVL is wrong by {parts[main][0]:+.1f} deg in {main}.",
        f"Add {words} deg to mounting_yaw_deg, mounting_pitch_deg and mounting_roll_deg of the geometry file.",
        f"dvl.geometry: mounting_{main}_deg",
    )


def _lever(_: Case, cause: Cause, __: str, ___: float) -> _Words:
    value, sd = cause.match.part("lever"), cause.match.part_sd("lever")
    words = ", ".join(f"{v:+.2f} ± {s:.1g}" for v, s in zip(value, sd, strict=True))
    return (
        "The DVL is not where the geometry states it.",
        f"Add {words} m (forward, right, down) to lever_arms_m of the geometry file.",
        "dvl.geometry: lever_arms_m",
    )


def _axes(case: Case, cause: Cause, what: str, _: float) -> _Words:
    M = cause.match.axes
    if what == "reversed":
        key = "dvl.axes" if case.dvl.source == "velocity" else "dvl.file"
        remedy = (
            "Reverse all three of dvl.axes." if case.dvl.source == "velocity" else
            "Convert the log with --negate-beams: a beam reads positive when the vehicle moves towards the "
            "seabed along it."
        )  # fmt: skip
        return "The sign of the beams is reversed.", remedy, key
    if np.all(np.asarray(cause.gyros) < 0.0):
        # f' = Q f with Q the axes of the IMU as they should be: Mᵀ takes what is stated to what is.
        right = axis_names(M.T @ _matrix(case.readings.axes))
        return (
            (
                f"Two axes of the IMU are exchanged or one is reversed: as stated ({', '.join(case.readings.axes)}) "
                "they have the other "
                "handedness than the readings."
            ),
            f"Set imu.axes = {list(right)}, or name the columns of force and omega in another order.".replace(
                "'", '"'
            ),
            "imu.axes",
        )
    if M[2, 2] > 0.0 and np.linalg.det(M) > 0.0:
        right = axis_names(M.T @ _matrix(case.readings.axes))
        yaw = np.rad2deg(np.arctan2(M[1, 0], M[0, 0]))
        return (
            f"The axes of DVL and IMU are {what} of each other.",
            f"If the IMU is turned, set imu.axes = {list(right)}; if the DVL is, add {yaw:.0f} deg to "
            "mounting_yaw_deg of the "
            "geometry file.".replace("'", '"'),
            "imu.axes",
        )
    key = "dvl.axes" if case.dvl.source == "velocity" else "dvl.geometry"
    return (
        f"The axes of the DVL are not as stated: {what}.",
        "Correct dvl.axes."
        if key == "dvl.axes"
        else "Correct order, azimuths or mounting of the beams in the geometry file.",
        key,
    )


def _matrix(axes: Axes) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
    matrix = np.zeros((3, 3))
    for k, name in enumerate(axes):
        matrix[k, "xyz".index(name[-1])] = -1.0 if name.startswith("-") else 1.0
    return matrix


def _gyros(case: Case, _: Cause, what: str, __: float) -> _Words:
    columns = ", ".join(case.readings.omega)
    return (
        f"The angular rate about {what} has the wrong sign.",
        f"Write the rate about {what} with the other sign (imu.omega is {columns}, imu.axes applies to forces too).",
        "imu.omega",
    )


def _units(case: Case, _: Cause, what: str, __: float) -> _Words:
    right = what.split(" ", maxsplit=1)[0]
    return (
        f"The unit of the angular rate is wrong: {what}.",
        f'Set imu.omega_unit = "{right}" (now "{case.readings.omega_unit}"), and imu.errors anew: {ANEW}.',
        "imu.omega_unit",
    )
