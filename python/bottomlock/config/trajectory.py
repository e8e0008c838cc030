"""The section `[trajectory]` of a scenario: the true motion, of a vehicle, analytic or from a file."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from bottomlock.config.own_methods import check_methods
from bottomlock.config.section import PackagedOrFile, Section, shown
from bottomlock.kernel.models import NonNegative, Positive, Real

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


class Trajectory(Section):
    """The true motion: of a simulated vehicle, analytic, or along a path of one's own (docs/own_trajectory.md)."""

    kind: Literal["straight", "constant_turn", "figure_eight", "lawn_mower", "waypoints", "file"]
    """the path; constant_turn is analytic only, waypoints of a vehicle only; a file needs no kind"""
    source: Literal["vehicle", "analytic", "file"] = "vehicle"
    """who makes the motion: a simulated vehicle under guidance, analytic functions with exact derivatives, or the
    splines through a file"""
    vehicle: Annotated[str, PackagedOrFile] = "tauv"
    """packaged vehicle, or a vehicle file, from the scenario's folder; source vehicle only"""
    feedback: Literal["truth", "estimate"] = "truth"
    """state that guidance and control use; with the estimate the path has the navigation error; source vehicle only"""
    pilot: Annotated[str, shown(range='"own" or a method of the campaign')] = "own"
    """with feedback = "estimate": the method whose estimate steers, or "own": each method has its own vehicle"""
    duration_s: Annotated[Real, Field(gt=0, le=86_400)] = 250.0
    """length of a run; a path through waypoints ends at the last of them unless this is given"""
    speed_mps: Annotated[Real, Field(gt=0, le=50)] = 2.0
    """speed over ground that the path is followed with"""
    heading_deg: Annotated[Real, Field(ge=-360, le=360)] = 0.0
    """heading at the start, from north to east; source analytic only"""
    yaw_rate_deg_per_s: Annotated[Real, Field(gt=0, le=90)] = 3.0
    """rate of the turns; source analytic only"""
    dive_angle_deg: Annotated[Real, Field(ge=0, le=60)] = 5.0
    """pitch of the dive, down; source analytic only"""
    dive_s: NonNegative = 30.0
    """length of the dive; source analytic only"""
    leg_s: Positive = 40.0
    """length of a leg of the lawn mower; source analytic only"""
    turn_s: Positive = 20.0
    """length of a half turn of the lawn mower; source analytic only"""
    sway_gain_m: Annotated[Real, Field(ge=-10, le=10)] = 0.6
    """sway over yaw rate in turns, m/s for each rad/s; source analytic only"""
    file: Annotated[Annotated[str, PackagedOrFile] | None, shown(example="nav.csv")] = None
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

    @model_validator(mode="after")
    def _of_one_source(self) -> Self:
        source, kind, given = self.source, self.kind, self.model_fields_set
        for name, keys in _KEYS.items():
            wrong = [key for key in keys if key in given and name != source]
            if wrong:
                hint = "; [mission] sets the vehicle's path" if source == "vehicle" else ""
                raise ValueError(
                    f'\'{wrong[0]}\' belongs to source = "{name}", and the source is "{source}"{hint}'
                )
        for alone, other in (("constant_turn", "analytic"), ("waypoints", "vehicle")):
            if kind == alone and source not in {other, "file"}:
                raise ValueError(f"kind '{kind}' exists with source = \"{other}\" alone")
        if (source == "file") != (kind == "file"):
            raise ValueError(
                "kind 'file' and source 'file' exist together: give the key file, and neither of the two"
            )
        if source == "file" and "file" not in given:
            raise ValueError('source = "file" needs the key file')
        if self.pilot != "own":
            check_methods([self.pilot])
        return self

    @model_serializer(mode="wrap")
    def _of_its_source(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leaves out the keys that would mean something else if they were given: what is dumped can be read again."""
        strange = {key for name, keys in _KEYS.items() if name != self.source for key in keys}
        # A path through waypoints ends at the last of them, unless it has a duration; so does one from a file.
        strange |= {"duration_s"} if self.kind in {"waypoints", "file"} else set()
        strange |= {"speed_mps"} if self.kind == "file" else set()
        dumped: dict[str, Any] = handler(self)
        return {key: value for key, value in dumped.items() if key not in strange - self.model_fields_set}
