"""Findings from the mounting: what is observable, what is not and why, and the recommended settings."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from bottomlock.audit.imu_alignment import ImuAlignment
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import find_matrix
from bottomlock.audit.mounting import LIMITS, Mounting
from bottomlock.audit.robust import Array, sigmas_for
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.finding import Finding

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
LEAST_RATE_RADPS = 1e-4
"""RMS rate of turn from which an IMU's axes and clock show in it."""


def _zeros() -> Array:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class Mounted:
    """A stated mounting: roll, pitch, yaw (3,), rad, from DVL to platform axes; lever arm (3,), m, platform frame."""

    rpy_rad: Array = field(default_factory=_zeros)
    lever_arm_p_m: Array = field(default_factory=_zeros)

    @classmethod
    def of(cls, geometry: BeamGeometry, rpy_rad: ArrayLike) -> "Mounted":
        """Of a geometry that contains this mounting; the lever arm is the mean of its beams'."""
        return cls(np.array(rpy_rad, dtype=np.float64), np.asarray(geometry.lever_arms_p_m).mean(axis=0))

    @property
    def rotation(self) -> Rotation:
        """From DVL axes to platform axes."""
        return Rotation.from_euler("ZYX", self.rpy_rad[::-1])

    def directions(self, geometry: BeamGeometry, log: BeamLog) -> tuple[Array, "Mounted"]:
        """Stated rows (beams, 3) in the frame of the instrument's velocity, and the mounting of that frame.

        An instrument may give its velocity in its own axes, or rotate it to the platform's by a mounting that it has
        been told: the frame is taken in which its own solution has the stated beams.
        """
        in_platform = geometry.sound_speed_scale * np.asarray(geometry.directions_p)
        in_own = self.rotation.inv().apply(in_platform)
        if not self.rpy_rad.any() or log.instrument_mps is None or not log.own_frame or log.beams < 3:
            return in_own, self
        pings = log.full & log.solved
        found = find_matrix(log.velocity_mps[pings], log.instrument_mps[pings])
        if found is None or not found.observable.all():
            return in_own, self
        off = [float(np.linalg.norm(found.rows - rows)) for rows in (in_own, in_platform)]
        return (in_own, self) if off[0] <= off[1] else (in_platform, Mounted(np.zeros(3), self.lever_arm_p_m))


def mounting_findings(mounting: Mounting | None, stated: Mounted | None = None) -> list[Finding]:
    """Misalignment and lever arm other than stated, clock offset and scale, and parameters that are not observable."""
    if mounting is None:
        return []
    m, stated = mounting, stated or Mounted()
    basis = (
        f"From {m.source}, {m.instants} instants; residual "
        f"{', '.join(f'{1e3 * value:.0f}' for value in m.residual_mps)} mm/s; "
        f"{100.0 * m.explained:.0f} % of the {'velocity changes' if m.of_changes else 'motion'} explained."
    )
    if not m.follows:
        gain = f" Response to the IMU {1.0 + m.scale:.2f} ± {m.scale_sd:.2g}." if m.of_changes else ""
        return [
            Finding(
                "mounting_not_observable", "note", 0.0,
                "Misalignment, lever arm, clock offset and scale are not observable in this log: the other recordings "
                "do not explain the velocity.",
                basis + gain,
                "Record accelerations, rotations and speeds well above the noise of the instrument.",
                size=m.explained,
            )
        ]  # fmt: skip
    found = _imu_findings(m.imu)
    if m.mirrored:
        found.append(
            Finding(
                "left_handed", "fault", 1.0,
                "The instrument's velocity is in a left-handed frame: it fits with its y axis reversed.",
                basis,
                "Reverse y before using the velocity.",
                size=1.0,
            )
        )  # fmt: skip
    found += _misalignment(m, stated, basis)
    found += _lever_arm(m, stated, basis)
    if m.clock_offset_sd_s > LIMITS["clock_offset_s"]:
        found.append(_not_observable("The clock offset", f"± {m.clock_offset_sd_s:.2g} s", "speed changes"))
    elif abs(m.clock_offset_s) > max(0.02, sigmas_for(m.blocks) * m.clock_offset_sd_s):
        found.append(
            Finding(
                "clock_offset", "fault", min(abs(m.clock_offset_s), 1.0),
                f"The DVL's clock is {abs(m.clock_offset_s):.3f} s "
                f"{'behind' if m.clock_offset_s > 0.0 else 'ahead of'} the reference's: "
                f"reference time is DVL time {m.clock_offset_s:+.3f} s.",
                f"± {m.clock_offset_sd_s:.2g} s. {basis}",
                "Set this clock offset for the DVL.",
                size=m.clock_offset_s, unit="s",
            )
        )  # fmt: skip
    if abs(m.scale) > max(0.002, sigmas_for(m.blocks) * m.scale_sd):
        found.append(
            Finding(
                "velocity_scale", "warning", abs(m.scale),
                f"The DVL reads {100.0 * m.scale:+.2f} % against the reference.",
                f"± {100.0 * m.scale_sd:.2g} %. {basis}",
                "Check the sound speed; let the filter estimate the scale.",
                size=100.0 * m.scale, unit="%",
            )
        )  # fmt: skip
    elif m.scale_sd > LIMITS["scale"]:
        found.append(_not_observable("The scale", f"± {100.0 * m.scale_sd:.2g} %", "speed"))
    return found


def _not_observable(what: str, sd: str, lacks: str) -> Finding:
    evidence = f"Its standard deviation is {sd}."
    if "± inf" in sd:
        evidence = (
            "The log has too few independent pings, or too little of this motion, for a standard deviation."
        )
    return Finding(
        "not_observable", "note", 0.0,
        f"{what} is not observable in this log.",
        evidence,
        f"Record more {lacks}.",
    )  # fmt: skip


def _misalignment(m: Mounting, stated: Mounted, basis: str) -> list[Finding]:
    sd = m.misalignment_sd_rad
    listed = ", ".join(
        f"{name} {np.rad2deg(value):+.2f} ± {np.rad2deg(spread):.2g}"
        for name, value, spread in zip(ANGLES, m.rpy_rad, sd, strict=True)
    )
    # About the platform's x, y, z, as the standard deviations are.
    off = (Rotation.from_euler("ZYX", m.rpy_rad[::-1]) * stated.rotation.inv()).as_rotvec()
    blind = [k for k in range(3) if sd[k] > LIMITS["misalignment_rad"]]
    sure = [
        k
        for k in range(3)
        if k not in blind and abs(off[k]) > max(np.deg2rad(0.05), sigmas_for(m.blocks) * sd[k])
    ]
    found = [
        _not_observable(f"Misalignment about {AXES[k]} ({ANGLES[k]})", f"± {np.rad2deg(sd[k]):.2g} "
            "deg", "speed across that axis")
        for k in blind
    ]  # fmt: skip
    if sure:
        size = float(np.rad2deg(np.linalg.norm(off[sure])))
        told = ", ".join(f"{np.rad2deg(value):.2f}" for value in stated.rpy_rad)
        against = f"the stated mounting ({told} deg)" if stated.rpy_rad.any() else "the platform"
        found.append(
            Finding(
                "misalignment", "fault" if size > 1.0 else "warning", float(np.sin(np.deg2rad(min(size, 90.0)))),
                f"The DVL is misaligned with {against}: {listed} deg ({', '.join(ANGLES[k] for k in sure)} "
                "significant).",
                basis,
                "Set these mounting angles for the DVL.",
                size=size, unit="deg",
            )
        )  # fmt: skip
    return found


def _lever_arm(m: Mounting, stated: Mounted, basis: str) -> list[Finding]:
    sd = m.lever_arm_sd_m
    off = m.lever_arm_p_m - stated.lever_arm_p_m
    sure = np.abs(off) > np.maximum(0.02, sigmas_for(m.blocks) * sd)
    seen = [k for k in range(3) if sure[k] or sd[k] <= LIMITS["lever_arm_m"]]
    listed = ", ".join(
        f"{AXES[k]} {m.lever_arm_p_m[k]:+.2f} ± {sd[k]:.2g}" if k in seen else f"{AXES[k]} not observable"
        for k in range(3)
    )
    rates = ", ".join(f"{np.rad2deg(value):.2g}" for value in m.rate_rms_radps)
    point = "the IMU" if m.of_changes else "the point of the reference velocity"
    if not seen:
        return [
            _not_observable("The lever arm", f"± {sd.min():.2g} m (rates {rates} deg/s RMS)", "rotations")
        ]
    if not sure.any():
        return []
    size = float(np.linalg.norm(off[seen]))
    told = ", ".join(f"{value:.2f}" for value in stated.lever_arm_p_m)
    against = f", stated is ({told}) m" if stated.lever_arm_p_m.any() else ""
    return [
        Finding(
            "lever_arm", "warning", min(float(size * np.linalg.norm(m.rate_rms_radps)), 1.0),
            f"The lever arm of the DVL from {point} is {listed} m{against}.",
            f"Rates {rates} deg/s RMS. {basis}",
            "Set this lever arm for the DVL.",
            size=size, unit="m",
        )
    ]  # fmt: skip


def _imu_findings(imu: ImuAlignment | None) -> list[Finding]:
    if imu is None or imu.rate_rms_radps < max(5.0 * imu.residual_radps, LEAST_RATE_RADPS):
        return []
    found = []
    reversed_axes = [AXES[k] for k in range(3) if imu.matrix[k, k] < -0.5]
    if reversed_axes:
        left = np.linalg.det(imu.matrix) < 0.0
        found.append(
            Finding(
                "imu_axes", "fault", 1.0,
                f"The IMU's {' and '.join(reversed_axes)} {'axis is' if len(reversed_axes) == 1 else 'axes are'} "
                f"opposite to the attitude's{': its frame is left-handed' if left else ''}.",
                f"Rates of the IMU against the attitude: diagonal "
                f"{', '.join(f'{imu.matrix[k, k]:+.3f}' for k in range(3))}.",
                "Reverse it for accelerometer and gyro.",
                size=float(len(reversed_axes)), unit="axes",
            )
        )  # fmt: skip
    if abs(imu.offset_s) > max(0.01, sigmas_for(imu.blocks) * imu.offset_sd_s) and imu.offset_sd_s < 0.05:
        found.append(
            Finding(
                "imu_clock_offset", "fault", min(abs(imu.offset_s), 1.0),
                f"The IMU's clock is {abs(imu.offset_s):.3f} s {'ahead of' if imu.offset_s > 0.0 else 'behind'} "
                "the attitude's.",
                f"± {imu.offset_sd_s:.2g} s, from the rotations in both recordings.",
                "Set this clock offset for the IMU.",
                size=imu.offset_s, unit="s",
            )
        )  # fmt: skip
    return found
