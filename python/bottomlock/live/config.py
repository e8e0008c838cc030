"""The configuration of `bottomlock live`: read from TOML, checked as a whole, and turned into what the kernel takes."""

import inspect
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Tag, ValidationError, model_validator

from bottomlock import units
from bottomlock.config.effort import EffortErrors, require_one_use
from bottomlock.config.motion_errors import WEIGHTLESS_MPS2
from bottomlock.config.scenario_sections import Filter, Robust, Section
from bottomlock.config.sensors import SENSORS
from bottomlock.config.thrust import ThrustErrors
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.config.validation import explain
from bottomlock.config.water_cells import WaterCells
from bottomlock.errors import ScenarioError
from bottomlock.io.beams import Instrument, read_geometry
from bottomlock.kernel import models, normal_gravity_mps2
from bottomlock.live.sections import (
    DVL_FORMATS,
    FORMATS,
    LEVELLING_SD_DEG,
    AcousticPositionSection,
    AttitudeSection,
    CheckpointSection,
    DepthSection,
    DiagnosticsSection,
    DvlSection,
    GpsSection,
    HealthSection,
    ImuFromAttitude,
    ImuSection,
    LogSection,
    Name,
    NavigationSection,
    OriginSection,
    PortSection,
    SourceSection,
    StartSection,
    StatesSection,
    VelocitySection,
    kind_of_imu,
)
from bottomlock.live.states import Limits
from bottomlock.ports.estimate import Mode
from bottomlock.ports.mavlink import MavlinkPort
from bottomlock.ports.port import Port
from bottomlock.ports.registry import PORTS
from bottomlock.ports.registry import port as make_port
from bottomlock.ports.rotation import matrix, quaternion


class LiveConfig(Section):
    """A whole configuration."""

    name: Name
    mode: Mode
    dvl: DvlSection
    source: tuple[SourceSection, ...] = ()
    port: tuple[PortSection, ...] = ()
    velocity: VelocitySection = VelocitySection()
    imu: (
        Annotated[
            Annotated[ImuSection, Tag(ImuSection.__name__)]
            | Annotated[ImuFromAttitude, Tag(ImuFromAttitude.__name__)],
            Discriminator(kind_of_imu),
        ]
        | None
    ) = None
    attitude: AttitudeSection | None = None
    depth: DepthSection | None = None
    gps: GpsSection | None = None
    acoustic_position: AcousticPositionSection | None = None
    water_track: WaterCells | None = None
    thrust: ThrustErrors | None = None
    effort: EffortErrors | None = None
    origin: OriginSection | None = None
    start: StartSection | None = None
    navigation: NavigationSection = NavigationSection()
    filter: Filter = Filter()
    robust: Robust = Robust()
    states: StatesSection = StatesSection()
    log: LogSection | None = None
    checkpoint: CheckpointSection | None = None
    health: HealthSection | None = HealthSection()
    diagnostics: DiagnosticsSection | None = None

    @model_validator(mode="after")
    def _parts_agree(self) -> Self:
        names = [source.name for source in self.source]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two sources are named '{name}', expected unique names")
        dvls = [source.name for source in self.source if source.format in DVL_FORMATS]
        if len(dvls) != 1:
            raise ValueError(
                f"{len(dvls)} sources are a DVL ({', '.join(dvls) or 'none'}), expected one, with a format of "
                f"{', '.join(DVL_FORMATS)}"
            )
        if [source.address for source in self.source].count("stdin") > 1:
            raise ValueError("two sources read stdin, expected one at most")
        if self.mode == "navigation":
            self._can_navigate()
        else:
            self._needs_nothing_else()
        return self

    def _can_navigate(self) -> None:
        missing = [f"[{key}]" for key in ("imu", "origin", "start") if getattr(self, key) is None]
        if missing:
            words = "section" if len(missing) == 1 else "sections"
            verb = "is" if len(missing) == 1 else "are"
            raise ValueError(
                f'mode = "navigation" needs the {words} {", ".join(missing)}, which {verb} missing'
            )
        by_attitude = isinstance(self.imu, ImuFromAttitude)
        what = "attitudes" if by_attitude else "inertial readings"
        if not self.sources_of(self.motion):
            raise ValueError(
                f'mode = "navigation" needs a source of {what}, with format {_named(self.motion)} or "mavlink"'
            )
        formats = [source.format for source in self.source]
        inertial = [one for one in formats if one in FORMATS["imu"]]
        if inertial and by_attitude:
            raise ValueError(
                f"a source has format '{inertial[0]}', and imu.source is \"attitude\": expected one of them"
            )
        self._start_is_known(by_attitude=by_attitude)
        for key in FORMATS:
            given = [one for one in formats if one in FORMATS[key]]
            if given and getattr(self, key) is None:
                raise ValueError(f"a source has format '{given[0]}', which needs the section [{key}]")
        for key in ("thrust", "effort"):
            if getattr(self, key) is not None and not self.sources_of(key, mavlink=False):
                raise ValueError(f"[{key}] needs a source with format {_named(key)}")
        require_one_use(self.thrust, self.effort)
        self._positions_have_a_place()
        if self.attitude is not None:
            self._attitude_is_one(self.attitude)
        reopens = self.filter.inflate_after_rejections
        if 0 < reopens <= self.states.rejected_pings:
            raise ValueError(
                f"states.rejected_pings is {self.states.rejected_pings}, and the gate opens again at rejection "
                f"{reopens} (filter.inflate_after_rejections): expected less, or the state would never say so"
            )

    def _positions_have_a_place(self) -> None:
        assert self.origin is not None  # seen above
        if self.gps is not None and self.origin.longitude_deg is None:
            raise ValueError("'origin.longitude_deg' is missing, expected number in deg: [gps] needs it")
        if self.gps is not None and not self.sources_of("gps"):
            raise ValueError(f'[gps] needs a source with format {_named("gps")} or "mavlink"')
        key = "acoustic_position"
        if self.acoustic_position is not None and not self.sources_of(key, mavlink=False):
            raise ValueError(f"[{key}] needs a source with format {_named(key)}")

    def _start_is_known(self, *, by_attitude: bool) -> None:
        start, attitude = self.start, self.attitude
        assert start is not None  # seen above
        if by_attitude:
            if attitude is None:
                raise ValueError('imu.source = "attitude" needs the section [attitude], which is missing')
            attitude.replaces_inertial_readings()
            if start.heading_deg is not None:
                raise ValueError(
                    "'start.heading_deg' is given, but imu.source = \"attitude\" gives the heading"
                )
            if start.level == "levelling":
                raise ValueError(
                    'start.level = "levelling" needs inertial readings, and imu.source is "attitude": set '
                    'start.level = "attitude"'
                )
        elif attitude is None:
            if start.level == "attitude":
                raise ValueError('start.level = "attitude" needs the section [attitude], which is missing')
            if start.heading_deg is None:
                raise ValueError(
                    "'start.heading_deg' is missing, expected number in deg: heading of the platform at the start, "
                    "which only a section [attitude] can give instead"
                )
        elif attitude.aids == "nothing" and start.heading_deg is not None and start.level != "attitude":
            raise ValueError(
                'attitude.aids is "nothing", and the start does not use [attitude] either: set attitude.aids = '
                '"attitude" or "heading", or leave start.heading_deg out'
            )

    def _attitude_is_one(self, attitude: AttitudeSection) -> None:
        """One sensor has one mounting and one slow error."""
        sources = self.sources_of("attitude")
        if len(sources) != 1:
            named = ", ".join(source.name for source in sources)
            raise ValueError(
                f"{len(sources)} sources can be that of [attitude] ({named or 'none'}), expected one, with format "
                f'{_named("attitude")}, or else "mavlink"'
            )
        (source,) = sources
        if source.format != "mavlink" and "message" in attitude.model_fields_set:
            raise ValueError(
                f"'attitude.message' is one of MAVLink, and the attitudes are those of source '{source.name}' with "
                f"format '{source.format}': leave it out, or remove that source"
            )
        if source.format == "mavlink" and attitude.frame != "ned_frd":
            raise ValueError(
                f'attitude.frame is "{attitude.frame}", expected "ned_frd": that of MAVLink\'s {attitude.message}'
            )
        if source.format == "ros-attitude" and "frame" not in attitude.model_fields_set:
            raise ValueError(
                "'attitude.frame' is missing, expected the frames of the driver of source "
                f'\'{source.name}\': "enu_flu", as REP 103 has them, or "ned_frd"'
            )

    def _needs_nothing_else(self) -> None:
        for key in (*FORMATS, "water_track", "origin", "start", "checkpoint"):
            if getattr(self, key) is not None:
                raise ValueError(
                    f'section [{key}] belongs to mode = "navigation", and the mode is "velocity"'
                )
        for source in self.source:
            if source.format not in DVL_FORMATS:
                raise ValueError(
                    f"source '{source.name}' has format '{source.format}', which mode = \"velocity\" does not use"
                )

    @property
    def motion(self) -> str:
        """The readings that move the vehicle: a key of `FORMATS`."""
        return "attitude" if isinstance(self.imu, ImuFromAttitude) else "imu"

    def sources_of(self, readings: str, *, mavlink: bool = True) -> list[SourceSection]:
        """The sources of a kind of reading, a key of `FORMATS`; where there are none of its own those of MAVLink."""
        own = [source for source in self.source if source.format in FORMATS[readings]]
        return own or [source for source in self.source if mavlink and source.format == "mavlink"]

    @property
    def level_by_attitude(self) -> bool:
        """Whether roll and pitch of the start are those of [attitude]."""
        return isinstance(self.imu, ImuFromAttitude) or (
            self.start is not None and self.start.level == "attitude"
        )

    def start_sd_deg(self) -> tuple[float, float]:
        """1 sigma of roll and pitch and of the heading at the start, deg, of a configuration in mode navigation."""
        start, attitude = self.start, self.attitude
        assert start is not None  # validated
        level, heading = start.level_sd_deg or LEVELLING_SD_DEG, start.heading_sd_deg
        if attitude is not None:
            heading = heading or attitude.start_yaw_sd_deg
            if self.level_by_attitude:
                level = start.level_sd_deg or attitude.start_roll_pitch_sd_deg
        assert heading is not None  # validated
        return level, heading

    @property
    def limits(self) -> Limits:
        """Where the conditions of the states begin."""
        return Limits(
            silent_periods=self.states.silent_periods,
            silent_least_ns=units.ns_from_s(self.states.silent_least_s),
            settle_ns=units.ns_from_s(self.states.settle_s),
            velocity_sd_mps=self.states.velocity_sd_mps,
            rejected_pings=self.states.rejected_pings,
            closure_ratio=self.states.closure_ratio,
        )

    def instrument(self) -> Instrument:
        """Geometry of the DVL and noise of its beams.

        Raises:
            ScenarioError: as `read_geometry`.
        """
        instrument = read_geometry(self.dvl.geometry)
        if self.dvl.beam_noise_mps is None:
            return instrument
        noise = np.full(instrument.geometry.beams, self.dvl.beam_noise_mps)
        return replace(instrument, beam_sd_mps=noise)

    def ports(self) -> tuple[Port, ...]:
        """The ports, in the order of the file.

        Raises:
            ScenarioError: for an unknown name or setting.
        """
        ports = tuple(self._port(one) for one in self.port)
        for section, one in zip(self.port, ports, strict=True):
            if section.to.startswith("ros:") and not one.ros_type:
                named = ", ".join(name for name, make in PORTS.items() if getattr(make, "ros_type", ""))
                raise ScenarioError(
                    f"port {section.port}: is sent to '{section.to}', and is no message of ROS 2, expected one of "
                    f"{named}"
                )
        first: dict[tuple[str, tuple[int, int]], MavlinkPort] = {}
        for section, one in zip(self.port, ports, strict=True):
            if isinstance(one, MavlinkPort):
                one.counts_with(first.setdefault((section.to, one.sender), one))
        return ports

    def _port(self, section: PortSection) -> Port:
        """A port with its settings; the geometry and the rate are known here."""
        make = PORTS.get(section.port)
        known = [] if make is None else list(inspect.signature(make).parameters)
        settings = dict(section.settings)
        for key in ("geometry", "max_rate_hz"):
            if key in settings:
                raise ScenarioError(
                    f"port {section.port}: settings.{key} cannot be set here: set dvl.geometry and rate_hz of the port"
                )
        if "geometry" in known:
            settings["geometry"] = self.instrument().geometry
        if section.rate_hz is not None:
            settings["max_rate_hz"] = section.rate_hz
        return make_port(section.port, **settings)

    def checked(self) -> Self:
        """The same configuration, once its geometry, ports and filter settings have been made.

        Raises:
            ScenarioError: for what only they can tell.
        """
        instrument = self.instrument()
        self.ports()
        if self.mode == "navigation":
            kernel_settings(self, instrument)
        return self


def _named(readings: str) -> str:
    """The formats of a kind of reading, for an error."""
    return ", ".join(f'"{one}"' for one in FORMATS[readings])


@dataclass(frozen=True)
class KernelSettings:
    """What a navigator is made of: model, options, and the rotation (3, 3) from the IMU's axes to the platform's.

    `gravity_mps2` is that of the place, also where the readings are without it.
    """

    model: models.Model
    options: models.Options
    imu_axes: NDArray[np.float64]
    gravity_mps2: float


def kernel_settings(config: LiveConfig, instrument: Instrument) -> KernelSettings:
    """Model and options in SI, as the kernel takes them, of a configuration in mode navigation.

    Raises:
        KernelError: for values that the kernel does not take.
    """
    imu, origin, start = config.imu, config.origin, config.start
    assert imu is not None  # validated in LiveConfig
    assert origin is not None
    assert start is not None
    latitude = units.rad_from_deg(origin.latitude_deg)
    gravity = normal_gravity_mps2(latitude) if origin.gravity == "normal" else float(origin.gravity)
    # The kernel's model names every sensor; those that are not there are never pushed.
    sensors: dict[str, Any] = {one.name: one.model(one.section(), gravity) for one in SENSORS}
    added: dict[str, Any] = {}
    for section in (config.depth, config.gps, config.acoustic_position, config.thrust, config.effort):
        if section is not None:
            sensors |= section.kernel_models()
            added |= section.kernel_options()
    if config.attitude is not None:
        sensors |= config.attitude.kernel_models()
    tilt, heading = map(units.rad_from_deg, config.start_sd_deg())
    model = models.Model(
        environment=models.Environment(
            latitude_rad=latitude,
            gravity_mps2=WEIGHTLESS_MPS2 if isinstance(imu, ImuFromAttitude) else gravity,
            earth=origin.earth,
        ),
        imu=_imu_model(imu, config.attitude),
        dvl=config.dvl.errors.kernel_model(float(instrument.beam_sd_mps.mean())),
        initial=models.InitialModel(
            position_sd_m=start.position_sd_m,
            attitude_sd_rad=(tilt, tilt, heading),
            velocity_sd_mps=start.velocity_sd_mps,
        ),
        **sensors,
    )
    options = models.Options(
        **config.filter.kernel_options(),
        robust=config.robust.kernel_options(),
        **imu.limits.kernel_options() | {"imu_gap": "inflate"},
        imu_sampling="averaged" if isinstance(imu, ImuFromAttitude) else imu.sampling,
        water_track=config.water_track is not None,
        **added,
    )
    axes = np.eye(3)
    if isinstance(imu, ImuSection):
        turned = (imu.mounting_roll_deg, imu.mounting_pitch_deg, imu.mounting_yaw_deg)
        axes = matrix(np.array(quaternion(*map(math.radians, turned))))
    return KernelSettings(model, options, axes, gravity)


def _imu_model(imu: ImuSection | ImuFromAttitude, attitude: AttitudeSection | None) -> models.ImuModel:
    """The errors of inertial readings, or of a motion made from attitudes."""
    if isinstance(imu, ImuSection):
        return imu.kernel_model()
    assert attitude is not None  # validated in LiveConfig
    return imu.kernel_model(0.0, attitude.gyro_noise_rad_rts)


def load_config(path: str | Path) -> LiveConfig:
    """Reads a configuration; relative paths in it start from its own folder.

    Raises:
        ScenarioError: for a file that is missing, ill-formed TOML, an unknown or missing key, or a value out of range;
            one line a fault.
    """
    path = Path(path)
    if not path.is_file():
        raise ScenarioError(f"{path}: no such configuration; `bottomlock live --init` writes one")
    return parse_config(read_text(path), place=str(path), folder=path.parent)


def parse_config(text: str, *, place: str, folder: Path | None = None) -> LiveConfig:
    """Reads a configuration from TOML text; `place` names it in errors.

    Raises:
        ScenarioError: as `load_config`.
    """
    content = parse_toml(text, place=place, kind="live configuration")
    if folder is not None:
        _from_folder(content, folder)
    try:
        config = LiveConfig.model_validate(content)
    except ValidationError as error:
        raise ScenarioError(explain(error, place, LiveConfig)) from error
    try:
        return config.checked()
    except (ScenarioError, ValueError) as error:
        raise ScenarioError(f"{place}: {error}") from error


_PATHS = (("dvl", "geometry"), ("log", "folder"), ("checkpoint", "file"))


def _from_folder(content: dict[str, Any], folder: Path) -> None:
    """Prefixes relative paths with the configuration's folder; a packaged geometry is no path."""
    for section, key in _PATHS:
        table = content.get(section)
        if not isinstance(table, dict):
            continue
        named = table.get(key)
        if isinstance(named, str) and (key != "geometry" or named.endswith(".toml")):
            table[key] = str(folder / named)
    for section, key in (("source", "address"), ("port", "to")):
        for table in content.get(section, ()) if isinstance(content.get(section), list) else ():
            named = table.get(key) if isinstance(table, dict) else None
            if isinstance(named, str) and named.startswith("file:"):
                table[key] = f"file:{folder / named.removeprefix('file:')}"
