"""What the sensors meet along a truth: which beams return, from how far, where GPS is heard, what moves a reading."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.errors import DataError
from bottomlock.plant.beam_loss import (
    MarkovDropout,
    ReturnLimits,
    altitude_loss,
    combine,
    markov_valid,
    replayed,
)
from bottomlock.plant.seabed import Footprints, footprints
from bottomlock.plant.surroundings import GpsReception, Iron, Pressure, magnetic_heading_error_rad
from bottomlock.simulation.build import World
from bottomlock.simulation.sensor_times import beam_valid, epochs_ns
from bottomlock.truth.trajectory import Truth

Floats = NDArray[np.float64]
Times = NDArray[np.int64]


class Conditions:
    """Epochs of every sensor between two times, and what each run meets at them as its truth unfolds.

    Chance is drawn under the campaign's key, so that run k alone meets what run k of a campaign meets.
    """

    def __init__(
        self,
        world: World,
        *,
        first_ns: int,
        last_ns: int,
        trajectory_key: int = 0,
        first_run: int = 0,
        runs: int = 1,
        vehicles_per_run: int = 1,
    ) -> None:
        """`first_run` and `runs` say whose chances are drawn; the vehicles of a run share them.

        Raises:
            DataError: for less than a second, which leaves nothing to record.
        """
        scenario = world.scenario
        self._world = world
        self._times = {
            "dvl": epochs_ns(first_ns, last_ns, scenario.dvl.rate_hz),
            "sample": epochs_ns(first_ns, last_ns, 1.0),
        }
        if not len(self._times["sample"]):
            raise DataError("the truth is shorter than a second: there is nothing to record")
        for name in ("depth", "magnetometer", "gps"):
            settings = getattr(scenario, name)
            rate_hz = settings.rate_hz if settings.enabled else 0.0
            self._times[name] = (
                epochs_ns(first_ns, last_ns, rate_hz) if rate_hz > 0.0 else np.zeros(0, dtype=np.int64)
            )
        valid = self._unconditional(trajectory_key, first_run, runs)
        self._valid = np.repeat(valid, vehicles_per_run, axis=0) if valid.ndim == 3 else valid
        self._gps = GpsReception(scenario.gps.antenna_depth_m, scenario.gps.acquire_s)

    def along(
        self, time_ns: Times, position_t_m: Floats, attitude_t_p: Floats
    ) -> tuple[dict[str, Any], Footprints | None]:
        """The kernel's schedule over a stretch, and where the beams meet the seabed, (vehicles, epochs, beams).

        Stretches come in order, each beginning with the last sample of the one before. Positions (vehicles,
        samples, 3) and attitudes (vehicles, samples, 4); a single one stands for all. Epochs lie after the
        first sample.
        """
        scenario = self._world.scenario
        within = {name: (times > time_ns[0]) & (times <= time_ns[-1]) for name, times in self._times.items()}
        now = {name: times[within[name]] for name, times in self._times.items()}
        valid = self._valid[..., within["dvl"], :]
        hits = self._footprints(now["dvl"], time_ns, position_t_m, attitude_t_p)
        if hits is not None:
            valid = combine(valid, _flat(self._limits().valid(hits)))
        plan: dict[str, Any] = {f"{name}_time_ns": times for name, times in now.items()}
        plan["beam_valid"] = valid
        if len(now["depth"]):
            depth_m = _between(time_ns, position_t_m, now["depth"])[..., 2]
            pressure = _pressure(self._world)
            plan["depth_offset_m"] = _flat(pressure.depth_error_m(depth_m, self._world.gravity_mps2))
        if len(now["magnetometer"]):
            attitude = _between(time_ns, attitude_t_p, now["magnetometer"])
            plan["yaw_offset_rad"] = _flat(self._heading_error_rad(attitude))
        if scenario.gps.enabled:
            plan["gps_heard"] = _flat(self._gps.received(time_ns, position_t_m[..., 2], now["gps"]))
        return plan, hits

    def _unconditional(self, trajectory_key: int, first_run: int, runs: int) -> NDArray[np.bool_]:
        """Validity that does not ask where the vehicle is: (epochs, beams), or (runs, epochs, beams) by chance."""
        dvl, times = self._world.scenario.dvl, self._times["dvl"]
        key = {
            "seed": self._world.scenario.campaign.seed,
            "trajectory_key": trajectory_key,
            "first_run": first_run,
            "runs": runs,
        }
        rules = [beam_valid(dvl, times)]
        if self._world.recorded is not None:
            rules.append(replayed(times, *self._world.recorded))
        if dvl.dropouts:
            chain: list[MarkovDropout | None] = [None] * dvl.beams
            for dropout in dvl.dropouts:
                for beam in dropout.beams:
                    chain[beam - 1] = MarkovDropout(dropout.mean_up_s, dropout.mean_down_s)
            rules.append(markov_valid(times, chain, **key))
        if dvl.altitude_loss is not None:
            together = MarkovDropout(dvl.altitude_loss.mean_up_s, dvl.altitude_loss.mean_down_s)
            rules.append(altitude_loss(times, dvl.beams, together, **key))
        return combine(*rules)

    def _limits(self) -> ReturnLimits:
        dvl = self._world.scenario.dvl
        return ReturnLimits(dvl.min_range_m, dvl.max_range_m, units.rad_from_deg(dvl.max_incidence_deg))

    def _footprints(
        self, epochs: Times, time_ns: Times, position_t_m: Floats, attitude_t_p: Floats
    ) -> Footprints | None:
        seabed, geometry = self._world.seabed, self._world.geometry
        if seabed is None:
            return None
        position = _between(time_ns, position_t_m, epochs)
        attitude = _between(time_ns, attitude_t_p, epochs)
        attitude /= np.linalg.norm(attitude, axis=-1, keepdims=True)
        flat = footprints(
            seabed,
            position.reshape(-1, 3),
            attitude.reshape(-1, 4),
            np.asarray(geometry.directions_p),
            np.asarray(geometry.lever_arms_p_m),
        )
        shape = (*position.shape[:2], geometry.beams)
        return Footprints(flat.range_m.reshape(shape), flat.incidence_rad.reshape(shape))

    def _heading_error_rad(self, attitude: Floats) -> Floats:
        compass, field = self._world.scenario.magnetometer, self._world.field
        assert field is not None
        assumed_deg = compass.assumed_declination_deg
        error = magnetic_heading_error_rad(
            field,
            Iron(hard_p_nt=compass.hard_iron_nt, soft=compass.soft_iron),
            attitude.reshape(-1, 4),
            assumed_declination_rad=field.declination_rad
            if assumed_deg is None
            else units.rad_from_deg(assumed_deg),
        )
        return error.reshape(attitude.shape[:2])


def schedule(
    world: World, truth: Truth, *, trajectory_key: int = 0, first_run: int = 0, runs: int = 1
) -> dict[str, Any]:
    """What the kernel's `run_batch` wants to know of the sensors along a truth that all runs share.

    Raises:
        DataError: for a truth of less than a second.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> from bottomlock.simulation.build import make_world
        >>> world = make_world(load_scenario("straight"))
        >>> schedule(world, world.truth())["beam_valid"].shape
        (250, 4)
    """
    return met(world, truth, trajectory_key=trajectory_key, first_run=first_run, runs=runs)[0]


def met(
    world: World, truth: Truth, *, trajectory_key: int = 0, first_run: int = 0, runs: int = 1
) -> tuple[dict[str, Any], Footprints | None]:
    """As `schedule`, and where the beams meet the seabed, (epochs, beams) each; None without a seabed."""
    conditions = Conditions(
        world,
        first_ns=int(truth.time_ns[0]),
        last_ns=int(truth.time_ns[-1]),
        trajectory_key=trajectory_key,
        first_run=first_run,
        runs=runs,
    )
    plan, hits = conditions.along(truth.time_ns, truth.position_t_m[None], truth.attitude_t_p[None])
    return plan, None if hits is None else Footprints(hits.range_m[0], hits.incidence_rad[0])


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """Without the leading axis where one truth stands for all runs."""
    return values[0] if len(values) == 1 else values


def _between(time_ns: Times, values: Floats, epochs: Times) -> Floats:
    """Values (runs, samples, n) at epochs, linear between the samples: (runs, epochs, n)."""
    after = np.clip(np.searchsorted(time_ns, epochs), 1, len(time_ns) - 1)
    part = (epochs - time_ns[after - 1]) / (time_ns[after] - time_ns[after - 1])
    return values[:, after - 1] + part[:, None] * (values[:, after] - values[:, after - 1])


def _pressure(world: World) -> Pressure:
    depth = world.scenario.depth
    assumed = depth.water_density_kg_per_m3
    return Pressure(
        density_kgpm3=depth.true_density_kg_per_m3 or assumed,
        assumed_density_kgpm3=assumed,
        tide_m=depth.tide_m,
        barometric_offset_pa=depth.barometric_offset_pa,
    )
