//! Vehicles that are steered on their estimates: the caller reads the estimates, and says how the vehicles moved.

use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::model::Model;
use crate::navigator::Method;
use crate::simulation::monte_carlo_run::{MethodRecord, MonteCarloRun, RunSegment};
use crate::simulation::run_group;
use crate::simulation::run_group::run_segments;
use crate::simulation::schedule::Schedule;
use crate::simulation::sensor_errors::RunKey;
use crate::simulation::truth::Truth;
use crate::state::NavState;
use crate::workers::Workers;

/// A vehicle at its start: the run whose sensor errors it has, its true state, and its methods.
#[derive(Debug, Clone, Copy)]
pub struct VehicleStart<'a> {
    /// Number of the run.
    pub run: u64,
    /// True state at the start.
    pub start: NavState,
    /// Ways of aiding, side by side.
    pub methods: &'a [Method],
}

/// What the vehicles of a closed loop have in common.
#[derive(Debug, Clone, Copy)]
pub struct ClosedLoopSetup<'a> {
    /// The beams.
    pub geometry: &'a BeamGeometry,
    /// What the sensors are.
    pub simulated: &'a Model,
    /// What the filter assumes them to be.
    pub assumed: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// Seed of the campaign.
    pub seed: u64,
    /// Key of the trajectory.
    pub trajectory_key: u64,
}

/// The motion of one vehicle since the last call.
#[derive(Debug, Clone, Copy)]
pub struct TruthSegment<'a> {
    /// Truth, from the last sample of the segment before (or the start) to its own end.
    pub truth: Truth<'a>,
    /// Epochs in it.
    pub schedule: Schedule<'a>,
}

/// Vehicles, each steered on the estimate of one of its methods.
///
/// The sensor errors of run k are those of run k of a campaign: with the same truth it yields the same bits.
#[derive(Debug)]
pub struct ClosedLoop {
    runs: Vec<MonteCarloRun>,
    /// How many of them run together.
    together: usize,
    workers: Workers,
}

impl ClosedLoop {
    /// A vehicle for each start.
    ///
    /// # Errors
    /// [`NavError`] for models, options, starts and numbers of threads that make no sense.
    pub fn new(common: &ClosedLoopSetup<'_>, starts: &[VehicleStart<'_>], threads: usize) -> Result<Self, NavError> {
        common.simulated.validate()?;
        let begin = |start: &VehicleStart<'_>| {
            start.start.validate()?;
            let key = RunKey {
                seed: common.seed,
                trajectory: common.trajectory_key,
                run: start.run,
            };
            let (simulated, assumed) = (common.simulated, common.assumed);
            let (start, methods) = (&start.start, start.methods);
            MonteCarloRun::new(
                start,
                common.geometry,
                simulated,
                assumed,
                common.options,
                methods,
                &key,
            )
        };
        let workers = Workers::new(threads)?;
        let methods = starts.first().map_or(&[][..], |first| first.methods);
        Ok(Self {
            runs: starts.iter().map(begin).collect::<Result<_, _>>()?,
            together: run_group::size(methods, starts.len(), workers.threads()).get(),
            workers,
        })
    }

    /// Leads every vehicle along its segment.
    ///
    /// # Errors
    /// As [`MonteCarloRun::advance`], and for a number of segments other than that of the vehicles.
    pub fn advance(&mut self, segments: &[TruthSegment<'_>], sample_time_ns: &[i64]) -> Result<(), NavError> {
        if segments.len() != self.runs.len() {
            return Err(NavError::WrongCount {
                field: "segments",
                got: segments.len(),
                expected: format!("{}, one per vehicle", self.runs.len()),
            });
        }
        let together = self.together;
        let mut groups: Vec<_> = self.runs.chunks_mut(together).collect();
        let outcomes = self.workers.each(&mut groups, |group, runs| {
            let own = segments[group * together..].iter().zip(runs.iter_mut());
            Ok(run_segments(own.map(|(segment, run)| {
                segment.truth.validate()?;
                RunSegment::new(run, segment.truth, segment.schedule, sample_time_ns)
            })))
        })?;
        outcomes.into_iter().flatten().collect()
    }

    /// The estimate of a method in every vehicle; empty for a method that is not there.
    #[must_use]
    pub fn estimates(&self, method: usize) -> Vec<NavState> {
        self.runs.iter().filter_map(|run| run.state(method)).collect()
    }

    /// What the methods of every vehicle have yielded.
    #[must_use]
    pub fn records(&self) -> Vec<Vec<MethodRecord>> {
        self.runs.iter().map(MonteCarloRun::records).collect()
    }
}
