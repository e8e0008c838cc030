"""The recorded attitude against the gyros and the accelerometers: unit of the gyros, mounting of the instrument.

Both turn over each second, and both show gravity over some seconds, in platform axes. One rotation from the attitude's
axes to the IMU's fits all of that (Kabsch 1976); the ratio of the turns is the unit.
"""

from dataclasses import dataclass

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.files.replay_tables import FORWARD
from bottomlock.recordings.axes import to_angles
from bottomlock.recordings.finding import Finding
from bottomlock.recordings.stream_sections import ImuStream
from bottomlock.recordings.streams import Floats, integrals
from bottomlock.replay.case import Case
from bottomlock.replay.findings.motion_findings import ANEW
from bottomlock.replay.motion.gyros import SLOPE_S, Turns, turns_of
from bottomlock.replay.rerun import PreparedRun

LEVEL_S = 10.0
"""Interval over which the direction of gravity is compared."""
FEWEST = 60
CORRELATED = 0.6
"""Correlation of the turns from which both are of one vehicle."""
TURNED_RAD = np.deg2rad(25.0)
"""A smaller rotation may be a slow error of the attitude."""
BETTER = 0.5
"""Part of the misfit that may be left after a rotation that is a finding."""
UNITS = {np.pi / 180.0: ("deg/s", "rad/s"), 180.0 / np.pi: ("rad/s", "deg/s")}
"""Ratio of gyros to attitude: the unit that is stated, and the right one."""


@dataclass(frozen=True, eq=False)
class AttitudeTurns:
    """Turns of gyros and attitude, and gravity in both.

    Attributes:
        turns: over steps of a second.
        down: (n, 3) directions of gravity by accelerometers and attitude.
        rotation: from the attitude's axes to those of the gyros, as it fits.
        ratio: slope of the gyros over the attitude, 1 in the right unit.
        correlation: of both.
    """

    turns: Turns
    down: tuple[Floats, Floats]
    rotation: Rotation
    ratio: float
    correlation: float

    @property
    def unit_is_right(self) -> bool:
        """Whether the gyros turn about as far as the attitude."""
        return bool(abs(np.log(abs(self.ratio))) < np.log(2.0))


def attitude_turns(case: Case, prepared: PreparedRun) -> AttitudeTurns | None:
    """Turns of gyros and recorded attitude; None without either, and where they are not of one vehicle."""
    attitudes, inertial = prepared.streams.attitudes, prepared.readings
    # Without an IMU the turns are those of the attitude itself.
    if case.attitude is None or attitudes is None or not isinstance(case.imu, ImuStream):
        return None
    rows = slice(int(np.searchsorted(attitudes.time_ns, prepared.alignment.time_ns)), None)
    turns = turns_of(
        inertial.time_ns, inertial.omega_p_radps, attitudes.time_ns[rows], attitudes.attitude[rows]
    )
    if turns is None or len(turns.gyros) < FEWEST:
        return None
    edges = np.arange(turns.edges_ns[0], turns.edges_ns[-1], round(LEVEL_S * 1e9), dtype=np.int64)
    force = integrals(inertial.time_ns, inertial.force_p_mps2, edges)
    level = integrals(attitudes.time_ns, attitudes.attitude.inv().apply([0.0, 0.0, 1.0]), edges)
    down = -_unit_rows(force), _unit_rows(level)
    rotation = _aligned(turns, *down)
    ratio, correlation = turns.slope(rotation)
    return AttitudeTurns(turns, down, rotation, ratio, correlation) if correlation >= CORRELATED else None


def attitude_findings(case: Case, seen: AttitudeTurns | None) -> list[Finding]:
    """Unit of the gyros and mounting of the attitude sensor, where both instruments contradict what is stated."""
    if seen is None:
        return []
    found = [
        _unit(case, seen.ratio, seen.correlation, seen.turns),
        _mounting(seen.turns, seen.down, seen.rotation, seen.ratio),
    ]
    return [one for one in found if one is not None]


def _unit(case: Case, ratio: float, correlation: float, turns: Turns) -> Finding | None:
    factor = min(UNITS, key=lambda one: abs(np.log(abs(ratio) / one)))
    stated, right = UNITS[factor]
    if abs(np.log(abs(ratio) / factor)) > np.log(2.0) or case.readings.omega_unit != stated:
        return None
    left = float(np.sum((turns.gyros / factor - turns.attitude) ** 2))
    misfit = float(np.sum((turns.gyros - turns.attitude) ** 2))
    return Finding(
        "gyro_unit", "fault", min(turns.gyros.size * misfit / max(left, 1e-12), 1e9),
        f"The unit of the angular rate is wrong: {right} taken for {stated}.",
        f"Slope of the gyros over the turns of the recorded attitude: {ratio:.3g} as stated, {ratio / factor:.3g} with "
        f"{right}, expected 1; correlation {correlation:.2f} over {len(turns.gyros)} intervals of {SLOPE_S:g} s.",
        f'Set imu.omega_unit = "{right}" (now "{stated}"), and imu.errors anew: {ANEW}.', "imu.omega_unit",
        expected="a slope of 1",
    )  # fmt: skip


def _mounting(turns: Turns, down: tuple[Floats, Floats], rotation: Rotation, ratio: float) -> Finding | None:
    if rotation.magnitude() < TURNED_RAD:
        return None
    parts = ((turns.gyros / ratio, turns.attitude), down)
    before, after = (
        sum(float(np.sum((a - r.apply(b)) ** 2) / max(np.sum(a**2), 1e-12)) for a, b in parts)
        for r in (Rotation.identity(), rotation)
    )
    if after > BETTER * before:
        return None
    yaw, pitch, roll = rotation.as_euler("ZYX", degrees=True)
    return Finding(
        "attitude_mounting", "fault", min(turns.gyros.size * before / max(after, 1e-12), 1e9),
        f"The attitude sensor is mounted {np.rad2deg(rotation.magnitude()):.0f} deg off what is stated.",
        f"Its turns and its level fit gyros and accelerometers after roll {roll:+.0f}, pitch {pitch:+.0f}, yaw "
        f"{yaw:+.0f} deg: {100.0 * after / before:.0f} % of the misfit is left, over {len(turns.gyros)} intervals of "
        f"{SLOPE_S:g} s.",
        f"Turn attitude.mounting_roll_deg, mounting_pitch_deg and mounting_yaw_deg by {roll:+.0f}, {pitch:+.0f}, "
        f"{yaw:+.0f}; or the IMU is turned, imu.axes.", "attitude.mounting_yaw_deg",
    )  # fmt: skip


def _aligned(turns: Turns, down_imu: Floats, down_attitude: Floats) -> Rotation:
    """The rotation from the attitude's platform axes to the IMU's, by turns and level with the same weight."""
    k = float(np.sqrt(np.sum(turns.gyros**2) / max(float(np.sum(turns.attitude**2)), 1e-12)))
    share = [1.0 / max(float(np.sum(turns.gyros**2)), 1e-12), 1.0 / len(down_imu)]
    found, _ = Rotation.align_vectors(
        np.concatenate([turns.gyros, down_imu]),
        np.concatenate([k * turns.attitude, down_attitude]),
        weights=np.repeat(share, [len(turns.gyros), len(down_imu)]),
    )
    return found


def _unit_rows(values: Floats) -> Floats:
    return np.asarray(values / np.maximum(np.linalg.norm(values, axis=1), 1e-9)[:, None], dtype=np.float64)


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
