"""Aiding methods of your own: a class that says what a ping measures, flown under its name as the built-in methods are.

The kernel propagates, gates and updates; the class turns the beams of a ping into a velocity or into rows
(docs/own_method.md).

Examples:
    >>> class Surge:
    ...     name = "surge_alone"
    ...
    ...     def ping(self, beams: Beams, prior: Prior) -> Rows:
    ...         return beams.rows
    >>> register(Surge)
    'surge_alone'
"""

import importlib
import importlib.util
import inspect
import sys
import time
import traceback
import uuid
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.errors import KernelError
from bottomlock.kernel import METHODS, OwnName, register_method

Floats = NDArray[np.float64]

DEAD_RECKONING = "dead_reckoning"
"""The method that is no filter: the DVL's velocity turned by an attitude reference (docs/methods/dead_reckoning.md)."""


@dataclass(frozen=True, eq=False)
class Fix:
    """A velocity over ground; apart from the DVL's scale factor its errors are white.

    Attributes:
        velocity_p_mps: (3,) surge, sway, heave.
        cov_m2ps2: (3, 3) covariance, positive definite.
    """

    velocity_p_mps: ArrayLike
    cov_m2ps2: ArrayLike


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows z = H δx + n of up to eight measurements; δx is true minus estimate.

    Attributes:
        residual: (m,) measured minus expected.
        jacobian: (m, 20) by position (tangent, m), misalignment (tangent, rad), velocity (platform, m/s), accelerometer
            bias, gyro bias, beam biases (four) and scale factor of the DVL.
        noise: (m, m) covariance of n, positive definite.
    """

    residual: ArrayLike
    jacobian: ArrayLike
    noise: ArrayLike


@dataclass(frozen=True, eq=False)
class Prior:
    """The estimate before the ping.

    Attributes:
        velocity_p_mps: (3,) over ground, platform frame.
        cov_m2ps2: (3, 3) its covariance.
        position_t_m: (3,) tangent frame.
        attitude_t_p: (4,) quaternion, scalar first, platform to tangent.
        omega_tp_p_radps: (3,) angular rate against the tangent frame, platform frame.
        dvl_bias_mps: (4,) estimated biases of the beams.
        dvl_scale_factor: estimated scale factor.
        covariance: (20, 20) of the whole state, in the order of `Rows.jacobian`.
    """

    velocity_p_mps: Floats
    cov_m2ps2: Floats
    position_t_m: Floats
    attitude_t_p: Floats
    omega_tp_p_radps: Floats
    dvl_bias_mps: Floats
    dvl_scale_factor: float
    covariance: Floats


@dataclass(frozen=True, eq=False)
class Beams:
    """The valid beams of a ping, none to all; after the rejection of outliers where that is on.

    Attributes:
        time_ns: time of validity.
        number: (n,) which beams, from 0.
        directions_p: (n, 3) unit vectors, platform frame.
        velocity_mps: (n,) b · v of each beam: its reading less lever arm, estimated bias and scale factor.
        cov_m2ps2: (n, n) covariance of these.
        reading_mps: (n,) as the instrument gave them.
        rows: what tight coupling takes: a row for each beam, with all its columns.
    """

    time_ns: int
    number: NDArray[np.int64]
    directions_p: Floats
    velocity_mps: Floats
    cov_m2ps2: Floats
    reading_mps: Floats
    rows: Rows
    _scale: float

    def through(self, gain: ArrayLike) -> Rows:
        """Rows of combinations of beams: `gain` (m, n) times `velocity_mps`, with every error of the beams.

        Equal to the loosely coupled update with the DVL's own states (erratum E7).
        """
        weights = np.asarray(gain, np.float64)
        residual, jacobian = np.asarray(self.rows.residual), np.asarray(self.rows.jacobian)
        return Rows(
            weights @ residual / self._scale,
            weights @ jacobian / self._scale,
            weights @ self.cov_m2ps2 @ weights.T,
        )


class OwnMethod(Protocol):
    """What a method is. An object of the class is made once, without arguments, and serves all runs on any thread.

    `ping` is a function of its arguments alone; it may be called again for the same ping.
    """

    name: str
    """In tables, figures and commands: lower-case letters, digits, underscores; no built-in method's."""

    def ping(self, beams: Beams, prior: Prior) -> Fix | Rows | None:
        """What the beams measure; None for nothing."""
        ...


AnyMethod = str | type[OwnMethod] | OwnMethod
"""A method as users name it: a name, "module:Class" or "file.py:Class", or a class or object of their own."""


@dataclass
class Cost:
    """Calls of a method in this process, and the seconds of a core that they took."""

    pings: int = 0
    seconds: float = 0.0


_COSTS: dict[str, Cost] = {}
_LOADED: dict[str, type[OwnMethod]] = {}
"""Classes by the places from which this process has them."""


@dataclass(frozen=True)
class _Registered:
    """What was registered under a name, and a mark that no other registration has."""

    name: OwnName
    given: type[OwnMethod] | OwnMethod
    mark: bytes


_REGISTERED: dict[str, _Registered] = {}


def register(method: type[OwnMethod] | OwnMethod) -> OwnName:
    """Makes a class, or an object, a method by its name; one of that name from before is replaced. Returns the name.

    Raises:
        KernelError: for a class that cannot be made without arguments, has no name or no `ping(beams, prior)`, and a
            name that is taken.
    """
    label = method.__qualname__ if isinstance(method, type) else type(method).__qualname__
    made = _made(method, label)
    name = getattr(made, "name", None)
    if not isinstance(name, str):
        raise KernelError(f"{label} has no name", expected='a class attribute, as in name = "my_method"')
    ping = getattr(made, "ping", None)
    try:
        inspect.signature(ping).bind("beams", "prior")  # type: ignore[arg-type] # what is no function is the error
    except (TypeError, ValueError) as error:
        raise KernelError(f"{label} has no method ping(self, beams, prior) ({error})") from error
    register_method(name, label, _timed(made, _COSTS.setdefault(name, Cost())))
    _REGISTERED[name] = _Registered(OwnName(name), method, uuid.uuid4().bytes)
    return OwnName(name)


def is_method(given: object) -> bool:
    """Whether it can be meant for a method without being a name: a class, or an object with a `ping`."""
    return isinstance(given, type) or hasattr(given, "ping")


def name_of(method: AnyMethod) -> str:
    """The kernel's name of a method: a name is its own; "module:Class", a class or an object is registered if need be.

    Raises:
        KernelError: as `register` and `load`.
    """
    if isinstance(method, str):
        return load(method) if ":" in method else method
    name = getattr(method, "name", None)
    known = _REGISTERED.get(name) if isinstance(name, str) else None
    return known.name if known is not None and known.given is method else register(method)


def place_of(name: str) -> str | None:
    """Where another process finds the class of a registered method, as `load` takes it.

    None for a name that is not registered, and for a method that is in this process alone: an object, and a class made
    in a notebook, a console or a function.
    """
    method = _REGISTERED[name].given if name in _REGISTERED else None
    if not isinstance(method, type):
        return None
    place = next((place for place, loaded in _LOADED.items() if loaded is method), None)
    if place is None:
        place = _place_of(method)
        if place is not None:
            # So that a script that is running is not run again to get its class.
            _LOADED[place] = method
    return place


def _place_of(method: type[OwnMethod]) -> str | None:
    name, module = method.__qualname__, sys.modules.get(method.__module__)
    file = getattr(module, "__file__", None)
    if module is None or file is None or getattr(module, name, None) is not method:
        return None
    if module.__name__ != "__main__":
        return f"{module.__name__}:{name}"
    script = Path(file).resolve()
    # What is typed after a script has run, as by python -i, is not in the script's text.
    functions = [inspect.unwrap(part) for part in vars(method).values() if inspect.isfunction(part)]
    written = all(Path(one.__code__.co_filename).resolve() == script for one in functions)
    return f"{script}:{name}" if written and script.suffix == ".py" else None


def in_this_process_alone(names: Iterable[str]) -> dict[str, bytes]:
    """The registered methods that no other process finds, with marks that no other class or process has."""
    return {name: _REGISTERED[name].mark for name in names if name in _REGISTERED and place_of(name) is None}


def _made(method: type[OwnMethod] | OwnMethod, label: str) -> OwnMethod:
    if not isinstance(method, type):
        return method
    try:
        return method()
    except Exception as error:
        raise KernelError(
            f"{label} cannot be made without arguments ({type(error).__name__}: {error})",
            hint="register an object instead",
        ) from error


def _timed(method: OwnMethod, cost: Cost) -> Callable[[dict[str, Any]], tuple[ArrayLike, ...] | None]:
    """The kernel's call: arrays in, arrays out."""

    def call(ping: dict[str, Any]) -> tuple[ArrayLike, ...] | None:
        started = time.thread_time()
        try:
            found = method.ping(*_arguments(ping))
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            raise KernelError(
                f"{error} ({Path(place.filename).name}, line {place.lineno})", place=type(error).__name__
            ) from error
        cost.pings += 1
        cost.seconds += time.thread_time() - started
        if found is None:
            return None
        if isinstance(found, Fix):
            return found.velocity_p_mps, found.cov_m2ps2
        if isinstance(found, Rows):
            return found.residual, found.jacobian, found.noise
        raise KernelError(f"ping returned {type(found).__name__}", expected="Fix, Rows or None")

    return call


def _arguments(ping: dict[str, Any]) -> tuple[Beams, Prior]:
    scale = 1.0 + ping["dvl_scale_factor"]
    covariance, velocity, directions = ping["covariance"], ping["velocity_p_mps"], ping["directions_p"]
    residual, noise = ping["residual_mps"], ping["noise_m2ps2"]
    beams = Beams(
        time_ns=ping["time_ns"],
        number=ping["number"],
        directions_p=directions,
        velocity_mps=directions @ velocity + residual / scale,
        cov_m2ps2=noise / scale**2,
        reading_mps=ping["reading_mps"],
        rows=Rows(residual, ping["jacobian"], noise),
        _scale=scale,
    )
    prior = Prior(
        velocity_p_mps=velocity,
        cov_m2ps2=covariance[6:9, 6:9],
        position_t_m=ping["position_t_m"],
        attitude_t_p=ping["attitude_t_p"],
        omega_tp_p_radps=ping["omega_tp_p_radps"],
        dvl_bias_mps=ping["dvl_bias_mps"],
        dvl_scale_factor=ping["dvl_scale_factor"],
        covariance=covariance,
    )
    return beams, prior


def load(place: str) -> str:
    """Registers the class at "module:Class" or "file.py:Class", read once in a process, and returns its name.

    Raises:
        KernelError: for what cannot be imported or is no method, in one line.
    """
    if place not in _LOADED:
        module, _, attribute = place.rpartition(":")
        if not module or not attribute.isidentifier():
            raise KernelError(f"method '{place}' is none", expected="MODULE:CLASS or FILE.py:CLASS")
        found = getattr(_module(module, place), attribute, None)
        if not isinstance(found, type):
            raise KernelError(f"{module} has no class {attribute}", place=f"method '{place}'")
        try:
            register(found)
        except KernelError as error:
            raise KernelError(error, place=f"method '{place}'") from error
        _LOADED[place] = found
    # Another class may have been given the name since.
    return name_of(_LOADED[place])


def _module(module: str, place: str) -> ModuleType:
    try:
        if module.endswith(".py"):
            return _of_file(Path(module))
        if "" not in sys.path and str(Path.cwd()) not in sys.path:
            # As `python -m` has it, which a script beside the interpreter has not.
            sys.path.insert(0, str(Path.cwd()))
        return importlib.import_module(module)
    except (Exception, SystemExit) as error:
        text = " ".join(str(error).split())
        raise KernelError(
            f"{module} cannot be imported ({type(error).__name__}: {text})",
            place=f"method '{place}'",
            expected="a module on Python's path or in this folder, or FILE.py:CLASS",
        ) from error


def _of_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise FileNotFoundError(f"no file {path}")
    spec = importlib.util.spec_from_file_location(f"own_method_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def costs() -> dict[str, Cost]:
    """Calls and seconds of the methods that were called in this process."""
    return {name: cost for name, cost in _COSTS.items() if cost.pings}


def source_of(places: Iterable[str]) -> bytes:
    """The text of the files that hold these classes: another text is another method."""
    parts = []
    for place in places:
        module = place.rpartition(":")[0]
        path = Path(module) if module.endswith(".py") else Path(str(_module(module, place).__file__))
        parts.append(path.read_bytes())
    return b"\0".join(parts)


def known_names() -> tuple[str, ...]:
    """Every method: built in, dead reckoning, one's own."""
    return (*METHODS, DEAD_RECKONING, *_REGISTERED)
