"""One simulated run, event by event: the effect of each DVL fix on the estimate.

A campaign records errors once a second and sums over fixes. The effect of a single fix is available only from the
streaming navigator, whose results are the same bits.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bottomlock import kernel
from bottomlock.config.sensors import SENSORS
from bottomlock.errors import ScenarioError
from bottomlock.kernel.models import DvlModel, WaterTrackModel
from bottomlock.simulation.build import Simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.truth import Truth

Floats = NDArray[np.float64]
_VELOCITY = slice(6, 9)
PUSH: dict[str, Callable[[kernel.Navigator, int, Mapping[str, Any], int, Any], object]] = {
    "depth": lambda navigator, time_ns, drawn, k, model: navigator.push_depth(
        time_ns, float(drawn["depth_m"][k]), sd_m=model.sd_m
    ),
    "magnetometer": lambda navigator, time_ns, drawn, k, model: navigator.push_attitude(
        time_ns,
        drawn["magnetometer_attitude_t_p"][k],
        yaw_sd_rad=model.yaw_sd_rad,
        roll_pitch_sd_rad=model.roll_pitch_sd_rad,
    ),
    "heading": lambda navigator, time_ns, drawn, k, model: navigator.push_heading(
        time_ns, float(drawn["heading_rad"][k]), sd_rad=model.sd_rad
    ),
    "gps": lambda navigator, time_ns, drawn, k, model: navigator.push_gps(
        time_ns, drawn["gps_position_t_m"][k], drawn["gps_velocity_t_mps"][k], **model.as_dict()
    ),
    "acoustic_position": lambda navigator, time_ns, drawn, k, _: navigator.push_acoustic_position(
        time_ns=time_ns,
        position_t_m=drawn["acoustic_position_t_m"][k],
        sd_m=drawn["acoustic_position_sd_m"][k],
    ),
    "thrust": lambda navigator, time_ns, drawn, k, model: navigator.push_thrust(
        time_ns, drawn["thrust_speed_p_mps"][k], sd_mps=model.noise_sd_mps
    ),
}
"""Gives reading k of the kernel's arrays to a navigator, at a time and with the sensor's section of the model."""


@dataclass(frozen=True, eq=False)
class Fix:
    """Effect of one ping on the estimate.

    Attributes:
        time_ns: time of the ping.
        step_p_mps: (3,) estimate of velocity after minus before, platform frame.
        before_sd_mps: (3,) claimed standard deviation of velocity before.
        after_sd_mps: (3,) and after.
        nis: normalised innovation squared.
        degrees: its degrees of freedom.
        used: whether the gate accepted any row.
    """

    time_ns: int
    step_p_mps: Floats
    before_sd_mps: Floats
    after_sd_mps: Floats
    nis: float
    degrees: int
    used: bool


class Readings:
    """The sensor readings of one run with every beam; masks are applied later.

    Noise is drawn for lost beams too, so a mask changes only which readings are used.
    """

    def __init__(self, simulation: Simulation, truth: Truth, *, run: int) -> None:
        """Draws the readings of `run` as a campaign of this scenario does.

        Raises:
            ScenarioError: if a ping falls between two inertial samples; its step and the motion cannot be separated.
        """
        scenario = simulation.scenario
        key = trajectory_key(scenario.name)
        plan: Any = measurement_schedule(simulation, truth, trajectory_key=key, first_run=run)
        self.valid: NDArray[np.bool_] = plan["beam_valid"].reshape(-1, simulation.geometry.beams)
        plan["beam_valid"] = np.ones_like(self.valid)
        if not np.isin(plan["dvl_time_ns"], truth.time_ns).all():
            raise ScenarioError(
                f"scenario {scenario.name}: dvl.rate_hz {scenario.dvl.rate_hz:g} puts pings between inertial samples, "
                f"expected a divisor of imu.rate_hz {scenario.imu.rate_hz:g}"
            )
        self.simulation = simulation
        self._model = scenario.kernel_model(simulation.gravity_mps2)
        self._options = scenario.kernel_options()
        arrays: Any = truth.kernel_arrays()
        self._drawn = kernel.simulate_sensors(
            simulation.geometry,
            arrays,
            self._model,
            plan,
            seed=scenario.campaign.seed,
            trajectory_key=key,
            run=run,
            imu_sampling=scenario.imu.sampling,
            options=self._options,
        )

    @property
    def ping_time_ns(self) -> NDArray[np.int64]:
        """Times of the pings."""
        times: NDArray[np.int64] = self._drawn["dvl_time_ns"]
        return times

    def fixes(self, method: str, valid: NDArray[np.bool_], watched: Sequence[int]) -> Iterator[Fix]:
        """Runs a method with the beams of `valid`, (pings, beams), and yields the fixes of the pings `watched`.

        The run ends at the last of these pings. A ping without a fix by the method yields nothing.
        """
        navigator = kernel.Navigator(
            self.simulation.geometry,
            self._model,
            self._options,
            self._drawn["initial"],
            method=cast("kernel.Method", method),
        )
        wanted, last_ns = set(watched), int(self.ping_time_ns[max(watched)])
        # The reference method has every beam, as in a campaign.
        flags = np.ones_like(valid) if method == "lc" else valid
        pushed = 0
        imu_ns = self._drawn["imu_time_ns"]
        for time_ns, sensor, k in self._events():
            if time_ns > last_ns:
                return
            upto = int(np.searchsorted(imu_ns, time_ns, side="right"))
            if upto > pushed:
                block = slice(pushed, upto)
                navigator.push_imu_block(
                    imu_ns[block],
                    omega_p_radps=self._drawn["imu_omega_p_radps"][block],
                    force_p_mps2=self._drawn["imu_force_p_mps2"][block],
                )
                pushed = upto
            if sensor == "water_track":
                self._water(navigator, k)
            elif sensor != "dvl":
                self._aid(navigator, sensor, k, time_ns)
            elif k in wanted:
                yield from self._watched(navigator, k, flags[k])
            else:
                self._ping(navigator, k, flags[k])

    def _events(self) -> list[tuple[int, str, int]]:
        """Epochs in order of time; at the same time DVL, the others in the order of `SENSORS`, water, as the kernel."""
        order = ("dvl", *(sensor.name for sensor in SENSORS), "water_track")
        events = [
            (int(time_ns), rank, k)
            for rank, sensor in enumerate(order)
            for k, time_ns in enumerate(self._drawn[f"{sensor}_time_ns"])
        ]
        return [(time_ns, order[rank], k) for time_ns, rank, k in sorted(events)]

    def _ping(self, navigator: kernel.Navigator, k: int, valid: NDArray[np.bool_]) -> list[Any]:
        sd_mps = np.full(len(valid), self._model.of(DvlModel).beam_noise_sd_mps)
        reports: list[Any] = navigator.push_beams(
            int(self.ping_time_ns[k]), self._drawn["dvl_velocity_mps"][k], valid, sd_mps=sd_mps
        )
        return reports

    def _water(self, navigator: kernel.Navigator, k: int) -> None:
        valid, errors = self._drawn["water_track_valid"][k], self._model.of(WaterTrackModel)
        navigator.push_water_track(
            int(self._drawn["water_track_time_ns"][k]),
            self._drawn["water_track_velocity_mps"][k],
            valid,
            sd_mps=np.full(len(valid), errors.beam_noise_sd_mps),
            range_m=errors.range_m,
        )

    def _watched(self, navigator: kernel.Navigator, k: int, valid: NDArray[np.bool_]) -> Iterator[Fix]:
        before_mps, before_cov = navigator.state()["velocity_p_mps"], navigator.covariance()
        pushed = self._ping(navigator, k, valid)
        reports = [one for one in pushed if one.sensor == "beams" and one.degrees > 0]
        after_cov = navigator.covariance()
        for report in reports[:1]:
            yield Fix(
                time_ns=int(self.ping_time_ns[k]),
                step_p_mps=navigator.state()["velocity_p_mps"] - before_mps,
                before_sd_mps=np.sqrt(np.diag(before_cov)[_VELOCITY]),
                after_sd_mps=np.sqrt(np.diag(after_cov)[_VELOCITY]),
                nis=report.nis,
                degrees=report.degrees,
                used=report.verdict in {"accepted", "accepted_in_part"},
            )

    def _aid(self, navigator: kernel.Navigator, name: str, k: int, time_ns: int) -> None:
        PUSH[name](navigator, time_ns, self._drawn, k, getattr(self._model, name))
