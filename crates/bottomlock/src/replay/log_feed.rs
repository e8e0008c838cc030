//! Methods side by side on the events of one log.

use super::innovations::{InnovationRecord, Withheld};
use super::log::{IMU, in_row};
use super::{BridgedInterval, ImuFaults, PingRecord, Replay, STREAMS, Series, Track, sensor_record};
use crate::error::NavError;
use crate::filter::BridgeNoise;
use crate::filter::filter_group::{FilterSpan, Owner};
use crate::filter::report::{Sensor, UpdateReport};
use crate::mechanisation::ImuSample;
use crate::navigator::events::Event;
use crate::navigator::run_events::{Failure, Feed};
use crate::navigator::{Method, Navigator};
use crate::smoother::smooth;
use crate::stop::Stop;

/// A method on a log.
#[derive(Debug)]
pub(super) struct MethodReplay {
    method: Method,
    navigator: Navigator,
    track: Track,
    withheld: Withheld,
    /// The error that ended it; other methods continue.
    failure: Option<NavError>,
}

impl MethodReplay {
    pub(super) fn new(request: &Replay<'_>, method: &Method) -> Result<Self, NavError> {
        let (start, model, options) = (request.start, request.model, request.options);
        let in_method = |source| in_method(method, source);
        let mut navigator =
            Navigator::new(start, request.geometry.clone(), method.aiding, model, options).map_err(in_method)?;
        if let Some(covariance) = request.covariance {
            navigator.set_covariance(covariance).map_err(in_method)?;
        }
        navigator.require_plausible_settings().map_err(in_method)?;
        navigator.require_plausible().map_err(in_method)?;
        if request.smooth {
            navigator.filters().begin_tape();
        }
        Ok(Self {
            method: *method,
            navigator,
            track: Track {
                pings: vec![PingRecord::default(); request.log.pings.len()],
                ..Track::default()
            },
            withheld: Withheld::default(),
            failure: None,
        })
    }

    /// Number of its filters.
    pub(super) fn filters(&mut self) -> usize {
        self.navigator.filters_mut().count()
    }

    fn push(&mut self, event: &Event, bridge: Option<&BridgeNoise>, request: &Replay<'_>) -> Result<(), NavError> {
        let (track, pings, aiding) = (&mut self.track, request.log.pings, self.method.aiding);
        if let Event::Imu(sample) = event {
            self.withheld.advance(sample, bridge, &mut track.innovations)?;
        }
        let note = &mut |report: &UpdateReport| {
            sensor_record::count(&mut track.sensors, report);
            if request.innovations {
                track.innovations.extend(InnovationRecord::of(report, false));
            }
            if report.sensor == Sensor::Beams
                && let Ok(index) = pings.binary_search_by_key(&report.time_ns, |ping| ping.time_ns)
            {
                track.pings[index] = PingRecord::new(report, &pings[index], aiding.rows_are_beams());
            }
        };
        match event {
            Event::Imu(sample) => self.navigator.push_bridging(sample, bridge, note)?,
            _ => self.navigator.push(event, note)?,
        }
        self.navigator.require_plausible()
    }

    /// Predicts a measurement that is not used.
    fn predict(&mut self, event: &Event) -> Result<(), NavError> {
        self.withheld
            .predict(&self.navigator, event, &mut self.track.innovations)
    }

    fn record(&mut self, keep_covariance: bool) {
        let (state, covariance) = (self.navigator.state(), self.navigator.covariance());
        self.track.filtered.push(state, &covariance, keep_covariance);
        let filter = self.navigator.filter();
        self.track.attitude_errors.extend(filter.attitude_error_rad());
        self.track.currents.push(filter.current());
        let slow = filter.slow_errors();
        let largest = &mut self.track.slow_errors;
        largest.resize(slow.len(), ("", 0.0));
        for (kept, now) in largest.iter_mut().zip(slow) {
            *kept = (now.0, kept.1.max(now.1));
        }
        let calibration = filter.calibration();
        let numbers = calibration.map(|(estimate, covariance)| (estimate.numbers(), covariance));
        self.track.calibrations.extend(numbers);
        self.navigator.filters().record_sample();
    }

    fn into_track(mut self, keep_covariances: bool, stop: &Stop) -> Result<Track, NavError> {
        if let Some(source) = self.failure {
            return Err(in_method(&self.method, source));
        }
        if let Some(tape) = self.navigator.filters().take_tape() {
            self.track.tape_bytes = tape.bytes();
            let mut smoothed = Series::default();
            for sample in smooth(tape, stop).map_err(|source| in_method(&self.method, source))? {
                smoothed.push(sample.state, &sample.covariance, keep_covariances);
            }
            self.track.smoothed = smoothed;
        }
        Ok(self.track)
    }
}

fn in_method(method: &Method, source: NavError) -> NavError {
    NavError::InMethod {
        method: method.name,
        source: Box::new(source),
    }
}

/// Methods on the events of a log from the start on; one that fails does not stop the others.
pub(super) struct LogFeed<'a> {
    request: &'a Replay<'a>,
    methods: Vec<MethodReplay>,
    /// The next row of each stream.
    next: [usize; STREAMS],
    /// Sample times to come.
    sample_time_ns: &'a [i64],
    /// The last reading that the filters have taken, and those that they take next.
    readings: &'a [ImuSample],
    faults: &'a ImuFaults,
    /// Bridged intervals to come.
    bridged: &'a [BridgedInterval],
}

impl<'a> LogFeed<'a> {
    pub(super) fn new(request: &'a Replay<'a>, faults: &'a ImuFaults, methods: Vec<MethodReplay>) -> Self {
        Self {
            request,
            methods,
            next: request.log.rows_before(request.start.time_ns),
            sample_time_ns: request.sample_time_ns,
            readings: &[],
            faults,
            bridged: &faults.bridged,
        }
    }

    /// Result of each method, or its error.
    pub(super) fn into_tracks(self, stop: &Stop) -> Vec<Result<Track, NavError>> {
        let keep = self.request.covariances;
        self.methods.into_iter().map(|one| one.into_track(keep, stop)).collect()
    }

    /// The readings ahead.
    fn ahead(&self) -> &'a [ImuSample] {
        &self.request.log.imu[self.next[IMU]..]
    }

    /// Pushes an event of a row to every method; what goes wrong names the row.
    fn push(&mut self, (stream, row): (usize, usize), event: &Event, bridge: Option<&BridgeNoise>) {
        let in_row = in_row(stream, row);
        let is_withheld = self.request.withheld[stream].get(row).is_some_and(|&flag| flag);
        for one in self.methods.iter_mut().filter(|one| one.failure.is_none()) {
            let outcome = if is_withheld {
                one.predict(event)
            } else {
                one.push(event, bridge, self.request)
            };
            one.failure = outcome.err().map(&in_row);
        }
    }

    /// Pushes the measurements before a time, in the order of the streams at the same time.
    fn push_before(&mut self, time_ns: i64) -> Result<(), NavError> {
        while let Some((stream, event)) = self.request.log.earliest(&self.next, IMU + 1)
            && event.time_ns() < time_ns
        {
            let row = self.next[stream];
            if let Some(one) = self.methods.iter().find(|one| one.failure.is_none()) {
                one.navigator.require_measurable(&event).map_err(in_row(stream, row))?;
            }
            self.next[stream] += 1;
            self.push((stream, row), &event, None);
        }
        Ok(())
    }

    /// Processes the measurements at a reading and records the sample.
    fn after_reading(&mut self, time_ns: i64) -> Result<(), NavError> {
        self.push_before(time_ns.saturating_add(1))?;
        let due = self.sample_time_ns.partition_point(|&sample_ns| sample_ns <= time_ns);
        self.sample_time_ns = &self.sample_time_ns[due..];
        for one in self.methods.iter_mut().filter(|one| one.failure.is_none()) {
            (0..due).for_each(|_| one.record(self.request.covariances));
        }
        Ok(())
    }
}

impl Feed for LogFeed<'_> {
    fn is_over(&self) -> bool {
        self.ahead().is_empty()
    }

    fn clear_readings(&self) -> usize {
        let ahead = self.ahead();
        // The first reading starts the filters.
        let begun = self.methods.iter().find(|one| one.failure.is_none());
        if begun.is_none_or(|one| one.navigator.last_imu().is_none()) {
            return 0;
        }
        let mut clear = ahead.len();
        if let Some((_, event)) = self.request.log.earliest(&self.next, IMU + 1) {
            let before = ahead.partition_point(|reading| reading.time_ns < event.time_ns());
            let is_at = ahead
                .get(before)
                .is_some_and(|reading| reading.time_ns == event.time_ns());
            clear = before + usize::from(is_at);
        }
        if let Some(bridged) = self.bridged.first() {
            clear = clear.min(ahead.partition_point(|reading| reading.time_ns < bridged.time_ns));
        }
        if let Some(&wanted_ns) = self.sample_time_ns.first() {
            clear = clear.min(ahead.partition_point(|reading| reading.time_ns < wanted_ns) + 1);
        }
        clear
    }

    fn step(&mut self) -> Result<(), NavError> {
        let reading = self.ahead()[0];
        // What falls between two readings waits inside the navigator for the later one.
        self.push_before(reading.time_ns)?;
        let bridge = self
            .bridged
            .first()
            .filter(|bridged| bridged.time_ns == reading.time_ns);
        self.bridged = &self.bridged[usize::from(bridge.is_some())..];
        let row = self.faults.row_of(self.next[IMU]);
        self.push((IMU, row), &Event::Imu(reading), bridge.map(|bridged| &bridged.noise));
        self.next[IMU] += 1;
        self.after_reading(reading.time_ns)
    }

    fn draw_readings(&mut self, count: usize) -> Result<(), NavError> {
        let next = self.next[IMU];
        self.readings = &self.request.log.imu[next - 1..next + count];
        Ok(())
    }

    fn spans(&mut self, feed: usize) -> Vec<FilterSpan<'_>> {
        let samples = self.readings;
        let mut spans = Vec::new();
        for (navigator, one) in self.methods.iter_mut().enumerate() {
            if one.failure.is_none() {
                let filters = one.navigator.filters_mut();
                spans
                    .extend(filters.map(|filter| FilterSpan::new(filter, samples).owned_by(Owner { feed, navigator })));
            }
        }
        spans
    }

    fn after_readings(&mut self, mut failures: Vec<Failure>) -> Result<(), NavError> {
        failures.sort_by_key(|failure| failure.at);
        for failure in failures {
            self.methods[failure.navigator].failure.get_or_insert(failure.error);
        }
        if let Some(last) = self.readings.last() {
            self.next[IMU] += self.readings.len() - 1;
            let going = self.methods.iter_mut().filter(|one| one.failure.is_none());
            for one in going {
                one.navigator.has_taken(last);
                one.failure = one.navigator.require_plausible_motion().err();
            }
            self.after_reading(last.time_ns)?;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), NavError> {
        Ok(())
    }
}
