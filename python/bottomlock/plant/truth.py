"""From a mission to the truth the sensors are simulated from."""

from dataclasses import dataclass

from bottomlock.config.scenario import EARTH_RATE_RADPS
from bottomlock.plant.cache import load_passage, passage_key, store_passage
from bottomlock.plant.ideal_sensors import inertial_measurements
from bottomlock.plant.mission import Mission
from bottomlock.plant.swim import Passage, swim
from bottomlock.plant.trim import check_stability
from bottomlock.plant.vehicle import Vehicle
from bottomlock.truth.truth import Truth


@dataclass(frozen=True)
class Flight:
    """A mission flown: the truth for the sensors, and the vehicle's whole state for looking at."""

    vehicle: Vehicle
    mission: Mission
    passage: Passage
    truth: Truth


def truth_of(
    passage: Passage,
    *,
    latitude_rad: float,
    gravity_mps2: float,
    earth_rate_radps: float = EARTH_RATE_RADPS,
) -> Truth:
    """The truth of a passage; specific force and inertial rate come from the passage's own accelerations."""
    omega, force = inertial_measurements(
        passage.state,
        passage.acceleration,
        latitude_rad=latitude_rad,
        gravity_mps2=gravity_mps2,
        earth_rate_radps=earth_rate_radps,
    )
    return Truth(
        time_ns=passage.time_ns,
        position_t_m=passage.state[:, 0:3].copy(),
        attitude_t_p=passage.state[:, 3:7].copy(),
        velocity_p_mps=passage.state[:, 7:10].copy(),
        omega_p_radps=omega,
        force_p_mps2=force,
        latitude_rad=latitude_rad,
        gravity_mps2=gravity_mps2,
    )


def fly(
    vehicle: Vehicle,
    mission: Mission,
    *,
    latitude_rad: float,
    gravity_mps2: float,
    earth_rate_radps: float = EARTH_RATE_RADPS,
    imu_rate_hz: float = 150.0,
    use_cache: bool = True,
) -> Flight:
    """Check the vehicle, swim the mission on the truth, and return the truth at the IMU's rate.

    Latitude in rad, gravity in m/s² (the kernel's normal gravity). The same arguments give the same bits;
    the passage is kept in the cache folder under the hash of vehicle, mission, gravity, rate and source.
    Raises `ScenarioError` when the vehicle has no stable trim or the mission leaves its range.

    >>> from bottomlock.plant import load_vehicle, straight
    >>> mission = straight(duration_s=1.0)
    >>> flight = fly(load_vehicle("tauv"), mission, latitude_rad=0.57, gravity_mps2=9.795, use_cache=False)
    >>> len(flight.truth.time_ns)
    151
    """
    key = passage_key(vehicle, mission, gravity_mps2=gravity_mps2, imu_rate_hz=imu_rate_hz)
    passage = load_passage(key) if use_cache else None
    if passage is None:
        check_stability(vehicle, gravity_mps2)
        passage = swim(vehicle, mission, gravity_mps2=gravity_mps2, imu_rate_hz=imu_rate_hz)
        if use_cache:
            store_passage(key, passage)
    truth = truth_of(
        passage, latitude_rad=latitude_rad, gravity_mps2=gravity_mps2, earth_rate_radps=earth_rate_radps
    )
    return Flight(vehicle, mission, passage, truth)
