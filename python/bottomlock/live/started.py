"""`Navigator.start`: a navigator in Python that begins by itself, from names and the readings that are pushed to it."""

import math
import operator
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from bottomlock.config.imu import ImuErrors
from bottomlock.config.through_water import require_one_drive
from bottomlock.config.validation import refusal
from bottomlock.errors import KernelError, ScenarioError
from bottomlock.io.beams import Instrument
from bottomlock.kernel import METHODS, RECOMMENDED_METHOD, Navigator, Report
from bottomlock.kernel.models import ImuModel
from bottomlock.live.aligned import AlignedNavigator
from bottomlock.live.doubts import Doubts, Reasons
from bottomlock.live.navigator_config import KernelSettings, NavigatorConfig, kernel_settings
from bottomlock.live.readings import ROUNDING
from bottomlock.live.sections import HEADING_SD_DEG, ImuFromAttitude, StatesSection
from bottomlock.own_method import DEAD_RECKONING, AnyMethod, known_names, name_of
from bottomlock.recordings.readings import (
    AttitudeReading,
    DepthReading,
    GpsReading,
    ImuReading,
    Ping,
    Reading,
    WaterReading,
)
from bottomlock.recordings.sensors import INSTRUMENTS, SENSOR_OF, is_on_earth
from bottomlock.recordings.streams import Floats
from bottomlock.text import did_you_mean

if TYPE_CHECKING:
    from bottomlock.kernel import StateDict


_BOUND_NS = 2**63
_NUMBERS = {one.reading: one.numbers for one in INSTRUMENTS if one.numbers}


def require_reading(given: object) -> None:
    """Checks the class.

    Raises:
        TypeError: for what is no reading.
    """
    if type(given) not in _NUMBERS and type(given) not in (Ping, WaterReading):
        shown = f"the class {given.__name__}" if isinstance(given, type) else f"a {type(given).__name__}"
        raise TypeError(f"push is given {shown}, expected a reading such as ImuReading or Ping")


def checked(reading: Any, beams: int) -> Any:  # noqa: ANN401 - of the same class
    """The same reading in the types that its class states; `beams` is the number of the DVL's.

    Raises:
        KernelError: for a time that is no whole number of nanoseconds, numbers that are none or not finite, other
            shapes than the class has, a quaternion that is not of unit length, and a place that is not on the Earth.
    """
    kind: Any = type(reading)
    if kind is Ping or kind is WaterReading:
        return _checked_beams(reading, beams)
    values: list[Any] = [
        None
        if field.optional and getattr(reading, field.name) is None
        else _numbers(kind, field.name, getattr(reading, field.name), field.count, field.unit)
        for field in _NUMBERS[kind]
    ]
    if kind is AttitudeReading and abs(math.hypot(*values[0]) - 1.0) > ROUNDING:
        raise KernelError(
            f"AttitudeReading.attitude_t_s is {values[0]}",
            expected="a quaternion of unit length, scalar first",
        )
    if kind is GpsReading and not is_on_earth(values[0], values[1]):
        raise KernelError(
            f"GpsReading is at latitude {values[0]}, longitude {values[1]}",
            expected="degrees, latitude first",
        )
    return kind(_time_ns(reading), *values)


def _checked_beams(reading: Ping | WaterReading, beams: int) -> Ping | WaterReading:
    of_beams, kind = f"the DVL has {beams} beams", type(reading)
    shapes = dict.fromkeys(("velocity_mps", "valid", "sd_mps"), (beams, of_beams))
    if kind is Ping:
        shapes |= {"range_m": (beams, of_beams), "instrument_mps": (3, "x, y, z")}
    arrays: dict[str, Any] = {
        name: _array(kind, name, getattr(reading, name), count, of) for name, (count, of) in shapes.items()
    }
    return replace(reading, time_ns=_time_ns(reading), **arrays)


def _time_ns(reading: Any) -> int:  # noqa: ANN401 - any reading
    given, name = reading.time_ns, type(reading).__name__
    try:
        time_ns = operator.index(given)
    except TypeError:
        hint = ": of seconds, round(seconds * 1e9)" if isinstance(given, float | np.floating) else ""
        raise KernelError(f"{name}.time_ns is {given!r}", expected=f"whole nanoseconds{hint}") from None
    if not -_BOUND_NS <= time_ns < _BOUND_NS:
        raise KernelError(f"{name}.time_ns is {time_ns}", expected="nanoseconds in 64 bits")
    return time_ns


def _numbers(kind: type, name: str, given: Any, count: int, of: str) -> Any:  # noqa: ANN401 - to be seen
    """A float, or a tuple of them."""
    if type(given) is tuple and len(given) == count and all(type(one) is float for one in given):
        values = list(given)  # most inertial readings: an array costs ten times as much
    else:
        values = _array(kind, name, given, count, of).astype(np.float64).reshape(-1).tolist()
    if not all(map(math.isfinite, values)):
        raise KernelError(f"{kind.__name__}.{name} is {_short(given)}", expected=f"finite numbers, {of}")
    return tuple(values) if count else values[0]


def _array(kind: type, name: str, given: Any, count: int, of: str) -> Any:  # noqa: ANN401 - to be seen
    """The array (count,) of a field, or of shape () for 0: of flags where it is `valid`, else of numbers."""
    try:
        array = np.asarray(given)
    except ValueError:  # lists of unequal lengths
        array = np.array(None)
    is_flags = name == "valid"
    if array.dtype.kind not in ("b" if is_flags else "fiu") or array.shape != ((count,) if count else ()):
        wanted = f"{count} {'flags' if is_flags else 'numbers'}" if count else "a number"
        raise KernelError(f"{kind.__name__}.{name} is {_short(given)}", expected=f"{wanted}, {of}")
    return array


def _short(given: object) -> str:
    """In one line."""
    return " ".join(repr(given).split())


PLACE = "Navigator.start"
"""Names the settings in errors."""
SLOWEST_ATTITUDE_S = 3.0
"""Longest interval of attitudes in place of inertial readings: three of 1 Hz, as in a live configuration."""


class StartedNavigator:
    """A navigator that aligns itself, then navigates: made by `Navigator.start`, fed by `push`.

    Level by the accelerometers over five seconds (`start={"window_s": …}`), velocity by a ping of three beams or more,
    depth by the depth sensor, heading as given or by an attitude.

    Attributes:
        unused: how many readings were not used, by why.
    """

    def __init__(self, config: NavigatorConfig, instrument: Instrument, settings: KernelSettings) -> None:
        self._config, self._instrument = config, instrument
        self._aligned = AlignedNavigator(config, instrument, settings, longest_attitude_s=SLOWEST_ATTITUDE_S)
        self.unused = Reasons()
        self._doubts = Doubts(instrument)

    def push(self, reading: Reading | Ping) -> list[Report]:
        """Takes a reading at its time of validity.

        Args:
            reading: a `Ping`, or an inertial, attitude, depth, position, thrust or effort reading, as `open_log` yields
                them; SI, ns.

        Returns:
            What became of it and of readings that waited: a report for each measurement. Empty before the alignment.

        Raises:
            TypeError: for what is no reading.
            KernelError: for a time that is no whole number of nanoseconds, does not rise or is older than the horizon,
                numbers that are not finite, shapes that do not fit; the reading is not taken.
        """
        require_reading(reading)
        if self._is_without_section(reading):
            return []
        reports = self._taken(reading)
        for report in reports:
            self._doubts.take(report)
        return reports

    def _taken(self, reading: Reading | Ping) -> list[Report]:
        reading = checked(reading, self._instrument.geometry.beams)
        if isinstance(reading, Ping):
            return self._ping(reading)
        if self.navigator is None and not isinstance(reading, ImuReading | AttitudeReading | DepthReading):
            self.unused.add(f"{type(reading).__name__} before the start")
        return list(self._aligned.push(reading.time_ns, reading))

    def _ping(self, ping: Ping) -> list[Report]:
        ping = self._config.with_noise(ping, self._instrument)
        reports = list(self._aligned.beams(ping.time_ns, ping))
        self._aligned.solve(ping.time_ns, ping)  # after it, so that a ping that is refused gives no velocity
        self._doubts.ping(ping)
        if self.navigator is None:
            return []
        if ping.water is not None and self._config.water_track is None:
            self.unused.add("water of a ping without section water_track")
        for _, _, found in self._aligned.water(ping.time_ns, ping):
            reports += found
        return reports

    def _is_without_section(self, reading: Reading | Ping) -> bool:
        """Whether nothing says how good such a reading is; counted."""
        sensor = SENSOR_OF.get(type(reading))
        if sensor is None or getattr(self._config, sensor.name) is not None:
            return False
        self.unused.add(f"{type(reading).__name__} without section {sensor.name}")
        return True

    @property
    def navigator(self) -> Navigator | None:
        """The navigator, with every other call of it; None before the alignment."""
        return self._aligned.navigator

    @property
    def waiting_for(self) -> str:
        """What the start still lacks, in words; "" once there is an estimate."""
        return self._aligned.waiting_for

    @property
    def warnings(self) -> list[str]:
        """Why a live process would not navigate with the beams, a sentence each; empty where all is well."""
        return [objection.words for objection in self._doubts.now.against(StatesSection())]

    def state(self) -> "StateDict":
        """As `Navigator.state`. Raises KernelError before the start."""
        return self._begun.state()

    def covariance(self) -> Floats:
        """As `Navigator.covariance`. Raises KernelError before the start."""
        return self._begun.covariance()

    @property
    def time_ns(self) -> int:
        """Time of the estimate.

        Raises:
            KernelError: before the start.
        """
        return int(self.state()["time_ns"])

    @property
    def position_t_m(self) -> Floats:
        """(3,) north, east, down from the origin, m. Raises KernelError before the start."""
        return self.state()["position_t_m"]

    @property
    def velocity_p_mps(self) -> Floats:
        """(3,) surge, sway, heave over ground, m/s. Raises KernelError before the start."""
        return self.state()["velocity_p_mps"]

    @property
    def attitude_t_p(self) -> Floats:
        """(4,) quaternion, scalar first, platform to tangent. Raises KernelError before the start."""
        return self.state()["attitude_t_p"]

    @property
    def position_sd_m(self) -> Floats:
        """(3,) 1 sigma of north, east, down, m. Raises KernelError before the start."""
        return np.sqrt(np.diag(self.covariance())[:3])

    @property
    def velocity_sd_mps(self) -> Floats:
        """(3,) 1 sigma of surge, sway, heave, m/s. Raises KernelError before the start."""
        return np.sqrt(np.diag(self.covariance())[6:9])

    @property
    def _begun(self) -> Navigator:
        if self.navigator is None:
            raise KernelError(f"there is no estimate yet: the start waits for {self.waiting_for}")
        return self.navigator

    def __repr__(self) -> str:
        if self.navigator is None:
            return f"<Navigator that waits for {self.waiting_for}>"
        return repr(self.navigator)


_IMU_ERRORS = [name for name, field in ImuErrors.model_fields.items() if field.is_required()]


def start(
    *,
    dvl: str | Path | Mapping[str, Any] | Instrument,
    imu: str | Mapping[str, Any] | ImuModel,
    latitude_deg: float,
    heading_deg: float | None = None,
    heading_sd_deg: float | None = None,
    method: AnyMethod | None = None,
    **sections: Mapping[str, Any] | None,
) -> StartedNavigator:
    """A navigator that begins by itself: `Navigator.start`, whose docstring has the arguments.

    Raises:
        ScenarioError: for an unknown name, section or key, a value out of range, a key that is given twice, and a start
            that nobody gives.
    """
    name = RECOMMENDED_METHOD if method is None else _method(method)
    arguments: dict[str, dict[str, Any]] = {
        "origin": {"latitude_deg": latitude_deg},
        "start": {"heading_deg": heading_deg, "heading_sd_deg": heading_sd_deg},
        "navigation": {"method": name if name in METHODS else RECOMMENDED_METHOD},
    }
    content: dict[str, Any] = {"depth": {}, **sections, "dvl": _dvl(dvl), "imu": _imu(imu)}
    content |= {section: _joined(section, keys, sections.get(section)) for section, keys in arguments.items()}
    if heading_deg is not None:
        content["start"].setdefault("heading_sd_deg", HEADING_SD_DEG)
    try:
        config = NavigatorConfig.model_validate(
            {key: value for key, value in content.items() if value is not None}
        )
        config.start_is_known(by_attitude=isinstance(config.imu, ImuFromAttitude))
        require_one_drive(config.thrust, config.effort)
    except ValidationError as error:
        raise refusal(error, PLACE, NavigatorConfig) from error
    except ValueError as error:
        raise ScenarioError(error, place=PLACE) from error
    # A method of one's own is none of a live configuration's, and known by now.
    config = config.model_copy(update={"navigation": config.navigation.model_copy(update={"method": name})})
    instrument = dvl if isinstance(dvl, Instrument) else config.instrument()
    settings = kernel_settings(config, instrument)
    if isinstance(imu, ImuModel):
        settings = replace(settings, model=settings.model.replace(imu=imu))
    return StartedNavigator(config, instrument, settings)


def _joined(section: str, arguments: Mapping[str, Any], keys: object) -> dict[str, Any]:
    """The keys of a section with the arguments that are given; no key is both."""
    if keys is not None and not isinstance(keys, Mapping):
        expected = f'keys of [{section}], as depth={{"sd_m": 0.1}}'
        raise ScenarioError(f"{section} is {keys!r}", place=PLACE, expected=expected)
    given = {key: value for key, value in arguments.items() if value is not None}
    for key in given.keys() & (keys or {}).keys():
        raise ScenarioError(
            "is given", place=PLACE, key=f"'{section}.{key}'", expected=f"the argument {key} alone"
        )
    return given | dict(keys or {})


def _method(method: AnyMethod) -> str:
    """Name of a method; one's own is registered."""
    try:
        name = name_of(method)
    except KernelError as error:
        raise ScenarioError(error, place=PLACE) from error
    names = [one for one in known_names() if one != DEAD_RECKONING]
    if name not in names:
        raise ScenarioError(
            f"method is '{name}'{did_you_mean(name, names)} (known: {', '.join(names)}",
            place=PLACE,
            hint="your own: a class, MODULE:CLASS or FILE.py:CLASS)",
        )
    return name


def _dvl(dvl: object) -> Mapping[str, Any]:
    """The keys of [dvl]; of an instrument that is given its geometry is no name."""
    if isinstance(dvl, Mapping):
        return dvl
    if isinstance(dvl, Instrument):
        return {"geometry": "given"}
    if not isinstance(dvl, str | Path):
        hint = (
            "; .instrument of it is one" if isinstance(getattr(dvl, "instrument", None), Instrument) else ""
        )
        raise ScenarioError(
            f"dvl is {_kind(dvl)}",
            place=PLACE,
            expected=(
                "a packaged geometry's name, its file, the keys of [dvl], or an Instrument, as "
                f"read_geometry returns it{hint}"
            ),
        )
    return {"geometry": str(dvl)}


def _imu(imu: object) -> Mapping[str, Any]:
    """The keys of [imu]; of a model that is given the section has no errors of its own."""
    if isinstance(imu, ImuModel):
        return dict.fromkeys(_IMU_ERRORS, 0.0)
    if not isinstance(imu, str | Mapping):
        raise ScenarioError(
            f"imu is {_kind(imu)}",
            place=PLACE,
            expected="a grade's name (see bottomlock list grades), the keys of [imu], or an ImuModel",
        )
    return imu if isinstance(imu, Mapping) else {"grade": imu}


def _kind(given: object) -> str:
    if given is None:
        return "None"
    return f"the class {given.__name__}" if isinstance(given, type) else f"of type {type(given).__name__}"
