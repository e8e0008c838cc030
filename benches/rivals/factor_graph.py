"""A fixed-lag factor graph with a factor per beam, on gtsam: preintegrated inertial readings between keyframes.

A keyframe is every time of a ping, a depth, a heading and the grid. Its variables are the navigation state (attitude,
position, velocity over ground in the tangent frame), the inertial biases, and the errors of the instruments (biases of
the first four beams, scale factor of the DVL, bias of the depth sensor). What leaves the lag is marginalised, so that
the estimate at the newest keyframe is that of a filter that relinearises over the lag.

Sources: Forster, Carlone, Dellaert & Scaramuzza, IEEE T-RO 33 (2017) 1 (preintegration); Indelman, Williams, Kaess &
Dellaert, RAS 61 (2013) 721 (incremental navigation); gtsam 4.3. README_graph.md says what is ours.
"""

import time
from dataclasses import dataclass
from typing import Any

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, D, N
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from benches.rivals.beam_factors import (
    beam_factor,
    depth_factor,
    heading_factor,
    skew,
    velocity_factor,
    walk_factor,
)
from benches.rivals.held_start import HeldStart
from bottomlock.kernel.models import Model
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]

LAG_S = 10.0
LEAST_WALK_SD = 1e-6
"""Of the position by preintegration, m²/s: readings are means, with little error of integration."""
LEAST_SD = 1e-6
INTEGRATION_VAR = 1e-12
"""Of the position by preintegration, m²/s: readings are means, with next to no error of integration."""


@dataclass(frozen=True)
class InstrumentErrors:
    """The random processes of the instrument errors: sd at the start, walk per root second, correlation time."""

    sd: Floats
    walk_rts: Floats
    time_s: Floats

    @classmethod
    def of(cls, model: Model, beams: int, *, estimated: bool) -> "InstrumentErrors":
        """Biases of up to four beams, slow errors of the heading if any, scale factor, bias of the depth sensor."""
        dvl, depth, heading, biased = model.dvl, model.depth, model.heading, min(beams, 4)
        # 1 sigma at the start, walk per root second, correlation time.
        rows = [(dvl.beam_bias_sd_mps * estimated, dvl.beam_bias_walk_mps_rts * estimated, np.inf)] * biased
        if heading is not None and (heading.offset_sd_rad > 0.0 or heading.walk_sd_rad > 0.0):
            rows.append((heading.offset_sd_rad, 0.0, np.inf))
            rows.append(
                (
                    heading.walk_sd_rad,
                    heading.walk_sd_rad * np.sqrt(2.0 / heading.walk_time_s),
                    heading.walk_time_s,
                )
            )
        rows.append((dvl.scale_factor_sd * estimated, dvl.scale_factor_walk_rts * estimated, np.inf))
        rows.append((depth.bias_sd_m, depth.bias_sd_m * np.sqrt(2.0 / depth.bias_time_s), depth.bias_time_s))
        sd, walk, times = np.array(rows).T
        return cls(sd=sd, walk_rts=walk, time_s=times)

    def decay(self, dt_s: float) -> Floats:
        """What remains of each after an interval."""
        return np.exp(-dt_s / self.time_s)

    def walk_sd(self, dt_s: float) -> Floats:
        """Standard deviation of what an interval adds."""
        return np.maximum(self.walk_rts * np.sqrt(dt_s), LEAST_WALK_SD)


def estimate(mission: Mission, *, lag_s: float = LAG_S, held_start: bool = True) -> Estimates:
    """Velocity, position and attitude at the grid, each from the readings up to its time.

    Where the mission's options have robust beams, the noise of a beam is Student's t of the options' degrees (Huber for
    Huber); otherwise Gaussian. There is no gate: a rejected reading cannot return, and the weights do its work.

    Args:
        mission: the mission.
        lag_s: length of the window that is relinearised.
        held_start: hold the velocity of the start until the first beam (held_start.py).
    """
    began = time.perf_counter()
    graph = _Graph(mission, lag_s)
    graph.held.waits = held_start
    times = _keyframe_times(mission)
    on_grid = set(mission.grid_ns.tolist())
    rows = []
    for time_ns in times:
        graph.advance(int(time_ns))
        if int(time_ns) in on_grid:
            rows.append(graph.head())
    velocity, velocity_cov, position, position_cov, attitude = (
        np.stack(column) for column in zip(*rows, strict=True)
    )
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=velocity,
        velocity_cov=velocity_cov,
        position_t_m=position,
        position_cov=position_cov,
        attitude_t_p=attitude,
        wall_s=time.perf_counter() - began,
    )


def _keyframe_times(mission: Mission) -> NDArray[np.int64]:
    streams = (mission.pings, mission.depth, mission.heading)
    times = np.unique(np.concatenate([*(stream.time_ns for stream in streams), mission.grid_ns]))
    return times[(times > mission.start.time_ns) & (times <= mission.imu.time_ns[-1])]


class _Graph:
    """The smoother and the readings that it has not taken yet."""

    def __init__(self, mission: Mission, lag_s: float) -> None:
        model = mission.model
        self.mission, self.count = mission, 0
        self.time_ns = mission.start.time_ns
        self.errors = InstrumentErrors.of(
            model, mission.geometry.beams, estimated=mission.options.estimate_dvl
        )
        environment = model.environment
        self.earth_rate_t = environment.earth_rate_radps * np.array(
            [np.cos(environment.latitude_rad), 0.0, -np.sin(environment.latitude_rad)]
        )
        self.preintegration = self._preintegration()
        self.at = int(np.searchsorted(mission.imu.time_ns, self.time_ns, side="right"))
        self.last_omega_p = mission.imu.omega_p_radps[max(self.at - 1, 0)]
        parameters = gtsam.LevenbergMarquardtParams()
        # Information from 1e-2 to 1e12 stands in one graph.
        parameters.setLinearSolverType("MULTIFRONTAL_QR")
        # Not the incremental smoother: where beams leave a direction of the velocity unobserved, it finds information
        # where there is none, and diverges (README_graph.md).
        self.smoother = gtsam.BatchFixedLagSmoother(lag_s, parameters)
        self.held = HeldStart(mission)
        self.state, self.bias, self.instrument = self._start()

    def _preintegration(self) -> Any:  # noqa: ANN401 - gtsam has no types
        """Gravity down, and the turning of the frame with the Earth, to first order in an interval."""
        imu = self.mission.model.imu
        parameters = gtsam.PreintegrationParams.MakeSharedD(self.mission.model.environment.gravity_mps2)
        parameters.setAccelerometerCovariance(np.eye(3) * imu.accel_noise_mps_rts**2)
        parameters.setGyroscopeCovariance(np.eye(3) * imu.gyro_noise_rad_rts**2)
        parameters.setIntegrationCovariance(np.eye(3) * INTEGRATION_VAR)
        parameters.setOmegaCoriolis(self.earth_rate_t)
        return parameters

    def _start(self) -> tuple[Any, Any, Floats]:
        """The prior at the start, in the axes of gtsam's navigation state: the platform's."""
        start, initial, imu = self.mission.start, self.mission.model.initial, self.mission.model.imu
        rotation = gtsam.Rot3.Quaternion(*start.attitude_t_p)
        matrix, velocity_p = rotation.matrix(), np.asarray(start.velocity_p_mps)
        state = gtsam.NavState(rotation, start.position_t_m, matrix @ velocity_p)
        # Attitude, position and velocity by the errors that the model states: ρ and r in the tangent frame, v in the
        # platform's. With R Exp(θ), θ = Rᵀ ρ and R dV = R δv + ρ × R v.
        turn = np.zeros((9, 9))
        turn[0:3, 0:3] = turn[3:6, 3:6] = matrix.T
        turn[6:9, 0:3] = -skew(velocity_p) @ matrix.T
        turn[6:9, 6:9] = np.eye(3)
        sd = np.concatenate([initial.attitude_sd_rad, initial.position_sd_m, initial.velocity_sd_mps])
        covariance = turn @ np.diag(np.maximum(sd, LEAST_SD) ** 2) @ turn.T
        bias_sd = np.repeat([imu.accel_bias_sd_mps2, imu.gyro_bias_sd_radps], 3)
        instrument = np.zeros(len(self.errors.sd))
        bias = gtsam.imuBias.ConstantBias()
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.add(gtsam.PriorFactorNavState(N(0), state, gtsam.noiseModel.Gaussian.Covariance(covariance)))
        graph.add(gtsam.PriorFactorConstantBias(B(0), bias, _sigmas(np.maximum(bias_sd, 1e-9))))
        instrument_sd = np.maximum(self.errors.sd, LEAST_SD)
        graph.add(gtsam.PriorFactorVector(D(0), instrument, _sigmas(instrument_sd)))
        values.insert(N(0), state)
        values.insert(B(0), bias)
        values.insert(D(0), instrument)
        self.smoother.update(graph, values, dict.fromkeys([N(0), B(0), D(0)], self.time_ns * 1e-9))
        return state, bias, instrument

    def advance(self, time_ns: int) -> None:
        """A keyframe at a time, with all that was measured then."""
        dt_s = (time_ns - self.time_ns) * 1e-9
        i, j = self.count, self.count + 1
        motion = self._integrate(time_ns)
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.add(gtsam.ImuFactor2(N(i), N(j), B(i), motion))
        imu = self.mission.model.imu
        walk = np.repeat([imu.accel_bias_walk_mps2_rts, imu.gyro_bias_walk_radps_rts], 3) * np.sqrt(dt_s)
        no_change = gtsam.imuBias.ConstantBias()
        graph.add(gtsam.BetweenFactorConstantBias(B(i), B(j), no_change, _sigmas(np.maximum(walk, 1e-9))))
        decay = self.errors.decay(dt_s)
        graph.add(walk_factor(D(i), D(j), decay, self.errors.walk_sd(dt_s)))
        values.insert(N(j), motion.predict(self.state, self.bias))
        values.insert(B(j), self.bias)
        values.insert(D(j), decay * self.instrument)
        for factor in self._measured(time_ns, j):
            graph.add(factor)
        self.smoother.update(graph, values, dict.fromkeys([N(j), B(j), D(j)], time_ns * 1e-9))
        estimate = self.smoother.calculateEstimate()
        self.state = estimate.atNavState(N(j))
        self.bias = estimate.atConstantBias(B(j))
        self.instrument = estimate.atVector(D(j))
        self.count, self.time_ns = j, time_ns

    def _integrate(self, time_ns: int) -> Any:  # noqa: ANN401 - gtsam has no types
        """Preintegration from the last keyframe; a mean that reaches beyond this one is taken in two parts.

        gtsam 4.3a0 turns the attitude with the Earth at the end of the interval, not the forces within it: at 1 Hz that
        leaves Ω × f T/2, 3e-4 m/s² or 30 µg, out. So the forces are turned here, by the attitude as it is estimated.
        """
        imu = self.mission.imu
        motion = gtsam.PreintegratedImuMeasurements(self.preintegration, self.bias)
        earth_p = self.state.attitude().matrix().T @ self.earth_rate_t
        now = self.time_ns
        while now < time_ns:
            end = min(int(imu.time_ns[self.at]), time_ns)
            force_p, omega_p = imu.force_p_mps2[self.at], imu.omega_p_radps[self.at]
            since_s = (0.5 * (now + end) - self.time_ns) * 1e-9
            turned_p = skew(motion.deltaRij().unrotate(earth_p)) @ force_p * since_s
            motion.integrateMeasurement(force_p - turned_p, omega_p, (end - now) * 1e-9)
            self.last_omega_p, self.last_step_s = omega_p, (end - now) * 1e-9
            if end == imu.time_ns[self.at]:
                self.at += 1
            now = end
        return motion

    def _measured(self, time_ns: int, j: int) -> list[Any]:
        """The factors of all readings at a time."""
        mission, model, factors = self.mission, self.mission.model, []
        for k in _rows(mission.pings.time_ns, time_ns):
            readings = mission.pings.velocity_mps[k]
            valid = np.flatnonzero(mission.pings.valid[k])
            if self.held.holds(mission.pings.valid[k]):
                velocity, cov = self.held.velocity((time_ns - mission.start.time_ns) * 1e-9)
                noise = gtsam.noiseModel.Gaussian.Covariance(cov)
                factors.append(velocity_factor(N(j), velocity, noise))
            factors.extend(self._beam(int(beam), float(readings[beam]), j) for beam in valid)
        for k in _rows(mission.depth.time_ns, time_ns):
            lever = np.asarray(mission.options.depth_lever_p_m)
            size = len(self.instrument)
            factors.append(
                depth_factor(N(j), D(j), float(mission.depth.value[k]), lever, size, model.depth.sd_m)
            )
        for k in _rows(mission.heading.time_ns, time_ns):
            assert model.heading is not None
            biased, size = min(mission.geometry.beams, 4), len(self.instrument)
            slow = range(biased, size - 2)
            factors.append(
                heading_factor(N(j), D(j), float(mission.heading.value[k]), slow, size, model.heading.sd_rad)
            )
        return factors

    def _beam(self, beam: int, reading_mps: float, j: int) -> Any:  # noqa: ANN401 - gtsam has no types
        geometry, model = self.mission.geometry, self.mission.model
        direction, lever = geometry.directions_p[beam], geometry.lever_arms_p_m[beam]
        scale = 1.0 / geometry.sound_speed_scale
        # Eq. 20, but for the covariance that the gyro noise gives to two beams through their lever arms.
        gyro_var = model.imu.gyro_noise_rad_rts**2 / self.last_step_s
        across = np.cross(lever, direction)
        sd = np.sqrt((model.dvl.beam_noise_sd_mps * scale) ** 2 + gyro_var * across @ across)
        return beam_factor(
            (N(j), B(j), D(j)),
            reading_mps * scale,
            direction,
            lever,
            self.last_omega_p,
            self.earth_rate_t,
            bias_row=beam if beam < 4 else None,
            size=len(self.instrument),
            noise=_beam_noise(self.mission.options.robust, float(sd)),
        )

    def head(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Velocity, its covariance, position, its covariance and attitude at the newest keyframe."""
        covariance = self._covariance()
        rotation = self.state.attitude().matrix()
        velocity_p = rotation.T @ self.state.velocity()
        # v = Rᵀ v_t with R Exp(θ) and v_t + R dV: δv = v × θ + dV.
        by_state = np.hstack([skew(velocity_p), np.zeros((3, 3)), np.eye(3)])
        w, x, y, z = (getattr(self.state.attitude().toQuaternion(), name)() for name in "wxyz")
        return (
            velocity_p,
            by_state @ covariance @ by_state.T,
            self.state.position(),
            rotation @ covariance[3:6, 3:6] @ rotation.T,
            np.array([w, x, y, z]),
        )

    def _covariance(self) -> Floats:
        """Marginal covariance of the newest navigation state, by a QR of the whole window.

        Not by the smoother's own `marginalCovariance`, which inverts an information matrix: where the window holds
        certain and uncertain errors together, it came out 229 times too large in a test.
        """
        window = self.smoother.getFactors().linearize(self.smoother.calculateEstimate())
        newest, order = N(self.count), gtsam.Ordering()
        for key in (*sorted(key for key in self.smoother.timestamps() if key != newest), newest):
            order.push_back(key)
        (factor,) = qr(window.jacobian(order)[0], mode="r", check_finite=False, overwrite_a=True)
        columns = factor.shape[1]
        last = factor[columns - 9 : columns, columns - 9 :]
        inverse = solve_triangular(last, np.eye(9))
        return np.asarray(inverse @ inverse.T)


def _beam_noise(robust: Any, sd: float) -> Any:  # noqa: ANN401 - gtsam has no types
    """Student's t of ν degrees as gtsam's Cauchy: their weights (ν + 1)/(ν + x²) over σ² are the same."""
    if robust is None or robust.tail == "gaussian":
        return _sigmas(np.array([sd]))
    estimators = gtsam.noiseModel.mEstimator
    if robust.tail == "huber":
        loss = estimators.Huber.Create(robust.huber_threshold)
        return gtsam.noiseModel.Robust.Create(loss, _sigmas(np.array([sd])))
    degrees = robust.student_t_degrees
    inner = _sigmas(np.array([sd * np.sqrt(degrees / (degrees + 1.0))]))
    return gtsam.noiseModel.Robust.Create(
        estimators.Cauchy.Create(np.sqrt(degrees) * sd / inner.sigmas()[0]), inner
    )


def _sigmas(sd: Floats) -> Any:  # noqa: ANN401 - gtsam has no types
    return gtsam.noiseModel.Diagonal.Sigmas(sd)


def _rows(times: NDArray[np.int64], time_ns: int) -> range:
    return range(*np.searchsorted(times, [time_ns, time_ns + 1]))
