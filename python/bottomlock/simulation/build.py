"""A simulation from its scenario: gravity, beams, vehicle, mission, seabed and magnetic field, loaded and checked."""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock import kernel, units
from bottomlock.config.scenario import EARTH_RATE_RADPS, Scenario, load_scenario
from bottomlock.errors import DataError, ScenarioError
from bottomlock.io.beams import read_validity
from bottomlock.kernel.models import InitialState
from bottomlock.own_method import in_this_process_alone, source_of
from bottomlock.plant import AnyVehicle, Flight, Mission, fly, load_vehicle
from bottomlock.plant.mission import Current, current_from_table, mission_from_table
from bottomlock.plant.seabed import GridSeabed, Seabed, seabed_from_table
from bottomlock.plant.surroundings import MagneticField, world_magnetic_model
from bottomlock.plant.swim import check_mission
from bottomlock.plant.trim import check_stability
from bottomlock.simulation.analytic import analytic_truth
from bottomlock.simulation.path import Path as OwnPath
from bottomlock.simulation.path import own_path, path_truth, with_path
from bottomlock.simulation.path_check import PathSummary
from bottomlock.truth import Truth, on_ellipsoid


@dataclass(frozen=True, eq=False)
class Simulation:
    """A scenario with everything that it names.

    Attributes:
        scenario: the settings.
        gravity_mps2: local gravity.
        geometry: the beams.
        vehicle: the vehicle; None for an analytic truth, and for a path from a file.
        mission: the mission that the vehicle swims; None without a vehicle.
        seabed: the seabed, or None.
        recorded: times, ns, (n,) and beam validity (n, beams) of a recorded log, or None.
        field: the magnetic field; None without a magnetometer.
        path: the path from a file, or None.
    """

    scenario: Scenario
    gravity_mps2: float
    geometry: kernel.BeamGeometry
    vehicle: AnyVehicle | None
    mission: Mission | None
    seabed: Seabed | None
    recorded: tuple[NDArray[np.int64], NDArray[np.bool_]] | None
    field: MagneticField | None
    path: OwnPath | None = None

    def __getstate__(self) -> dict[str, Any]:
        """All but the beams, whose class belongs to the kernel; files are held by their content."""
        return {name: value for name, value in vars(self).items() if name != "geometry"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {"geometry": geometry_of(state["scenario"])})

    @property
    def latitude_rad(self) -> float:
        """Geodetic latitude."""
        return units.rad_from_deg(self.scenario.environment.latitude_deg)

    @property
    def earth_rate_radps(self) -> float:
        """Earth rate; zero where the scenario stops the Earth."""
        return EARTH_RATE_RADPS if self.scenario.environment.earth_rotation else 0.0

    @property
    def current(self) -> Current:
        """The current in which the vehicle swims, or in which the water moves under a truth without one."""
        if self.mission is not None:
            return self.mission.current
        return current_from_table(self.scenario.water_track.current)

    def fingerprint(self) -> str:
        """SHA-256 of all that decides the numbers: the scenario, and the content of every file that it names."""
        digest = hashlib.sha256(self.scenario.content_hash().encode())
        if self.vehicle is not None:
            digest.update(self.vehicle.model_dump_json().encode())
        if isinstance(self.seabed, GridSeabed):
            for axis in (self.seabed.north_m, self.seabed.east_m, self.seabed.depth_m):
                digest.update(np.ascontiguousarray(axis, dtype=np.float64).tobytes())
        for part in self.recorded or ():
            digest.update(np.ascontiguousarray(part).tobytes())
        # Not its name but its text is what a method of one's own does.
        if self.scenario.campaign.own_methods:
            digest.update(source_of(self.scenario.campaign.own_methods))
        for mark in in_this_process_alone(self.scenario.campaign.methods).values():
            digest.update(mark)
        for numbers in () if self.path is None else self.path.numbers():
            digest.update(np.ascontiguousarray(numbers).tobytes())
        return digest.hexdigest()

    def flight(self) -> Flight:
        """The vehicle's mission with guidance on the truth.

        Raises:
            ScenarioError: for a truth without a vehicle.
        """
        if self.vehicle is None or self.mission is None:
            motion = "its truth is analytic" if self.path is None else "its trajectory is a file"
            raise ScenarioError(f"{motion} and has no vehicle", place=f"scenario {self.scenario.name}")
        flight = fly(
            self.vehicle,
            self.mission,
            latitude_rad=self.latitude_rad,
            gravity_mps2=self.gravity_mps2,
            earth_rate_radps=self.earth_rate_radps,
            imu_rate_hz=self.scenario.imu.rate_hz,
        )
        return replace(flight, truth=self._on_the_earth(flight.truth))

    def _on_the_earth(self, truth: Truth) -> Truth:
        """A motion over a plane as the scenario's model of the Earth has it."""
        on_plane = self.scenario.environment.earth == "tangent_plane"
        return truth if on_plane else on_ellipsoid(truth, self.earth_rate_radps)

    def truth(self) -> Truth:
        """The true motion: analytic, along a path, or the vehicle's mission with guidance on the truth."""
        if self.path is not None:
            return self.along_path()[0]
        if self.vehicle is None:
            return self._on_the_earth(analytic_truth(self.scenario, self.gravity_mps2))
        return self.flight().truth

    def along_path(self) -> tuple[Truth, PathSummary]:
        """The truth along the path from a file, and what the path is like.

        Raises:
            ScenarioError: for a motion that is not plausible, and a scenario without such a path.
        """
        name = self.scenario.name
        if self.path is None:
            raise ScenarioError("its trajectory is not from a file", place=f"scenario {name}")
        try:
            truth, summary = path_truth(
                self.path,
                rate_hz=self.scenario.imu.rate_hz,
                latitude_rad=self.latitude_rad,
                gravity_mps2=self.gravity_mps2,
                earth_rate_radps=self.earth_rate_radps,
                duration_s=self.scenario.trajectory.duration_s,
            )
            return self._on_the_earth(truth), summary
        except DataError as error:
            raise ScenarioError(f"trajectory.file: {error}", place=f"scenario {name}") from error


def build_simulation(scenario: Scenario | str | Path) -> Simulation:
    """Loads and checks everything that a scenario names, so that a fault shows before anything runs.

    Args:
        scenario: a Scenario, a packaged name or the path of a file.

    Raises:
        ScenarioError: as `load_scenario`; for beams in a plane, a vehicle file with a fault or without a stable trim, a
            mission beyond the vehicle's range, a seabed, a recorded log or a trajectory that cannot be read.

    Examples:
        >>> build_simulation("straight").geometry.beams
        4
    """
    scenario = load_scenario(scenario)
    path = own_path(scenario) if scenario.trajectory.source == "file" else None
    scenario = scenario if path is None else with_path(scenario, path)
    gravity_mps2 = gravity_of(scenario)
    vehicle = mission = None
    if scenario.trajectory.source == "vehicle":
        vehicle = load_vehicle(scenario.trajectory.vehicle)
        mission = mission_of(scenario)
        check_mission(vehicle, mission)
        check_stability(vehicle, gravity_mps2)
    return Simulation(
        scenario=scenario,
        gravity_mps2=gravity_mps2,
        geometry=geometry_of(scenario),
        vehicle=vehicle,
        mission=mission,
        seabed=seabed_from_table(scenario.seabed) if scenario.seabed else None,
        recorded=_recorded(scenario),
        field=_field(scenario),
        path=path,
    )


def trajectory_key(name: str) -> int:
    """Key of a trajectory's random numbers: the first eight bytes of the SHA-256 of its name.

    >>> trajectory_key("straight") == trajectory_key("straight") != trajectory_key("lawn_mower")
    True
    """
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")


def gravity_of(scenario: Scenario) -> float:
    """Gravity of a scenario in m/s²: as stated, or normal gravity at its latitude and depth.

    On the ellipsoid it is that at the origin: the kernel adds what the depth of the vehicle changes.
    """
    environment = scenario.environment
    if environment.gravity != "normal":
        return float(environment.gravity)
    depth_m = environment.depth_m if environment.earth == "tangent_plane" else 0.0
    return kernel.normal_gravity_mps2(units.rad_from_deg(environment.latitude_deg), depth_m)


def mission_of(scenario: Scenario) -> Mission:
    """The vehicle's mission, by default with speed and duration of the section `[trajectory]`."""
    settings, mission = scenario.trajectory, scenario.mission
    assert mission is not None  # of every vehicle
    # A mission through waypoints ends at its last waypoint, unless a duration is given.
    is_timed = settings.kind != "waypoints" or "duration_s" in settings.model_fields_set
    return mission_from_table(
        mission,
        scenario.name,
        speed_mps=mission.speed_mps or settings.speed_mps,
        duration_s=mission.duration_s or (settings.duration_s if is_timed else None),
    )


def geometry_of(scenario: Scenario) -> kernel.BeamGeometry:
    """The beams of a scenario.

    Raises:
        ScenarioError: for directions that are not unit vectors, and beams that lie in a plane.
    """
    try:
        return scenario.dvl.geometry()
    except kernel.KernelError as error:
        raise ScenarioError(f"dvl: {error}", place=f"scenario {scenario.name}") from error


def _recorded(scenario: Scenario) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
    path = scenario.dvl.replay_validity
    if path is None:
        return None
    try:
        return read_validity(Path(path), beams=scenario.dvl.beams)
    except DataError as error:
        raise ScenarioError(f"dvl.replay_validity: {error}", place=f"scenario {scenario.name}") from error


def _field(scenario: Scenario) -> MagneticField | None:
    compass, environment = scenario.magnetometer, scenario.environment
    if not compass.enabled:
        return None
    if compass.declination_deg == "wmm":
        return world_magnetic_model(
            units.rad_from_deg(environment.latitude_deg),
            units.rad_from_deg(environment.longitude_deg),
            environment.year,
        )
    return MagneticField(
        declination_rad=units.rad_from_deg(float(compass.declination_deg)),
        inclination_rad=units.rad_from_deg(compass.inclination_deg),
        strength_nt=compass.field_nt,
    )


def closure(simulation: Simulation, truth: Truth) -> tuple[float, float]:
    """Error of the inertial navigation on the truth's own samples, at its end: position, m, and attitude, rad.

    It is what sampling at the IMU's rate loses, and would show a truth whose samples do not belong together.
    """
    scenario = simulation.scenario
    start = InitialState(
        time_ns=int(truth.time_ns[0]),
        position_t_m=truth.position_t_m[0],
        attitude_t_p=truth.attitude_t_p[0],
        velocity_p_mps=truth.velocity_p_mps[0],
    )
    # The truth's samples are values at their times, and equal ones are no fault of a sensor.
    options = scenario.kernel_options()
    options = options.replace(
        imu_sampling="instantaneous", imu_limits=options.imu_limits.replace(stuck_after=0)
    )
    navigator = kernel.Navigator(
        simulation.geometry, scenario.kernel_model(simulation.gravity_mps2), options, start, method="ins"
    )
    navigator.push_imu_block(
        truth.time_ns, omega_p_radps=truth.omega_p_radps, force_p_mps2=truth.force_p_mps2
    )
    state = navigator.state()
    w, x, y, z = (float(part) for part in state["attitude_t_p"])
    conjugate = np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    turned = 2.0 * (conjugate @ truth.attitude_t_p[-1])[1:]
    return (
        float(np.linalg.norm(np.asarray(state["position_t_m"]) - truth.position_t_m[-1])),
        float(np.linalg.norm(turned)),
    )
