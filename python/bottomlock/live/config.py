"""The configuration of `bottomlock live`: read from TOML, checked as a whole, and turned into what the kernel takes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Self

from pydantic import model_validator

from bottomlock.config.section import InFolder, shown
from bottomlock.config.through_water import require_one_drive
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.config.validation import checked
from bottomlock.errors import ScenarioError
from bottomlock.io.formats import LIVE
from bottomlock.kernel.models import InitialState
from bottomlock.live.navigator_config import NavigatorConfig, kernel_settings
from bottomlock.live.of_case import with_case
from bottomlock.live.sections import (
    DVL_FORMATS,
    FORMATS,
    AttitudeSection,
    CheckpointSection,
    DiagnosticsSection,
    HealthSection,
    ImuFromAttitude,
    LogSection,
    Name,
    PortSection,
    SourceSection,
    StatesSection,
    VelocitySection,
)
from bottomlock.ports.address import Address, sink_address, source_address
from bottomlock.ports.estimate import Mode
from bottomlock.ports.mavlink import MAX_RATE_HZ, MavlinkPort
from bottomlock.ports.port import Port
from bottomlock.ports.registry import PORTS
from bottomlock.ports.registry import port as make_port
from bottomlock.recordings.sensors import ATTITUDE, DEPTH, SENSORS, WATER_TRACK


class LiveConfig(NavigatorConfig):
    """A whole configuration; with `case` the sections of a navigator are those of a case of `bottomlock replay`.

    A section may stand in one of the two files. From [start] of the case only the 1 sigma values are taken. Keys of the
    case that say how its tables are read do not count.
    """

    name: Annotated[Name, shown(example="rov")]
    """name on the page and in the log"""
    mode: Annotated[Mode, shown(example="velocity")]
    """velocity: what the beams of a ping determine; navigation: an inertial solution"""
    case: Annotated[Annotated[str, InFolder] | None, shown(example="dive.toml")] = None
    """case of bottomlock replay whose sections count here; none: those of this file"""
    source: tuple[SourceSection, ...] = ()
    port: tuple[PortSection, ...] = ()
    velocity: VelocitySection = VelocitySection()
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
        self._devices_have_one_use()
        self._dvl_states_noise(next(one.format for one in self.source if one.name == dvls[0]))
        if self.mode == "navigation":
            self._can_navigate()
        else:
            self._needs_nothing_else()
        return self

    def _devices_have_one_use(self) -> None:
        """A device is opened once: one source reads it, and ports may write to it at the same speed."""
        read: dict[tuple[str, str, int], tuple[SourceSection, Address]] = {}
        for source in self.source:
            address = source_address(source.address)
            if address.kind in {"serial", "stdin", "file"} and address.device in read:
                other = read[address.device][0].name
                raise ValueError(f"sources '{other}' and '{source.name}' read {source.address}, expected one")
            read[address.device] = source, address
        for port in self.port:
            to = sink_address(port.to)
            if to.device not in read:
                continue
            source, address = read[to.device]
            if to.kind == "tcpin" or to.baud != address.baud:
                raise ValueError(
                    f"port {port.port} is sent to {port.to}, and source '{source.name}' reads {source.address}: "
                    f"expected {'another port' if to.kind == 'tcpin' else 'one speed of the line'}"
                )

    def _dvl_states_noise(self, form: str) -> None:
        stating = [name for name, one in LIVE.items() if one.figures]
        if self.dvl.beam_noise_from == "recording" and form not in stating:
            raise ValueError(
                f"dvl.beam_noise_from is \"recording\", and format '{form}' has no figure of merit of a beam, expected "
                f'"geometry", or a DVL with a format of {", ".join(stating)}'
            )

    def _can_navigate(self) -> None:
        missing = _missing({key: True for key in _NAVIGATES if getattr(self, key) is not None})
        if missing:
            raise ValueError(missing)
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
        self.start_is_known(by_attitude=by_attitude)
        for key in FORMATS:
            given = [one for one in formats if one in FORMATS[key]]
            if given and getattr(self, key) is None:
                raise ValueError(f"a source has format '{given[0]}', which needs the section [{key}]")
        for sensor in SENSORS:
            # A pressure may come by a source that is switched on later; an attitude is that of one source.
            is_given = sensor not in {DEPTH, ATTITUDE, WATER_TRACK} and getattr(self, sensor.name) is not None
            if is_given and not self.sources_of(sensor.name, mavlink=sensor.mavlink):
                other = ' or "mavlink"' if sensor.mavlink else ""
                raise ValueError(f"[{sensor.name}] needs a source with format {_named(sensor.name)}{other}")
        require_one_drive(self.thrust, self.effort)
        if self.attitude is not None:
            self._attitude_is_one(self.attitude)
        reopens = self.filter.inflate_after_rejections
        if 0 < reopens <= self.states.rejected_pings:
            raise ValueError(
                f"states.rejected_pings is {self.states.rejected_pings}, and the gate opens again at rejection "
                f"{reopens} (filter.inflate_after_rejections): expected less, or the state would never say so"
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
        for key in (*FORMATS, "water_track", "origin", "start", "calibration", "checkpoint"):
            if getattr(self, key) is not None and key in self.model_fields_set:
                raise ValueError(
                    f'section [{key}] belongs to mode = "navigation", and the mode is "velocity"'
                )
        for source in self.source:
            if source.format not in DVL_FORMATS:
                raise ValueError(
                    f"source '{source.name}' has format '{source.format}', which mode = \"velocity\" does not use"
                )

    def sources_of(self, readings: str, *, mavlink: bool = True) -> list[SourceSection]:
        """The sources of a kind of reading, a key of `FORMATS`; where there are none of its own those of MAVLink."""
        own = [source for source in self.source if source.format in FORMATS[readings]]
        return own or [source for source in self.source if mavlink and source.format == "mavlink"]

    def ports(self) -> tuple[Port, ...]:
        """The ports, in the order of the file.

        Raises:
            ScenarioError: for an unknown name or setting.
        """
        ports = tuple(self._port(one) for one in self.port)
        for section, one in zip(self.port, ports, strict=True):
            if section.to.startswith("ros:") and not one.ros_type:
                named = ", ".join(name for name, make in PORTS.items() if make.ros_type)
                raise ScenarioError(
                    f"is sent to '{section.to}', and is no message of ROS 2",
                    place=f"port {section.port}",
                    expected=f"one of {named}",
                )
        first: dict[tuple[str, tuple[int, int]], MavlinkPort] = {}
        for section, one in zip(self.port, ports, strict=True):
            if isinstance(one, MavlinkPort):
                one.counts_with(first.setdefault((section.to, one.sender), one))
        return ports

    def _port(self, section: PortSection) -> Port:
        """A port with its settings; the geometry and the rate are known here."""
        make = PORTS.get(section.port)
        known = {} if make is None else make.model_fields
        settings = dict(section.settings)
        for key in ("geometry", "max_rate_hz"):
            if key in settings:
                raise ScenarioError(
                    f"settings.{key} cannot be set here: set dvl.geometry and rate_hz of the port",
                    place=f"port {section.port}",
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
        self.dvl.errors.kernel_model(float(instrument.beam_sd_mps.max()), instrument.calibration)
        if self.mode == "navigation":
            kernel_settings(self, instrument)
            assert self.start is not None  # validated
            # Refuses a place and a velocity that no vehicle has.
            InitialState(
                time_ns=0, attitude_t_p=(1.0, 0.0, 0.0, 0.0), position_t_m=self.start.position_m,
                velocity_p_mps=self.start.velocity_mps,
            )  # fmt: skip
        return self


_NAVIGATES = ("imu", "origin", "start")
"""Sections without which nothing navigates."""


def _missing(content: Mapping[str, object]) -> str:
    """Which of them are missing, in words; "" where none is."""
    missing = [f"[{key}]" for key in _NAVIGATES if key not in content]
    plural = ("sections", "are") if len(missing) > 1 else ("section", "is")
    words = f'mode = "navigation" needs the {plural[0]} {", ".join(missing)}, which {plural[1]} missing'
    return words if missing else ""


def _named(readings: str) -> str:
    """The formats of a kind of reading, for an error."""
    return ", ".join(f'"{one}"' for one in FORMATS[readings])


def load_config(path: str | Path) -> LiveConfig:
    """Reads a configuration; relative paths in it start from its own folder.

    Raises:
        ScenarioError: for a file that is missing, ill-formed TOML, an unknown or missing key, or a value out of range;
            one line a fault.
    """
    path = Path(path)
    text = read_text(path, "live configuration", "`bottomlock live --init` writes one")
    return parse_config(text, place=str(path), folder=path.parent)


def parse_config(text: str, *, place: str, folder: Path | None = None) -> LiveConfig:
    """Reads a configuration from TOML text; `place` names it in errors.

    Raises:
        ScenarioError: as `load_config`.
    """
    content = parse_toml(text, place=place, kind="live configuration")
    if isinstance(content.get("case"), str):
        try:
            content = with_case(content, (folder or Path()) / content["case"])
        except ScenarioError as error:
            raise ScenarioError(error, place=place) from error
    try:
        config = checked(LiveConfig, content, place, folder)
    except ScenarioError as error:
        # What only a sound configuration is asked for stands beside the other faults.
        missing = _missing(content) if content.get("mode") == "navigation" else ""
        if not missing or missing in str(error):
            raise
        raise ScenarioError(f"{error}\n{place}: {missing}") from error
    try:
        return config.checked()
    except (ScenarioError, ValueError) as error:
        raise ScenarioError(error, place=place) from error


PX4_START_S = 0.2
"""PX4's EKF2 begins with external vision where two messages are less than this apart (EV_MAX_INTERVAL)."""


def cautions(config: LiveConfig) -> list[str]:
    """What PX4 and ArduPilot will not do with these ports, a line each: they begin to aid only under conditions."""
    found = []
    for section in config.port:
        if section.port == "odometry" and section.settings.get("receiver", "px4") == "px4":
            dvl_hz = min(one.rate_hz for one in config.source if one.format in DVL_FORMATS)
            slow = 1.0 / dvl_hz
            if config.mode == "navigation":
                slow = 1.0 / (section.rate_hz or MAX_RATE_HZ) + 1.0 / config.navigation.estimate_hz
            if slow >= PX4_START_S:
                found.append(
                    f"port odometry: messages may be {slow:.2g} s apart, "
                    f"and PX4 begins to aid only below {PX4_START_S} s"
                )
        if section.port == "vision_speed_estimate" and not any(
            one.port == "odometry" and one.to == section.to for one in config.port
        ):
            found.append(
                "port vision_speed_estimate: ArduPilot begins external navigation only with positions beside it "
                "(EK3_SRC1_POSXY = 6): port odometry with settings.receiver = 'ardupilot' sends both"
            )
    return found
