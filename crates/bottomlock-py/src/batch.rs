//! Sensor streams, and batches of runs and methods.

use std::sync::{Mutex, PoisonError};

use bottomlock::aiding::registry::{Measurement, SensorKind};
use bottomlock::dvl::geometry::BeamSample;
use bottomlock::error_model::dense_at;
use bottomlock::filter::options::Options;
use bottomlock::mechanisation::{EarthTerms, ImuSample};
use bottomlock::simulation::batch::{Batch, run_batch_into};
use bottomlock::simulation::schedule::Schedule;
use bottomlock::simulation::sensor_errors::RunKey;
use bottomlock::simulation::sensor_streams;
use bottomlock::state::NavState;

use crate::arrays::vec3;
use crate::batch_arrays::{BatchArrays, batch_bytes};
use crate::calls::{detached, interruptible};
use crate::errors::raise_timeless;
use crate::prelude::*;
use crate::state::state_dict;
use crate::truth::Truths;

/// Draws every sensor stream of one run as arrays, with the true errors behind them.
///
/// The streams are keyed by (seed, trajectory_key, run): run k alone is run k of a campaign, and a sensor that is
/// switched off shifts no other. `options` are a filter's, of which the lever arms count. Raises KernelError for a
/// truth, a model or a schedule that is not valid, naming the field and the time.
#[pyfunction]
#[pyo3(signature = (geometry, truth, model, schedule, *, seed, trajectory_key, run, imu_sampling="instantaneous",
    options=None))]
pub fn simulate_sensors<'py>(
    py: Python<'py>,
    geometry: Argument,
    truth: Argument,
    model: Argument,
    schedule: Argument,
    seed: u64,
    trajectory_key: u64,
    run: u64,
    imu_sampling: &str,
    options: Option<Argument>,
) -> Dict<'py> {
    let geometry = dvl::geometry(geometry)?;
    let (truths, model) = (Truths::new(truth, None)?, settings::model(model)?);
    let truth = truths.of(0)?;
    let beams = geometry.beams();
    let schedule = crate::schedule::schedule(schedule, beams, 1)?;
    let given = options.map(settings::options).transpose()?;
    let options = Options {
        imu_sampling: settings::sampling(imu_sampling)?,
        levers: given.unwrap_or_default().levers,
        ..Options::default()
    };
    let key = RunKey {
        seed,
        trajectory: trajectory_key,
        run,
    };
    let streams = detached(py, || {
        truth.validate()?;
        sensor_streams::simulate(&truth, &geometry, &model, &model, &schedule.of(0), &options, &key)
    })?;

    let out = PyDict::new(py);
    out.set_item("initial", state_dict(py, &streams.initial)?)?;
    let imu = || streams.imu.iter();
    out.column("imu_time_ns", imu().map(|sample| sample.time_ns))?;
    out.column("imu_omega_p_radps", imu().map(|sample| sample.rate_p_radps))?;
    out.column("imu_force_p_mps2", imu().map(|sample| sample.force_p_mps2))?;
    out.column("accel_bias_p_mps2", streams.accel_bias_p_mps2)?;
    out.column("gyro_bias_p_radps", streams.gyro_bias_p_radps)?;
    put_beams(&out, "dvl", streams.pings.iter(), beams)?;
    let bias = streams.beam_bias_mps.iter().flat_map(|bias| &bias[..beams]);
    out.put("dvl_bias_mps", &[streams.pings.len(), beams], bias.copied())?;
    out.column("dvl_scale_factor", streams.scale_factor)?;
    let water = streams.water.iter().map(|sample| &sample.ping);
    put_beams(&out, "water_track", water, beams)?;
    SensorKind::ALL
        .into_iter()
        .try_for_each(|kind| put_readings(&out, kind, &streams.sensors[kind as usize]))?;
    Ok(out)
}

/// Times, velocities and validity of beams, the names with a prefix.
fn put_beams<'a>(
    out: &Bound<'_, PyDict>,
    prefix: &str,
    pings: impl ExactSizeIterator<Item = &'a BeamSample> + Clone,
    beams: usize,
) -> PyResult<()> {
    let wide = [pings.len(), beams];
    let key = |name: &str| format!("{prefix}_{name}");
    out.column(&key("time_ns"), pings.clone().map(|ping| ping.time_ns))?;
    let readings = pings.clone().flat_map(|ping| &ping.velocity_mps[..beams]);
    out.put(&key("velocity_mps"), &wide, readings.copied())?;
    let flags = pings.flat_map(|ping| (0..beams).map(|beam| ping.valid.contains(beam)));
    out.put(&key("valid"), &wide, flags)
}

/// Times and columns of a simulated sensor.
fn put_readings(out: &Bound<'_, PyDict>, kind: SensorKind, readings: &[Measurement]) -> PyResult<()> {
    let Some(simulation) = kind.declaration().simulation else {
        return Ok(());
    };
    let key = format!("{}_time_ns", simulation.name);
    out.column(&key, readings.iter().map(Measurement::time_ns))?;
    let numbers: Vec<Vec<f64>> = readings.iter().map(Measurement::numbers).collect();
    let mut first = 0;
    for column in simulation.columns {
        let part = first..first + column.width;
        first = part.end;
        let values = numbers.iter().flat_map(|row| row[part.clone()].iter().copied());
        let shape = &[readings.len(), column.width][..if column.width == 1 { 1 } else { 2 }];
        out.put(column.key, shape, values)?;
    }
    Ok(())
}

/// Runs a batch: all methods of a run see the same sensor errors.
///
/// The results do not depend on the number of threads, bit for bit.
///
/// Returns a dict:
///
/// - error, sd (runs, methods, samples, 9): true minus estimate and its standard deviation, for position (tangent, m),
///   misalignment (tangent, rad) and velocity (platform, m/s);
/// - nees, nees_velocity_attitude (runs, methods, samples);
/// - nis_mean (NaN without fixes), fixes_accepted, fixes_rejected, fixes_beyond_linear_range (runs, methods);
/// - final_bias_error, final_bias_sd (runs, methods, 6): accelerometer biases (platform, m/s²) and gyro biases
///   (platform, rad/s) at the last sample, NaN without samples;
/// - choice (runs, methods, pings, 3): for the selector of the paper, the codes of `SOURCES` for surge, sway and heave; 255
///   elsewhere.
///
/// The GIL is released meanwhile; the arrays of the truth must not be written to. A signal (Ctrl-C) ends the batch within
/// some tenths of a second, and so does `stop`, a `threading.Event` that another thread sets. Raises KernelError, which names
/// the field, or the run and the method, also for results that do not fit into memory.
#[pyfunction]
#[pyo3(signature = (geometry, truth, simulated, assumed, options, schedule, methods, *, seed, trajectory_key, first_run, runs,
    threads, stop=None))]
pub fn run_batch<'py>(
    py: Python<'py>,
    geometry: Argument,
    truth: Argument,
    simulated: Argument,
    assumed: Argument,
    options: Argument,
    schedule: Argument,
    methods: Argument,
    seed: u64,
    trajectory_key: u64,
    first_run: u64,
    runs: usize,
    threads: usize,
    stop: Option<Argument>,
) -> Dict<'py> {
    let geometry = dvl::geometry(geometry)?;
    let truths = Truths::new(truth, None)?;
    let (simulated, assumed) = (settings::model(simulated)?, settings::model(assumed)?);
    let options = settings::options(options)?;
    let methods = settings::methods(methods)?;
    let samples = crate::schedule::sample_count(schedule);
    crate::memory::require(batch_bytes(runs, methods.len(), samples), || {
        format!("{runs} runs of {} methods with {samples} samples", methods.len())
    })?;
    let schedule = crate::schedule::schedule(schedule, geometry.beams(), runs)?;
    let schedules: Vec<Schedule<'_>> = (0..runs).map(|run| schedule.of(run)).collect();
    let batch = Batch {
        truth: truths.of(0)?,
        geometry: &geometry,
        simulated: &simulated,
        assumed: &assumed,
        options: &options,
        schedules: &schedules,
        sample_time_ns: &schedule.sample_time_ns,
        methods: &methods,
        seed,
        trajectory_key,
        first_run,
        runs,
    };
    let results = Mutex::new(BatchArrays::new([runs, methods.len(), schedule.sample_time_ns.len()]));
    let store = |run: &mut usize, records| {
        results
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .store(*run, records)
    };
    let mut places: Vec<usize> = (0..runs).collect();
    interruptible(py, stop, |stop| {
        run_batch_into(&batch, threads, stop, &mut places, store)
    })?;
    results
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner)
        .into_dict(py)
}

/// The dense F of Eq. 9 and the noise density G Q Gᵀ, each (20, 20), SI, at an attitude, a velocity and an IMU reading.
///
/// Raises KernelError for a wrong shape or a number that is not finite.
#[pyfunction]
#[pyo3(signature = (model, *, attitude_t_p, velocity_p_mps, omega_p_radps, force_p_mps2))]
pub fn error_model<'py>(
    py: Python<'py>,
    model: Argument,
    attitude_t_p: Argument,
    velocity_p_mps: Argument,
    omega_p_radps: Argument,
    force_p_mps2: Argument,
) -> Dict<'py> {
    let model = settings::model(model)?;
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = settings::attitude("attitude_t_p", attitude_t_p)?;
    state.velocity_p_mps = vec3("velocity_p_mps", velocity_p_mps)?;
    let sample = ImuSample {
        time_ns: 0,
        rate_p_radps: vec3("omega_p_radps", omega_p_radps)?,
        force_p_mps2: vec3("force_p_mps2", force_p_mps2)?,
    };
    let (earth, noise) = (EarthTerms::from(&model.environment), model.process_noise(true));
    let [f, q] = dense_at(&earth, &noise, &state, &sample).map_err(raise_timeless)?;
    let out = PyDict::new(py);
    out.column("f", f)?;
    out.column("q", q)?;
    Ok(out)
}
