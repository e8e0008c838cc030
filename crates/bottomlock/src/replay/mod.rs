//! A recorded log through the event loop: every method beside the others, each fed the same events in order of validity.
//!
//! # Asynchronous streams
//! Sensors measure when they measure. The log is merged by time of validity, so nothing in it is late: a reading that reached the
//! host late stands where it was valid. Between two inertial readings the [`crate::navigator::Navigator`] splits the strapdown step at
//! the measurement's own time, with the readings interpolated (instantaneous sampling) or held (averaged sampling).
//!
//! What lies before the start, or after the last inertial reading, moves no filter and is counted in [`Unused`].

mod log;
mod ping;

use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::filter::report::Sensor;
use crate::layout::DIM;
use crate::model::Model;
use crate::navigator::Method;
use crate::navigator::NavigatorSet;
use crate::navigator::dual_filter::DualFilter;
use crate::navigator::events::Event;
use crate::smoother::smooth;
use crate::state::{Covariance, NavState};
use crate::workers::Workers;

pub use self::log::{Log, Unused};
pub use self::ping::{FIX_STATUS, FixStatus, PingRecord};
pub use crate::navigator::events::{STREAM_NAMES, STREAMS};

/// What is flown along a log.
#[derive(Debug, Clone, Copy)]
pub struct Replay<'a> {
    /// The log.
    pub log: Log<'a>,
    /// The beams.
    pub geometry: &'a BeamGeometry,
    /// What the filter assumes of the sensors.
    pub model: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// State at the start.
    pub start: NavState,
    /// Covariance at the start; the model's without.
    pub covariance: Option<&'a Covariance>,
    /// Ways of aiding; each sees the valid beams of the log and no others, the reference method too.
    pub methods: &'a [Method],
    /// Times at which states are recorded, ns, rising; the first inertial reading at or after each counts.
    pub sample_time_ns: &'a [i64],
    /// Whether every method is smoothed too.
    pub smooth: bool,
    /// Whether covariances are kept beside the standard deviations.
    pub covariances: bool,
}

/// Estimates at the samples.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Estimate at each sample.
    pub states: Vec<NavState>,
    /// Standard deviation of each error state there.
    pub sd: Vec<[f64; DIM]>,
    /// Covariance there; empty where it was not asked for.
    pub covariances: Vec<Covariance>,
}

impl Series {
    fn push(&mut self, state: NavState, covariance: &Covariance, keep_covariance: bool) {
        self.states.push(state);
        // Rounding may leave a variance of zero a hair below it where the log fixes a state altogether.
        self.sd
            .push(std::array::from_fn(|k| covariance[(k, k)].max(0.0).sqrt()));
        if keep_covariance {
            self.covariances.push(*covariance);
        }
    }
}

/// What one method yields.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    /// The filter at each sample: what was known then.
    pub filtered: Series,
    /// What the whole log says of each sample; empty where it was not asked for.
    pub smoothed: Series,
    /// A record for each ping of the log.
    pub pings: Vec<PingRecord>,
    /// Bytes that the smoother's tape took.
    pub tape_bytes: usize,
}

/// What a replay yields.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// A track for each method, in their order.
    pub tracks: Vec<Track>,
    /// Rows that moved no filter.
    pub unused: Unused,
}

/// Flies every method along the log, on `threads` threads; the bits do not depend on their number.
///
/// Each method ends as a [`NavigatorSet`] does that is fed the same events one by one, bit for bit.
///
/// # Errors
/// [`NavError::InRow`] for a row that makes no sense; [`NavError::WrongCount`] for a log without an inertial reading after the
/// start; [`NavError::OutsideLog`] or [`NavError::TimeNotIncreasing`] for sample times; [`NavError::InMethod`] for what goes wrong
/// under way, and for a method that is to be smoothed and cannot be.
pub fn replay(request: &Replay<'_>, threads: usize) -> Result<Replayed, NavError> {
    let (log, start_ns) = (&request.log, request.start.time_ns);
    log.validate(request.geometry)?;
    let last_ns = match log.imu.last() {
        Some(last) if last.time_ns >= start_ns => last.time_ns,
        _ => {
            return Err(NavError::WrongCount {
                field: "imu rows at or after the start",
                got: 0,
                expected: "1 or more".into(),
            });
        }
    };
    check_samples(request.sample_time_ns, start_ns, last_ns)?;
    let mut methods = request.methods.to_vec();
    let tracks = Workers::new(threads)?.each(&mut methods, |_, method| {
        fly(request, method).map_err(|source| NavError::InMethod {
            method: method.name,
            source: Box::new(source),
        })
    })?;
    Ok(Replayed {
        tracks,
        unused: log.unused(start_ns, last_ns),
    })
}

fn check_samples(sample_time_ns: &[i64], first_ns: i64, last_ns: i64) -> Result<(), NavError> {
    if let Some(pair) = sample_time_ns.windows(2).find(|pair| pair[1] <= pair[0]) {
        return Err(NavError::TimeNotIncreasing {
            stream: "sample",
            time_ns: pair[1],
            previous_ns: pair[0],
        });
    }
    match sample_time_ns.iter().find(|&&t| t < first_ns || t > last_ns) {
        None => Ok(()),
        Some(&time_ns) => Err(NavError::OutsideLog {
            time_ns,
            first_ns,
            last_ns,
        }),
    }
}

fn fly(request: &Replay<'_>, method: &Method) -> Result<Track, NavError> {
    let (model, options) = (request.model, request.options);
    let mut guide = NavigatorSet::new(request.start, request.geometry, method.aiding, model, options)?;
    if let Some(covariance) = request.covariance {
        guide.set_covariance(covariance)?;
    }
    if request.smooth {
        let filters = guide.filters().ok_or(NavError::NoSmoother {
            instead: "tc, weak_sway, sway_current",
        })?;
        filters.begin_tape();
    }
    let pings = request.log.pings;
    let mut track = Track {
        pings: vec![PingRecord::default(); pings.len()],
        ..Track::default()
    };
    let mut samples = request.sample_time_ns.iter().peekable();
    let mut reached_ns = None;
    for event in request.log.events_from(request.start.time_ns) {
        if let Event::Imu(reading) = event {
            // All that was valid at the last reading has been taken by now.
            record(
                &mut guide,
                reached_ns,
                &mut samples,
                request.covariances,
                &mut track.filtered,
            );
            reached_ns = Some(reading.time_ns);
        }
        guide.push(&event, &mut |report| {
            if report.sensor == Sensor::Beams
                && let Ok(index) = pings.binary_search_by_key(&report.time_ns, |ping| ping.time_ns)
            {
                track.pings[index] = PingRecord::new(report, &pings[index], method.aiding.rows_are_beams());
            }
        })?;
    }
    record(
        &mut guide,
        reached_ns,
        &mut samples,
        request.covariances,
        &mut track.filtered,
    );
    if let Some(tape) = guide.filters().and_then(DualFilter::take_tape) {
        track.tape_bytes = tape.bytes();
        for sample in smooth(tape)? {
            track
                .smoothed
                .push(sample.state, &sample.covariance, request.covariances);
        }
    }
    Ok(track)
}

/// Records the state for every sample time that the last inertial reading has reached.
fn record<'a>(
    guide: &mut NavigatorSet,
    reached_ns: Option<i64>,
    samples: &mut std::iter::Peekable<impl Iterator<Item = &'a i64>>,
    keep_covariances: bool,
    filtered: &mut Series,
) {
    let Some(reached_ns) = reached_ns else { return };
    while samples.next_if(|&&sample_ns| sample_ns <= reached_ns).is_some() {
        filtered.push(guide.state(), &guide.covariance(), keep_covariances);
        if let Some(filters) = guide.filters() {
            filters.record_sample();
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
