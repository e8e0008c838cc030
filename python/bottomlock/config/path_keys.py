"""Keys of `[trajectory]` for a path of one's own, and which keys belong to which source."""

from collections.abc import Set as AbstractSet
from typing import Annotated, Any

from pydantic import Field, model_validator

from bottomlock.config.section import Section, shown
from bottomlock.kernel.models import NonNegative, Positive

_KEYS = {
    "analytic": (
        "heading_deg", "yaw_rate_deg_per_s", "dive_angle_deg", "dive_s", "leg_s", "turn_s", "sway_gain_m",
    ),
    "vehicle": ("vehicle", "feedback", "pilot"),
    "file": ("file", "columns", "max_gap_s", "limits"),
}  # fmt: skip


class PathLimits(Section):
    """What is plausible of a path; a file beyond it is refused with the row."""

    speed_mps: Positive = 15.0
    """greatest speed"""
    least_speed_mps: NonNegative = 0.05
    """least mean speed: below it the unit is probably wrong"""
    accel_mps2: Positive = 5.0
    """greatest acceleration"""
    jerk_mps3: Annotated[Positive, shown(unit="m/s³")] = 20.0
    """greatest change of the acceleration in a second"""
    turn_deg_per_s: Positive = 60.0
    """greatest angular rate"""


class PathKeys(Section):
    """A path of one's own (docs/own_trajectory.md): CSV or Parquet, samples of a smooth motion."""

    file: Annotated[str | None, shown(example="nav.csv")] = None
    """a path of your own: CSV or Parquet, from the scenario's folder; it alone says that the source is a file"""
    columns: Annotated[dict[str, str], shown(example={"time_s": "t", "north_m": "x"})] = Field(
        default_factory=dict
    )
    """the file's names of columns, by ours"""
    max_gap_s: Annotated[Positive | None, shown(example=2.0)] = None
    """longest time between rows; by default ten times the usual one, and a second at least"""
    limits: PathLimits = PathLimits()
    """what is plausible of the path"""

    @model_validator(mode="before")
    @classmethod
    def _file_is_its_source(cls, data: Any) -> Any:  # noqa: ANN401 - whatever a file holds
        """A file alone says that it is the source."""
        if isinstance(data, dict) and data.get("file") is not None:
            return {"source": "file", "kind": "file"} | data
        return data


def others_keys(source: str) -> set[str]:
    """Keys that belong to another source than this one."""
    return {key for name, keys in _KEYS.items() if name != source for key in keys}


def check_source(source: str, kind: str, given: AbstractSet[str]) -> None:
    """Checks that every key that is given belongs to the source.

    Raises:
        ValueError: naming the key.
    """
    for name, keys in _KEYS.items():
        for key in keys if name != source else ():
            if key in given:
                raise ValueError(
                    f'\'{key}\' belongs to source = "{name}", and the source is "{source}"'
                    + ("; [mission] sets the vehicle's path" if source == "vehicle" else "")
                )
    if source == "vehicle" and kind == "constant_turn":
        raise ValueError("kind 'constant_turn' exists with source = \"analytic\" alone")
    if source == "analytic" and kind == "waypoints":
        raise ValueError("kind 'waypoints' exists with source = \"vehicle\" alone")
    if (source == "file") != (kind == "file"):
        raise ValueError(
            "kind 'file' and source 'file' exist together: give the key file, and neither of the two"
        )
    if source == "file" and "file" not in given:
        raise ValueError('source = "file" needs the key file')
