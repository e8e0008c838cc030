//! Filters side by side in the lanes of vectors, over IMU samples between which nothing is measured.
//!
//! The methods of a run, and the runs of a batch, are predicted together. Each lane has the bits of a filter alone, whoever its
//! neighbours are.
//!
//! All is inlined always: with `inline` alone `compare_filters` takes 19 times as long at `methods 8`.

use std::marker::PhantomData;

use super::Eskf;
use super::predict::ran_out_of_numbers;
use super::prediction::{Group, LastStep, PredictionHooks, predict};
use super::streams::Streams;
use crate::error::NavError;
use crate::error_model::{FirstOrderInterval, Interval, Matrix, SecondOrderInterval, SideBySide, complete_biases};
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, ImuSample, Kinematics};
use crate::simd::{Lanes, Simd, WIDEST, gather, scatter, scatter_rows, three, widest_lanes, with_lanes};
use crate::state::Covariance;

/// Whose filter it is: the number of a run or log, and of a navigator in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Owner {
    /// Number of the run.
    pub feed: usize,
    /// Number of the navigator.
    pub navigator: usize,
}

/// A filter and the samples that it takes; the first of them it has taken already.
#[derive(Debug)]
pub struct FilterSpan<'a> {
    /// Whose filter it is.
    pub owner: Owner,
    /// The filter.
    pub filter: &'a mut Eskf,
    /// Its samples.
    pub samples: &'a [ImuSample],
    /// What went wrong, and at which sample.
    pub failure: Option<(usize, NavError)>,
}

impl<'a> FilterSpan<'a> {
    /// A filter with its samples, of which it has taken the first.
    pub fn new(filter: &'a mut Eskf, samples: &'a [ImuSample]) -> Self {
        Self {
            owner: Owner::default(),
            filter,
            samples,
            failure: None,
        }
    }

    /// The same with an owner.
    #[must_use]
    pub fn owned_by(self, owner: Owner) -> Self {
        Self { owner, ..self }
    }

    /// Takes what comes after sample `taken`, which the filter has taken already.
    fn predict_alone(&mut self, taken: usize) {
        if self.failure.is_none() {
            let outcome = self.filter.predict_along(&self.samples[taken..]);
            self.failure = outcome.err().map(|(at, error)| (taken + at, error));
        }
    }

    /// True where two filters do the same operations at the same steps, as far as the ends of their samples tell.
    fn can_share_lanes_with(&self, other: &Self) -> bool {
        let (own, its) = (&*self.filter, &*other.filter);
        let ends = |span: &Self| {
            let [first, .., last] = span.samples else {
                return None;
            };
            Some([first.time_ns, last.time_ns])
        };
        own.interval.duration_s().to_bits() == its.interval.duration_s().to_bits()
            && own.settings == its.settings
            && self.samples.len() == other.samples.len()
            && ends(self) == ends(other)
    }
}

/// Predicts every filter over its samples, as [`Eskf::predict`] does step by step.
///
/// What goes wrong for a filter is noted in its own span. Filters whose samples are at the same times and whose covariances are
/// due together share the lanes of vectors, as far as the times agree.
pub fn predict_together(spans: &mut [FilterSpan<'_>]) {
    let mut waiting: Vec<&mut FilterSpan<'_>> = spans.iter_mut().collect();
    while let Some(first) = waiting.pop() {
        let (mut group, others): (Vec<_>, Vec<_>) =
            waiting.into_iter().partition(|span| span.can_share_lanes_with(first));
        group.push(first);
        waiting = others;
        for part in group.chunks_mut(width()) {
            match part {
                [alone] => alone.predict_alone(0),
                _ => with_lanes!(run, part, else part.iter_mut().for_each(|span| span.predict_alone(0))),
            }
        }
    }
}

/// How many filters share a vector: the widest of the machine; 1 where they go one by one.
#[must_use]
pub fn width() -> usize {
    widest_lanes()
}

#[inline(always)]
fn run<S: Simd, T: Lanes<S>>(simd: S, spans: &mut [&mut FilterSpan<'_>]) {
    for span in spans.iter_mut() {
        if matches!(span.samples, [first, second, ..] if first.time_ns < second.time_ns) {
            span.filter.begin_interval();
        }
    }
    match spans[0].filter.interval {
        Interval::Open => spans.iter_mut().for_each(|span| span.predict_alone(0)),
        Interval::FirstOrder(_) => run_lanes::<S, T, FirstOrderInterval<T>>(simd, spans),
        Interval::SecondOrder(_) => run_lanes::<S, T, SecondOrderInterval<T>>(simd, spans),
    }
}

/// At most as many filters as there are lanes; a lane left over repeats the last filter.
#[inline(always)]
fn run_lanes<S: Simd, T: Lanes<S>, I: SideBySide<S, T>>(simd: S, spans: &mut [&mut FilterSpan<'_>]) {
    let place = |k: usize| k.min(spans.len() - 1);
    let filters: [&Eskf; WIDEST] = std::array::from_fn(|k| &*spans[place(k)].filter);
    let biases: [T; WIDEST] = gather(
        simd,
        filters
            .map(|filter| {
                let (gyro, accel) = (filter.state.gyro_bias_p_radps.0, filter.state.accel_bias_p_mps2.0);
                [gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z, 0.0, 0.0]
            })
            .each_ref(),
    );
    let of: [&[ImuSample]; WIDEST] = std::array::from_fn(|k| spans[place(k)].samples);
    let streams = Streams {
        are_one: of.iter().all(|stream| std::ptr::eq(*stream, of[0])),
        of,
        gyro_bias_p_radps: three(&biases, 0),
        accel_bias_p_mps2: three(&biases, 3),
    };
    let settings = filters[0].settings;
    let mut kinematics: Kinematics<T> = Kinematics::from_array(gather(
        simd,
        filters.map(|filter| filter.kinematics.to_array()).each_ref(),
    ));
    let Some(mut interval) = I::gathered(simd, &filters.map(|filter| filter.interval)) else {
        return spans.iter_mut().for_each(|span| span.predict_alone(0));
    };
    let mut covariance: Matrix<T> = [[biases[0]; DIM]; DIM];
    for i in 0..DIM {
        covariance[i] = gather(simd, filters.map(|filter| &filter.covariance.data.0[i]));
    }
    let mut earth = lanes_of_earth(simd, &filters);
    let mut group = Group {
        kinematics: &mut kinematics,
        interval: &mut interval,
        covariance: &mut covariance,
        earth: &mut earth,
    };
    let mut lanes = InLanes {
        are_extended: spans.iter().any(|span| !span.filter.extensions.is_empty()),
        spans,
        lost: Vec::new(),
        lanes: PhantomData,
    };
    let last = predict(simd, &mut group, &streams, &settings, &mut lanes);
    complete_biases(group.covariance);
    lanes.finish(last, &group);
}

/// Gravity of the filters; on a plane it is common to them.
#[inline(always)]
fn lanes_of_earth<S: Simd, T: Lanes<S>>(simd: S, filters: &[&Eskf; WIDEST]) -> EarthTerms<T> {
    let own = filters.map(|filter| filter.earth.to_array());
    EarthTerms::of_array(&filters[0].earth, gather(simd, own.each_ref()))
}

/// Hooks of a prediction in lanes, for the filters that the lanes belong to.
struct InLanes<'a, 'b, 'c, S> {
    spans: &'a mut [&'b mut FilterSpan<'c>],
    /// Whether some filter has states beyond the 20.
    are_extended: bool,
    /// Filters as they were when their numbers ran out, by their lanes.
    lost: Vec<(usize, Eskf)>,
    lanes: PhantomData<S>,
}

impl<S: Simd, T: Lanes<S>, I: SideBySide<S, T>> PredictionHooks<T, I> for InLanes<'_, '_, '_, S> {
    #[inline(always)]
    fn propagate(&mut self, interval: &I, end: &Kinematics<T>, earth: &EarthTerms<T>) {
        if !self.are_extended {
            return;
        }
        for (k, span) in self.spans.iter_mut().enumerate() {
            if !span.filter.extensions.is_empty() {
                let end = Kinematics::from_array(scatter(&end.to_array(), k));
                let own = &mut *span.filter;
                let earth = EarthTerms::of_array(&own.earth, scatter(&earth.to_array(), k));
                own.extensions.propagate(&interval.lane(k), &end, &earth);
            }
        }
    }

    #[inline(always)]
    fn propagated(&mut self, covariance: &mut Matrix<T>) {
        if !self.are_extended {
            return;
        }
        let added: [Option<Box<Covariance>>; WIDEST] = std::array::from_fn(|k| {
            self.spans
                .get_mut(k)
                .and_then(|span| span.filter.extensions.added.take())
        });
        if added.iter().all(Option::is_none) {
            return;
        }
        for (i, row) in covariance.iter_mut().enumerate() {
            for (j, element) in row.iter_mut().enumerate() {
                *element += element.each(|k| added[k].as_ref().map_or(0.0, |added| added[(i, j)]));
            }
        }
    }

    #[cold]
    fn on_non_finite(&mut self, at: usize, dt_s: f64, group: &Group<'_, T, I>) -> bool {
        let [x, y, z] = group.kinematics.position_t_m;
        for (k, span) in self.spans.iter_mut().enumerate() {
            if span.failure.is_some() || (x + y + z).get(k).is_finite() {
                continue;
            }
            let mut filter = span.filter.clone();
            filter.take_lane(k, group);
            filter.covariance = Covariance::from_fn(|i, j| group.covariance[i.min(j)][i.max(j)].get(k));
            filter.settle(span.samples, LastStep { at, dt_s });
            span.failure = Some((at, ran_out_of_numbers(filter.state.time_ns)));
            self.lost.push((k, filter));
        }
        self.lost.len() < self.spans.len()
    }
}

impl<S: Simd> InLanes<'_, '_, '_, S> {
    /// Writes every lane back to its filter.
    #[inline(always)]
    fn finish<T: Lanes<S>, I: SideBySide<S, T>>(self, last: LastStep, group: &Group<'_, T, I>) {
        for (i, row) in group.covariance.iter().enumerate() {
            scatter_rows(row, self.spans.len(), |k, columns, numbers| {
                numbers.store(&mut self.spans[k].filter.covariance.data.0[i][columns]);
            });
        }
        for (k, span) in self.spans.iter_mut().enumerate() {
            span.filter.take_lane(k, group);
            span.filter.settle(span.samples, last);
        }
        for (k, filter) in self.lost {
            *self.spans[k].filter = filter;
        }
        // Where times differ between lanes, or do not rise.
        self.spans.iter_mut().for_each(|span| span.predict_alone(last.at));
    }
}

impl Eskf {
    /// Motion and interval of a lane.
    #[inline(always)]
    fn take_lane<S: Simd, T: Lanes<S>, I: SideBySide<S, T>>(&mut self, k: usize, group: &Group<'_, T, I>) {
        self.kinematics = Kinematics::from_array(scatter(&group.kinematics.to_array(), k));
        self.interval = group.interval.lane(k);
        if self.earth.gradient_t.is_some() {
            self.earth = EarthTerms::of_array(&self.earth, scatter(&group.earth.to_array(), k));
        }
    }
}

#[cfg(test)]
#[path = "filter_group_tests.rs"]
mod tests;
