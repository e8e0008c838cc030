//! Batches of runs and methods: all methods of a run see the same sensor errors; results are placed by index.

use std::ops::Range;

use crate::dvl::geometry::BeamGeometry;
use crate::error::{NavError, require_rising};
use crate::filter::options::Options;
use crate::model::Model;
use crate::navigator::Method;
use crate::simulation::monte_carlo_run::{MonteCarloRun, RunSegment};
use crate::simulation::run_group;
use crate::simulation::run_group::run_segments;
use crate::simulation::schedule::Schedule;
use crate::simulation::sensor_errors::RunKey;
use crate::simulation::truth::{Truth, true_state};
use crate::stop::Stop;
use crate::workers::Workers;

pub use crate::simulation::monte_carlo_run::MethodRecord;

/// A batch of runs and methods.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// True motion.
    pub truth: Truth<'a>,
    /// Beam geometry.
    pub geometry: &'a BeamGeometry,
    /// Model of the simulated sensors.
    pub simulated: &'a Model,
    /// Model that the filters assume.
    pub assumed: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// Measurement epochs and valid beams: one schedule for all runs, or one per run.
    pub schedules: &'a [Schedule<'a>],
    /// Increasing times at which errors are recorded, ns, each at the first IMU sample at or after it.
    pub sample_time_ns: &'a [i64],
    /// Aiding methods.
    pub methods: &'a [Method],
    /// Seed of the campaign.
    pub seed: u64,
    /// Key of the trajectory.
    pub trajectory_key: u64,
    /// Number of the first run.
    pub first_run: u64,
    /// Number of runs.
    pub runs: usize,
}

/// Runs a batch on `threads` threads (0: one per core) and returns a record per run and method.
///
/// The results do not depend on the number of threads, bit for bit.
///
/// # Errors
/// [`NavError`] for invalid input; [`NavError::InRun`], which names run and method, for an error during a run.
pub fn run_batch(batch: &Batch<'_>, threads: usize) -> Result<Vec<Vec<MethodRecord>>, NavError> {
    let mut results = vec![Vec::new(); batch.runs];
    run_batch_into(batch, threads, &Stop::new(), &mut results, |place, records| {
        *place = records
    })?;
    Ok(results)
}

/// As [`run_batch`], with `store` called with a run's place and records when the run is finished, on the thread of the
/// run.
///
/// # Errors
/// As [`run_batch`]; [`NavError::WrongCount`] unless there is one place per run; [`NavError::Interrupted`] where `stop`
/// asks for an early end.
pub fn run_batch_into<P: Send>(
    batch: &Batch<'_>,
    threads: usize,
    stop: &Stop,
    places: &mut [P],
    store: impl Fn(&mut P, Vec<MethodRecord>) + Sync + Send,
) -> Result<(), NavError> {
    if places.len() != batch.runs {
        return Err(NavError::WrongCount {
            field: "places",
            got: places.len(),
            expected: format!("{}, one per run", batch.runs),
        });
    }
    check_runs(batch.first_run, batch.runs)?;
    batch.truth.validate()?;
    batch.simulated.validate()?;
    if batch.schedules.len() != 1 && batch.schedules.len() != batch.runs {
        return Err(NavError::WrongCount {
            field: "schedules",
            got: batch.schedules.len(),
            expected: format!("1 for all runs or {}, one per run", batch.runs),
        });
    }
    check_samples(batch.sample_time_ns, batch.truth.time_ns)?;
    let workers = Workers::new(threads)?;
    let group_size = run_group::size(batch.methods, batch.runs, workers.threads()).get();
    let mut groups: Vec<_> = places.chunks_mut(group_size).collect();
    workers.each(&mut groups, |group, places| {
        stop.check()?;
        let first = group * group_size;
        let results = run_together(batch, first..first + places.len(), stop);
        for (place, records) in places.iter_mut().zip(results) {
            store(place, records?);
        }
        Ok(())
    })?;
    Ok(())
}

/// Checks that the runs have numbers.
fn check_runs(first_run: u64, runs: usize) -> Result<(), NavError> {
    match first_run.checked_add(runs as u64) {
        Some(_) => Ok(()),
        None => Err(NavError::WrongCount {
            field: "runs",
            got: runs,
            expected: format!("at most {}, as first_run is {first_run}", u64::MAX - first_run),
        }),
    }
}

/// Checks that the times of the samples rise and lie within the truth.
pub(crate) fn check_samples(sample_time_ns: &[i64], truth_time_ns: &[i64]) -> Result<(), NavError> {
    require_rising("sample", sample_time_ns)?;
    let (Some(&first_ns), Some(&last_ns)) = (truth_time_ns.first(), truth_time_ns.last()) else {
        return Ok(());
    };
    match sample_time_ns.iter().find(|&&t| t < first_ns || t > last_ns) {
        None => Ok(()),
        Some(&time_ns) => Err(NavError::OutsideTruth {
            stream: "sample",
            time_ns,
            first_ns,
            last_ns,
        }),
    }
}

/// Runs a group of runs together, and returns the records or the error of each.
fn run_together(batch: &Batch<'_>, indices: Range<usize>, stop: &Stop) -> Vec<Result<Vec<MethodRecord>, NavError>> {
    let mut runs: Vec<_> = indices.clone().map(|index| monte_carlo_run(batch, index)).collect();
    let segments = runs.iter_mut().zip(indices).map(|(run, index)| {
        let schedule = batch.schedules[index.min(batch.schedules.len() - 1)];
        let run = run.as_mut().map_err(|error| error.clone())?;
        RunSegment::new(run, batch.truth, schedule, batch.sample_time_ns)
    });
    let outcomes = run_segments(segments, stop);
    let results = runs.into_iter().zip(outcomes);
    results
        .map(|(run, outcome)| outcome.and_then(|()| run.map(MonteCarloRun::into_records)))
        .collect()
}

/// The run of index `index`, at the start of the truth.
fn monte_carlo_run(batch: &Batch<'_>, index: usize) -> Result<MonteCarloRun, NavError> {
    let key = RunKey {
        seed: batch.seed,
        trajectory: batch.trajectory_key,
        run: batch.first_run + index as u64,
    };
    let start = true_state(&batch.truth, 0);
    let (simulated, assumed) = (batch.simulated, batch.assumed);
    MonteCarloRun::new(
        &start,
        batch.geometry,
        simulated,
        assumed,
        batch.options,
        batch.methods,
        &key,
    )
}
