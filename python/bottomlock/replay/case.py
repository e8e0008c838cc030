"""The case file: recording, columns, initial alignment, methods and what-if cases, validated before data are read."""

import hashlib
import json
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from bottomlock.config.dvl import CalibrationSection
from bottomlock.config.own_methods import OwnMethods, known_methods
from bottomlock.config.scenario_sections import Filter, Outage, Robust
from bottomlock.config.section import Earth, Section, Vector, shown
from bottomlock.config.through_water import require_one_drive
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.config.validation import checked
from bottomlock.errors import ScenarioError
from bottomlock.io.beam_table import water_file
from bottomlock.kernel import METHODS
from bottomlock.kernel.models import Finite, NonNegative, Positive, Real, Whole
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.dvl_sections import DvlStream, WaterTrackStream
from bottomlock.recordings.stream_sections import (
    ImuFromAttitude,
    ImuStream,
    ReferenceStream,
    SensorStreams,
    Stream,
    kind_of_imu,
)

FROM_REFERENCE = "reference"
Beam = Annotated[Whole, Field(ge=1, le=8)]


class Origin(Earth):
    """Origin of the tangent frame; without coordinates, the first position of the reference or of GPS."""

    latitude_deg: Annotated[Annotated[Real, Field(ge=-90, le=90)] | None, shown(example=42.3)] = None
    """latitude of the tangent plane's origin; none: the first position of reference or GPS"""
    longitude_deg: Annotated[Annotated[Real, Field(ge=-180, le=360)] | None, shown(example=-83.7)] = None
    """longitude of the origin; needs the latitude"""
    height_m: Finite = 0.0
    """height of the origin above the ellipsoid"""

    @model_validator(mode="after")
    def _longitude_needs_latitude(self) -> Self:
        if self.longitude_deg is not None and self.latitude_deg is None:
            raise ValueError(
                "'longitude_deg' is given without 'latitude_deg', expected both or the latitude alone"
            )
        return self


class Start(Section):
    """Initial alignment: the source of each part of the initial state and its 1 sigma.

    A standard deviation that is left out is computed by the alignment.
    """

    at_s: Annotated[NonNegative | None, shown(example=60.0)] = None
    """begin of the navigation, from the first inertial reading; none: there, or at the reference's first row"""
    window_s: Positive = 10.0
    """time that the alignment averages over"""
    level: Literal["levelling", "attitude", "reference", "given"] = "levelling"
    """source of roll and pitch"""
    heading: Literal["gyrocompass", "attitude", "reference", "given"]
    """source of the heading"""
    roll_deg: Finite = 0.0
    """roll, for level given"""
    pitch_deg: Finite = 0.0
    """pitch, for level given"""
    heading_deg: Finite = 0.0
    """heading, for heading given"""
    level_sd_deg: Annotated[Positive | None, shown(example=1.0)] = None
    """1 sigma of roll and pitch; none: computed; needed for given and reference"""
    heading_sd_deg: Annotated[Positive | None, shown(example=3.0)] = None
    """1 sigma of the heading; none: computed; needed for given and reference"""
    position: Literal["given", "reference", "gps"] = "given"
    """source of the position"""
    position_m: Vector = (0.0, 0.0, 0.0)
    """north, east, down, for position given"""
    position_sd_m: Annotated[
        tuple[NonNegative, NonNegative, NonNegative] | None, shown(example=[2.0, 2.0, 0.5])
    ] = None
    """1 sigma of north, east, down; needed unless the position is from gps, where none is that of [gps]; [0, 0, 0]
    says that positions count from the start"""
    velocity: Literal["given", "reference", "beams"] = "given"
    """source of the velocity"""
    velocity_mps: Vector = (0.0, 0.0, 0.0)
    """surge, sway, heave, for velocity given"""
    velocity_sd_mps: tuple[Positive, Positive, Positive] = (0.05, 0.05, 0.05)
    """1 sigma of surge, sway, heave"""

    @property
    def from_reference(self) -> bool:
        """Whether a part of the initial state comes from the reference."""
        return FROM_REFERENCE in {self.level, self.heading, self.position, self.velocity}

    @model_validator(mode="after")
    def _sds_of_what_is_given(self) -> Self:
        faults = []
        if self.heading == "given" and "heading_deg" not in self.model_fields_set:
            faults.append("heading = \"given\" needs 'heading_deg'")
        for part, source, sd in (
            ("heading", self.heading, self.heading_sd_deg),
            ("level", self.level, self.level_sd_deg),
        ):
            if source in {"given", FROM_REFERENCE} and sd is None:
                faults.append(
                    f"{part} = \"{source}\" needs '{part}_sd_deg', its 1 sigma: the alignment cannot compute it"
                )
        if self.position in {"given", FROM_REFERENCE} and self.position_sd_m is None:
            faults.append(
                f"position = \"{self.position}\" needs 'position_sd_m', 1 sigma of north, east, down in m; "
                "[0, 0, 0] says that positions count from the start, the depth too"
            )
        if faults:
            raise ValueError("; ".join(faults))
        return self


class Settings(OwnMethods, Section):
    """Methods, smoothing, and the output interval without a reference.

    Dead reckoning runs beside the methods wherever the case has an attitude, named or not.
    """

    methods: Annotated[
        tuple[str, ...], BeforeValidator(known_methods), shown(example=["tc", "sway_current"])
    ] = METHODS
    """aiding methods, all on the same readings; dead_reckoning runs beside them wherever there is an attitude"""
    smooth: bool = True
    """whether a smoother follows the filter"""
    sample_s: Positive = 1.0
    """interval of the samples without a reference"""
    duration_s: Annotated[Positive | None, shown(example=600.0)] = None
    """length of the navigation; none: to the end"""

    @property
    def filters(self) -> tuple[str, ...]:
        """The methods that are filters."""
        return tuple(method for method in self.methods if method != DEAD_RECKONING)


class WhatIf(Section):
    """A what-if case: the beams that are taken to be lost, throughout or in outages.

    Times are seconds from the start of the navigation.
    """

    name: Annotated[
        str,
        Field(pattern=r"^[A-Za-z0-9_\-]+$"),
        shown(range='letters, digits, _ and -; not "recorded"', example="lost_34"),
    ]
    """name of the what-if case in tables"""
    beams_lost: Annotated[tuple[Beam, ...], shown(unit="1", example=[3, 4])] = ()
    """beams lost throughout, numbered from 1"""
    outages: tuple[Outage, ...] = ()

    @model_validator(mode="after")
    def _loses_a_beam(self) -> Self:
        if self.name == "recorded":
            raise ValueError("the name 'recorded' is reserved for the recording without beam losses")
        if not (self.beams_lost or self.outages):
            raise ValueError(f"what_if '{self.name}' loses no beam, expected beams_lost or outages")
        return self

    @property
    def beams_named(self) -> tuple[int, ...]:
        """Every beam that a rule names, from 1."""
        return tuple(beam for beams in (self.beams_lost, *(o.beams for o in self.outages)) for beam in beams)

    def text(self) -> str:
        """The beam losses in one line, for reports."""
        parts = [f"beams {_join(self.beams_lost)} lost throughout"] if self.beams_lost else []
        for outage in self.outages:
            end = "the end" if math.isinf(outage.to_s) else f"{outage.to_s:g} s"
            parts.append(f"beams {_join(outage.beams)} lost from {outage.from_s:g} s to {end}")
        return "; ".join(parts)


def _join(beams: tuple[int, ...]) -> str:
    return ", ".join(str(beam) for beam in beams)


class Case(SensorStreams):
    """A whole case file."""

    name: Annotated[
        str, Field(pattern=r"^[A-Za-z0-9_\-]+$"), shown(range="letters, digits, _ and -", example="dive7")
    ]
    """name of the replay in tables and pages"""
    description: Annotated[str, shown(example="Dive 7 along the wall")] = ""
    """one sentence for tables and pages"""
    assumed: Annotated[tuple[str, ...], shown(example=["dvl.geometry"])] = ()
    """keys whose values nothing in the files decides, as a first case lists them: take out those that are known"""
    origin: Origin = Origin()
    imu: Annotated[
        Annotated[ImuStream, Tag(ImuStream.__name__)]
        | Annotated[ImuFromAttitude, Tag(ImuFromAttitude.__name__)],
        Discriminator(kind_of_imu),
    ]
    dvl: DvlStream
    water_track: WaterTrackStream | None = None
    reference: ReferenceStream | None = None
    start: Start
    filter: Filter = Filter()
    robust: Robust = Robust()
    calibration: CalibrationSection = CalibrationSection()
    replay: Settings = Settings()
    what_if: tuple[WhatIf, ...] = ()

    @model_validator(mode="after")
    def _parts_agree(self) -> Self:
        streams = {"attitude": self.attitude, "reference": self.reference, "gps": self.gps}
        for key in ("level", "heading", "position", "velocity"):
            source = getattr(self.start, key)
            if source in streams and streams[source] is None:
                raise ValueError(f'start.{key} = "{source}" needs the section [{source}], which is missing')
        if isinstance(self.imu, ImuFromAttitude):
            self._needs_no_readings()
        require_one_drive(self.thrust, self.effort)
        if self.water_track is not None:
            self._water_has_times(self.water_track)
        if self.reference is not None:
            self._reference_has(self.reference)
        for key in self.assumed:
            if key.partition(".")[0] not in type(self).model_fields:
                raise ValueError(
                    f"assumed names '{key}', expected keys with their sections, such as 'dvl.geometry'"
                )
        if DEAD_RECKONING in self.replay.methods and self.attitude is None:
            raise ValueError(f"replay.methods names '{DEAD_RECKONING}', which needs the section [attitude]")
        if not self.replay.filters:
            raise ValueError("replay.methods names no filter, expected one or more")
        names = [what_if.name for what_if in self.what_if]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"what_if '{name}' is defined twice, expected unique names")
        return self

    def _needs_no_readings(self) -> None:
        if self.attitude is None:
            raise ValueError('imu.source = "attitude" needs the section [attitude], which is missing')
        self.attitude.replaces_inertial_readings()
        for key in ("level", "heading"):
            source = getattr(self.start, key)
            if source in {"levelling", "gyrocompass"}:
                raise ValueError(
                    f'start.{key} = "{source}" needs inertial readings, and imu.source is "attitude": set '
                    f'start.{key} = "attitude"'
                )

    def _water_has_times(self, water: WaterTrackStream) -> None:
        if water.file is None and self.dvl.source != "beams":
            raise ValueError(
                "'water_track.file' is missing, expected the water table: there is none beside a velocity"
            )
        if self.dvl.clock.rate_hz is not None:
            raise ValueError(
                "[water_track] has the stamps of the DVL, and dvl.clock.rate_hz moves those of the beams: expected a "
                "clock with a column alone"
            )

    def _reference_has(self, reference: ReferenceStream) -> None:
        has = {
            "level": reference.has_attitude,
            "heading": reference.has_attitude,
            "position": reference.has_position,
            "velocity": reference.velocity_ned is not None or reference.velocity_body is not None,
        }
        for key, there in has.items():
            if getattr(self.start, key) == FROM_REFERENCE and not there:
                raise ValueError(f'start.{key} = "reference", but [reference] has no columns for it')

    def with_methods(self, methods: Iterable[str]) -> Self:
        """The same case with other methods.

        Raises:
            ScenarioError: for an unknown or repeated method.
        """
        content = self.replay.model_dump() | {"methods": tuple(methods)}
        return self.model_copy(update={"replay": checked(Settings, content, f"case {self.name}: replay")})

    @property
    def readings(self) -> ImuStream:
        """The section [imu] of a case that has inertial readings."""
        assert isinstance(self.imu, ImuStream)
        return self.imu

    @property
    def motion_file(self) -> Path:
        """The table of the inertial readings, or of the attitudes that they are made from."""
        if isinstance(self.imu, ImuStream):
            return self.imu.file
        assert self.attitude is not None  # validated
        return self.attitude.file

    @property
    def water_file(self) -> Path | None:
        """The table of the water's beams; None without [water_track]."""
        if self.water_track is None:
            return None
        return self.water_track.file or water_file(self.dvl.file)

    @property
    def semi_synthetic(self) -> tuple[str, ...]:
        """What was derived from the measurements, a phrase each; empty for a recording as it is."""
        return ("beams projected from the instrument's velocity",) if self.dvl.source == "velocity" else ()

    def files(self) -> dict[str, Path]:
        """Every file that the case reads, by its section."""
        named: dict[str, Path] = {}
        for key in type(self).model_fields:
            stream = getattr(self, key)
            if isinstance(stream, Stream):
                named[key] = stream.file
        if self.water_file is not None:
            named["water_track"] = self.water_file
        return named

    def content_hash(self) -> str:
        """SHA-256 of every setting that affects the numbers; files by name (the manifest has their own hashes)."""
        content = json.dumps(self.model_dump(mode="json", exclude={"description", "assumed"}), sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()


def load_case(path: str | Path) -> Case:
    """Reads a case from a TOML file; relative paths in it start from its own folder.

    Raises:
        ScenarioError: for a file that is missing or unreadable, ill-formed TOML, a missing or unknown key, or a value
            out of range; one line per fault.
    """
    if not isinstance(path, str | os.PathLike):
        raise ScenarioError(f"the case is of type {type(path).__name__}", expected="the path of a TOML file")
    path = Path(path)
    return parse_case(read_text(path, "replay case"), place=str(path), folder=path.parent)


def parse_case(text: str, *, place: str, folder: Path | None = None) -> Case:
    """Reads a case from TOML text; `place` names it in errors.

    Raises:
        ScenarioError: as `load_case`.
    """
    content = parse_toml(text, place=place, kind="replay case")
    return checked(Case, content, place, folder)
