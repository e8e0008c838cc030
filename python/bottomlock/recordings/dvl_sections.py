"""Sections of a case file about the beams: those of the bottom and of the water."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from bottomlock.config.dvl import DvlSettings
from bottomlock.config.section import InFolder, shown
from bottomlock.config.sensors import WaterCells
from bottomlock.kernel.models import Positive
from bottomlock.recordings.stream_sections import Clock, ColumnTriple, ReorderedStream


class DvlStream(DvlSettings, ReorderedStream):
    """Beams as recorded (source "beams"), or projected from the instrument's velocity ("velocity", semi-synthetic).

    `geometry` is a TOML file of the instrument or a packaged name: directions, mounting, lever arms, noise of the
    beams, and the columns of recorded beams. A beam table of `bottomlock convert` needs no clock. A
    velocity is three columns in the instrument's own frame, after `axes`; it is divided by `velocity_scale` and
    projected on the beam directions in that frame. An empty row is no ping; a row whose column `valid` is 0 is a ping
    with all beams lost.
    """

    source: Literal["beams", "velocity"] = "beams"
    """whether beams were recorded, or are projected from the instrument's velocity"""
    clock: Clock = Clock(column="time_ns", unit="ns")
    velocity: Annotated[ColumnTriple | None, shown(example=["vx", "vy", "vz"])] = None
    """columns of the instrument's velocity, its axes x, y, z; for source velocity"""
    velocity_unit: Literal["m/s", "cm/s", "mm/s", "km/h", "kn", "ft/s"] = "m/s"
    """unit of that velocity"""
    velocity_scale: Annotated[Positive, shown(unit="1")] = 1.0
    """factor that is in that velocity, and is divided out"""
    valid: Annotated[str | None, shown(example="valid")] = None
    """column that is 0 where a ping lost its velocity; for source velocity"""

    @model_validator(mode="before")
    @classmethod
    def _mounted_in_its_file(cls, given: Any) -> Any:  # noqa: ANN401 - pydantic's
        if isinstance(given, dict) and any(str(key).startswith("mounting_") for key in given):
            raise ValueError(
                "mounting angles are given in [dvl], expected them in the geometry file of the DVL"
            )
        return given

    @model_validator(mode="after")
    def _of_one_source(self) -> Self:
        if (self.source == "velocity") != (self.velocity is not None):
            raise ValueError(
                'source = "velocity" needs \'velocity\' (three columns), and source = "beams" takes none'
            )
        if self.source == "beams":
            for key in ("axes", "velocity_scale", "valid", "velocity_unit"):
                if key in self.model_fields_set:
                    raise ValueError(
                        f"'{key}' applies to source = \"velocity\" only; recorded beams are used as they are"
                    )
            if "clock" in self.model_fields_set and self.clock.column is None:
                raise ValueError(
                    "source = \"beams\" needs clock.column, the time column of the table ('time_ns' by default)"
                )
        elif "clock" not in self.model_fields_set:
            raise ValueError("source = \"velocity\" needs a 'clock', the times of the table's rows")
        if self.beam_noise_from == "recording" and self.source != "beams":
            raise ValueError('beam_noise_from = "recording" needs source = "beams"')
        return self


class WaterTrackStream(WaterCells):
    """Beams that the water returned, in a water table (docs/howto/water_track.md).

    Without `file` it is the one beside that of [dvl]. Times are on the clock of the DVL: `dvl.clock.offset_s` counts
    for both. What-if cases remove beams of the bottom only.
    """

    file: Annotated[Annotated[Path, InFolder] | None, shown(example="beams_water.parquet")] = None
    """water table of bottomlock convert; none: the one beside the beams of [dvl], beams_water.parquet of
    beams.parquet"""
