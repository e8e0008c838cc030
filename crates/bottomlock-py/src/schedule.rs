//! When sensors measure, from a dict: for many runs at once.

use bottomlock::aiding::registry::{SENSORS, SensorKind};
use bottomlock::aiding::sensor::Simulation;
use bottomlock::dvl::geometry::BeamMask;
use bottomlock::simulation::schedule::{Schedule, SensorEpochs};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{booleans, floats, item, times};
use crate::errors::refuse;
use crate::settings::mask;

/// Epochs of all sensors, owned.
pub struct OwnedSchedule {
    dvl_time_ns: Vec<i64>,
    beam_valid: PerRun<BeamMask>,
    sensors: [OwnedEpochs; SENSORS],
    pub sample_time_ns: Vec<i64>,
}

/// Epochs of a sensor, and what the surroundings add to its readings: of every run, or one for all.
#[derive(Default)]
struct OwnedEpochs {
    time_ns: Vec<Vec<i64>>,
    offset: Vec<Vec<f64>>,
}

impl OwnedSchedule {
    /// What one run meets.
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
        }
    }
}

/// Values of each epoch, the same for every run or each run's own.
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
fn per_run_shape(value: &Bound<'_, PyAny>, runs: usize, of_one: &[Option<usize>]) -> (bool, Vec<Option<usize>>) {
    let dimensions: usize = value.getattr("ndim").and_then(|n| n.extract()).unwrap_or(of_one.len());
    let by_run = dimensions == of_one.len() + 1;
    let leading = by_run.then_some(Some(runs));
    (by_run, leading.into_iter().chain(of_one.iter().copied()).collect())
}

/// The epochs of a sensor at which each run hears it, under `<name>_time_ns`, with `<name>_heard` and its offset where there are
/// any; a sensor that is not named never measures.
fn epochs(dict: &Bound<'_, PyDict>, of: &Simulation, runs: usize) -> PyResult<OwnedEpochs> {
    let (times_key, heard_key) = (format!("{}_time_ns", of.name), format!("{}_heard", of.name));
    let Some(given) = dict.get_item(&times_key)? else {
        return match of.offset.map(|key| dict.contains(key)).transpose()?.unwrap_or(false)
            || dict.contains(&heard_key)?
        {
            true => Err(refuse(format!("schedule lacks the key '{times_key}'"))),
            false => Ok(OwnedEpochs::default()),
        };
    };
    let time_ns = times(&format!("schedule.{times_key}"), &given)?;
    let count = time_ns.len();
    let offset = match of.offset.map(|key| dict.get_item(key)).transpose()?.flatten() {
        None => None,
        Some(value) => {
            let (by_run, shape) = per_run_shape(&value, runs, &[Some(count)]);
            let key = of.offset.unwrap_or_default();
            let values = floats(&format!("schedule.{key}"), &value, &shape)?.values;
            Some(PerRun {
                values,
                epochs: count,
                by_run,
            })
        }
    };
    let heard = match dict.get_item(&heard_key)? {
        None => None,
        Some(value) => {
            let (by_run, shape) = per_run_shape(&value, runs, &[Some(count)]);
            let values = booleans(&format!("schedule.{heard_key}"), &value, &shape)?.values;
            Some(PerRun {
                values,
                epochs: count,
                by_run,
            })
        }
    };
    let own = |by_run: Option<bool>| if by_run == Some(true) { runs } else { 1 };
    let is_heard = |run: usize, k: usize| heard.as_ref().is_none_or(|heard| heard.of(run)[k]);
    fn kept<T: Copy>(values: &[T], is_kept: impl Fn(usize) -> bool) -> Vec<T> {
        let pairs = values.iter().enumerate().filter(|(k, _)| is_kept(*k));
        pairs.map(|(_, &value)| value).collect()
    }
    let by_run = heard.as_ref().map(|heard| heard.by_run);
    let offsets_by_run = offset.as_ref().map(|offset| offset.by_run || by_run == Some(true));
    Ok(OwnedEpochs {
        time_ns: (0..own(by_run))
            .map(|run| kept(&time_ns, |k| is_heard(run, k)))
            .collect(),
        offset: match &offset {
            None => Vec::new(),
            Some(offset) => (0..own(offsets_by_run))
                .map(|run| kept(offset.of(run), |k| is_heard(run, k)))
                .collect(),
        },
    })
}

/// A schedule for a number of runs.
pub fn schedule(dict: &Bound<'_, PyDict>, beams: usize, runs: usize) -> PyResult<OwnedSchedule> {
    let epochs_of = |key: &str| times(&format!("schedule.{key}"), &item(dict, "schedule", key)?);
    let dvl_time_ns = epochs_of("dvl_time_ns")?;
    let valid = item(dict, "schedule", "beam_valid")?;
    let pings = dvl_time_ns.len();
    let (by_run, shape) = per_run_shape(&valid, runs, &[Some(pings), Some(beams)]);
    let flags = booleans("schedule.beam_valid", &valid, &shape)?;
    let mut sensors: [OwnedEpochs; SENSORS] = Default::default();
    for kind in SensorKind::ALL {
        if let Some(simulation) = kind.declaration().simulation {
            sensors[kind as usize] = epochs(dict, &simulation, runs)?;
        }
    }
    Ok(OwnedSchedule {
        beam_valid: PerRun {
            values: flags.values.chunks_exact(beams.max(1)).map(mask).collect(),
            epochs: pings,
            by_run,
        },
        dvl_time_ns,
        sensors,
        sample_time_ns: epochs_of("sample_time_ns")?,
    })
}
