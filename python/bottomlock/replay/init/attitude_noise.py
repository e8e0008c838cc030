"""The noise of a recorded attitude in a first case: of a packaged grade that suits its gyros."""

import numpy as np

from bottomlock.config.instrument_grades import grades
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.text import Section

GYROCOMPASS_DEG_PER_H = 10.0
"""Gyros within this of an attitude are of an instrument that finds north by itself."""


def put_attitude_noise(section: Section, parts: Parts) -> None:
    """Noise of roll, pitch and yaw."""
    offset = (
        np.inf if parts.gyros is None else float(np.rad2deg(np.abs(parts.gyros.offset_radps).max())) * 3600.0
    )
    name = "gyrocompass" if offset < GYROCOMPASS_DEG_PER_H else "mti_ahrs"
    grade = grades("attitude")[name]
    why = f"as of the grade {name}: {grade.title}; what is yours?"
    for part in ("roll_pitch", "yaw"):
        parts_deg = [grade.keys[f"{part}{of}_sd_deg"] for of in ("", "_offset", "_walk")]
        section.put(f"{part}_sd_deg", float(f"{np.linalg.norm(parts_deg):.2g}"), why, known=False)
