"""The errors of a recorded attitude in a first case: of a packaged grade that suits its gyros."""

import numpy as np

from bottomlock.config.instrument_grades import grades
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.text import Section

GYROCOMPASS_DEG_PER_H = 10.0
"""Gyros within this of an attitude are of an instrument that finds north by itself."""


def put_attitude_noise(section: Section, parts: Parts) -> None:
    """The grade of the instrument, with its white noise, offset and walk as the filter then estimates them."""
    offset = (
        np.inf if parts.gyros is None else float(np.rad2deg(np.abs(parts.gyros.offset_radps).max())) * 3600.0
    )
    grade = grades("attitude")["gyrocompass" if offset < GYROCOMPASS_DEG_PER_H else "mti_ahrs"]
    section.put("grade", grade.name, f"which instrument is it? {grade.title}", known=False)
    keys = grade.keys
    section.say(
        f"white noise {keys['roll_pitch_sd_deg']:g} deg (yaw {keys['yaw_sd_deg']:g}), offset "
        f"{keys['roll_pitch_offset_sd_deg']:g} ({keys['yaw_offset_sd_deg']:g}), walk "
        f"{keys['roll_pitch_walk_sd_deg']:g} ({keys['yaw_walk_sd_deg']:g}) of {keys['walk_time_s']:g} s: a key written "
        "here replaces the grade's"
    )
