"""Scenarios: TOML in human units to a frozen, validated `Scenario` with views in SI."""

import difflib
import hashlib
import json
import math
import tomllib
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from bottomlock import units
from bottomlock.errors import OutputError, ScenarioError

ARM_NAMES = ("ins", "lc", "tc", "vb", "nsv", "plcf", "vhv", "elc", "vb_exact", "info", "weak_sway")
EARTH_RATE_RADPS = 7.292115e-5

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = tuple[NonNegative, NonNegative, NonNegative]
Vector = tuple[Finite, Finite, Finite]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class Trajectory(_Section):
    """The true motion."""

    kind: Literal["straight", "constant_turn", "figure_eight", "lawn_mower", "waypoints"]
    source: Literal["analytic", "vehicle"] = "analytic"
    vehicle: str = "tauv"
    duration_s: Annotated[float, Field(gt=0, le=86_400)] = 250.0
    speed_mps: Positive = 2.0
    heading_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    yaw_rate_deg_per_s: Annotated[float, Field(gt=0, le=90)] = 3.0
    dive_angle_deg: Annotated[float, Field(ge=0, le=60)] = 5.0
    dive_s: NonNegative = 30.0
    leg_s: Positive = 40.0
    turn_s: Positive = 20.0
    sway_gain_m: Annotated[float, Field(ge=-10, le=10)] = 0.6


class Environment(_Section):
    """Where on the Earth."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)] = 32.8
    gravity: Literal["normal"] | Positive = "normal"
    depth_m: Finite = 0.0
    earth_rotation: bool = True


class Imu(_Section):
    """Inertial measurement unit: rate and errors (1 sigma)."""

    rate_hz: Annotated[float, Field(gt=0, le=10_000)] = 150.0
    sampling: Literal["instantaneous", "averaged"] = "instantaneous"
    accel_bias_mg: NonNegative
    gyro_bias_deg_per_h: NonNegative
    accel_noise_mps_per_rt_h: NonNegative
    gyro_noise_deg_per_rt_h: NonNegative
    accel_bias_walk_mps2_per_rt_s: NonNegative = 0.0
    gyro_bias_walk_deg_per_s_per_rt_s: NonNegative = 0.0


class Outage(_Section):
    """Beams that do not return between two times."""

    beams: tuple[Annotated[int, Field(ge=1, le=8)], ...]
    from_s: NonNegative = 0.0
    to_s: Positive = math.inf


class Dvl(_Section):
    """Doppler velocity log: geometry, rate, errors (1 sigma) and lost beams."""

    rate_hz: Annotated[float, Field(gt=0, le=100)] = 1.0
    configuration: Literal["x", "+", "angles", "directions"] = "x"
    tilt_deg: Annotated[float, Field(gt=0, lt=90)] = 20.0
    tilts_deg: tuple[Annotated[float, Field(gt=-90, lt=90)], ...] | None = None
    azimuths_deg: tuple[Annotated[float, Field(ge=-360, le=360)], ...] | None = None
    directions: tuple[Vector, ...] | None = None
    lever_arms_m: tuple[Vector, ...] | None = None
    mounting_roll_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    mounting_pitch_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    mounting_yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    sound_speed_scale: Positive = 1.0
    beam_noise_mps: Positive
    beam_bias_mps: NonNegative = 0.0
    beam_bias_walk_mps_per_rt_s: NonNegative = 0.0
    scale_factor_percent: NonNegative = 0.0
    scale_factor_walk_percent_per_rt_s: NonNegative = 0.0
    beams_lost: tuple[Annotated[int, Field(ge=1, le=8)], ...] = ()
    outages: tuple[Outage, ...] = ()

    @property
    def beams(self) -> int:
        """Number of beams."""
        if self.configuration == "angles":
            return len(self.azimuths_deg or ())
        if self.configuration == "directions":
            return len(self.directions or ())
        return 4

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.configuration == "angles" and (
            not self.azimuths_deg or not self.tilts_deg or len(self.azimuths_deg) != len(self.tilts_deg)
        ):
            raise ValueError("configuration 'angles' needs azimuths_deg and tilts_deg of the same length")
        if self.configuration == "directions" and not self.directions:
            raise ValueError("configuration 'directions' needs directions, one unit vector per beam")
        if self.lever_arms_m is not None and len(self.lever_arms_m) != self.beams:
            raise ValueError(
                f"lever_arms_m has {len(self.lever_arms_m)} entries, expected {self.beams}, one per beam"
            )
        for beam in (*self.beams_lost, *(beam for outage in self.outages for beam in outage.beams)):
            if beam > self.beams:
                raise ValueError(f"lost beam {beam} does not exist, expected 1 to {self.beams}")
        for outage in self.outages:
            if outage.to_s <= outage.from_s:
                raise ValueError(
                    f"outage ends at {outage.to_s} s, expected after its start at {outage.from_s} s"
                )
        return self


class Depth(_Section):
    """Depth sensor."""

    enabled: bool = True
    rate_hz: Positive = 0.25
    noise_pa: Positive = 194.0
    water_density_kg_per_m3: Positive = 1025.0


class Magnetometer(_Section):
    """Magnetometer and tilt sensor as an attitude sensor."""

    enabled: bool = True
    rate_hz: Positive = 0.5
    yaw_noise_deg: Positive = 5.72
    roll_pitch_noise_deg: Positive = 1.15


class Gps(_Section):
    """GPS receiver at the surface."""

    enabled: bool = True
    rate_hz: Positive = 1.0
    position_noise_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    velocity_noise_mps: tuple[Positive, Positive, Positive] = (0.1, 0.1, 0.2)


class Initial(_Section):
    """Uncertainty of the initial state, 1 sigma."""

    position_m: Triple = (2.0, 2.0, 2.0)
    velocity_mps: Triple = (0.05, 0.05, 0.05)
    roll_deg: NonNegative = 0.573
    pitch_deg: NonNegative = 0.573
    yaw_deg: NonNegative = 1.146


class Filter(_Section):
    """Filter options.

    The paper gives neither n_f nor ε. n_f = 1 is its Eq. 28 with nothing added; ε = 1e-3 m²/s² is a sway of 3 cm/s,
    "close to zero" without pressing real beams out of the gate. Neither is fitted to a result.
    """

    gate: Literal["joint", "per_row", "off"] = "joint"
    gate_probability: Annotated[float, Field(gt=0, lt=1)] = 0.9973
    covariance_rate_hz: NonNegative = 10.0
    estimate_dvl: bool = True
    virtual_beam_factor: Positive = 1.0
    nullified_sway_var_m2ps2: Positive = 1e-3
    weak_sway_var_m2ps2: Positive = 2.0
    information_port: Literal["axes", "full"] = "axes"


def check_arms(arms: Iterable[str]) -> None:
    """Refuses unknown and repeated arms and an empty list.

    Raises:
        ValueError: with the names that are known.
    """
    seen: set[str] = set()
    for arm in arms:
        if arm not in ARM_NAMES:
            close = difflib.get_close_matches(arm, ARM_NAMES, n=1)
            hint = f", did you mean '{close[0]}'?" if close else ""
            raise ValueError(f"unknown arm '{arm}'{hint} (known: {', '.join(ARM_NAMES)})")
        if arm in seen:
            raise ValueError(f"arm '{arm}' is named twice")
        seen.add(arm)
    if not seen:
        raise ValueError(f"no arm is named, expected one or more of {', '.join(ARM_NAMES)}")


class Campaign(_Section):
    """How many runs of what."""

    runs: Annotated[int, Field(ge=1, le=10_000_000)] = 100
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 2017
    arms: tuple[str, ...] = ARM_NAMES

    @model_validator(mode="after")
    def _known(self) -> Self:
        check_arms(self.arms)
        return self


class Scenario(_Section):
    """A whole scenario.

    Examples:
        >>> scenario = load_scenario("straight")
        >>> scenario.dvl.beams_lost
        (3, 4)
        >>> round(scenario.kernel_model(9.8)["initial"]["attitude_sd_rad"][2], 3)
        0.02
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_\-]+$")]
    description: str = ""
    trajectory: Trajectory
    mission: dict[str, Any] = {}
    environment: Environment = Environment()
    imu: Imu
    dvl: Dvl
    depth: Depth = Depth(enabled=False)
    magnetometer: Magnetometer = Magnetometer(enabled=False)
    gps: Gps = Gps(enabled=False)
    initial: Initial = Initial()
    filter: Filter = Filter()
    campaign: Campaign = Campaign()

    def content_hash(self) -> str:
        """SHA-256 of everything that decides the numbers (not the number of runs, the arms or the words)."""
        content = self.model_dump(mode="json", exclude={"description": True, "campaign": {"runs", "arms"}})
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def with_overrides(
        self, *, runs: int | None = None, seed: int | None = None, arms: Iterable[str] | None = None
    ) -> Self:
        """The same scenario with another number of runs, seed or arms.

        Raises:
            ScenarioError: for a number out of range or an unknown or repeated arm.
        """
        change: dict[str, Any] = {"runs": runs, "seed": seed, "arms": None if arms is None else tuple(arms)}
        content = self.campaign.model_dump() | {
            key: value for key, value in change.items() if value is not None
        }
        try:
            return self.model_copy(update={"campaign": Campaign.model_validate(content)})
        except ValidationError as error:
            raise ScenarioError(explain(error, f"scenario {self.name}: campaign")) from error

    def kernel_model(self, gravity_mps2: float) -> dict[str, Any]:
        """Environment and sensor errors in SI, as the kernel wants them."""
        imu, dvl, initial = self.imu, self.dvl, self.initial
        roll, pitch, yaw = initial.roll_deg, initial.pitch_deg, initial.yaw_deg
        return {
            "environment": {
                "latitude_rad": units.rad_from_deg(self.environment.latitude_deg),
                "gravity_mps2": gravity_mps2,
                "earth_rate_radps": EARTH_RATE_RADPS if self.environment.earth_rotation else 0.0,
            },
            "imu": {
                "accel_noise_mps_rts": units.per_rt_s_from_per_rt_h(imu.accel_noise_mps_per_rt_h),
                "gyro_noise_rad_rts": units.rad_from_deg(
                    units.per_rt_s_from_per_rt_h(imu.gyro_noise_deg_per_rt_h)
                ),
                "accel_bias_sd_mps2": units.mps2_from_mg(imu.accel_bias_mg),
                "gyro_bias_sd_radps": units.radps_from_deg_per_h(imu.gyro_bias_deg_per_h),
                "accel_bias_walk_mps2_rts": imu.accel_bias_walk_mps2_per_rt_s,
                "gyro_bias_walk_radps_rts": units.rad_from_deg(imu.gyro_bias_walk_deg_per_s_per_rt_s),
            },
            "dvl": {
                "beam_noise_sd_mps": dvl.beam_noise_mps,
                "beam_bias_sd_mps": dvl.beam_bias_mps,
                "beam_bias_walk_mps_rts": dvl.beam_bias_walk_mps_per_rt_s,
                "scale_factor_sd": units.fraction_from_percent(dvl.scale_factor_percent),
                "scale_factor_walk_rts": units.fraction_from_percent(dvl.scale_factor_walk_percent_per_rt_s),
            },
            "initial": {
                "position_sd_m": list(initial.position_m),
                "attitude_sd_rad": [units.rad_from_deg(angle) for angle in (roll, pitch, yaw)],
                "velocity_sd_mps": list(initial.velocity_mps),
            },
            "depth": {"sd_m": self.depth.noise_pa / (self.depth.water_density_kg_per_m3 * gravity_mps2)},
            "magnetometer": {
                "yaw_sd_rad": units.rad_from_deg(self.magnetometer.yaw_noise_deg),
                "roll_pitch_sd_rad": units.rad_from_deg(self.magnetometer.roll_pitch_noise_deg),
            },
            "gps": {
                "position_sd_m": list(self.gps.position_noise_m),
                "velocity_sd_mps": list(self.gps.velocity_noise_mps),
            },
        }

    def kernel_options(self) -> dict[str, Any]:
        """Filter options as the kernel wants them."""
        rate_hz = self.filter.covariance_rate_hz
        options = self.filter.model_dump(exclude={"covariance_rate_hz"})
        return options | {
            "covariance_period_ns": units.ns_from_s(1.0 / rate_hz) if rate_hz > 0.0 else 0,
            "imu_sampling": self.imu.sampling,
        }


_UNITS = (
    ("_deg_per_s_per_rt_s", "deg/s/√s"), ("_percent_per_rt_s", "%/√s"), ("_mps2_per_rt_s", "m/s²/√s"),
    ("_mps_per_rt_s", "m/s/√s"), ("_mps_per_rt_h", "m/s/√h"), ("_deg_per_rt_h", "deg/√h"), ("_deg_per_h", "deg/h"),
    ("_deg_per_s", "deg/s"), ("_kg_per_m3", "kg/m³"), ("_m2ps2", "m²/s²"), ("_percent", "%"), ("_mps", "m/s"),
    ("_deg", "deg"), ("_mg", "mg"), ("_hz", "Hz"), ("_pa", "Pa"), ("_s", "s"), ("_m", "m"),
)  # fmt: skip
_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}


def _unit_of(key: str) -> str:
    return next((f" {unit}" for ending, unit in _UNITS if key.endswith(ending)), "")


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    for part in path:
        field = model.model_fields.get(str(part))
        if (
            field is None
            or not isinstance(field.annotation, type)
            or not issubclass(field.annotation, BaseModel)
        ):
            break
        model = field.annotation
    return list(model.model_fields)


def explain(error: ValidationError, place: str, model: type[BaseModel] | None = None) -> str:
    """One line per fault: place, key, value found, what was expected, unit."""
    lines = []
    for fault in error.errors():
        location = tuple(part for part in fault["loc"] if part not in {"normal", "constrained-float"})
        key = ".".join(str(part) for part in location if not str(part).startswith(("literal", "function")))
        value, kind, context = fault.get("input"), fault["type"], fault.get("ctx", {})
        unit = _unit_of(key)
        if kind == "extra_forbidden":
            known = _known_keys(model or Scenario, location[:-1])
            close = difflib.get_close_matches(str(location[-1]), known, n=1, cutoff=0.4)
            hint = f", did you mean '{close[0]}'?" if close else f" (known: {', '.join(known)})"
            lines.append(f"{place}: unknown key '{key}'{hint}")
        elif kind == "missing":
            lines.append(f"{place}: '{key}' is missing{', expected in' + unit if unit else ''}")
        elif kind in _BOUNDS:
            name, sign = _BOUNDS[kind]
            lines.append(f"{place}: '{key}' is {value}, expected {sign} {context[name]}{unit}")
        elif kind == "value_error":
            lines.append(f"{place}: {key + ': ' if key else ''}{context['error']}")
        else:
            lines.append(
                f"{place}: '{key}' is {value!r}, expected {fault['msg'].removeprefix('Input should be ')}{unit}"
            )
    return "\n".join(dict.fromkeys(lines))


def packaged_scenarios() -> dict[str, str]:
    """Names and descriptions of the scenarios that ship with the package.

    >>> sorted(packaged_scenarios())
    ['figure_eight', 'lawn_mower', 'straight']
    """
    folder = resources.files("bottomlock") / "scenarios"
    names = sorted(
        entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")
    )
    return {name: load_scenario(name).description for name in names}


def _packaged_text(name: str) -> str | None:
    entry = resources.files("bottomlock") / "scenarios" / f"{name}.toml"
    return entry.read_text(encoding="utf-8") if entry.is_file() else None


def load_scenario(source: str | Path) -> Scenario:
    """A scenario from a packaged name or a TOML file.

    Raises:
        ScenarioError: for a file that is not there or cannot be read, ill-formed TOML (with line and column),
        a missing or
            unknown key, or a value out of range; one line per fault.
    """
    path = Path(source)
    packaged = _packaged_text(str(source)) if path.suffix != ".toml" else None
    if packaged is not None:
        return parse_scenario(packaged, place=f"scenario {source}")
    if not path.is_file():
        names = sorted(
            entry.name.removesuffix(".toml")
            for entry in (resources.files("bottomlock") / "scenarios").iterdir()
            if entry.name.endswith(".toml")
        )
        close = difflib.get_close_matches(str(source), names, n=1)
        hint = f", did you mean '{close[0]}'?" if close else f" (packaged: {', '.join(names)})"
        raise ScenarioError(f"scenario '{source}' is neither a file nor a packaged scenario{hint}")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read as text ({error})") from error
    return parse_scenario(text, place=str(path))


def parse_scenario(text: str, *, place: str) -> Scenario:
    """A scenario from TOML text; `place` names it in errors.

    Raises:
        ScenarioError: as `load_scenario`.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{place}: not valid TOML: {error}") from error
    if "dvl" not in content:
        raise ScenarioError(f"{place}: there is no [dvl] section; a scenario needs one to aid the INS with")
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        raise ScenarioError(explain(error, place)) from error


def copy_scenario(name: str, destination: Path) -> Path:
    """Writes a packaged scenario out to edit; an existing file stays as it is.

    Raises:
        ScenarioError: for a name that is not packaged.
        OutputError: where the destination exists or cannot be written.
    """
    text = _packaged_text(name)
    if text is None:
        raise ScenarioError(
            f"no packaged scenario is called '{name}' (packaged: {', '.join(packaged_scenarios())})"
        )
    try:
        with destination.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise OutputError(f"{destination}: exists already, nothing was overwritten") from error
    except OSError as error:
        raise OutputError(f"{destination}: cannot be written ({error.strerror})") from error
    return destination
