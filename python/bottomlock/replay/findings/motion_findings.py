"""Findings from the comparison of the DVL's velocity with the inertial readings: a template for each mistake."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.axes import from_angles, to_angles
from bottomlock.recordings.finding import Finding
from bottomlock.recordings.rotation import permute_axes
from bottomlock.recordings.streams import Floats
from bottomlock.replay.case import Case
from bottomlock.replay.findings.hypotheses import Cause, Comparison
from bottomlock.replay.init.guess import axis_names

ANEW = "noise and offset of the gyros may be in the wrong unit too; delete grade and its keys, or run --init again"
"""What a wrong unit of the gyros leaves behind."""
SOUND_SPEED = 0.06
"""A larger error of scale is no speed of sound: the geometry has another tilt."""
ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Template:
    """Kind, text, advice and key of a finding, with places for what was found."""

    kind: str
    text: str
    hint: str
    key: str


TEMPLATES = {
    "clock": Template(
        "clock", "The clock of the DVL is {size:.3f} ± {sd:.2g} s {late} against the IMU's.",
        "Set dvl.clock.offset_s = {right:.3f} (now {now:.3f}).", "dvl.clock.offset_s",
    ),
    "scale": Template(
        "scale", "The scale of the DVL is off: its velocities have to be {percent:.2f} ± {sd:.2g} % {way}.",
        "Set sound_speed_scale in the geometry file, or for a velocity dvl.velocity_scale; is the salinity right?",
        "dvl.geometry: sound_speed_scale",
    ),
    "tilt": Template(
        "scale",
        "The geometry is not this instrument's: its velocities have to be {percent:.1f} ± {sd:.2g} % {way}{tilt}.",
        "State the tilt of this DVL in dvl.geometry (now {now:.1f} deg): see `bottomlock list geometries`.",
        "dvl.geometry",
    ),
    "gyro_bias": Template(
        "gyro_offset",
        "The gyros are off by {size:.4g} deg/h ({axis}), {times:.0f} times the bias that the case claims.",
        "Offsets about forward, right, down: {listed} deg/h. Set imu.errors.gyro_bias_deg_per_h to their size (now "
        "{now:g}), or subtract them from the readings.", "imu.errors.gyro_bias_deg_per_h",
    ),
    "rotation": Template(
        "mounting", "The mounting of the DVL is wrong by {angle:+.1f} deg in {main}.",
        "Set {listed} in the geometry file.", "dvl.geometry: mounting_{main}_deg",
    ),
    "lever": Template(
        "lever_arm", "The DVL is not where the geometry states it.",
        "Add {listed} m (forward, right, down) to lever_arms_m of the geometry file.", "dvl.geometry: lever_arms_m",
    ),
    "left-handed IMU": Template(
        "axes",
        "Two axes of the IMU are exchanged or one is reversed: as stated ({now}) they have the other handedness than "
        "the readings.",
        "Set imu.axes = {imu}, or name the columns of force and omega in another order.", "imu.axes",
    ),
    "quarter turn": Template(
        "axes", "The axes of DVL and IMU are turned by {yaw:.0f} deg about the vertical of each other.",
        "If the IMU is turned, set imu.axes = {imu}; if the DVL is, add {yaw:.0f} deg to mounting_yaw_deg of the "
        "geometry file.", "imu.axes",
    ),
    "velocity": Template(
        "axes", "The axes of the DVL are not as stated: forward, right and down are {dvl} of them.",
        "Correct dvl.axes.", "dvl.axes",
    ),
    "beams": Template(
        "axes", "The axes of the DVL are not as stated: forward, right and down are {dvl} of them.",
        "Correct order, azimuths or mounting of the beams in the geometry file.", "dvl.geometry",
    ),
    "reversed beams": Template(
        "axes", "The sign of the beams is reversed.",
        "Convert the log with --negate-beams: a beam reads positive when the vehicle moves towards the seabed along "
        "it.", "dvl.file",
    ),
    "gyros": Template(
        "gyro_sign", "The angular rate about {of} has the wrong sign.",
        "Write the rate about {of} with the other sign (imu.omega is {now}, imu.axes applies to forces too).",
        "imu.omega",
    ),
    "units": Template(
        "gyro_unit", "The unit of the angular rate is wrong: {of}.",
        'Set imu.omega_unit = "{right}" (now "{now}"), and imu.errors anew: ' + ANEW + ".", "imu.omega_unit",
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Stated:
    """What the fit departs from: the case, roll, pitch and yaw (3,) of its DVL, and the mean tilt of the beams, rad."""

    case: Case
    mounting_rpy_rad: Floats
    tilt_rad: float


def motion_findings(stated: Stated, comparison: Comparison) -> list[Finding]:
    """A finding for each cause, the likeliest first."""
    before = comparison.stated
    departs = (
        f"{1e3 * before.sigma_mps:.0f} mm/s a ping (chi-squared {before.cost:.0f} of {3 * before.pings})"
    )
    if comparison.unexplained:
        return [
            Finding(
                "unexplained", "fault", before.cost,
                "The DVL's velocity does not follow the inertial readings, and no single mistake explains it.",
                f"It departs by {departs}; no unit, sign, order of axes, clock, scale, mounting, gyro offset or lever "
                "arm alone removes half of that.",
                "More than one is wrong, or something else: check the files one after another, and run replay --init "
                "again.",
            )
        ]  # fmt: skip
    found = []
    for cause in comparison.causes:
        name, values = _values(stated, cause)
        template = TEMPLATES[name]
        size = _moves(cause.name, cause.values, cause.mistake.axes)
        found.append(
            Finding(
                template.kind, "fault", cause.drop, template.text.format(**values),
                f"The DVL's velocity departs from the motion that the IMU felt by {departs}; this explains "
                f"{100.0 * cause.drop / max(before.cost, 1e-9):.0f} % of it.",
                template.hint.format(**values), template.key.format(**values), size, "1",
            )
        )  # fmt: skip
    return found


def _moves(name: str, values: Floats, axes: Floats) -> float:
    """Part of its extent by which a cause moves a horizontal track, about; 0 for what neither turns nor scales it.

    >>> _moves("scale", np.array([-0.03]), np.eye(3)), _moves("clock", np.array([1.5]), np.eye(3))
    (0.03, 0.0)
    >>> [_moves("axes", np.zeros(3), np.diag(signs)) for signs in ([1.0, -1.0, 1.0], [1.0, 1.0, -1.0])]
    [2.0, 0.0]
    """
    if name in {"scale", "rotation"}:
        return float(np.abs(values).max())
    return float(np.abs(axes - np.eye(3))[:2, :2].max()) if name == "axes" else 0.0


def _values(stated: Stated, cause: Cause) -> tuple[str, dict[str, Any]]:
    """Name of the template, and what it has places for."""
    case, name = stated.case, cause.name
    if name == "axes":
        return _of_axes(case, cause)
    if name == "gyros":
        return name, {"of": cause.mistake.of, "now": ", ".join(case.readings.omega)}
    if name == "units":
        right = cause.mistake.of.split(" ", maxsplit=1)[0]
        return name, {"of": cause.mistake.of, "right": right, "now": case.readings.omega_unit}
    values, sd = cause.values, cause.match.part_sd(name)
    if name == "clock":
        value, now = float(values[0]), case.dvl.clock.offset_s
        late = "late" if value < 0.0 else "early"
        return name, {"size": abs(value), "sd": sd[0], "late": late, "right": now + value, "now": now}
    if name == "scale":
        return _of_scale(float(values[0]), float(sd[0]), stated.tilt_rad)
    if name == "lever":
        return name, {"listed": _listed(values, sd, "+.2f", ".1g")}
    values, sd = np.rad2deg(values), np.rad2deg(sd)
    if name == "gyro_bias":
        values, sd, now = 3600.0 * values, 3600.0 * sd, case.readings.errors.gyro_bias_deg_per_h
        k = int(np.argmax(np.abs(values) / sd))
        size, listed = abs(values[k]), _listed(values, sd, "+.4g", ".2g")
        return name, {
            "size": size, "axis": "xyz"[k], "times": size / max(now, 1e-9), "listed": listed, "now": now
        }  # fmt: skip
    turned = Rotation.from_matrix(cause.match.turned)
    off, to_set = (
        np.rad2deg(to_angles(one)) for one in (turned, turned * from_angles(*stated.mounting_rpy_rad))
    )
    main = int(np.argmax(np.abs(off)))
    keys = (
        f"mounting_{axis}_deg = {angle:.1f} ± {spread:.1g}"
        for axis, angle, spread in zip(ANGLES, to_set, sd, strict=True)
    )
    return name, {"angle": off[main], "main": ANGLES[main], "listed": ", ".join(keys)}


def _listed(values: Floats, sd: Floats, digits: str, digits_sd: str) -> str:
    """Numbers with their sigmas."""
    return ", ".join(f"{value:{digits}} ± {one:{digits_sd}}" for value, one in zip(values, sd, strict=True))


def _of_scale(value: float, sd: float, tilt_rad: float) -> tuple[str, dict[str, Any]]:
    sine = np.sin(tilt_rad) / (1.0 + value)
    tilt = (
        f"; beams tilted by {np.rad2deg(np.arcsin(sine)):.1f} deg would give it" if 0.0 < sine < 1.0 else ""
    )
    return "tilt" if abs(value) > SOUND_SPEED else "scale", {
        "percent": 100.0 * abs(value), "sd": 100.0 * sd, "way": "larger" if value > 0.0 else "smaller",
        "tilt": tilt, "now": np.rad2deg(tilt_rad),
    }  # fmt: skip


def _of_axes(case: Case, cause: Cause) -> tuple[str, dict[str, Any]]:
    M, axes = cause.mistake.axes, case.readings.axes
    of_beams = case.dvl.source != "velocity"
    # f' = Q f with Q the axes of the IMU as they should be: Mᵀ takes what is stated to what is.
    right = axis_names(M.T @ permute_axes(np.eye(3), axes).T)
    values = {
        "now": ", ".join(axes), "imu": str(list(right)).replace("'", '"'), "dvl": ", ".join(axis_names(M)),
        "yaw": np.rad2deg(np.arctan2(M[1, 0], M[0, 0])),
    }  # fmt: skip
    if np.all(np.asarray(cause.mistake.gyros) < 0.0):
        return "left-handed IMU", values
    if M[2, 2] > 0.0 and np.linalg.det(M) > 0.0:
        return "quarter turn", values
    if np.array_equal(M, -np.eye(3)) and of_beams:
        return "reversed beams", values
    return "beams" if of_beams else "velocity", values
