"""The errors of a recorded attitude in a first case: those of a magnetic attitude reference."""

from bottomlock.config.instrument_grades import grades
from bottomlock.replay.init.text import Section

MAGNETIC = "mti_ahrs"
"""Gyros that agree with an attitude show a good IMU. They say nothing of north, so no gyrocompass follows from them."""


def put_attitude_noise(section: Section) -> None:
    """The grade of the instrument, with its white noise, offset and walk as the filter then estimates them."""
    grade = grades("attitude")[MAGNETIC]
    section.put("grade", grade.name, f"which instrument is it? {grade.title}", known=False)
    keys = grade.keys
    section.say(
        f"white noise {keys['roll_pitch_sd_deg']:g} deg (yaw {keys['yaw_sd_deg']:g}), offset "
        f"{keys['roll_pitch_offset_sd_deg']:g} ({keys['yaw_offset_sd_deg']:g}), walk "
        f"{keys['roll_pitch_walk_sd_deg']:g} ({keys['yaw_walk_sd_deg']:g}) of {keys['walk_time_s']:g} s: a key written "
        "here replaces the grade's"
    )
