//! Sensor streams, and batches of runs and methods.

use bottomlock::aiding::registry::{Measurement, SensorKind};
use bottomlock::dvl::geometry::BeamSample;
use bottomlock::error_model::{Coefficients, dense_noise};
use bottomlock::filter::options::Options;
use bottomlock::frames::Vec3;
use bottomlock::mechanisation::{EarthTerms, ImuSample, Inertial};
use bottomlock::simulation::batch::{Batch, run_batch_into};
use bottomlock::simulation::monte_carlo_run::MethodRecord;
use bottomlock::simulation::schedule::Schedule;
use bottomlock::simulation::sensor_errors::RunKey;
use bottomlock::simulation::sensor_streams;
use bottomlock::simulation::sensor_streams::Streams;
use bottomlock::state::NavState;
use numpy::Element;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, from_rows, vector};
use crate::batch_arrays::{BatchArrays, RecordSlices, batch_bytes};
use crate::calls::{detached, interruptible};
use crate::dvl::BeamGeometry;
use crate::errors::raise_timeless;
use crate::settings;
use crate::state::put_state;
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
    geometry: &BeamGeometry,
    truth: &Bound<'py, PyAny>,
    model: &Bound<'py, PyAny>,
    schedule: &Bound<'py, PyAny>,
    seed: u64,
    trajectory_key: u64,
    run: u64,
    imu_sampling: &str,
    options: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let truths = Truths::new(truth)?;
    let truth = truths.of(0)?;
    let model = settings::model(model)?;
    let beams = geometry.inner.beams();
    let schedule = crate::schedule::schedule(schedule, beams, 1)?;
    let options = Options {
        imu_sampling: settings::sampling(imu_sampling)?,
        levers: options
            .map(settings::options)
            .transpose()?
            .map_or_else(Default::default, |options| options.levers),
        ..Options::default()
    };
    let key = RunKey {
        seed,
        trajectory: trajectory_key,
        run,
    };
    let streams = detached(py, || {
        truth.validate()?;
        sensor_streams::simulate(&truth, &geometry.inner, &model, &model, &schedule.of(0), &options, &key)
    })?;

    let out = PyDict::new(py);
    let initial = PyDict::new(py);
    put_state(&initial, &streams.initial)?;
    out.set_item("initial", initial)?;
    put_inertial(&out, &streams)?;
    put_pings(&out, &streams, beams)?;
    put_beams(
        &out,
        ["water_track_time_ns", "water_track_velocity_mps", "water_track_valid"],
        streams.water.iter().map(|sample| &sample.ping),
        beams,
    )?;
    SensorKind::ALL
        .into_iter()
        .try_for_each(|kind| put_readings(&out, kind, &streams.sensors[kind as usize]))?;
    Ok(out)
}

fn put<T: Element>(out: &Bound<'_, PyDict>, name: &str, values: Vec<T>, shape: &[usize]) -> PyResult<()> {
    out.set_item(name, array(out.py(), values, shape)?)
}

/// Inertial readings and the true biases behind them.
fn put_inertial(out: &Bound<'_, PyDict>, streams: &Streams) -> PyResult<()> {
    let count = streams.imu.len();
    let threes = |of: fn(&ImuSample) -> [f64; 3]| streams.imu.iter().flat_map(of).collect::<Vec<f64>>();
    put(
        out,
        "imu_time_ns",
        streams.imu.iter().map(|s| s.time_ns).collect(),
        &[count],
    )?;
    put(
        out,
        "imu_omega_p_radps",
        threes(|s| s.rate_p_radps.to_array()),
        &[count, 3],
    )?;
    put(
        out,
        "imu_force_p_mps2",
        threes(|s| s.force_p_mps2.to_array()),
        &[count, 3],
    )?;
    put(
        out,
        "accel_bias_p_mps2",
        streams.accel_bias_p_mps2.concat(),
        &[count, 3],
    )?;
    put(
        out,
        "gyro_bias_p_radps",
        streams.gyro_bias_p_radps.concat(),
        &[count, 3],
    )
}

/// Pings and the true errors behind them.
fn put_pings(out: &Bound<'_, PyDict>, streams: &Streams, beams: usize) -> PyResult<()> {
    let wide = [streams.pings.len(), beams];
    put_beams(
        out,
        ["dvl_time_ns", "dvl_velocity_mps", "dvl_valid"],
        streams.pings.iter(),
        beams,
    )?;
    let bias = streams.beam_bias_mps.iter().flat_map(|b| b[..beams].to_vec());
    put(out, "dvl_bias_mps", bias.collect(), &wide)?;
    put(out, "dvl_scale_factor", streams.scale_factor.clone(), &wide[..1])
}

/// Times, velocities and validity of beams under their names.
fn put_beams<'a>(
    out: &Bound<'_, PyDict>,
    names: [&str; 3],
    pings: impl ExactSizeIterator<Item = &'a BeamSample> + Clone,
    beams: usize,
) -> PyResult<()> {
    let wide = [pings.len(), beams];
    put(out, names[0], pings.clone().map(|p| p.time_ns).collect(), &wide[..1])?;
    let readings = pings.clone().flat_map(|p| p.velocity_mps[..beams].to_vec());
    put(out, names[1], readings.collect(), &wide)?;
    let flags = pings.flat_map(|p| (0..beams).map(|b| p.valid.contains(b)));
    put(out, names[2], flags.collect(), &wide)
}

/// Times and columns of a simulated sensor.
fn put_readings(out: &Bound<'_, PyDict>, kind: SensorKind, readings: &[Measurement]) -> PyResult<()> {
    let Some(simulation) = kind.declaration().simulation else {
        return Ok(());
    };
    let times = readings.iter().map(Measurement::time_ns).collect();
    put(out, &format!("{}_time_ns", simulation.name), times, &[readings.len()])?;
    let numbers: Vec<Vec<f64>> = readings.iter().map(Measurement::numbers).collect();
    let mut first = 0;
    for column in simulation.columns {
        let part = first..first + column.width;
        first = part.end;
        let values = numbers.iter().flat_map(|row| row[part.clone()].iter().copied());
        let shape = &[readings.len(), column.width][..if column.width == 1 { 1 } else { 2 }];
        put::<f64>(out, column.key, values.collect(), shape)?;
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
/// - choice (runs, methods, pings, 3): for methods that select, the codes of `SOURCES` for surge, sway and heave, or
///   the codes of `SELECTOR_METHODS` and `SELECTION_REASONS`; 255 elsewhere.
///
/// The GIL is released meanwhile; the arrays of the truth must not be written to. A signal (Ctrl-C) ends the batch within
/// some tenths of a second, and so does `stop`, a `threading.Event` that another thread sets. Raises KernelError, which names
/// the field, or the run and the method, also for results that do not fit into memory.
#[pyfunction]
#[pyo3(signature = (geometry, truth, simulated, assumed, options, schedule, methods, *, seed, trajectory_key, first_run, runs,
    threads, stop=None))]
pub fn run_batch<'py>(
    py: Python<'py>,
    geometry: &BeamGeometry,
    truth: &Bound<'py, PyAny>,
    simulated: &Bound<'py, PyAny>,
    assumed: &Bound<'py, PyAny>,
    options: &Bound<'py, PyAny>,
    schedule: &Bound<'py, PyAny>,
    methods: Vec<String>,
    seed: u64,
    trajectory_key: u64,
    first_run: u64,
    runs: usize,
    threads: usize,
    stop: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let truths = Truths::new(truth)?;
    let (simulated, assumed) = (settings::model(simulated)?, settings::model(assumed)?);
    let options = settings::options(options)?;
    let methods = settings::methods(&methods)?;
    let samples = crate::schedule::sample_count(schedule);
    crate::memory::require(batch_bytes(runs, methods.len(), samples), || {
        format!("{runs} runs of {} methods with {samples} samples", methods.len())
    })?;
    let schedule = crate::schedule::schedule(schedule, geometry.inner.beams(), runs)?;
    let schedules: Vec<Schedule<'_>> = (0..runs).map(|run| schedule.of(run)).collect();
    let batch = Batch {
        truth: truths.of(0)?,
        geometry: &geometry.inner,
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
    let mut results = BatchArrays::new(runs, methods.len(), schedule.sample_time_ns.len());
    let mut slices = results.slices();
    let store = |slices: &mut Vec<RecordSlices<'_>>, records: Vec<MethodRecord>| {
        slices
            .iter_mut()
            .zip(&records)
            .for_each(|(slices, record)| slices.store(record));
    };
    interruptible(py, stop, |stop| {
        run_batch_into(&batch, threads, stop, &mut slices, store)
    })?;
    results.into_dict(py)
}

/// The dense F of Eq. 9 and the noise density G Q Gᵀ, each (20, 20), SI, at an attitude, a velocity and an IMU reading.
///
/// Raises KernelError for a wrong shape or a number that is not finite.
#[pyfunction]
#[pyo3(signature = (model, *, attitude_t_p, velocity_p_mps, omega_p_radps, force_p_mps2))]
pub fn error_model<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyAny>,
    attitude_t_p: &Bound<'py, PyAny>,
    velocity_p_mps: &Bound<'py, PyAny>,
    omega_p_radps: &Bound<'py, PyAny>,
    force_p_mps2: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let model = settings::model(model)?;
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = settings::attitude("attitude_t_p", attitude_t_p)?;
    state.velocity_p_mps = Vec3::from_array(vector("velocity_p_mps", velocity_p_mps)?);
    state.validate().map_err(raise_timeless)?;
    let sample = ImuSample {
        time_ns: 0,
        rate_p_radps: Vec3::from_array(vector("omega_p_radps", omega_p_radps)?),
        force_p_mps2: Vec3::from_array(vector("force_p_mps2", force_p_mps2)?),
    };
    sample.validate().map_err(raise_timeless)?;
    let inertial = Inertial {
        rate_p_radps: sample.rate_p_radps.to_array(),
        force_p_mps2: sample.force_p_mps2.to_array(),
    };
    let earth = EarthTerms::from(&model.environment);
    let coefficients = Coefficients::at(&state.kinematics(), &inertial, &earth);
    let out = PyDict::new(py);
    out.set_item("f", from_rows(py, &coefficients.dense(&earth))?)?;
    out.set_item(
        "q",
        from_rows(py, &dense_noise(&coefficients, &model.process_noise(true)))?,
    )?;
    Ok(out)
}
