//! Runs × methods: every method of a run sees the same streams; results are placed by index.

use std::ops::Range;

use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::model::Model;
use crate::navigator::Method;
use crate::simulation::monte_carlo_run::{MonteCarloRun, RunSegment};
use crate::simulation::run_group;
use crate::simulation::run_group::run_segments;
use crate::simulation::schedule::Schedule;
use crate::simulation::sensor_errors::RunKey;
use crate::simulation::truth::{Truth, true_state};
use crate::workers::Workers;

pub use crate::simulation::monte_carlo_run::MethodRecord;

/// What a batch works on.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// The true motion.
    pub truth: Truth<'a>,
    /// The beams.
    pub geometry: &'a BeamGeometry,
    /// What the sensors are.
    pub simulated: &'a Model,
    /// What the filter assumes them to be.
    pub assumed: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// When sensors measure and which beams return: one for all runs, or one for each.
    pub schedules: &'a [Schedule<'a>],
    /// Times at which errors are recorded, ns, rising; the first IMU sample at or after each counts.
    pub sample_time_ns: &'a [i64],
    /// Ways of aiding.
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

/// Works off a batch on `threads` threads; the bits do not depend on their number.
///
/// # Errors
/// [`NavError`]; an error inside a run names the run and the method.
pub fn run_batch(batch: &Batch<'_>, threads: usize) -> Result<Vec<Vec<MethodRecord>>, NavError> {
    let mut yielded = vec![Vec::new(); batch.runs];
    run_batch_into(batch, threads, &mut yielded, |place, records| *place = records)?;
    Ok(yielded)
}

/// As [`run_batch`]; `take` gets what each run yields, with its own place, as soon as the run is over, on the thread that flew it.
///
/// # Errors
/// As [`run_batch`], and [`NavError::WrongCount`] for a number of places other than that of the runs.
pub fn run_batch_into<P: Send>(
    batch: &Batch<'_>,
    threads: usize,
    places: &mut [P],
    take: impl Fn(&mut P, Vec<MethodRecord>) + Sync + Send,
) -> Result<(), NavError> {
    if places.len() != batch.runs {
        return Err(NavError::WrongCount {
            field: "places",
            got: places.len(),
            expected: format!("{}, one per run", batch.runs),
        });
    }
    batch.truth.validate()?;
    batch.simulated.validate()?;
    if batch.schedules.len() != 1 && batch.schedules.len() != batch.runs {
        return Err(NavError::WrongCount {
            field: "schedules",
            got: batch.schedules.len(),
            expected: format!("1 for all runs or {}, one per run", batch.runs),
        });
    }
    if let Some(pair) = batch.sample_time_ns.windows(2).find(|pair| pair[1] <= pair[0]) {
        return Err(NavError::TimeNotIncreasing {
            stream: "sample",
            time_ns: pair[1],
            previous_ns: pair[0],
        });
    }
    let last_ns = batch.truth.time_ns[batch.truth.time_ns.len() - 1];
    let first_ns = batch.truth.time_ns[0];
    if let Some(&time_ns) = batch.sample_time_ns.iter().find(|&&t| t < first_ns || t > last_ns) {
        return Err(NavError::OutsideTruth {
            stream: "sample",
            time_ns,
            first_ns,
            last_ns,
        });
    }
    let workers = Workers::new(threads)?;
    let together = run_group::size(batch.methods, batch.runs, workers.threads()).get();
    let mut groups: Vec<_> = places.chunks_mut(together).collect();
    workers.each(&mut groups, |group, places| {
        let first = group * together;
        let yielded = some_runs(batch, first..first + places.len());
        for (place, records) in places.iter_mut().zip(yielded) {
            take(place, records?);
        }
        Ok(())
    })?;
    Ok(())
}

/// Runs that fly together; what each yields, or why it failed.
fn some_runs(batch: &Batch<'_>, runs: Range<usize>) -> Vec<Result<Vec<MethodRecord>, NavError>> {
    let mut begun: Vec<_> = runs.clone().map(|index| begin(batch, index)).collect();
    let segments = begun.iter_mut().zip(runs).map(|(run, index)| {
        let schedule = batch.schedules[index.min(batch.schedules.len() - 1)];
        let run = run.as_mut().map_err(|error| error.clone())?;
        RunSegment::new(run, batch.truth, schedule, batch.sample_time_ns)
    });
    let outcomes = run_segments(segments);
    let yielded = begun.into_iter().zip(outcomes);
    yielded
        .map(|(run, outcome)| outcome.and_then(|()| run.map(MonteCarloRun::into_records)))
        .collect()
}

fn begin(batch: &Batch<'_>, index: usize) -> Result<MonteCarloRun, NavError> {
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
