//! Runs whose truth depends on their own estimates: whoever steers asks where each believes it is, and tells where it went.

use crate::batch::Arm;
use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::model::{Model, Options};
use crate::sensors::{RunKey, Schedule};
use crate::state::NavState;
use crate::truth::Truth;
use crate::voyage::{ArmRecord, Voyage};
use crate::workers::Workers;

/// What the runs of a closed loop have in common.
#[derive(Debug, Clone, Copy)]
pub struct Common<'a> {
    /// The beams.
    pub geometry: &'a BeamGeometry,
    /// What the sensors are.
    pub simulated: &'a Model,
    /// What the filter assumes them to be.
    pub assumed: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// Ways of aiding, side by side in every run.
    pub arms: &'a [Arm],
    /// Seed of the campaign.
    pub seed: u64,
    /// Key of the trajectory.
    pub trajectory_key: u64,
    /// Number of the first run.
    pub first_run: u64,
}

/// The way that one run went since the last time it was asked.
#[derive(Debug, Clone, Copy)]
pub struct Stretch<'a> {
    /// Truth, from the last sample of the stretch before (or the start) to its own end.
    pub truth: Truth<'a>,
    /// Epochs in it.
    pub schedule: Schedule<'a>,
}

/// Runs under way, each steered on what one of its arms believes.
///
/// The sensor errors of run k are those of run k of a campaign: with the same truth it yields the same bits.
#[derive(Debug)]
pub struct ClosedLoop {
    voyages: Vec<Voyage>,
    workers: Workers,
}

impl ClosedLoop {
    /// A run for each true state at the start.
    ///
    /// # Errors
    /// [`NavError`] for models, options, starts and numbers of threads that make no sense.
    pub fn new(common: &Common<'_>, starts: &[NavState], threads: usize) -> Result<Self, NavError> {
        common.simulated.validate()?;
        let begin = |(k, start): (usize, &NavState)| {
            start.validate()?;
            let key = RunKey {
                seed: common.seed,
                trajectory: common.trajectory_key,
                run: common.first_run + k as u64,
            };
            Voyage::new(
                start,
                common.geometry,
                common.simulated,
                common.assumed,
                common.options,
                common.arms,
                &key,
            )
        };
        Ok(Self {
            voyages: starts.iter().enumerate().map(begin).collect::<Result<_, _>>()?,
            workers: Workers::new(threads)?,
        })
    }

    /// Leads every run along its stretch.
    ///
    /// # Errors
    /// As [`Voyage::advance`], and for a number of stretches other than that of the runs.
    pub fn advance(&mut self, stretches: &[Stretch<'_>], sample_time_ns: &[i64]) -> Result<(), NavError> {
        if stretches.len() != self.voyages.len() {
            return Err(NavError::WrongCount {
                field: "stretches",
                got: stretches.len(),
                expected: format!("{}, one per run", self.voyages.len()),
            });
        }
        self.workers.each(&mut self.voyages, |k, voyage| {
            stretches[k].truth.validate()?;
            voyage.advance(&stretches[k].truth, &stretches[k].schedule, sample_time_ns)
        })?;
        Ok(())
    }

    /// What an arm believes in every run; empty for an arm that is not there.
    #[must_use]
    pub fn beliefs(&self, arm: usize) -> Vec<NavState> {
        self.voyages.iter().filter_map(|voyage| voyage.state(arm)).collect()
    }

    /// What the arms of every run have yielded.
    #[must_use]
    pub fn records(&self) -> Vec<Vec<ArmRecord>> {
        self.voyages.iter().map(Voyage::records).collect()
    }
}
