//! A recorded log through the event loop.

use bottomlock::aiding::calibration::{CALIBRATION, CalibrationCovariance};
use bottomlock::aiding::current_layers::LAYER_STATES;
use bottomlock::aiding::registry::{Measurement, SENSORS, SensorKind};
use bottomlock::aiding::water::WATER;
use bottomlock::aiding::water_track::WaterSample;
use bottomlock::dvl::geometry::BeamSample;
use bottomlock::filter::current::CurrentEstimate;
use bottomlock::frames::{Platform, Rot, Tangent};
use bottomlock::layout::DIM;
use bottomlock::mechanisation::ImuSample;
use bottomlock::model::Model;
use bottomlock::replay as core;
use bottomlock::replay::{Log, PingRecord, Replay, STREAM_NAMES, STREAMS, Series, Track};
use bottomlock::state::NavState;
use nalgebra::{Matrix2, Vector2};

use crate::arrays::{booleans, by_name, floats, times};
use crate::beam_arrays::{pings, water_samples};
use crate::calls::interruptible;
use crate::imu_faults::put_faults;
use crate::keys::{Keys, read};
use crate::memory::product;
use crate::prelude::*;
use crate::replay_records::{put_innovations, put_pings, put_sensors};
use crate::state::state;

struct OwnedLog {
    imu: Vec<ImuSample>,
    pings: Vec<BeamSample>,
    sensors: [Vec<Measurement>; SENSORS],
    water_track: Vec<WaterSample>,
    withheld: [Vec<bool>; STREAMS],
}

impl OwnedLog {
    fn read(value: Argument, beams: usize, model: &Model) -> PyResult<Self> {
        read("log", value, |keys| {
            let imu_ns = keys.with("imu_time_ns", times)?;
            let rates = numbers(keys, "omega_p_radps", imu_ns.len(), 3)?;
            let forces = numbers(keys, "force_p_mps2", imu_ns.len(), 3)?;
            let mut sensors: [Vec<Measurement>; SENSORS] = Default::default();
            for kind in SensorKind::ALL {
                sensors[kind as usize] = Self::measurements(keys, kind, model)?;
            }
            let sd_mps = model.sensors.dvl.beam_noise_sd_mps;
            let mut log = Self {
                imu: ImuSample::of_columns(&imu_ns, rates.as_chunks().0, forces.as_chunks().0).collect(),
                pings: pings(keys, "dvl_time_ns", "beam", beams, sd_mps)?,
                sensors,
                water_track: water_samples(keys, beams, sd_mps)?,
                withheld: Default::default(),
            };
            for (name, withheld) in STREAM_NAMES.iter().zip(&mut log.withheld).skip(1) {
                let flags = |name: &str, value: Argument| Ok(booleans(name, value, &[None])?.values);
                *withheld = keys.given(&format!("{name}_withheld"), flags)?.unwrap_or_default();
            }
            Ok(log)
        })
    }

    /// The rows of a sensor, under `<stream>_time_ns` and its columns; none where the log names none of them.
    fn measurements(keys: &Keys<'_>, kind: SensorKind, model: &Model) -> PyResult<Vec<Measurement>> {
        let declaration = kind.declaration();
        let times_key = format!("{}_time_ns", declaration.stream);
        let mut named = !declaration.log.is_empty() && keys.has(&times_key)?;
        for column in declaration.log {
            named |= keys.has(column.key)?;
        }
        if !named {
            return Ok(Vec::new());
        }
        let time_ns = keys.with(&times_key, times)?;
        let mut columns = Vec::new();
        for column in declaration.log {
            if column.optional && !keys.has(column.key)? {
                columns.push(None);
                continue;
            }
            let values = numbers(keys, column.key, time_ns.len(), column.width)?;
            for (row, quaternion) in values.as_chunks().0.iter().enumerate().filter(|_| column.width == 4) {
                let place = format!("{}[{row}]", keys.path(column.key));
                Rot::<Tangent, Platform>::from_unit_wxyz(&place, *quaternion).map_err(raise)?;
            }
            columns.push(Some(values));
        }
        Ok(declaration.of_rows(&time_ns, &columns, &model.sensors))
    }

    fn log(&self) -> Log<'_> {
        Log {
            imu: &self.imu,
            pings: &self.pings,
            sensors: self.sensors.each_ref().map(Vec::as_slice),
            water_track: &self.water_track,
        }
    }
}

/// Numbers of a key, `count` rows of a width; without rows any empty list.
fn numbers(keys: &Keys<'_>, key: &str, count: usize, width: usize) -> PyResult<Vec<f64>> {
    let value = keys.item(key)?;
    if count == 0 && value.len()? == 0 {
        return Ok(Vec::new());
    }
    let shape = &[Some(count), Some(width)][..if width == 1 { 1 } else { 2 }];
    Ok(floats(&keys.path(key), &value, shape)?.values)
}

/// Runs methods side by side along a recorded log. The filters are those of a campaign and of `Navigator`, bit for bit.
///
/// Streams may have different times. The log is merged by time of validity (ties: IMU, DVL, then the others in the order of
/// `SENSORS`), and a measurement between two inertial readings splits the strapdown step at its own time. Rows before the start or
/// after the last inertial reading are not used; `unused` counts them.
///
/// Args:
///     geometry: the beams.
///     model: environment and assumed sensor errors, SI; also the standard deviations of depth, heading,
///         attitude and GPS position, and of the beams where the log has none.
///     options: filter options.
///     methods: names of `METHODS`; each has the log's valid beams only, lc too.
///     log: imu_time_ns (N,) int64 with force_p_mps2 (N, 3) and omega_p_radps (N, 3), angular rate relative to inertial space;
///         dvl_time_ns (E,) with beam_velocity_mps and beam_valid (E, B) and optionally beam_sd_mps (E, B);
///         water_track_time_ns with water_track_velocity_mps, water_track_valid and optionally water_track_sd_mps, as those of pings,
///         and water_track_range_m (.,), from the transducer along the beam to the middle of the cell, 0 if it is left out;
///         depth_time_ns, depth_m; heading_time_ns, heading_rad; attitude_time_ns, attitude_t_p (., 4), scalar first;
///         gps_time_ns, gps_position_t_m (., 3); further sensors as docs/sensors.md lists them. Each time rises strictly; any but
///         the inertial stream and the pings may be left out. Rows whose flag in `<stream>_withheld` (n,) is true are predicted, and
///         their innovations recorded, but not used.
///     start: the state at the start (`InitialState`).
///     sample_time_ns: (T,) int64, rising; the state at the first inertial reading at or after each is recorded.
///     covariance: (20, 20) covariance at the start; the model's by default.
///     smooth: also smooth every method over the whole log (fixed interval).
///     covariances: also return the (20, 20) covariance of each sample.
///     innovations: also return the innovations of all measurements.
///     threads: 0 for as many as there are cores; the bits do not depend on it.
///
/// Returns:
///     A dict of arrays, for M methods, T samples, E pings and B beams:
///
///     - sample_time_ns (T,), the times of the recorded states;
///     - position_t_m, velocity_p_mps, accel_bias_p_mps2, gyro_bias_p_radps (M, T, 3), attitude_t_p (M, T, 4), dvl_bias_mps
///       (M, T, 4), dvl_scale (M, T), sd (M, T, 20);
///     - nis, NaN without a fix, nis_dof and fix_status (codes of FIX_STATUS), (M, E);
///     - innovation_mps and innovation_sd_mps (M, E, B), NaN where the beam was not a row;
///     - beam_weight (M, E, B): 1 for full weight, less with a heavy-tailed likelihood, 0 if a gate rejected the reading, NaN if
///       it was lost;
///     - choice (M, E, 3) as in run_batch;
///     - unused, the number of rows of each stream before the start and after the end;
///     - with `smooth`: the estimates and sd again with the prefix `smoothed_`, and `smoother_bytes` (M,), the memory of each method's
///       backward pass;
///     - where a method estimates the current: current_t_mps (M, T, 2), north and east at the vehicle's depth, with current_covariance (M, T, 2, 2), NaN
///       for the others;
///     - where the attitude reference has slow errors: attitude_error and attitude_error_sd (M, T, 3), roll, pitch, yaw, rad;
///     - where `options.calibration` is on: calibration and calibration_sd (M, T, 4), the rotation of the DVL from its stated
///       mounting about forward, right and down (rad) and the time to add to its stamps (s), with `covariances` also
///       calibration_covariance (M, T, 4, 4); they are constants, so the last sample has what a smoother would give;
///     - sensors, a list of a dict for each method, which has for each sensor that measured (`beams` among them) how many readings were
///       measured, rejected by the gate, left_out near the vertical, how often they inflated the covariance, and the sums of the
///       NIS and of its degrees; and slow_errors, a list of a dict for each method: the largest estimate at a sample of each block of
///       slow errors, in sigmas of its prior;
///     - with `covariances`: `covariance` (M, T, 20, 20), with `smooth` also `smoothed_covariance`;
///     - with `innovations`, or of the withheld rows alone: a list of a dict for each method, which has for each sensor, and for the
///       sway and heave that sway_current assumes, the innovations before any gate: time_ns and withheld (n,), rows (n,),
///       residual (n, k) and covariance (n, k, k), NaN beyond the rows. Those of measurements that are used are of the filter
///       without assumptions, those of withheld ones of the method's estimate.
///
/// Raises:
///     KernelError: in one line that names the field, or stream, row and time, also for results that do not fit into memory. A
///         signal (Ctrl-C) ends the replay within some tenths of a second.
#[pyfunction]
#[pyo3(signature = (geometry, model, options, methods, log, start, *, sample_time_ns, covariance=None, smooth=false,
    covariances=false, innovations=false, threads=1))]
pub fn replay_log<'py>(
    py: Python<'py>,
    geometry: Argument,
    model: Argument,
    options: Argument,
    methods: Argument,
    log: Argument,
    start: Argument,
    sample_time_ns: Argument,
    covariance: Option<Argument>,
    smooth: bool,
    covariances: bool,
    innovations: bool,
    threads: usize,
) -> Dict<'py> {
    let geometry = dvl::geometry(geometry)?;
    let (model, options) = (settings::model(model)?, settings::options(options)?);
    let beams = geometry.beams();
    let log = OwnedLog::read(log, beams, &model)?;
    let (state, covariance) = (state("start", start)?, crate::state::covariance(covariance)?);
    let sample_time_ns = times("sample_time_ns", sample_time_ns)?;
    let methods = settings::methods(methods)?;
    let request = Replay {
        log: log.log(),
        geometry: &geometry,
        model: &model,
        options: &options,
        start: state,
        covariance: covariance.as_ref(),
        methods: &methods,
        sample_time_ns: &sample_time_ns,
        smooth,
        covariances,
        innovations,
        withheld: log.withheld.each_ref().map(Vec::as_slice),
    };
    let (samples, pings) = (sample_time_ns.len(), request.log.pings.len());
    crate::memory::require(replay_bytes(&request), || {
        format!("{} methods with {samples} samples and {pings} pings", methods.len())
    })?;
    let replayed = interruptible(py, None, |stop| core::replay_until(&request, threads, stop))?;

    let out = PyDict::new(py);
    let reached = replayed.tracks.first().map_or(&[][..], |track| &track.filtered.states);
    out.column("sample_time_ns", reached.iter().map(|state| state.time_ns))?;
    let tracks = &replayed.tracks;
    put_series(&out, tracks, covariances, |track| &track.filtered)?;
    if smooth {
        let smoothed = PyDict::new(py);
        put_series(&smoothed, tracks, covariances, |track| &track.smoothed)?;
        for (key, values) in smoothed {
            out.set_item(format!("smoothed_{key}"), values)?;
        }
        out.column("smoother_bytes", tracks.iter().map(|track| track.tape_bytes))?;
    }
    put_calibrations(&out, tracks, covariances)?;
    put_attitude_errors(&out, tracks)?;
    put_currents(&out, tracks)?;
    put_pings(&out, tracks, log.pings.len(), beams)?;
    put_sensors(&out, tracks)?;
    if innovations || log.withheld.iter().any(|flags| !flags.is_empty()) {
        put_innovations(&out, tracks)?;
    }
    let unused = PyDict::new(py);
    for (key, counts) in [
        ("before_start", replayed.unused.before_start),
        ("after_end", replayed.unused.after_end),
        ("rejected", replayed.unused.rejected),
    ] {
        unused.set_item(key, by_name(py, &STREAM_NAMES, &counts)?)?;
    }
    out.set_item("unused", unused)?;
    put_faults(&out, &replayed.imu_faults)?;
    Ok(out)
}

/// Memory of a replay, bytes: its records, and the arrays made of them.
fn replay_bytes(request: &Replay<'_>) -> u128 {
    const NUMBER: usize = size_of::<f64>();
    // A tape has the covariance and the transition of every sample, of all further states too.
    let (matrix, tape) = (
        DIM * DIM * NUMBER,
        2 * (DIM + 1 + CALIBRATION + WATER + LAYER_STATES).pow(2) * NUMBER,
    );
    let state = size_of::<NavState>() + size_of::<Option<CurrentEstimate>>();
    let estimate = state + DIM * NUMBER + if request.covariances { matrix } else { 0 };
    let sample = 2 * estimate * if request.smooth { 2 } else { 1 } + if request.smooth { tape } else { 0 };
    let (methods, samples) = (request.methods.len(), request.sample_time_ns.len());
    let pings = product(&[methods, request.log.pings.len(), 2 * size_of::<PingRecord>()]);
    product(&[methods, samples, sample]).saturating_add(pings)
}

/// Estimates of methods × samples.
fn put_series(
    out: &Bound<'_, PyDict>,
    tracks: &[Track],
    covariances: bool,
    of: impl Fn(&Track) -> &Series,
) -> PyResult<()> {
    let each = || tracks.iter().map(&of);
    let shape = [tracks.len(), each().next().map_or(0, |series| series.states.len())];
    let states = || each().flat_map(|series| &series.states);
    columns! { out, &shape, states() => position_t_m, attitude_t_p, velocity_p_mps }
    columns! { out, &shape, states() => accel_bias_p_mps2, gyro_bias_p_radps, dvl_bias_mps }
    out.put("dvl_scale", &shape, states().map(|state| state.dvl_scale_factor))?;
    out.put("sd", &shape, each().flat_map(|series| &series.sd).copied())?;
    if covariances {
        out.put(
            "covariance",
            &shape,
            each().flat_map(|series| &series.covariances).copied(),
        )?;
    }
    Ok(())
}

/// Estimated currents, NaN where there is none; nothing where no method estimates one.
fn put_currents(out: &Bound<'_, PyDict>, tracks: &[Track]) -> PyResult<()> {
    let none = (Vector2::repeat(f64::NAN), Matrix2::repeat(f64::NAN));
    let each = || tracks.iter().flat_map(|track| &track.currents);
    if each().all(Option::is_none) {
        return Ok(());
    }
    let shape = [tracks.len(), tracks[0].currents.len()];
    let each = || each().map(|current| current.unwrap_or(none));
    out.put("current_t_mps", &shape, each().map(|current| current.0))?;
    out.put("current_covariance", &shape, each().map(|current| current.1))
}

/// The estimated error of the attitude reference, where every method has it.
fn put_attitude_errors(out: &Bound<'_, PyDict>, tracks: &[Track]) -> PyResult<()> {
    let samples = tracks.first().map_or(0, |track| track.attitude_errors.len());
    if samples == 0 || tracks.iter().any(|track| track.attitude_errors.len() != samples) {
        return Ok(());
    }
    let each = || tracks.iter().flat_map(|track| &track.attitude_errors);
    let shape = [tracks.len(), samples];
    out.put("attitude_error", &shape, each().map(|axes| axes.map(|error| error.0)))?;
    out.put(
        "attitude_error_sd",
        &shape,
        each().map(|axes| axes.map(|error| error.1)),
    )
}

/// Mounting and clock of the DVL at each sample, methods × samples × 4, where they are estimated.
fn put_calibrations(out: &Bound<'_, PyDict>, tracks: &[Track], covariances: bool) -> PyResult<()> {
    let shape = [tracks.len(), tracks.first().map_or(0, |track| track.calibrations.len())];
    if shape[1] == 0 {
        return Ok(());
    }
    let each = || tracks.iter().flat_map(|track| &track.calibrations);
    let sd = |covariance: &CalibrationCovariance| covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    out.put("calibration", &shape, each().map(|calibration| calibration.0))?;
    out.put("calibration_sd", &shape, each().map(|calibration| sd(&calibration.1)))?;
    if covariances {
        out.put(
            "calibration_covariance",
            &shape,
            each().map(|calibration| calibration.1),
        )?;
    }
    Ok(())
}
