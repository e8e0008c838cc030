"""The A-KIT recordings as cases: what their README says must be corrected, written as a case file per section.

The recordings are not republished; nothing of them stands here but what was found about their clocks, axes and methods.
"""

from collections.abc import Sequence
from pathlib import Path

from bottomlock.files.atomic_write import write_text
from bottomlock.replay.case import Case, parse_case
from tests.toml_text import Sections, toml

LAG_S = {
    1: -0.41, 2: -0.45, 3: -0.46, 4: -0.42, 5: 0.50, 6: 0.44, 7: -0.43, 8: -0.41, 9: -0.40, 10: -0.45, 11: 0.45,
    12: 0.48, 13: -0.45,
}  # fmt: skip
"""Clock of the reference against row / 100 Hz of the IMU, by section (the recordings' README)."""
SECTIONS = (1, 2, 3, 5, 6, 7, 10, 12)

# The README has the DVL at (-1.8, -0.03, 0.1) m from the reference's point. The accelerometers are not at that point
# either: velocity increments over a second put them at (-1.77, -0.02, -0.12) m,
# so the reference's point lies ahead of the IMU, and the DVL almost at it.
REFERENCE_LEVER_M = (1.77, 0.02, 0.12)
DVL_LEVER_M = (-0.03, -0.01, 0.22)

GEOMETRY = f"""
name = "Workhorse Navigator of the A-KIT recordings, beams projected"
configuration = "x"
tilt_deg = 30.0
lever_arms_m = [{", ".join([str(list(DVL_LEVER_M))] * 4)}]
# The README's misalignment turns the platform to the DVL; a mounting turns the DVL to the platform.
mounting_roll_deg = 0.1
mounting_pitch_deg = -0.07
mounting_yaw_deg = -0.15
beam_noise_mps = 0.01  # the velocity scatters by 5 to 17 mm/s about the reference
"""

WHAT_IF: Sections = {"lost_34": {"beams_lost": [3, 4]}}


def akit_case(
    data: Path, scratch: Path, section: int, *, asks: Sequence[str] = (), depth: bool = True, replay: str = ""
) -> Case:
    """A section as a case.

    Args:
        data: folder of the recordings.
        scratch: folder that the geometry file may be written to.
        section: its number.
        asks: what-if cases of `WHAT_IF` beside the beams as recorded.
        depth: with the altitude of the reference as a depth sensor.
        replay: lines for the section [replay].
    """
    geometry = scratch / "akit_dvl.toml"
    write_text(geometry, GEOMETRY)
    files, lever, lag = data / "akit_snapir", list(REFERENCE_LEVER_M), LAG_S[section]
    altitude: Sections = {
        "file": f"{files}/gt_{section:02d}.csv", "clock": {"rate_hz": 1.0, "offset_s": lag}, "column": "Altitude [m]",
        "up": True, "sd_m": 0.05, "lever_arm_m": lever,
    }  # fmt: skip
    # A row of the IMU is the mean over the 10 ms after its own time.
    text = toml({
        "": {"name": f"akit_{section:02d}"},
        "imu": {
            "file": f"{files}/imu_{section:02d}.parquet", "clock": {"rate_hz": 100.0, "start_s": 0.01},
            "sampling": "averaged", "force": ["acc_x", "acc_y", "acc_z"], "omega": ["gyro_x", "gyro_y", "gyro_z"],
            "axes": ["x", "-y", "z"],
        },
        "imu.errors": {
            "accel_bias_mg": 0.05, "gyro_bias_deg_per_h": 0.1, "accel_noise_mps_per_rt_h": 0.005,
            "gyro_noise_deg_per_rt_h": 0.005,
        },
        "dvl": {
            "source": "velocity", "file": f"{files}/dvl_{section:02d}.csv",
            "clock": {"rate_hz": 1.0, "offset_s": 1.03},
            "velocity": ["DVL X [m/s]", "DVL Y [m/s]", "DVL Z [m/s]"], "velocity_scale": 1.002,
            "geometry": str(geometry),
        },
        "dvl.errors": {
            "beam_bias_mps": 0.002, "scale_factor_percent": 0.4, "scale_factor_walk_percent_per_rt_s": 1e-3,
        },
        **({"depth": altitude} if depth else {}),
        "reference": {
            "file": f"{files}/gt_{section:02d}.csv", "clock": {"rate_hz": 1.0, "offset_s": lag},
            "latitude": "Latitude [rad]", "longitude": "Longitude [rad]", "height": "Altitude [m]",
            "angle_unit": "rad", "lever_arm_m": lever,
            "velocity_ned": ["V North [m/s]", "V East [m/s]", "V Down [m/s]"],
            "roll": "Roll [rad]", "pitch": "Pitch [rad]", "yaw": "Yaw [rad]",
            "note": "post-processed from the same IMU and DVL, so not independent of either",
        },
        "start": {
            "level": "reference", "heading": "reference", "position": "reference", "velocity": "reference",
            "position_sd_m": [0.0] * 3, "level_sd_deg": 0.02, "heading_sd_deg": 0.1, "velocity_sd_mps": [0.02] * 3,
        },
    })  # fmt: skip
    text += f"[replay]\n{replay}\n" + toml({"what_if": [{"name": one, **WHAT_IF[one]} for one in asks]})
    return parse_case(text, place=f"akit section {section}")
