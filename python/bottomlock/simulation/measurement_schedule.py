"""Times and conditions of the measurements of a simulation: epochs, returning beams, ranges, GPS reception, offsets."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock import kernel
from bottomlock.config.scenario_sections import AltitudeLoss, Dropout
from bottomlock.config.sensors import SENSORS
from bottomlock.errors import DataError
from bottomlock.plant.beam_loss import combine, markov_valid, replayed, returning, scheduled
from bottomlock.plant.seabed import Footprints, footprints
from bottomlock.plant.surroundings import GpsReception, depth_error_m, magnetic_heading_error_rad
from bottomlock.recordings.rotation import matrices
from bottomlock.simulation.build import Simulation
from bottomlock.truth import Truth

Floats = NDArray[np.float64]
Times = NDArray[np.int64]


def epochs_ns(first_ns: int, last_ns: int, rate_hz: float) -> NDArray[np.int64]:
    """Epochs at a rate up to the last time, included; the first comes one interval after the first time.

    >>> epochs_ns(0, 2_000_000_000, 1.0).tolist()
    [1000000000, 2000000000]
    """
    period = 1e9 / rate_hz
    count = int((last_ns - first_ns) / period + 1e-9)
    return first_ns + np.round(np.arange(1, count + 1) * period).astype(np.int64)


class MeasurementSchedule:
    """Epochs of every sensor between two times, and the conditions of each run at them along its truth.

    Random dropouts are drawn under the campaign's key, so run k alone has the dropouts of run k of a campaign.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        first_ns: int,
        last_ns: int,
        trajectory_key: int = 0,
        first_run: int = 0,
        runs: int = 1,
        vehicles_per_run: int = 1,
    ) -> None:
        """`first_run` and `runs` select the runs; the vehicles of a run share its random dropouts.

        Raises:
            DataError: for less than a second, which leaves nothing to record.
        """
        scenario = simulation.scenario
        self._simulation = simulation
        self._times = {
            "dvl": epochs_ns(first_ns, last_ns, scenario.dvl.rate_hz),
            "sample": epochs_ns(first_ns, last_ns, 1.0),
        }
        if not len(self._times["sample"]):
            raise DataError("the truth is shorter than a second: there is nothing to record")
        for name in (sensor.name for sensor in SENSORS):
            settings = getattr(scenario, name)
            rate_hz = settings.rate_hz if settings.enabled else 0.0
            self._times[name] = (
                epochs_ns(first_ns, last_ns, rate_hz) if rate_hz > 0.0 else np.zeros(0, dtype=np.int64)
            )
        valid = self._unconditional(trajectory_key, first_run, runs)
        self._valid = np.repeat(valid, vehicles_per_run, axis=0) if valid.ndim == 3 else valid
        moving = {"dvl": scenario.water_track.enabled, "thrust": scenario.thrust.enabled}
        self._current = {
            name: self._current_at(name, last_ns) for name, is_measured in moving.items() if is_measured
        }
        self._environment = scenario.kernel_model(simulation.gravity_mps2).environment
        self._gps = GpsReception(scenario.gps)

    def over(
        self, time_ns: Times, position_t_m: Floats, attitude_t_p: Floats
    ) -> tuple[dict[str, Any], Footprints | None]:
        """The kernel's schedule over a part of the truth, and where the beams meet the seabed.

        Parts come in order; each begins with the last sample of the one before, and its epochs lie after that sample.

        Args:
            time_ns: (samples,) int64.
            position_t_m: (vehicles, samples, 3); a single vehicle stands for all.
            attitude_t_p: (vehicles, samples, 4) unit quaternions, scalar first.

        Returns:
            The schedule, and footprints (vehicles, epochs, beams) or None without a seabed.
        """
        scenario = self._simulation.scenario
        in_tangent_frame, position_t_m = position_t_m, self._below_the_sea(position_t_m)
        within = {name: (times > time_ns[0]) & (times <= time_ns[-1]) for name, times in self._times.items()}
        now = {name: times[within[name]] for name, times in self._times.items()}
        valid = self._valid[..., within["dvl"], :]
        hits = self._footprints(now["dvl"], time_ns, position_t_m, attitude_t_p)
        if hits is not None:
            valid = combine(valid, _flat(returning(hits, scenario.dvl)))
        ranges = {}
        if hits is not None and scenario.dvl.beam_noise_mps_per_m > 0.0:
            ranges = {"beam_range_m": _flat(np.where(np.isfinite(hits.range_m), hits.range_m, 0.0))}
        schedule: dict[str, Any] = {f"{name}_time_ns": times for name, times in now.items()}
        schedule |= ranges | {"beam_valid": valid}
        if "dvl" in self._current:
            schedule |= self._water(now["dvl"], self._current["dvl"][within["dvl"]], valid)
        if len(now["thrust"]):
            poses = [
                _between(time_ns, one, now["thrust"])
                for one in (in_tangent_frame, position_t_m, attitude_t_p)
            ]
            current = self._current["thrust"][within["thrust"]]
            schedule["thrust_current_mps"] = _flat(self._current_ahead_mps(current, *poses))
        if len(now["depth"]):
            depth_m = _between(time_ns, position_t_m, now["depth"])[..., 2]
            gravity_mps2 = self._simulation.gravity_mps2
            schedule["depth_offset_m"] = _flat(depth_error_m(scenario.depth, depth_m, gravity_mps2))
        if len(now["magnetometer"]):
            attitude = _between(time_ns, attitude_t_p, now["magnetometer"])
            schedule["yaw_offset_rad"] = _flat(self._heading_error_rad(attitude))
        if scenario.gps.enabled:
            schedule["gps_received"] = _flat(self._gps.received(time_ns, position_t_m[..., 2], now["gps"]))
        return schedule, hits

    def _current_at(self, name: str, last_ns: int) -> Floats:
        """Surface current (N, E), its rate and the shear (N, E) at every epoch of a sensor, (epochs, 6)."""
        # As over the whole truth, so that it is the current in which the vehicle swims.
        time_s = np.append(self._times[name], last_ns) * 1e-9
        return self._simulation.current.columns(time_s)[:-1]

    def _current_ahead_mps(
        self, current: Floats, position_t_m: Floats, level_m: Floats, attitude: Floats
    ) -> Floats:
        """The current at the vehicle along its forward axis, (vehicles, epochs), by its positions and attitudes."""
        north_east = current[:, 0:2] + current[:, 4:6] * level_m[..., 2:3]
        flat = np.concatenate([north_east, np.zeros_like(level_m[..., 2:3])], axis=-1).reshape(-1, 3)
        if self._simulation.scenario.environment.earth == "ellipsoid":
            rotation = kernel.local_earth(self._environment, position_t_m.reshape(-1, 3))["rotation_t_n"]
            flat = np.einsum("nij,nj->ni", rotation, flat)
        ahead = matrices(attitude / np.linalg.norm(attitude, axis=-1, keepdims=True))[..., 0]
        return np.asarray(np.einsum("...i,...i->...", ahead, flat.reshape(ahead.shape)))

    def _water(self, time_ns: Times, current: Floats, beam_valid: NDArray[np.bool_]) -> dict[str, Any]:
        """The part of the kernel's schedule for the beams that the water returns."""
        with_bottom = beam_valid.any(axis=-1, keepdims=True)
        if self._simulation.scenario.water_track.pings == "all":
            with_bottom = np.zeros((len(time_ns), 1), dtype=np.bool_)
        beams = self._simulation.geometry.beams
        return {
            "water_track_time_ns": time_ns,
            "water_track_valid": np.repeat(~with_bottom, beams, axis=-1),
            "water_current_n_mps": np.ascontiguousarray(current[:, 0:2]),
            "water_shear_n_ps": np.ascontiguousarray(current[:, 4:6]),
        }

    def _below_the_sea(self, position_t_m: Floats) -> Floats:
        """Positions with the depth below the level of the sea as third component."""
        if self._simulation.scenario.environment.earth == "tangent_plane":
            return position_t_m
        here = kernel.local_earth(self._environment, position_t_m.reshape(-1, 3))
        level = position_t_m.copy()
        level[..., 2] = here["depth_m"].reshape(level.shape[:-1])
        return level

    def _unconditional(self, trajectory_key: int, first_run: int, runs: int) -> NDArray[np.bool_]:
        """Validity apart from the vehicle's motion: (epochs, beams), or (runs, epochs, beams) where it is random."""
        dvl, times = self._simulation.scenario.dvl, self._times["dvl"]
        rules = [scheduled(times, dvl.beams, dvl.beams_lost, dvl.outages)]
        if self._simulation.recorded is not None:
            rules.append(replayed(times, *self._simulation.recorded))
        losses: list[Dropout | AltitudeLoss] = [*dvl.dropouts]
        if dvl.altitude_loss is not None:
            losses.append(dvl.altitude_loss)
        if losses:
            random = markov_valid(
                times,
                dvl.beams,
                losses,
                seed=self._simulation.scenario.campaign.seed,
                trajectory_key=trajectory_key,
                first_run=first_run,
                runs=runs,
            )
            rules.append(random)
        return combine(*rules)

    def _footprints(
        self, epochs: Times, time_ns: Times, position_t_m: Floats, attitude_t_p: Floats
    ) -> Footprints | None:
        seabed, geometry = self._simulation.seabed, self._simulation.geometry
        if seabed is None:
            return None
        position = _between(time_ns, position_t_m, epochs)
        attitude = _between(time_ns, attitude_t_p, epochs)
        attitude /= np.linalg.norm(attitude, axis=-1, keepdims=True)
        return footprints(
            seabed,
            position,
            attitude,
            np.asarray(geometry.directions_p),
            np.asarray(geometry.lever_arms_p_m),
        )

    def _heading_error_rad(self, attitude: Floats) -> Floats:
        compass, field = self._simulation.scenario.magnetometer, self._simulation.field
        assert field is not None
        return magnetic_heading_error_rad(field, compass, attitude)


def measurement_schedule(
    simulation: Simulation, truth: Truth, *, trajectory_key: int = 0, first_run: int = 0, runs: int = 1
) -> dict[str, Any]:
    """The `schedule` argument of `run_batch`: epochs, beam validity and offsets along a truth that all runs share.

    Args:
        simulation: the scenario.
        truth: the true motion.
        trajectory_key: key of the random dropouts, see `build.trajectory_key`.
        first_run: number of the first run.
        runs: number of runs.

    Returns:
        `dvl_time_ns`, `sample_time_ns` and the epochs of the other sensors, int64 ns; `beam_valid` (epochs, beams), or
        (runs, epochs, beams) where it is random; `depth_offset_m`, `yaw_offset_rad` and `gps_received` if the scenario
        has these sensors; with thrust `thrust_current_mps`, the current along the vehicle's axis; with water track
        `water_track_time_ns`, `water_track_valid`, and the current at depth 0 and its change with depth along north and
        east, `water_current_n_mps` and `water_shear_n_ps`, (epochs, 2).

    Raises:
        DataError: for a truth of less than a second.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> from bottomlock.simulation.build import build_simulation
        >>> simulation = build_simulation(load_scenario("straight").with_trajectory(duration_s=10.0))
        >>> measurement_schedule(simulation, simulation.truth())["beam_valid"].shape
        (10, 4)
    """
    return schedule_and_footprints(
        simulation, truth, trajectory_key=trajectory_key, first_run=first_run, runs=runs
    )[0]


def schedule_and_footprints(
    simulation: Simulation, truth: Truth, *, trajectory_key: int = 0, first_run: int = 0, runs: int = 1
) -> tuple[dict[str, Any], Footprints | None]:
    """As `measurement_schedule`, and the footprints of the beams, (epochs, beams) each; None without a seabed."""
    whole = MeasurementSchedule(
        simulation,
        first_ns=int(truth.time_ns[0]),
        last_ns=int(truth.time_ns[-1]),
        trajectory_key=trajectory_key,
        first_run=first_run,
        runs=runs,
    )
    schedule, hits = whole.over(truth.time_ns, truth.position_t_m[None], truth.attitude_t_p[None])
    return schedule, None if hits is None else Footprints(hits.range_m[0], hits.incidence_rad[0])


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """Without the leading axis where one truth stands for all runs."""
    return values[0] if len(values) == 1 else values


def _between(time_ns: Times, values: Floats, epochs: Times) -> Floats:
    """Values (runs, samples, n) at the epochs, linear between the samples: (runs, epochs, n)."""
    after = np.clip(np.searchsorted(time_ns, epochs), 1, len(time_ns) - 1)
    fraction = (epochs - time_ns[after - 1]) / (time_ns[after] - time_ns[after - 1])
    return values[:, after - 1] + fraction[:, None] * (values[:, after] - values[:, after - 1])
