//! Several voyages at once: their filters sit side by side from one measurement to the next.

use std::num::NonZeroUsize;

use crate::error::NavError;
use crate::filter::filter_group::{FilterSpan, predict_together, width};
use crate::navigator::BeamAiding;
use crate::navigator::Method;
use crate::navigator::{Aiding, SELECTOR_METHODS};
use crate::simulation::monte_carlo_run::RunSegment;

/// Fewer samples than this are not worth taking seats for.
const WORTH_BOARDING: usize = 4;
/// As many samples are drawn at a time at most: what a run in flight needs of memory beyond its filters.
const MOST_SAMPLES: usize = 256;

/// Leads every voyage to the end of its stretch, but for those that could not begin; the bits are those of each led alone.
pub(crate) fn lead<'a>(begun: impl IntoIterator<Item = Result<RunSegment<'a>, NavError>>) -> Vec<Result<(), NavError>> {
    let (mut results, mut legs, mut places) = (Vec::new(), Vec::new(), Vec::new());
    for (place, leg) in begun.into_iter().enumerate() {
        results.push(leg.map(|leg| {
            legs.push(leg);
            places.push(place);
        }));
    }
    let mut outcomes = vec![Ok(()); legs.len()];
    let mut waiting: Vec<usize> = (0..legs.len()).collect();
    while let Some(&leader) = waiting.first() {
        let times = legs[leader].ahead_ns();
        let (mut together, others) = waiting.iter().partition(|&&k| same(legs[k].ahead_ns(), times));
        lead_in_step(&mut legs, &mut together, &mut outcomes);
        waiting = others;
    }
    for (place, outcome) in places.into_iter().zip(outcomes) {
        results[place] = outcome;
    }
    results
}

/// The same slice, or equal ones.
fn same(own: &[i64], other: &[i64]) -> bool {
    std::ptr::eq(own, other) || own == other
}

/// Voyages over the same sample times; one that fails stays behind.
fn lead_in_step(legs: &mut [RunSegment<'_>], together: &mut Vec<usize>, results: &mut [Result<(), NavError>]) {
    while let Some(&leader) = together.first() {
        if legs[leader].ahead_ns().is_empty() {
            break;
        }
        let clear = together.iter().map(|&k| legs[k].clear_samples()).min().unwrap_or(0);
        if clear < WORTH_BOARDING {
            together.retain(|&k| keep(&mut results[k], legs[k].step()));
            continue;
        }
        let count = clear.min(MOST_SAMPLES);
        together.retain(|&k| keep(&mut results[k], legs[k].draw(count)));
        let underway = legs.iter_mut().enumerate().filter(|(k, _)| together.contains(k));
        let (mut seats, mut counts): (Vec<FilterSpan<'_>>, Vec<usize>) = (Vec::new(), Vec::new());
        for (_, leg) in underway {
            let before = seats.len();
            seats.extend(leg.seats());
            counts.push(seats.len() - before);
        }
        predict_together(&mut seats);
        let mut failures = seats
            .into_iter()
            .map(|seat| seat.failure)
            .collect::<Vec<_>>()
            .into_iter();
        let mut counts = counts.into_iter();
        together.retain(|&k| {
            let own = failures.by_ref().take(counts.next().unwrap_or(0)).collect();
            keep(&mut results[k], legs[k].land(own))
        });
    }
    together.iter().for_each(|&k| results[k] = legs[k].finish());
}

/// Notes an outcome; true where it was a good one.
fn keep(result: &mut Result<(), NavError>, outcome: Result<(), NavError>) -> bool {
    *result = outcome;
    result.is_ok()
}

/// How many runs fly together, so that the lanes are well filled and every thread has work.
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
    let of_one = |aiding| if aiding == BeamAiding::SwayCurrent { 2 } else { 1 };
    match method.aiding {
        Aiding::One(aiding) => of_one(aiding),
        Aiding::Consistent => SELECTOR_METHODS.iter().map(|(_, aiding)| of_one(*aiding)).sum(),
    }
}
