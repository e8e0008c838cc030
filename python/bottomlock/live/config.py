"""The configuration of `bottomlock live`: read from TOML, checked as a whole, and turned into what the kernel takes."""

import inspect
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Tag, ValidationError, model_validator

from bottomlock import models, units
from bottomlock.config.motion_errors import WEIGHTLESS_MPS2
from bottomlock.config.scenario_sections import Filter, Robust, Section
from bottomlock.config.sensors import SENSORS
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.config.validation import explain
from bottomlock.errors import ScenarioError
from bottomlock.io.beams import Instrument, read_geometry
from bottomlock.kernel import normal_gravity_mps2
from bottomlock.live.sections import (
    DVL_FORMATS,
    CheckpointSection,
    DepthSection,
    DvlSection,
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
    depth: DepthSection | None = None
    origin: OriginSection | None = None
    start: StartSection | None = None
    navigation: NavigationSection = NavigationSection()
    filter: Filter = Filter()
    robust: Robust = Robust()
    states: StatesSection = StatesSection()
    log: LogSection | None = None
    checkpoint: CheckpointSection | None = None
    health: HealthSection | None = HealthSection()

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
        lines, what = ("attitude-csv", "attitudes") if by_attitude else ("imu-csv", "inertial readings")
        formats = [source.format for source in self.source]
        if not {lines, "mavlink"}.intersection(formats):
            raise ValueError(
                f'mode = "navigation" needs a source of {what}, with format "{lines}" or "mavlink"'
            )
        if "attitude-csv" in formats and not by_attitude:
            raise ValueError("a source has format 'attitude-csv', which needs imu.source = \"attitude\"")
        if "imu-csv" in formats and by_attitude:
            raise ValueError(
                "a source has format 'imu-csv', and imu.source is \"attitude\": expected one of them"
            )
        assert self.start is not None  # seen above
        if by_attitude != (self.start.heading_deg is None):
            raise ValueError(
                "'start.heading_deg' is given, but imu.source = \"attitude\" gives the heading"
                if by_attitude
                else "'start.heading_deg' is missing, expected number in deg: heading of the platform at the start"
            )
        if any(source.format == "depth-csv" for source in self.source) and self.depth is None:
            raise ValueError("a source has format 'depth-csv', which needs the section [depth]")

    def _needs_nothing_else(self) -> None:
        for key in ("imu", "depth", "origin", "start", "checkpoint"):
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
    def limits(self) -> Limits:
        """Where the conditions of the states begin."""
        return Limits(
            silent_periods=self.states.silent_periods,
            silent_least_ns=units.ns_from_s(self.states.silent_least_s),
            settle_ns=units.ns_from_s(self.states.settle_s),
            velocity_sd_mps=self.states.velocity_sd_mps,
            rejected_pings=self.states.rejected_pings,
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
        return tuple(self._port(one) for one in self.port)

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
    lever = (0.0, 0.0, 0.0)
    if config.depth is not None:
        depth = config.depth
        lever = depth.lever_arm_m
        sensors["depth"] = models.DepthModel(
            sd_m=depth.sd_m, bias_sd_m=depth.bias_m, bias_time_s=depth.bias_time_s
        )
    tilt, heading = (units.rad_from_deg(sd) for sd in (start.level_sd_deg, start.heading_sd_deg))
    model = models.Model(
        environment=models.Environment(
            latitude_rad=latitude,
            gravity_mps2=WEIGHTLESS_MPS2 if isinstance(imu, ImuFromAttitude) else gravity,
        ),
        imu=imu.kernel_model(0.0, units.rad_from_deg(units.per_rt_s_from_per_rt_h(start.heading_sd_deg)))
        if isinstance(imu, ImuFromAttitude)
        else imu.kernel_model(),
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
        depth_lever_p_m=lever,
    )
    mounting = [
        math.radians(a) for a in (imu.mounting_roll_deg, imu.mounting_pitch_deg, imu.mounting_yaw_deg)
    ]
    return KernelSettings(model, options, matrix(np.array(quaternion(*mounting))), gravity)


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
    content = parse_toml(text, place=place)
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
