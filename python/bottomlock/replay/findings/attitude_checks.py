"""The recorded attitude against the IMU, unit of the gyros and mounting; and what the log says of the heading."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.files.replay_tables import FORWARD
from bottomlock.recordings.attitude_fit import STEP_S, AttitudeFit, fit_attitude
from bottomlock.recordings.axes import to_angles
from bottomlock.recordings.finding import Finding
from bottomlock.recordings.stream_sections import ImuStream
from bottomlock.replay.case import Case
from bottomlock.replay.findings.motion_findings import ANEW
from bottomlock.replay.read_tables import OMEGA_SI, rate_unit
from bottomlock.replay.rerun import PreparedRun

FEWEST = 60
ONE_VEHICLE = 0.6
"""Correlation of turns from which both are of one vehicle."""
TURNED_RAD = np.deg2rad(25.0)
"""A smaller rotation may be a slow error of the attitude."""
BETTER = 0.5
"""Part of the misfit that may be left after a rotation that is a finding."""


def gyro_fit(case: Case, prepared: PreparedRun) -> AttitudeFit | None:
    """Gyros against the recorded attitude; None without either, and where they are not of one vehicle."""
    attitudes = prepared.streams.attitudes
    # Without an IMU the turns are those of the attitude itself.
    if case.attitude is None or attitudes is None or not isinstance(case.imu, ImuStream):
        return None
    fit = fit_attitude(prepared.readings, attitudes.kept(attitudes.time_ns >= prepared.alignment.time_ns))
    return fit if fit is not None and fit.steps >= FEWEST and fit.alike >= ONE_VEHICLE else None


def attitude_findings(case: Case, fit: AttitudeFit | None) -> list[Finding]:
    """Unit of the gyros and mounting of the attitude sensor, where both instruments contradict what is stated."""
    return [] if fit is None else [*_unit(case.readings.omega_unit, fit), *_mounting(fit), *_signs(fit)]


def _unit(stated: str, fit: AttitudeFit) -> list[Finding]:
    told = None if stated not in OMEGA_SI else rate_unit(fit.scale, stated)
    if told is None or told[0] == stated:
        return []
    right, slope = told
    return [
        Finding(
            "gyro_unit", "fault", min(fit.scale_gain, 1e9),
            f"The unit of the angular rate is wrong: {right} taken for {stated}.",
            f"Slope of the gyros over the turns of the recorded attitude: {fit.scale:.3g} ± {fit.scale_sd:.1g} as "
            f"stated, {slope:.3g} with {right}, expected 1; correlation {fit.alike:.2f} over {fit.steps} "
            f"intervals of {STEP_S:g} s.",
            f'Set imu.omega_unit = "{right}" (now "{stated}"), and imu.errors anew: {ANEW}.', "imu.omega_unit",
            expected="a slope of 1",
        )
    ]  # fmt: skip


def _mounting(fit: AttitudeFit) -> list[Finding]:
    left = 1.0 / (1.0 + fit.rotation_gain / (3.0 * fit.steps))
    rotation = Rotation.from_matrix(fit.rotation)
    if rotation.magnitude() < TURNED_RAD or left > BETTER:
        return []
    yaw, pitch, roll = rotation.as_euler("ZYX", degrees=True)
    return [
        Finding(
            "attitude_mounting", "fault", min(fit.rotation_gain, 1e9),
            f"The attitude sensor is mounted {np.rad2deg(rotation.magnitude()):.0f} deg off what is stated.",
            f"Its turns and its level fit gyros and accelerometers after roll {roll:+.0f}, pitch {pitch:+.0f}, yaw "
            f"{yaw:+.0f} deg: {100.0 * left:.0f} % of the misfit is left, over {fit.steps} intervals of "
            f"{STEP_S:g} s.",
            f"Turn attitude.mounting_roll_deg, mounting_pitch_deg and mounting_yaw_deg by {roll:+.0f}, {pitch:+.0f}, "
            f"{yaw:+.0f}; or the IMU is turned, imu.axes.", "attitude.mounting_yaw_deg",
        )
    ]  # fmt: skip


def _signs(fit: AttitudeFit) -> list[Finding]:
    return [
        Finding(
            "gyro_sign", "fault", fit.steps * alike**2,
            f"About {axis} the gyros turn the other way than the recorded attitude: one of the two has the wrong sign.",
            f"Correlation of their turns {alike:.2f} over {fit.steps} intervals of {STEP_S:g} s.",
            "Look at the sign of that rate (imu.omega) and of that angle, and at attitude.frame.", "imu.omega",
        )
        for axis, alike in zip("xyz", fit.of_axes, strict=True)
        if alike < -ONE_VEHICLE
    ]  # fmt: skip


RELATIVE_DEG = 10.0
"""1 sigma of the yaw at the end from which the track is relative: a sixth of the way is then off to the side."""
SIGMAS = 5.0
NEAR_S = 1.5
"""Time after the start within which the first sample tells of the start."""


@dataclass(frozen=True)
class Correction:
    """What the whole log says of the heading at the start, deg: correction, its 1 sigma before and after."""

    change_deg: float
    sd_deg: float
    left_deg: float

    @property
    def sigmas(self) -> float:
        """The correction over its 1 sigma."""
        return abs(self.change_deg) / max(self.sd_deg, 1e-9)


def start_words(prepared: PreparedRun, samples: pl.DataFrame, method: str) -> list[str]:
    """What the whole log says of the heading at the start, in one sentence; none where the method was not smoothed."""
    found = start_correction(prepared, samples, method)
    if found is None:
        return []
    words = f"Heading at the start: the whole log corrects it by {found.change_deg:+.1f} deg, {found.sigmas:.1f} times"
    return [f"{words} its 1 sigma of {found.sd_deg:.3g} deg ({method}); {found.left_deg:.3g} deg are left."]


def start_correction(prepared: PreparedRun, samples: pl.DataFrame, method: str) -> Correction | None:
    """Of a method that was smoothed; None without."""
    smoothed = samples.filter((pl.col("method") == method) & (pl.col("pass") == "smoothed"))
    if smoothed.is_empty():
        return None
    first, alignment = smoothed.sort("time_ns").row(0, named=True), prepared.alignment
    if first["time_ns"] - alignment.time_ns > NEAR_S * 1e9:
        return None
    inertial = prepared.readings
    rows = slice(*np.searchsorted(inertial.time_ns, [alignment.time_ns, first["time_ns"] + 1]))
    step_s = np.diff(inertial.time_ns[rows])[:, None] * 1e-9
    attitude = alignment.attitude
    for turn in Rotation.from_rotvec(inertial.omega_p_radps[rows][1:] * step_s) if len(step_s) else ():
        attitude = attitude * turn
    change = (first["yaw_deg"] - float(np.rad2deg(to_angles(attitude)[2])) + 180.0) % 360.0 - 180.0
    sd, left = alignment.attitude_sd_rad[2], first["sd_misalignment_down_rad"]
    return Correction(change, float(np.rad2deg(sd)), float(np.rad2deg(left)))


def heading_findings(prepared: PreparedRun, samples: pl.DataFrame, method: str) -> list[Finding]:
    """Of the method that stands for all."""
    found = []
    last = samples.filter((pl.col("pass") == FORWARD) & (pl.col("method") == method)).sort("time_ns").tail(1)
    sd_deg = float(np.rad2deg(last["sd_misalignment_down_rad"][0])) if last.height else 0.0
    if sd_deg > RELATIVE_DEG:
        found.append(
            Finding(
                "relative_track", "warning", (sd_deg / RELATIVE_DEG) ** 2,
                f"The heading is known to {sd_deg:.0f} deg (1 sigma) at the end: the track is relative, turned as a "
                "whole by an angle that the log hardly tells.",
                f"Start: {prepared.alignment.sources.get('heading', '')}.",
                "Set start.heading_deg and start.heading_sd_deg, or add an attitude, a heading or positions.",
                "start.heading",
            )
        )  # fmt: skip
    correction = start_correction(prepared, samples, method)
    if correction is not None and correction.sigmas > SIGMAS:
        found.append(
            Finding(
                "start_heading", "fault", correction.sigmas**2,
                f"The whole log corrects the heading at the start by {correction.change_deg:+.1f} deg, "
                f"{correction.sigmas:.0f} times its claimed 1 sigma.",
                f"{method}, smoothed; {correction.left_deg:.3g} deg are left. Start: "
                f"{prepared.alignment.sources.get('heading', '')}.",
                "Set start.heading_deg to what the log finds, or start.heading_sd_deg to what is known of it.",
                "start.heading_sd_deg",
            )
        )  # fmt: skip
    return found
