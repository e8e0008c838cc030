//! One simulated run: its sensor errors, and every method on the same readings, along the whole truth or a part at a time.

use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamSample};
use crate::error::NavError;
use crate::filter::filter_group::{FilterSpan, Owner};
use crate::filter::options::Options;
use crate::filter::report::{Sensor, UpdateReport};
use crate::mechanisation::ImuSample;
use crate::model::Model;
use crate::navigator::Method;
use crate::navigator::Navigator;
use crate::navigator::events::Event;
use crate::navigator::run_events::{Failure, Feed};
use crate::simulation::epochs::{Aid, Epoch, Epochs};
pub use crate::simulation::method_record::{BiasRecord, MethodRecord};
use crate::simulation::method_record::{Deviation, nees_of};
use crate::simulation::schedule::Schedule;
use crate::simulation::sensor_errors::RunKey;
use crate::simulation::sensor_errors::{SensorErrors, drawn_start};
use crate::simulation::truth::{Truth, true_state};
use crate::state::NavState;

/// A method with its filters and results.
#[derive(Debug, Clone)]
struct MethodRun {
    method: Method,
    navigator: Navigator,
    record: MethodRecord,
    nis_sum: f64,
}

impl MethodRun {
    fn push(&mut self, event: &Event) -> Result<(), NavError> {
        let (record, nis_sum) = (&mut self.record, &mut self.nis_sum);
        self.navigator.push(event, &mut |report: &UpdateReport| {
            record.choices.extend(report.choice);
            if report.sensor == Sensor::Beams && report.rows > 0 {
                *nis_sum += report.nis;
                record.fixes_beyond_linear_range += u64::from(report.is_beyond_linear_range);
                if report.was_used() {
                    record.fixes_accepted += 1;
                } else {
                    record.fixes_rejected += 1;
                }
            }
        })
    }

    fn into_record(mut self) -> MethodRecord {
        let fixes = self.record.fixes_accepted + self.record.fixes_rejected;
        self.record.nis_mean = if fixes > 0 {
            self.nis_sum / fixes as f64
        } else {
            f64::NAN
        };
        self.record
    }

    fn deviation(&self, truth: &NavState) -> Deviation {
        let covariance = self.navigator.covariance();
        Deviation {
            error: truth.error_of(&self.navigator.state()),
            linear_error: self.navigator.filter().linear_error(truth, &covariance),
            covariance,
        }
    }
}

/// A run in progress.
#[derive(Debug)]
pub struct MonteCarloRun {
    number: u64,
    geometry: BeamGeometry,
    sensors: SensorErrors,
    methods: Vec<MethodRun>,
    started: bool,
}

impl MonteCarloRun {
    /// A run at its start: sensors as `simulated` says, filters that assume `assumed`, off by a drawn error.
    ///
    /// # Errors
    /// [`NavError`] for models and options that make no sense.
    pub fn new(
        start: &NavState,
        geometry: &BeamGeometry,
        simulated: &Model,
        assumed: &Model,
        options: &Options,
        methods: &[Method],
        key: &RunKey,
    ) -> Result<Self, NavError> {
        let initial = drawn_start(start, simulated, key);
        let methods = methods.iter().map(|&method| {
            let navigator = Navigator::new(initial, geometry.clone(), method.aiding, assumed, options)
                .map_err(|source| in_run(key.run, &method, source))?;
            Ok(MethodRun {
                method,
                navigator,
                record: MethodRecord::default(),
                nis_sum: 0.0,
            })
        });
        Ok(Self {
            number: key.run,
            geometry: geometry.clone(),
            sensors: SensorErrors::new(simulated, assumed, options, geometry.beams(), start.time_ns, key),
            methods: methods.collect::<Result<_, _>>()?,
            started: false,
        })
    }

    /// The estimate of a method.
    #[must_use]
    pub fn state(&self, method: usize) -> Option<NavState> {
        self.methods.get(method).map(|one| one.navigator.state())
    }

    /// Results of the methods, in their order.
    #[must_use]
    pub fn records(&self) -> Vec<MethodRecord> {
        self.methods.iter().cloned().map(MethodRun::into_record).collect()
    }

    /// [`MonteCarloRun::records`] of a run that is over.
    #[must_use]
    pub fn into_records(self) -> Vec<MethodRecord> {
        self.methods.into_iter().map(MethodRun::into_record).collect()
    }

    /// The last reading that the filters have taken.
    fn last_imu(&self) -> Option<ImuSample> {
        self.methods.first().and_then(|one| one.navigator.last_imu())
    }

    fn each(&mut self, mut work: impl FnMut(&mut MethodRun) -> Result<(), NavError>) -> Result<(), NavError> {
        let number = self.number;
        self.methods
            .iter_mut()
            .try_for_each(|one| work(one).map_err(|source| in_run(number, &one.method, source)))
    }

    /// Records the errors of every method, and their NEES side by side.
    fn sample(&mut self, truth: &NavState) -> Result<(), NavError> {
        let deviations: Vec<Deviation> = self.methods.iter().map(|one| one.deviation(truth)).collect();
        let nees = nees_of(&deviations);
        for ((one, deviation), nees) in self.methods.iter_mut().zip(&deviations).zip(nees) {
            let Some(nees) = nees else {
                let source = NavError::NotPositiveDefinite {
                    matrix: "state covariance",
                    time_ns: truth.time_ns,
                };
                return Err(in_run(self.number, &one.method, source));
            };
            one.record.push(deviation, nees);
        }
        Ok(())
    }

    fn measure(&mut self, truth: &Truth<'_>, schedule: &Schedule<'_>, (sensor, k): Epoch) -> Result<(), NavError> {
        let event = match sensor {
            Aid::Dvl => Event::Beams(self.sensors.ping(truth, &self.geometry, schedule, k)?),
            Aid::Water => match self.sensors.water_ping(truth, &self.geometry, &schedule.water, k)? {
                Some(sample) => Event::WaterTrack(sample),
                None => return Ok(()),
            },
            Aid::Sensor(kind) => {
                let epochs = schedule.of(kind);
                let offset = epochs.offset.get(k).copied().unwrap_or(0.0);
                match self.sensors.measure(truth, kind, epochs.time_ns[k], offset)? {
                    Some(measurement) => Event::Aiding(measurement),
                    None => return Ok(()),
                }
            }
        };
        let all = BeamMask::all(self.geometry.beams());
        self.each(|one| match event {
            Event::Beams(ping) if one.method.all_beams => one.push(&Event::Beams(BeamSample { valid: all, ..ping })),
            _ => one.push(&event),
        })
    }
}

fn in_run(run: u64, method: &Method, source: NavError) -> NavError {
    NavError::InRun {
        run,
        method: method.name,
        source: Box::new(source),
    }
}

/// A run along a segment of the truth.
///
/// The first segment begins at the start; each later one begins with the last sample of the one before. Epochs lie after the
/// segment's first sample (the first segment: at or after it). Errors are recorded at the first sample at or after each of
/// `sample_time_ns`. However the truth is cut, the bits are the same.
pub(crate) struct RunSegment<'a> {
    run: &'a mut MonteCarloRun,
    truth: Truth<'a>,
    schedule: Schedule<'a>,
    epochs: Epochs<'a>,
    sample_time_ns: &'a [i64],
    /// The sample of the truth that comes next.
    next: usize,
    /// The last reading that the filters have taken, and those that they take next.
    readings: Vec<ImuSample>,
    /// How many of them are new.
    drawn: usize,
}

impl<'a> RunSegment<'a> {
    /// At the start of a segment.
    ///
    /// # Errors
    /// [`NavError`] for a schedule that is not valid.
    pub(crate) fn new(
        run: &'a mut MonteCarloRun,
        truth: Truth<'a>,
        schedule: Schedule<'a>,
        sample_time_ns: &'a [i64],
    ) -> Result<Self, NavError> {
        schedule.validate()?;
        let next = usize::from(run.started);
        Ok(Self {
            run,
            truth,
            schedule,
            epochs: Epochs::new(&schedule),
            sample_time_ns,
            next,
            readings: Vec::new(),
            drawn: 0,
        })
    }

    /// Times of the samples ahead, ns.
    pub(crate) fn ahead_ns(&self) -> &'a [i64] {
        &self.truth.time_ns[self.next..]
    }

    /// Processes the measurements at the last sample and records it.
    fn after_sample(&mut self) -> Result<(), NavError> {
        let k = self.next - 1;
        let time_ns = self.truth.time_ns[k];
        while let Some(epoch) = self.epochs.next_if(|epoch_ns| epoch_ns <= time_ns) {
            self.run.measure(&self.truth, &self.schedule, epoch)?;
        }
        let due = self.sample_time_ns.partition_point(|&sample_ns| sample_ns <= time_ns);
        self.sample_time_ns = &self.sample_time_ns[due..];
        for _ in 0..due {
            let mut state = true_state(&self.truth, k);
            self.run.sensors.errors_into(&mut state);
            self.run.sample(&state)?;
        }
        Ok(())
    }
}

impl Feed for RunSegment<'_> {
    fn is_over(&self) -> bool {
        self.ahead_ns().is_empty()
    }

    fn clear_readings(&self) -> usize {
        let ahead_ns = self.ahead_ns();
        // The first reading starts the filters, where there are any.
        if self.run.last_imu().is_none() && !self.run.methods.is_empty() {
            return 0;
        }
        let mut clear = ahead_ns.len();
        if let Some(epoch_ns) = self.epochs.next_ns() {
            let before = ahead_ns.partition_point(|&time_ns| time_ns < epoch_ns);
            clear = before + usize::from(ahead_ns.get(before) == Some(&epoch_ns));
        }
        if let Some(&wanted_ns) = self.sample_time_ns.first() {
            clear = clear.min(ahead_ns.partition_point(|&time_ns| time_ns < wanted_ns) + 1);
        }
        clear
    }

    fn step(&mut self) -> Result<(), NavError> {
        let time_ns = self.truth.time_ns[self.next];
        // What falls between two samples waits inside the navigator for the later one.
        while let Some(epoch) = self.epochs.next_if(|epoch_ns| epoch_ns < time_ns) {
            self.run.measure(&self.truth, &self.schedule, epoch)?;
        }
        let reading = Event::Imu(self.run.sensors.imu(&self.truth, self.next));
        self.run.each(|one| one.push(&reading))?;
        self.next += 1;
        self.after_sample()
    }

    fn draw_readings(&mut self, count: usize) -> Result<(), NavError> {
        self.readings.clear();
        self.readings.extend(self.run.last_imu());
        let taken = self.readings.len();
        self.drawn = count;
        let readings = &mut self.readings;
        self.run
            .sensors
            .imus(&self.truth, self.next..self.next + count, &mut |reading, _, _| {
                readings.push(reading);
            });
        let bad = self.readings[taken..]
            .iter()
            .find_map(|reading| reading.validate().err());
        match (bad, self.run.methods.first()) {
            (Some(source), Some(first)) => Err(in_run(self.run.number, &first.method, source)),
            _ => Ok(()),
        }
    }

    fn spans(&mut self, feed: usize) -> Vec<FilterSpan<'_>> {
        let samples = &self.readings[..];
        let mut spans = Vec::new();
        for (navigator, one) in self.run.methods.iter_mut().enumerate() {
            let filters = one.navigator.filters_mut();
            spans.extend(filters.map(|filter| FilterSpan::new(filter, samples).owned_by(Owner { feed, navigator })));
        }
        spans
    }

    fn after_readings(&mut self, failures: Vec<Failure>) -> Result<(), NavError> {
        if let Some(first) = failures.into_iter().min_by_key(|failure| failure.at) {
            return Err(in_run(
                self.run.number,
                &self.run.methods[first.navigator].method,
                first.error,
            ));
        }
        self.next += self.drawn;
        if let Some(&last) = self.readings.last() {
            self.run
                .methods
                .iter_mut()
                .for_each(|one| one.navigator.has_taken(&last));
        }
        self.after_sample()
    }

    fn finish(&mut self) -> Result<(), NavError> {
        self.run.started = true;
        // Only epochs beyond the stretch are left, and the truth rejects them.
        while let Some(epoch) = self.epochs.next_if(|_| true) {
            self.run.measure(&self.truth, &self.schedule, epoch)?;
        }
        Ok(())
    }
}
