//! Closed-loop simulation: the caller steers each vehicle on its estimate and returns the truth that results.

use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::model::Model;
use crate::navigator::Method;
use crate::simulation::batch::check_samples;
use crate::simulation::monte_carlo_run::{MethodRecord, MonteCarloRun, RunSegment};
use crate::simulation::run_group;
use crate::simulation::run_group::run_segments;
use crate::simulation::schedule::Schedule;
use crate::simulation::sensor_errors::RunKey;
use crate::simulation::truth::Truth;
use crate::state::NavState;
use crate::stop::Stop;
use crate::workers::Workers;

/// Start of a vehicle: run number, true state, and methods.
#[derive(Debug, Clone, Copy)]
pub struct VehicleStart<'a> {
    /// Run number, which sets the sensor errors.
    pub run: u64,
    /// True state at the start.
    pub start: NavState,
    /// Aiding methods of the vehicle.
    pub methods: &'a [Method],
}

impl<'a> VehicleStart<'a> {
    /// Vehicles of consecutive runs: one for each run with all methods, or, with `vehicle_per_method`, one for each run and method.
    ///
    /// # Errors
    /// [`NavError::Setting`] without a method, for starts that are no multiple of the methods, and for runs without a number.
    pub fn of_runs(
        first_run: u64,
        starts: &[NavState],
        methods: &'a [Method],
        vehicle_per_method: bool,
    ) -> Result<Vec<Self>, NavError> {
        if methods.is_empty() {
            return Err(NavError::setting("methods", "is empty", "at least one"));
        }
        let vehicles: Vec<&[Method]> = if vehicle_per_method {
            methods.chunks(1).collect()
        } else {
            vec![methods]
        };
        if !starts.len().is_multiple_of(vehicles.len()) {
            let expected = format!("a multiple of {} methods", vehicles.len());
            return Err(NavError::setting(
                "start",
                format!("has {} rows", starts.len()),
                expected,
            ));
        }
        let vehicle = |(k, &start): (usize, &NavState)| {
            let run = first_run.checked_add((k / vehicles.len()) as u64).ok_or_else(|| {
                let expected = "room for the runs after it";
                NavError::setting("first_run", format!("is {first_run}"), expected)
            })?;
            let methods = vehicles[k % vehicles.len()];
            Ok(Self { run, start, methods })
        };
        starts.iter().enumerate().map(vehicle).collect()
    }
}

/// Settings common to the vehicles of a closed loop.
#[derive(Debug, Clone, Copy)]
pub struct ClosedLoopSetup<'a> {
    /// Beam geometry.
    pub geometry: &'a BeamGeometry,
    /// Model of the simulated sensors.
    pub simulated: &'a Model,
    /// Model that the filters assume.
    pub assumed: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// Seed of the campaign.
    pub seed: u64,
    /// Key of the trajectory.
    pub trajectory_key: u64,
}

/// Truth of one vehicle since the previous call.
#[derive(Debug, Clone, Copy)]
pub struct TruthSegment<'a> {
    /// Truth from the last sample of the previous segment (or the start) to the end of this one.
    pub truth: Truth<'a>,
    /// Measurement epochs in the segment.
    pub schedule: Schedule<'a>,
}

/// Vehicles of a closed loop, each steered on the estimate of one of its methods.
///
/// The sensor errors of run k are those of run k of a campaign, so the same truth gives the same results, bit for bit.
#[derive(Debug)]
pub struct ClosedLoop {
    runs: Vec<MonteCarloRun>,
    /// Number of runs whose filters are propagated together.
    group_size: usize,
    workers: Workers,
    /// Time that every vehicle has come to, ns; none without vehicles.
    reached_ns: Option<i64>,
    /// The error of a call that left the vehicles at different places.
    failure: Option<NavError>,
}

impl ClosedLoop {
    /// One vehicle per start, on `threads` threads (0: one per core).
    ///
    /// # Errors
    /// [`NavError`] for an invalid model, option, start or number of threads, which names the field, and for a vehicle
    /// without methods.
    pub fn new(setup: &ClosedLoopSetup<'_>, starts: &[VehicleStart<'_>], threads: usize) -> Result<Self, NavError> {
        setup.simulated.validate()?;
        let begin = |start: &VehicleStart<'_>| {
            start.start.validate()?;
            if start.methods.is_empty() {
                return Err(NavError::WrongCount {
                    field: "methods",
                    got: 0,
                    expected: "at least one".into(),
                });
            }
            let key = RunKey {
                seed: setup.seed,
                trajectory: setup.trajectory_key,
                run: start.run,
            };
            let (simulated, assumed) = (setup.simulated, setup.assumed);
            let (start, methods) = (&start.start, start.methods);
            MonteCarloRun::new(start, setup.geometry, simulated, assumed, setup.options, methods, &key)
        };
        let workers = Workers::new(threads)?;
        let methods = starts.first().map_or(&[][..], |first| first.methods);
        Ok(Self {
            runs: starts.iter().map(begin).collect::<Result<_, _>>()?,
            group_size: run_group::size(methods, starts.len(), workers.threads()).get(),
            workers,
            reached_ns: starts.first().map(|first| first.start.time_ns),
            failure: None,
        })
    }

    /// Runs every vehicle along its segment and records errors at `sample_time_ns`.
    ///
    /// # Errors
    /// [`NavError`] for an invalid truth or schedule, a truth that does not begin where the last one ended, and samples
    /// outside the truth, and [`NavError::WrongCount`] unless there is one segment per vehicle: the loop is then as before.
    /// [`NavError::InRun`] for an error during a run and [`NavError::Interrupted`] where `stop` asks for an early end: the
    /// loop has then failed, and every later call returns [`NavError::AfterFailure`].
    pub fn advance(
        &mut self,
        segments: &[TruthSegment<'_>],
        sample_time_ns: &[i64],
        stop: &Stop,
    ) -> Result<(), NavError> {
        self.check()?;
        self.check_segments(segments, sample_time_ns)?;
        // Holds until the vehicles have all arrived.
        self.failure = Some(NavError::Interrupted);
        let outcome = self.run(segments, sample_time_ns, stop);
        self.failure = outcome.as_ref().err().cloned();
        self.reached_ns = segments
            .first()
            .and_then(|segment| segment.truth.time_ns.last().copied());
        outcome
    }

    /// Checks that the loop can go on.
    ///
    /// # Errors
    /// [`NavError::AfterFailure`] where a call to [`ClosedLoop::advance`] has failed on the way.
    pub fn check(&self) -> Result<(), NavError> {
        match &self.failure {
            None => Ok(()),
            Some(failure) => Err(NavError::AfterFailure {
                source: Box::new(failure.clone()),
            }),
        }
    }

    /// Checks the segments before any vehicle takes its own.
    fn check_segments(&self, segments: &[TruthSegment<'_>], sample_time_ns: &[i64]) -> Result<(), NavError> {
        if segments.len() != self.runs.len() {
            return Err(NavError::WrongCount {
                field: "segments",
                got: segments.len(),
                expected: format!("{}, one per vehicle", self.runs.len()),
            });
        }
        for TruthSegment { truth, schedule } in segments {
            truth.validate()?;
            schedule.validate()?;
            let (time_ns, expected_ns) = (truth.time_ns[0], self.reached_ns.unwrap_or(truth.time_ns[0]));
            if time_ns != expected_ns {
                return Err(NavError::NotContinued { time_ns, expected_ns });
            }
            check_samples(sample_time_ns, truth.time_ns)?;
        }
        Ok(())
    }

    fn run(&mut self, segments: &[TruthSegment<'_>], sample_time_ns: &[i64], stop: &Stop) -> Result<(), NavError> {
        let group_size = self.group_size;
        let mut groups: Vec<_> = self.runs.chunks_mut(group_size).collect();
        let outcomes = self.workers.each(&mut groups, |group, runs| {
            let own = segments[group * group_size..].iter().zip(runs.iter_mut());
            let begun = own.map(|(segment, run)| RunSegment::new(run, segment.truth, segment.schedule, sample_time_ns));
            Ok(run_segments(begun, stop))
        })?;
        outcomes.into_iter().flatten().collect()
    }

    /// Estimate of a method (by index) on every vehicle; empty if there is no such method.
    #[must_use]
    pub fn estimates(&self, method: usize) -> Vec<NavState> {
        self.runs.iter().filter_map(|run| run.state(method)).collect()
    }

    /// Records of every vehicle, method by method.
    #[must_use]
    pub fn records(&self) -> Vec<Vec<MethodRecord>> {
        self.runs.iter().map(MonteCarloRun::records).collect()
    }
}
