//! The streaming navigator.

#[path = "navigator_lock.rs"]
mod lock;

use bottomlock::aiding::acoustic_position::AcousticPositionSample;
use bottomlock::aiding::registry::SensorModels;
use bottomlock::mechanisation::{IMU_FAULTS, ImuSample};
use bottomlock::navigator::events::{
    AttitudeSample, DepthSample, Event, GpsSample, GpsVelocity, HeadingSample, STREAM_NAMES, ThrustSample,
    VelocitySample, WaterSample,
};
use bottomlock::navigator::{LiveNavigator, Navigator as Filters, RECOMMENDED_METHOD, Snapshot};
use nalgebra::Matrix3;
use numpy::PyArrayDyn;
use pyo3::types::{PyBytes, PyType};

use crate::arrays::{by_name, floats, vec3, vector};
use crate::beam_arrays::ping;
use crate::imu_faults::samples;
use crate::prelude::*;
use crate::report::Report;
use crate::results::entries;
use crate::shared::Shared;
use crate::state::{state, state_dict};

/// The event of a sample.
macro_rules! event {
    ($sample:expr) => {
        Event::from($sample)
    };
}

/// What a push returns.
type Reports = PyResult<Vec<Report>>;
/// What is estimated beside the state, none where it is not.
type Estimate<'py> = PyResult<Option<Bound<'py, PyDict>>>;

/// An aided inertial navigator for live use, one sample at a time. Its estimates are those of a campaign, bit for bit.
///
/// A measurement between two IMU samples is processed with the later one; the strapdown step is split at the measurement's own
/// time. A measurement that arrives late, up to `horizon_ns`, is put in its place, and everything after it is processed again: any
/// order of arrival ends in the bits of the log in order of time (docs/late_data.md). A later one, and an inertial reading that
/// is late, raises an error and is counted in `late_events`.
///
/// Args:
///     geometry: the beams.
///     model: environment and sensor errors in SI (`Scenario.kernel_model`).
///     options: filter options (`Scenario.kernel_options`).
///     initial: time_ns, position_t_m, attitude_t_p (scalar first), velocity_p_mps; biases and scale factor are optional.
///     method: aiding method: ins, lc, tc, vb, nsv, plcf, vhv, elc, info, weak_sway or sway_current. The default is
///         `RECOMMENDED_METHOD`, sway_current, for a slender vehicle unless the options say otherwise; tc assumes nothing of it.
///     covariance: (20, 20) covariance at the start; the model's by default.
///     horizon_ns: how late a measurement may be, behind the last good inertial reading: 0 (none) to 10 s; 2 s by default.
///
/// Every push returns the reports of the measurements that it processed: innovation, its covariance, NIS, verdict; and, with
/// `revised` true, those reported before that a late sample has changed. An inertial reading at or beyond the full scale of the options, or stuck, is rejected: its report has the sensor "imu", the
/// verdict "rejected" and the reason (docs/imu_faults.md).
///
/// Raises:
///     KernelError: for numbers that are not finite or that no instrument has, wrong shapes, time that does not increase
///         within a stream or lies before the filter's, and a gap between inertial readings longer than `max_gap_s`. A
///         push that is refused changes nothing but the count of late events. The error has `taken`, the number of
///         readings that `push_imu_block` took before it, and `reports`, theirs.
///
/// A navigator may be used by several threads: a lock inside takes their calls one after another, each whole. The order of
/// samples is then that of the calls, so one thread should push. `save` and `load`, `copy` and `pickle` keep the whole state: the
/// restored navigator goes on bit for bit.
#[pyclass(frozen, module = "bottomlock._kernel")]
pub struct Navigator {
    inner: Shared<LiveNavigator>,
    sensors: SensorModels,
    beams: usize,
}

#[pymethods]
impl Navigator {
    #[new]
    #[pyo3(
        signature = (geometry, model, options, initial, *, method=None, covariance=None, horizon_ns=None),
        text_signature = "(geometry, model, options, initial, *, method=None, covariance=None, horizon_ns=None)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        geometry: Argument,
        model: Argument,
        options: Argument,
        initial: Argument,
        method: Option<Argument>,
        covariance: Option<Argument>,
        horizon_ns: Option<Argument>,
    ) -> PyResult<Self> {
        let horizon_ns = lock::horizon(horizon_ns)?;
        let geometry = crate::dvl::geometry(geometry)?;
        let aiding = match method {
            None => settings::method(RECOMMENDED_METHOD)?.aiding,
            Some(method) => {
                let named = py.import("bottomlock.own_method")?.call_method1("name_of", (method,))?;
                settings::method(&named.extract::<String>()?)?.aiding
            }
        };
        let (model, options) = (settings::model(model)?, settings::options(options)?);
        let initial = state("initial", initial)?;
        let mut inner = LiveNavigator::new(initial, &geometry, aiding, &model, &options, horizon_ns).map_err(raise)?;
        if let Some(covariance) = crate::state::covariance(covariance)? {
            inner.set_covariance(&covariance).map_err(raise)?;
        }
        Ok(Self::of(Snapshot {
            live: inner,
            sensors: model.sensors,
        }))
    }

    /// A navigator that begins by itself from names and the readings that are pushed to it.
    ///
    /// Level by the accelerometers over five seconds, velocity by a ping of three beams or more, depth by the depth sensor.
    ///
    /// Args:
    ///     dvl: name of a packaged geometry, its file, the keys of [dvl] of a live configuration, or what `read_geometry` returns.
    ///     imu: name of a grade, the keys of [imu], or an `ImuModel`.
    ///     latitude_deg: of the place, deg.
    ///     heading_deg: of the platform at the start, deg; None where a section `attitude` gives it.
    ///     heading_sd_deg: its 1 sigma, deg; None is 2.
    ///     method: of aiding: its name, or a class of one's own; None is `RECOMMENDED_METHOD`.
    ///     sections: keys of further sections of a live configuration, such as depth={"sd_m": 0.1}. `depth` has its defaults where
    ///         it is left out; None takes a section away.
    ///
    /// Returns:
    ///     A `StartedNavigator`.
    ///
    /// Raises:
    ///     ScenarioError: for an unknown name, section or key, a value out of range, and a start that nobody gives.
    #[staticmethod]
    #[pyo3(
        signature = (**given),
        text_signature = "(*, dvl, imu, latitude_deg, heading_deg=None, heading_sd_deg=None, method=None, **sections)"
    )]
    fn start<'py>(py: Python<'py>, given: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        py.import("bottomlock.live.started")?.getattr("start")?.call((), given)
    }

    /// An inertial reading: angular rate relative to inertial space and specific force in the platform frame, (3,) each, rad/s and
    /// m/s²; at rest and level force_p_mps2 is (0, 0, -9.8).
    ///
    /// Raises KernelError, and takes nothing, for numbers that are not finite or a time that does not come after the last, and
    /// after the first second for a mean specific force far from gravity: in g, or swapped with the rate.
    #[pyo3(signature = (time_ns, *, omega_p_radps, force_p_mps2))]
    fn push_imu(&self, py: Python<'_>, time_ns: i64, omega_p_radps: Argument, force_p_mps2: Argument) -> Reports {
        let (rate_p_radps, force_p_mps2) = (
            vec3("omega_p_radps", omega_p_radps)?,
            vec3("force_p_mps2", force_p_mps2)?,
        );
        self.push(
            py,
            [event! { Event::Imu(ImuSample { time_ns, rate_p_radps, force_p_mps2 }) }],
        )
    }

    /// Many inertial readings: time_ns (n,) int64, omega_p_radps (n, 3), force_p_mps2 (n, 3).
    ///
    /// An error refuses the reading that it names and those after it; the readings before it are taken, and the error's `taken`
    /// is their number and `reports` their reports.
    #[pyo3(signature = (time_ns, *, omega_p_radps, force_p_mps2))]
    fn push_imu_block(&self, time_ns: Argument, omega_p_radps: Argument, force_p_mps2: Argument) -> Reports {
        let readings = samples(time_ns, omega_p_radps, force_p_mps2)?;
        self.push(time_ns.py(), readings.into_iter().map(Event::Imu))
    }

    /// A ping: velocity_mps, valid and sd_mps, each (beams,); entries of invalid beams may be NaN. A beam that is masked (numpy.ma)
    /// is not valid.
    #[pyo3(signature = (time_ns, velocity_mps, valid, *, sd_mps))]
    fn push_beams(&self, time_ns: i64, velocity_mps: Argument, valid: Argument, sd_mps: Argument) -> Reports {
        let ping = ping(time_ns, [velocity_mps, valid, sd_mps], self.beams)?;
        self.push(valid.py(), [Event::Beams(ping)])
    }

    /// Beams that the water returned, as `push_beams` and with its sign: a beam reads positive when the vehicle moves along it through
    /// the water. `range_m` leads from the transducer along the beam to the middle of the cell, m. For options with
    /// `water_track`.
    #[pyo3(signature = (time_ns, velocity_mps, valid, *, sd_mps, range_m=0.0))]
    fn push_water_track(
        &self,
        time_ns: i64,
        velocity_mps: Argument,
        valid: Argument,
        sd_mps: Argument,
        range_m: f64,
    ) -> Reports {
        let ping = ping(time_ns, [velocity_mps, valid, sd_mps], self.beams)?;
        self.push(valid.py(), [Event::WaterTrack(WaterSample { ping, range_m })])
    }

    /// A velocity solved by the instrument: (3,) in the platform frame, with its (3, 3) covariance.
    #[pyo3(signature = (time_ns, velocity_p_mps, *, cov_m2ps2))]
    fn push_velocity(&self, time_ns: i64, velocity_p_mps: Argument, cov_m2ps2: Argument) -> Reports {
        let py = cov_m2ps2.py();
        let cov = floats("cov_m2ps2", cov_m2ps2, &[Some(3), Some(3)])?.values;
        let (velocity_p_mps, cov_m2ps2) = (vec3("velocity_p_mps", velocity_p_mps)?, Matrix3::from_row_slice(&cov));
        self.push(py, [event! { VelocitySample { time_ns, velocity_p_mps, cov_m2ps2 } }])
    }

    /// A depth below the tangent plane's origin, m.
    #[pyo3(signature = (time_ns, depth_m, *, sd_m))]
    fn push_depth(&self, py: Python<'_>, time_ns: i64, depth_m: f64, sd_m: f64) -> Reports {
        self.push(py, [event! { DepthSample { time_ns, depth_m, sd_m } }])
    }

    /// An attitude (4,), scalar first, with the standard deviations of its Euler angles.
    #[pyo3(signature = (time_ns, attitude_t_p, *, roll_pitch_sd_rad, yaw_sd_rad))]
    fn push_attitude(&self, time_ns: i64, attitude_t_p: Argument, roll_pitch_sd_rad: f64, yaw_sd_rad: f64) -> Reports {
        let py = attitude_t_p.py();
        let attitude_t_p = settings::attitude("attitude_t_p", attitude_t_p)?;
        self.push(
            py,
            [event! { AttitudeSample { time_ns, attitude_t_p, roll_pitch_sd_rad, yaw_sd_rad } }],
        )
    }

    /// A yaw angle alone, rad.
    #[pyo3(signature = (time_ns, yaw_rad, *, sd_rad))]
    fn push_heading(&self, py: Python<'_>, time_ns: i64, yaw_rad: f64, sd_rad: f64) -> Reports {
        self.push(py, [event! { HeadingSample { time_ns, yaw_rad, sd_rad } }])
    }

    /// Speed through the water along surge, sway and heave, (3,), m/s, that the vehicle's drives say, 0 along an axis that is not driven,
    /// with the white noise of each, 1 sigma. For options with `thrust`.
    #[pyo3(signature = (time_ns, speed_p_mps, *, sd_mps))]
    fn push_thrust(&self, py: Python<'_>, time_ns: i64, speed_p_mps: Argument, sd_mps: f64) -> Reports {
        let speed_p_mps = vec3("speed_p_mps", speed_p_mps)?;
        self.push(py, [event! { ThrustSample { time_ns, speed_p_mps, sd_mps } }])
    }

    /// A GPS position and velocity in the tangent frame, each (3,), with standard deviations (3,).
    #[pyo3(signature = (time_ns, position_t_m, velocity_t_mps, *, position_sd_m, velocity_sd_mps))]
    fn push_gps(
        &self,
        time_ns: i64,
        position_t_m: Argument,
        velocity_t_mps: Argument,
        position_sd_m: Argument,
        velocity_sd_mps: Argument,
    ) -> Reports {
        let py = position_t_m.py();
        self.push(
            py,
            [event! { GpsSample {
                time_ns,
                position_t_m: vec3("position_t_m", position_t_m)?,
                position_sd_m: vector("position_sd_m", position_sd_m)?,
                velocity: Some(GpsVelocity {
                    velocity_t_mps: vec3("velocity_t_mps", velocity_t_mps)?,
                    sd_mps: vector("velocity_sd_mps", velocity_sd_mps)?,
                }),
            } }],
        )
    }

    /// A position alone of the GPS antenna in the tangent frame (3,), with its standard deviations (3,).
    #[pyo3(signature = (time_ns, position_t_m, *, position_sd_m))]
    fn push_position(&self, time_ns: i64, position_t_m: Argument, position_sd_m: Argument) -> Reports {
        let py = position_t_m.py();
        let (position_t_m, position_sd_m) = (
            vec3("position_t_m", position_t_m)?,
            vector("position_sd_m", position_sd_m)?,
        );
        self.push(
            py,
            [event! { GpsSample { time_ns, position_t_m, position_sd_m, velocity: None } }],
        )
    }

    /// An acoustic position fix (USBL, LBL) of the transponder in the tangent frame (3,), with its standard deviations (3,); without
    /// them, with those of the model at the fix's slant range from the transceiver.
    #[pyo3(signature = (*, time_ns, position_t_m, sd_m=None))]
    fn push_acoustic_position(&self, time_ns: i64, position_t_m: Argument, sd_m: Option<Argument>) -> Reports {
        let position = vec3("position_t_m", position_t_m)?;
        let sd_m = sd_m.map(|sd_m| vector("sd_m", sd_m)).transpose()?;
        let sample = AcousticPositionSample::new(time_ns, position, sd_m, &self.sensors.acoustic_position);
        self.push(position_t_m.py(), [Event::from(sample)])
    }

    /// The whole navigator as bytes, with a format number and a digest: filters, counts of late samples, and the samples within
    /// the horizon, 57 bytes for each inertial reading.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.snapshot(py)?.to_bytes().map_err(raise)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// The navigator of the bytes that `save` returned; it goes on as the saved one does, bit for bit.
    ///
    /// Raises KernelError for bytes that are damaged, cut short, no navigator, or saved by another version.
    #[classmethod]
    fn load(_cls: &Bound<'_, PyType>, data: &[u8]) -> PyResult<Self> {
        Snapshot::from_bytes(data).map(Self::of).map_err(raise)
    }

    /// A copy that goes its own way; some microseconds.
    fn __copy__(&self, py: Python<'_>) -> PyResult<Self> {
        self.snapshot(py).map(Self::of)
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> PyResult<Self> {
        self.__copy__(py)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((slf.get_type().getattr("load")?, (slf.get().save(slf.py())?,)))
    }

    /// Number of samples of each stream that arrived too late and were not used.
    ///
    /// A sample is too late if its time of validity lies before the start, or behind the last good IMU sample by more than
    /// `horizon_ns`. Of two samples of one stream at one time one is used, always the same one; the other is counted here too.
    fn late_events<'py>(&self, py: Python<'py>) -> Dict<'py> {
        by_name(py, &STREAM_NAMES, &self.with(py, |inner| *inner.late_events())?)
    }

    /// Number of inertial readings that were rejected, by reason (out_of_range, clipped, stuck, jumped), and of gaps longer than
    /// `max_gap_s` that were bridged with inflation (inflated_gaps).
    fn imu_faults<'py>(&self, py: Python<'py>) -> Dict<'py> {
        by_name(py, &IMU_FAULTS, &self.with(py, |inner| *inner.imu_faults())?)
    }

    /// Drops the measurements that wait for the next inertial reading, where they make its push fail; returns their number.
    fn discard_waiting(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, LiveNavigator::discard_waiting)
    }

    /// The estimate at the time of the last IMU sample.
    fn state<'py>(&self, py: Python<'py>) -> Dict<'py> {
        state_dict(py, &self.with(py, |inner| inner.navigator().state())?)
    }

    /// The (20, 20) covariance at that time; the call changes nothing.
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        entries(py, &[], [self.with(py, |inner| inner.navigator().covariance())?])
    }

    /// Estimate of the motion through the water after the last update, by every method with `options.water_track` or `thrust`, else by
    /// "sway_current"; None elsewhere.
    ///
    /// current_t_mps (2,), north and east at the vehicle's depth, with its covariance current_covariance (2, 2), in which the
    /// heading's error is; sway gain and trim; slips with their estimated standard deviations and time constants; the number of
    /// restarts of the assumptions and of alarms that widened the slip; and the (6, 6) covariance of current, gain, trim, sway slip
    /// and heave slip, in which the current is along the estimated heading.
    ///
    /// With layers (`options.current_layers`) the current in the (6, 6) covariance is what all depths have in common, and
    /// `layers` has depth_m (L,), current_t_mps (L, 2), current_covariance (L, 2, 2) and age_s (L,), the time since a layer was
    /// measured last, infinite for one that was not; without layers L is 0.
    fn water<'py>(&self, py: Python<'py>) -> Estimate<'py> {
        let of = |filters: &Filters| {
            let (estimate, covariance) = filters.water_estimate().zip(filters.filter().water_covariance())?;
            Some((estimate, covariance, filters.layer_estimates()))
        };
        self.estimate(py, of, |out, (estimate, covariance, layers)| {
            fields! { out, estimate => current_t_mps, current_covariance, sway_gain_m, trim_heave_mps, sway_slip_mps }
            fields! { out, estimate => heave_slip_mps, sway_slip_sd_mps, heave_slip_sd_mps, sway_slip_time_s }
            fields! { out, estimate => heave_slip_time_s, restarts, alarms }
            out.entry("covariance", covariance)?;
            let by_depth = PyDict::new(py);
            let shape = [layers.len()];
            columns! { by_depth, &shape, layers.iter() => depth_m, current_t_mps, current_covariance, age_s }
            out.set_item("layers", by_depth)
        })
    }

    /// Estimate of what the drives make of the speed through the water after the last update; None where `options.thrust` is off.
    ///
    /// Along surge, sway and heave each: scale, the speed over that which they say; slip_mps, what the vehicle is faster; and the
    /// (6, 6) covariance of both, in this order. Zero for an axis that is not used.
    fn thrust<'py>(&self, py: Python<'py>) -> Estimate<'py> {
        self.estimate(py, Filters::thrust_estimate, |out, estimate| {
            fields! { out, estimate => scale, slip_mps, covariance }
            Ok(())
        })
    }

    /// Estimated error of the attitude reference in roll, pitch and yaw, offset and walk together, after the last update; None
    /// where `model.magnetometer` has no slow errors.
    ///
    /// error_rad (3,) and its 1 sigma, sd_rad (3,).
    fn attitude_error<'py>(&self, py: Python<'py>) -> Estimate<'py> {
        self.estimate(py, |filters| filters.filter().attitude_error_rad(), slow_error)
    }

    /// Estimated error of the heading sensor, offset and walk together, after the last update; None where `model.heading` has
    /// no slow errors.
    ///
    /// error_rad (1,) and its 1 sigma, sd_rad (1,).
    fn heading_error<'py>(&self, py: Python<'py>) -> Estimate<'py> {
        let of = |filters: &Filters| filters.filter().heading_error_rad();
        self.estimate(py, of, |out, error| slow_error(out, [error]))
    }

    /// Estimate of the DVL's mounting and clock after the last update; None where `options.calibration` is off.
    ///
    /// mounting_rad (3,), the rotation from the stated mounting about forward, right and down; clock_s, the time to add to the
    /// stamps; the (4, 4) covariance of both.
    fn calibration<'py>(&self, py: Python<'py>) -> Estimate<'py> {
        self.estimate(py, Filters::calibration_estimate, |out, estimate| {
            fields! { out, estimate => mounting_rad, clock_s, covariance }
            Ok(())
        })
    }
}

/// Estimates with their standard deviations, rad.
fn slow_error<const N: usize>(out: &Bound<'_, PyDict>, errors: [(f64, f64); N]) -> PyResult<()> {
    out.entry("error_rad", errors.map(|(error, _)| error))?;
    out.entry("sd_rad", errors.map(|(_, sd)| sd))
}
