//! When sensors measure, from their keys: for many runs at once.

use bottomlock::aiding::registry::{SENSORS, SensorKind};
use bottomlock::aiding::sensor::Simulation;
use bottomlock::dvl::geometry::BeamMask;
use bottomlock::simulation::schedule::{Schedule, SensorEpochs, WaterEpochs};
use pyo3::prelude::*;

use crate::arrays::{Argument, Array, booleans, floats, rows, times};
use crate::errors::invalid;
use crate::keys::{Keys, read};
use crate::settings::mask;

/// Epochs of all sensors, owned.
pub struct OwnedSchedule {
    dvl_time_ns: Vec<i64>,
    beam_valid: PerRun<BeamMask>,
    sensors: [OwnedEpochs; SENSORS],
    water: OwnedWater,
    pub sample_time_ns: Vec<i64>,
}

/// Epochs of a sensor and the offsets that the environment adds to its readings, for each run or shared by all.
#[derive(Default)]
struct OwnedEpochs {
    time_ns: Vec<Vec<i64>>,
    offset: Vec<Vec<f64>>,
}

/// Epochs of the beams that the water returns, and the current at each.
#[derive(Default)]
struct OwnedWater {
    time_ns: Vec<i64>,
    beam_valid: PerRun<BeamMask>,
    current_n_mps: Vec<[f64; 2]>,
    shear_n_ps: Vec<[f64; 2]>,
}

impl OwnedSchedule {
    /// The epochs of one run.
    pub fn of(&self, run: usize) -> Schedule<'_> {
        fn pick<T>(runs: &[Vec<T>], run: usize) -> &[T] {
            runs.get(run).or(runs.last()).map_or(&[], Vec::as_slice)
        }
        Schedule {
            dvl_time_ns: &self.dvl_time_ns,
            beam_valid: self.beam_valid.of(run),
            sensors: self.sensors.each_ref().map(|epochs| SensorEpochs {
                time_ns: pick(&epochs.time_ns, run),
                offset: pick(&epochs.offset, run),
            }),
            water: WaterEpochs {
                time_ns: &self.water.time_ns,
                beam_valid: self.water.beam_valid.of(run),
                current_n_mps: &self.water.current_n_mps,
                shear_n_ps: &self.water.shear_n_ps,
            },
        }
    }
}

/// Values at each epoch, shared by all runs or one set per run.
#[derive(Default)]
struct PerRun<T> {
    values: Vec<T>,
    epochs: usize,
    by_run: bool,
}

impl<T> PerRun<T> {
    /// The values of one run.
    fn of(&self, run: usize) -> &[T] {
        if self.by_run {
            &self.values[run * self.epochs..(run + 1) * self.epochs]
        } else {
            &self.values
        }
    }
}

/// The shape (epochs, ..) or (runs, epochs, ..) of values that may differ by run.
fn per_run_shape(value: Argument, runs: usize, of_one: &[Option<usize>]) -> (bool, Vec<Option<usize>>) {
    let dimensions: usize = value.getattr("ndim").and_then(|n| n.extract()).unwrap_or(of_one.len());
    let by_run = dimensions == of_one.len() + 1;
    let leading = by_run.then_some(Some(runs));
    (by_run, leading.into_iter().chain(of_one.iter().copied()).collect())
}

/// What an array converter gives: numbers or truth values.
type Convert<T> = fn(&str, Argument, &[Option<usize>]) -> PyResult<Array<T>>;

/// Values at each epoch of a sensor, shared by all runs or one set per run; none without the key.
fn at_epochs<T>(
    keys: &Keys<'_>,
    key: &str,
    runs: usize,
    epochs: usize,
    convert: Convert<T>,
) -> PyResult<Option<PerRun<T>>> {
    let Some(value) = keys.get(key)? else {
        return Ok(None);
    };
    let (by_run, shape) = per_run_shape(&value, runs, &[Some(epochs)]);
    let values = convert(&keys.path(key), &value, &shape)?.values;
    Ok(Some(PerRun { values, epochs, by_run }))
}

/// The epochs of a sensor that each run receives: `<name>_time_ns`, and where given `<name>_received` and the sensor's offset. A
/// sensor that is not named never measures.
fn epochs(keys: &Keys<'_>, of: &Simulation, runs: usize) -> PyResult<OwnedEpochs> {
    let (times_key, received_key) = (format!("{}_time_ns", of.name), format!("{}_received", of.name));
    let mut is_wanted = keys.has(&received_key)?;
    if let Some(key) = of.offset {
        is_wanted |= keys.has(key)?;
    }
    let Some(given) = keys.get(&times_key)? else {
        if is_wanted {
            return Err(invalid(format!("schedule lacks the key '{times_key}'")));
        }
        return Ok(OwnedEpochs::default());
    };
    let time_ns = times(&keys.path(&times_key), &given)?;
    let received = at_epochs::<bool>(keys, &received_key, runs, time_ns.len(), booleans)?;
    let offset_of = |key| at_epochs::<f64>(keys, key, runs, time_ns.len(), floats);
    let offset = of.offset.map_or(Ok(None), offset_of)?;
    let is_received = |run: usize, k: usize| received.as_ref().is_none_or(|received| received.of(run)[k]);
    let received_by_run = received.as_ref().is_some_and(|received| received.by_run);
    let offset_by_run = received_by_run || offset.as_ref().is_some_and(|offset| offset.by_run);
    let each = |by_run: bool| 0..if by_run { runs } else { 1 };
    Ok(OwnedEpochs {
        time_ns: each(received_by_run)
            .map(|run| kept(&time_ns, |k| is_received(run, k)))
            .collect(),
        offset: offset.map_or_else(Vec::new, |offset| {
            each(offset_by_run)
                .map(|run| kept(offset.of(run), |k| is_received(run, k)))
                .collect()
        }),
    })
}

/// The values whose place is kept.
fn kept<T: Copy>(values: &[T], is_kept: impl Fn(usize) -> bool) -> Vec<T> {
    let places = (0..values.len()).filter(|&k| is_kept(k));
    places.map(|k| values[k]).collect()
}

/// Number of samples of a schedule, before it is read; none where it cannot be, which its reading then says.
pub fn sample_count(value: Argument) -> usize {
    value
        .get_item("sample_time_ns")
        .and_then(|times| times.len())
        .unwrap_or(0)
}

/// A schedule for a number of runs.
pub fn schedule(value: Argument, beams: usize, runs: usize) -> PyResult<OwnedSchedule> {
    read("schedule", value, |keys| schedule_of(keys, beams, runs))
}

/// The valid beams at each of a number of epochs.
fn masks(keys: &Keys<'_>, key: &str, epochs: usize, beams: usize, runs: usize) -> PyResult<PerRun<BeamMask>> {
    let valid = keys.item(key)?;
    let (by_run, shape) = per_run_shape(&valid, runs, &[Some(epochs), Some(beams)]);
    let flags = booleans(&keys.path(key), &valid, &shape)?;
    Ok(PerRun {
        values: flags.values.chunks_exact(beams.max(1)).map(mask).collect(),
        epochs,
        by_run,
    })
}

/// The epochs of the water, none without `water_track_time_ns`.
fn water(keys: &Keys<'_>, beams: usize, runs: usize) -> PyResult<OwnedWater> {
    const VALUES: [&str; 3] = ["water_track_valid", "water_current_n_mps", "water_shear_n_ps"];
    let Some(given) = keys.get("water_track_time_ns")? else {
        for key in VALUES {
            if keys.has(key)? {
                return Err(invalid(format!(
                    "schedule has the key '{key}' but lacks 'water_track_time_ns'"
                )));
            }
        }
        return Ok(OwnedWater::default());
    };
    let time_ns = times(&keys.path("water_track_time_ns"), &given)?;
    let epochs = time_ns.len();
    let pairs = |key: &str| rows::<2>(&keys.path(key), &keys.item(key)?, Some(epochs));
    Ok(OwnedWater {
        beam_valid: masks(keys, VALUES[0], epochs, beams, runs)?,
        current_n_mps: pairs(VALUES[1])?,
        shear_n_ps: pairs(VALUES[2])?,
        time_ns,
    })
}

fn schedule_of(keys: &Keys<'_>, beams: usize, runs: usize) -> PyResult<OwnedSchedule> {
    let epochs_of = |key: &str| times(&keys.path(key), &keys.item(key)?);
    let dvl_time_ns = epochs_of("dvl_time_ns")?;
    let beam_valid = masks(keys, "beam_valid", dvl_time_ns.len(), beams, runs)?;
    let mut sensors: [OwnedEpochs; SENSORS] = Default::default();
    for kind in SensorKind::ALL {
        if let Some(simulation) = kind.declaration().simulation {
            sensors[kind as usize] = epochs(keys, &simulation, runs)?;
        }
    }
    Ok(OwnedSchedule {
        beam_valid,
        dvl_time_ns,
        sensors,
        water: water(keys, beams, runs)?,
        sample_time_ns: epochs_of("sample_time_ns")?,
    })
}
