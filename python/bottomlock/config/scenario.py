"""Scenarios: TOML in human units to a frozen, validated `Scenario` with views in SI."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from bottomlock import units
from bottomlock.config.imu import Imu
from bottomlock.config.mission_sections import (
    MISSION_KINDS,
    AnyMission,
    AnySeabed,
    CurrentTable,
    GridSeabedTable,
)
from bottomlock.config.packaged import packaged_names, text_of
from bottomlock.config.scenario_sections import Campaign, Dvl, Environment, Filter, Initial, Robust
from bottomlock.config.section import in_si, shown
from bottomlock.config.sensors import SENSORS, SensorSections, WaterTrack
from bottomlock.config.toml_file import parse_toml, toml_value
from bottomlock.config.trajectory import Trajectory
from bottomlock.config.validation import checked
from bottomlock.errors import ScenarioError
from bottomlock.kernel import models
from bottomlock.own_method import AnyMethod
from bottomlock.text import html_table

EARTH_RATE_RADPS = 7.292115e-5

_BY_SEABED = ("min_range_m", "max_range_m", "max_incidence_deg", "range_noise_m", "beam_noise_mps_per_m")
"""Keys of `[dvl]` that need a seabed."""


class Scenario(SensorSections):
    """A whole scenario.

    Examples:
        >>> scenario = load_scenario("straight")
        >>> scenario
        <Scenario straight: straight at 2 m/s for 250 s, 4 beams without 3, 4, 100 runs of 11 methods>
        >>> scenario.dvl.beams_lost
        (3, 4)
        >>> round(scenario.kernel_model(9.8).initial.attitude_sd_rad[2], 3)
        0.02
    """

    name: Annotated[
        str, Field(pattern=r"^[A-Za-z0-9_\-]+$"), shown(range="letters, digits, _ and -", example="harbour")
    ]
    """name of the campaign's rows, tables and figures"""
    description: Annotated[str, shown(example="A survey of the harbour with two beams")] = ""
    """one sentence for tables and pages"""
    trajectory: Trajectory
    mission: AnyMission | None = None
    environment: Environment = Environment()
    seabed: AnySeabed | None = None
    imu: Imu
    dvl: Dvl
    water_track: WaterTrack = WaterTrack(enabled=False)
    initial: Initial = Initial()
    filter: Filter = Filter()
    robust: Robust = Robust(enabled=False)
    campaign: Campaign = Campaign()

    @model_validator(mode="before")
    @classmethod
    def _mission_of_its_path(cls, data: Any) -> Any:  # noqa: ANN401 - whatever a file holds
        """A vehicle has a mission, which is of the trajectory's kind unless it says otherwise; nothing else has one."""
        path: Any = data.get("trajectory") if isinstance(data, dict) else None
        mission = data.get("mission") or {} if isinstance(path, dict | Trajectory) else None
        if not isinstance(mission, dict):
            return data
        path = dict(path)
        source = path.get("source", "vehicle" if path.get("file") is None else "file")
        if source != "vehicle" and mission:
            motion = "an analytic truth" if source == "analytic" else "a trajectory from a file"
            raise ValueError(f'[mission] is given, but {motion} has no mission: set source = "vehicle"')
        if source == "vehicle" and path.get("kind") in MISSION_KINDS:
            mission = {"kind": path["kind"]} | mission
        # What is wrong with the trajectory's kind is said of that.
        return data | {"mission": mission if "kind" in mission else None}

    @model_validator(mode="after")
    def _parts_agree(self) -> Self:
        if self.mission and self.mission.kind == self.trajectory.kind:
            # It follows the trajectory's to another one.
            self.mission.model_fields_set.discard("kind")
        limits = {key for key in _BY_SEABED if getattr(self.dvl, key) != Dvl.model_fields[key].default}
        if limits and not self.seabed:
            raise ValueError(f"dvl.{min(limits)} is given, but there is no [seabed] to range to")
        if self.trajectory.source == "vehicle" and self.water_track.current != CurrentTable():
            raise ValueError(
                "water_track.current is given, but the current of a vehicle is that of [mission]"
            )
        if self.trajectory.pilot not in {"own", *self.campaign.methods}:
            raise ValueError(
                f"trajectory.pilot is '{self.trajectory.pilot}', expected \"own\" or one of the campaign's methods"
            )
        return self

    def content_hash(self) -> str:
        """SHA-256 of everything that decides the numbers (not the number of runs, the methods or the words)."""
        # What is switched off decides nothing; the water moves for the propeller, too.
        used = {"water_track"} if self.thrust.enabled else set()
        exclude: dict[str, Any] = {
            name: True for name, section in self if name not in used and not getattr(section, "enabled", True)
        }
        # The name of a vehicle is words too: its numbers stand beside it. Simulated readings are not checked.
        exclude |= {"description": True, "campaign": {"runs", "methods", "own_methods"}, "imu": {"limits"}}
        exclude["filter"] = {"water": {"vehicle"}}
        exclude["filter"] |= {} if self.filter.speed_sd_mps else {"speed_sd_mps": True, "speed_time_s": True}
        exclude |= {} if self.dvl.outlier_fraction else {"dvl": {"outlier_fraction", "outlier_factor"}}
        exclude |= {} if self.environment.earth == "ellipsoid" else {"environment": {"earth"}}
        content = self.model_dump(mode="json", exclude=exclude)
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def files(self) -> list[Path]:
        """The files that it names."""
        seabed = self.seabed.path if isinstance(self.seabed, GridSeabedTable) else None
        named = (seabed, self.dvl.replay_validity, self.trajectory.vehicle, self.trajectory.file)
        return [Path(one) for one in named if one is not None and Path(one).suffix]

    def __repr__(self) -> str:
        """Name, path, beams, sensors and runs in a line."""
        path, dvl, campaign = self.trajectory, self.dvl, self.campaign
        length = "" if path.kind == "waypoints" else f" for {path.duration_s:g} s"
        lost = f" without {', '.join(str(beam) for beam in dvl.beams_lost)}" if dvl.beams_lost else ""
        sensors = [*(sensor.name for sensor in SENSORS), "water_track"]
        parts = [
            f"{path.kind} at {path.speed_mps:g} m/s{length}",
            f"{dvl.beams} beams{lost}",
            *(name for name in sensors if getattr(self, name).enabled),
            f"{campaign.runs} runs of {len(campaign.methods)} methods",
        ]
        return f"<Scenario {self.name}: {', '.join(parts)}>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """Every key that the file states, a row for each section, for notebooks."""
        rows = []
        for name, value in self.model_dump(exclude_unset=True).items():
            if isinstance(value, dict):
                keys = ", ".join(f"{key} = {toml_value(stated)}" for key, stated in value.items())
                rows.append((f"[{name}]", keys))
            elif name != "name":
                rows.append((name, str(value)))
        return html_table(f"Scenario {self.name}", rows)

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """The scenario with other values of some keys, for instance "imu.gyro_bias_deg_per_h"; checked as a file is.

        All of them are set before anything is checked, so keys that are valid only together are given together.

        Raises:
            ScenarioError: for an unknown key, which names the nearest, a value that is not valid, and a key that is
                part of another.

        Examples:
            >>> better = load_scenario("straight").replace({"imu.gyro_bias_deg_per_h": 0.01, "dvl.beams_lost": [4]})
            >>> better.imu.gyro_bias_deg_per_h, better.dvl.beams_lost
            (0.01, (4,))
        """
        given: Any = changes  # a caller without a type checker may give anything
        place = f"scenario {self.name}"
        if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
            expected = 'keys with their values, such as {"imu.gyro_bias_deg_per_h": 0.01}'
            raise ScenarioError(f"the changes are {given!r:.60}", place=place, expected=expected)
        content = self.model_dump(exclude_unset=True)
        for key, value in given.items():
            within = next((other for other in given if key.startswith(f"{other}.")), None)
            if within is not None:
                found = f"is part of '{within}'"
                raise ScenarioError(found, place=place, key=f"'{key}'", expected="one of them")
            *sections, last = key.split(".")
            section = content
            for name in sections:
                section = section.setdefault(name, {})
                if not isinstance(section, dict):
                    raise ScenarioError(f"unknown key '{key}' ('{name}' is no section)", place=place)
            section[last] = value
        return checked(type(self), content, place)

    def with_overrides(
        self, *, runs: int | None = None, seed: int | None = None, methods: Iterable[AnyMethod] | None = None
    ) -> Self:
        """The same scenario with another number of runs, seed or methods: names, and classes of one's own.

        Raises:
            ScenarioError: for a number out of range, an unknown or repeated method, and a class that is none.
        """
        if isinstance(methods, str | type | set | frozenset):
            raise ScenarioError(
                f"methods is {methods!r:.60}", place=f"scenario {self.name}", expected="a list of methods"
            )
        change = {"runs": runs, "seed": seed, "methods": None if methods is None else tuple(methods)}
        return self.replace({f"campaign.{key}": value for key, value in change.items() if value is not None})

    def with_trajectory(self, **change: Any) -> Self:  # noqa: ANN401 - any key of the section
        """The scenario with other keys under `[trajectory]`; a change of source drops the keys of the old one.

        Raises:
            ScenarioError: for a key or value that `[trajectory]` rejects.
        """
        moved = change.get("source", self.trajectory.source) != self.trajectory.source
        content = self.model_dump(exclude_unset=True, exclude={"mission"} if moved else None)
        kept = {"kind", "duration_s", "speed_mps"} if moved else content["trajectory"].keys()
        path = {key: value for key, value in content["trajectory"].items() if key in kept}
        return checked(type(self), content | {"trajectory": path | change}, f"scenario {self.name}")

    def kernel_model(self, gravity_mps2: float) -> models.Model:
        """Environment and sensor errors in SI, as the kernel takes them."""
        initial = self.initial
        sections = [getattr(self, sensor.name) for sensor in SENSORS]
        sections += [self.water_track] if self.water_track.enabled else []
        sensors: dict[str, Any] = {}
        for section in sections:
            sensors |= section.kernel_models(gravity_mps2)
        angles = (initial.roll_deg, initial.pitch_deg, initial.yaw_deg)
        return models.Model(
            environment=in_si(
                dict(self.environment),
                models.Environment,
                gravity_mps2=gravity_mps2,
                earth_rate_radps=EARTH_RATE_RADPS if self.environment.earth_rotation else 0.0,
            ),
            imu=self.imu.kernel_model(),
            dvl=self.dvl.kernel_model(self.dvl.beam_noise_mps, None),
            dvl_outliers=in_si(dict(self.dvl), models.DvlOutlierModel),
            initial=in_si(
                dict(initial),
                models.InitialModel,
                attitude_sd_rad=[units.rad_from_deg(angle) for angle in angles],
            ),
            **sensors,
        )

    def kernel_options(self) -> models.Options:
        """Filter options as the kernel takes them."""
        sensors = (getattr(self, sensor.name) for sensor in SENSORS)
        imu = {"imu_sampling": self.imu.sampling, "imu_limits": self.imu.limits.kernel_limits()}
        robust = {"robust": self.robust.kernel_options()}
        used = [one.kernel_options() for one in (*sensors, self.water_track) if one.enabled]
        return models.Options.of(self.filter.kernel_options(), robust, imu, *used)


def packaged_scenarios() -> dict[str, str]:
    """Names and descriptions of the scenarios that ship with the package.

    >>> sorted(packaged_scenarios())
    ['figure_eight', 'hovering', 'lawn_mower', 'long_way', 'slope', 'straight', 'survey', 'survey_table2']
    """
    return {name: load_scenario(name).description for name in packaged_names("scenarios")}


def load_scenario(source: Scenario | str | Path) -> Scenario:
    """A scenario from a packaged name or a TOML file; one that is loaded already is returned as it is.

    A packaged name is taken as such; a `Note` says so where NAME.toml is in the working directory.

    Raises:
        ScenarioError: for a file that is not there or cannot be read, ill-formed TOML (with line and column), a missing
            or unknown key, or a value out of range; one line per fault.
    """
    if isinstance(source, Scenario):
        return source
    given: Any = source  # a caller without a type checker may give anything
    if not isinstance(given, str | Path):
        raise ScenarioError(
            f"the scenario is {given!r:.60}", expected="a Scenario, a packaged name or a path"
        )
    text, place = text_of("scenario", source)
    return parse_scenario(text, place=place, folder=Path(source).parent)


def parse_scenario(text: str, *, place: str, folder: Path | None = None) -> Scenario:
    """A scenario from TOML text; `place` names it in errors, files that it names are looked for from `folder`.

    Raises:
        ScenarioError: as `load_scenario`.
    """
    return checked(Scenario, parse_toml(text, place=place, kind="scenario"), place, folder)
