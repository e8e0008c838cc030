"""A heading that nothing in the log tells, and one that the log moves far beyond its claim."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.recordings.axes import to_angles
from bottomlock.recordings.finding import Finding
from bottomlock.replay.rerun import PreparedRun
from bottomlock.tables.replay import FORWARD

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
                f"{method}, smoothed; {correction.left_deg:.2g} deg are left. Start: "
                f"{prepared.alignment.sources.get('heading', '')}.",
                "Set start.heading_deg to what the log finds, or start.heading_sd_deg to what is known of it.",
                "start.heading_sd_deg",
            )
        )  # fmt: skip
    return found
