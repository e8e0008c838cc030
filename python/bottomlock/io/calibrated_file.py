"""A DVL's file with another mounting, scale and clock offset, each with its 1 sigma; everything else stays as it is."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from bottomlock.errors import OutputError

ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class Calibrated:
    """What a calibration found.

    Attributes:
        source: where from, for the comment.
        mounting_rpy_rad: (3,) roll, pitch, yaw from DVL axes to platform axes; None to leave the mounting as it is.
        mounting_sd_rad: (3,) about the platform's forward, right and down axes.
        scale, scale_sd: the DVL reads 1 + scale times the velocity; None where it is not known.
        clock_offset_s, clock_sd_s: to be added to the DVL's stamps; None where it is not known.
    """

    source: str
    mounting_rpy_rad: NDArray[np.float64] | None
    mounting_sd_rad: NDArray[np.float64] | None
    scale: float | None
    scale_sd: float | None
    clock_offset_s: float | None
    clock_sd_s: float | None


def require_toml(path: Path) -> None:
    """Refuses a name that is none of a TOML file.

    Raises:
        OutputError: naming it.
    """
    if path.suffix.lower() != ".toml":
        raise OutputError(place=path, expected="a name that ends in .toml")


def calibration_lines(found: Calibrated) -> list[str]:
    """The table [calibration]; empty where nothing is known."""
    lines = []
    if found.mounting_sd_rad is not None:
        sd = ", ".join(f"{value:.4g}" for value in np.rad2deg(found.mounting_sd_rad))
        lines.append(f"mounting_sd_deg = [{sd}]  # 1 sigma about forward, right, down")
    if found.scale is not None and found.scale_sd is not None:
        lines.append(f"scale_percent = {100.0 * found.scale:.4f}  # the DVL reads so much too much")
        lines.append(f"scale_sd_percent = {100.0 * found.scale_sd:.4g}")
    if found.clock_offset_s is not None and found.clock_sd_s is not None:
        lines.append(f"clock_offset_s = {found.clock_offset_s:.4f}  # to be added to the DVL's stamps")
        lines.append(f"clock_sd_s = {found.clock_sd_s:.4g}")
    return ["", f"[calibration]  # {found.source}", *lines] if lines else []


def calibrated_text(text: str, found: Calibrated) -> str:
    """A DVL's file (TOML) with a calibration in place of its own; comments and all other keys stay."""
    document = tomlkit.parse(text)
    document.pop("calibration", None)
    if found.mounting_rpy_rad is not None:
        for name, value in zip(ANGLES, found.mounting_rpy_rad, strict=True):
            document[f"mounting_{name}_deg"] = tomlkit.value(f"{np.rad2deg(value):.4f}")
    return "\n".join([tomlkit.dumps(document).rstrip(), *calibration_lines(found)]) + "\n"
