//! Several simulated runs at once: their filters go side by side from one measurement to the next.

use std::num::NonZeroUsize;

use crate::error::NavError;
use crate::filter::filter_group::width;
use crate::navigator::run_events::run_events;
use crate::navigator::{BeamAiding, Method};
use crate::simulation::monte_carlo_run::RunSegment;
use crate::stop::Stop;

/// Runs every segment to its end, but for those that could not begin; the bits are those of each run alone.
pub(crate) fn run_segments<'a>(
    begun: impl IntoIterator<Item = Result<RunSegment<'a>, NavError>>,
    stop: &Stop,
) -> Vec<Result<(), NavError>> {
    let mut segments: Vec<Result<RunSegment<'a>, NavError>> = begun.into_iter().collect();
    let mut outcomes: Vec<_> = segments
        .iter()
        .map(|segment| segment.as_ref().map(|_| ()).map_err(Clone::clone))
        .collect();
    let mut waiting: Vec<_> = segments
        .iter_mut()
        .enumerate()
        .filter_map(|(k, s)| Some((k, s.as_mut().ok()?)))
        .collect();
    while let Some((_, first)) = waiting.first() {
        let times = first.ahead_ns();
        let (together, others): (Vec<_>, Vec<_>) = waiting
            .into_iter()
            .partition(|(_, segment)| same(segment.ahead_ns(), times));
        let (places, mut feeds): (Vec<usize>, Vec<_>) = together.into_iter().unzip();
        for (place, outcome) in places.into_iter().zip(run_events(&mut feeds, stop)) {
            outcomes[place] = outcome;
        }
        waiting = others;
    }
    outcomes
}

/// The same slice, or equal ones.
fn same(own: &[i64], other: &[i64]) -> bool {
    std::ptr::eq(own, other) || own == other
}

/// How many runs go together, so that the lanes are well filled and every thread has work.
pub(crate) fn size(methods: &[Method], runs: usize, threads: usize) -> NonZeroUsize {
    let filters: usize = methods.iter().map(filters_of).sum();
    let width = width();
    // A lane in eight may stay empty.
    let filled = |runs: &usize| (runs * filters).div_ceil(width) * width * 7 <= runs * filters * 8;
    if filters == 0 {
        return NonZeroUsize::MIN;
    }
    let wanted = (1..=width).find(filled).unwrap_or(width);
    let share = runs.div_ceil(threads.max(1));
    NonZeroUsize::new(wanted.min(share)).unwrap_or(NonZeroUsize::MIN)
}

fn filters_of(method: &Method) -> usize {
    1 + usize::from(method.aiding == BeamAiding::SwayCurrent)
}
