//! The one event loop over many navigators: their filters go side by side from one measurement to the next.
//!
//! A run of a campaign and a recorded log are both [`Feed`]s; an event at a time, as in live use, is
//! [`super::Navigator::push`].

use crate::error::NavError;
use crate::filter::filter_group::{FilterSpan, predict_together};
use crate::stop::Stop;

/// Fewer readings than this are pushed one by one.
const WORTH_GROUPING: usize = 4;
/// Largest number of readings drawn at a time; it bounds a run's memory beyond its filters.
const MOST_READINGS: usize = 256;

/// Navigators with the inertial readings and measurements that they take.
pub(crate) trait Feed {
    /// True after the last reading.
    fn is_over(&self) -> bool;
    /// Number of readings ahead before anything happens between two of them, up to the one where something happens.
    fn clear_readings(&self) -> usize;
    /// Pushes one reading, with the measurements before it or at it.
    ///
    /// # Errors
    /// The error that ends the feed.
    fn step(&mut self) -> Result<(), NavError>;
    /// Draws as many of the clear readings.
    ///
    /// # Errors
    /// The error that ends the feed.
    fn draw_readings(&mut self, count: usize) -> Result<(), NavError>;
    /// The filters of every navigator with the readings drawn; each span names its owner in the feed of this number.
    fn spans(&mut self, feed: usize) -> Vec<FilterSpan<'_>>;
    /// After the filters have taken the readings drawn, but for those that failed.
    ///
    /// # Errors
    /// The error that ends the feed.
    fn after_readings(&mut self, failures: Vec<Failure>) -> Result<(), NavError>;
    /// After the last reading.
    ///
    /// # Errors
    /// The rest.
    fn finish(&mut self) -> Result<(), NavError>;
}

/// A filter that failed: the number of its navigator, and the reading at which it did.
#[derive(Debug, Clone)]
pub(crate) struct Failure {
    pub(crate) navigator: usize,
    pub(crate) at: usize,
    pub(crate) error: NavError,
}

/// Runs every feed to its end; all of them have readings at the same times. The bits are those of each run alone.
///
/// A feed ends with [`NavError::Interrupted`] where `stop` asks for it.
pub(crate) fn run_events<F: Feed>(feeds: &mut [&mut F], stop: &Stop) -> Vec<Result<(), NavError>> {
    let count = feeds.len();
    let mut outcomes = vec![Ok(()); count];
    loop {
        if let Err(interrupted) = stop.check() {
            return vec![Err(interrupted); count];
        }
        let mut going: Vec<(usize, &mut F)> = (feeds.iter_mut().map(|feed| &mut **feed).enumerate())
            .filter(|(k, feed)| outcomes[*k].is_ok() && !feed.is_over())
            .collect();
        let Some(clear) = going.iter().map(|(_, feed)| feed.clear_readings()).min() else {
            break;
        };
        if clear < WORTH_GROUPING {
            going.iter_mut().for_each(|(k, feed)| outcomes[*k] = feed.step());
            continue;
        }
        for (k, feed) in &mut going {
            outcomes[*k] = feed.draw_readings(clear.min(MOST_READINGS));
        }
        going.retain(|(k, _)| outcomes[*k].is_ok());
        let mut failures = predict(&mut going, count);
        for (k, feed) in &mut going {
            outcomes[*k] = feed.after_readings(std::mem::take(&mut failures[*k]));
        }
    }
    for (feed, outcome) in feeds.iter_mut().zip(&mut outcomes) {
        if outcome.is_ok() {
            *outcome = feed.finish();
        }
    }
    outcomes
}

/// Predicts the filters of all feeds together; errors by the number of the feed.
fn predict<F: Feed>(going: &mut [(usize, &mut F)], feeds: usize) -> Vec<Vec<Failure>> {
    let mut spans: Vec<FilterSpan<'_>> = going.iter_mut().flat_map(|(k, feed)| feed.spans(*k)).collect();
    predict_together(&mut spans);
    let mut failures = vec![Vec::new(); feeds];
    for span in spans {
        if let Some((at, error)) = span.failure {
            let navigator = span.owner.navigator;
            failures[span.owner.feed].push(Failure { navigator, at, error });
        }
    }
    failures
}
