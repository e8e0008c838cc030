//! The one prediction: filters side by side over inertial readings, up to the next measurement (Groves 2013, sect. 3.2.2).
//!
//! A filter alone is a group of one, whose lane type is `f64`; a reading that arrives live is a slice of one step.

use super::streams::{Step, Streams};
use crate::earth::{Earth, EarthTerms};
use crate::error_model::{CovarianceInterval, Matrix, ProcessNoise};
use crate::mechanisation::{Kinematics, Sampling};
use crate::simd::{Lane, Simd, Strips, add_scaled};

/// What a prediction changes of a group of filters.
pub(super) struct Group<'a, T, I> {
    pub(super) kinematics: &'a mut Kinematics<T>,
    pub(super) interval: &'a mut I,
    pub(super) covariance: &'a mut Matrix<T>,
    /// At the interval's place.
    pub(super) earth: &'a mut EarthTerms<T>,
}

/// What the filters of a group have in common.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Settings {
    pub(super) earth: Earth,
    pub(super) noise: ProcessNoise,
    pub(super) sampling: Sampling,
    /// Interval of the covariance; zero for every step.
    pub(super) covariance_period_s: f64,
}

impl Settings {
    /// Gravity where the middle of the interval that begins will be: over an interval it is taken as constant, which leaves out less
    /// than the gradient times the path of an interval that a measurement cuts short, 0.04 µg at 5 m/s and 10 Hz.
    #[inline(always)]
    pub(super) fn earth_of_interval<T: Lane>(&self, start: &Kinematics<T>) -> EarthTerms<T> {
        let half = start.velocity_t_mps[0].splat(0.5 * self.covariance_period_s);
        self.earth
            .terms(add_scaled(start.position_t_m, start.velocity_t_mps, half))
    }
}

/// Hooks run during the prediction of a group, filter by filter.
pub(super) trait PredictionHooks<T, I> {
    /// The covariance is about to be propagated over an interval, which has come to `end`.
    fn propagate(&mut self, interval: &I, end: &Kinematics<T>, earth: &EarthTerms<T>);
    /// The covariance has been propagated.
    fn propagated(&mut self, covariance: &mut Matrix<T>);
    /// Some filter's position is no number after the step to reading `at`; true where a filter is left.
    fn on_non_finite(&mut self, at: usize, dt_s: f64, group: &Group<'_, T, I>) -> bool;
}

/// The last step of a prediction: the reading that it ended at, and its length.
#[derive(Debug, Clone, Copy)]
pub(super) struct LastStep {
    pub(super) at: usize,
    pub(super) dt_s: f64,
}

/// Strapdown steps over all readings after the first, which has been taken already, and the covariance wherever it is due.
///
/// Stops before a reading whose time does not rise, and where no filter is left.
#[inline(always)]
pub(super) fn predict<S: Simd, T: Strips<S>, I: CovarianceInterval<T>>(
    simd: S,
    group: &mut Group<'_, T, I>,
    streams: &Streams<'_, T>,
    settings: &Settings,
    hooks: &mut impl PredictionHooks<T, I>,
) -> LastStep {
    let sampling = settings.sampling;
    let rate_t = group.earth.rate_t;
    let mut last = LastStep { at: 0, dt_s: 0.0 };
    let mut next = streams.step(
        1,
        &streams.corrected(0),
        group.kinematics.attitude_t_p,
        sampling,
        rate_t,
    );
    while let Some(Step {
        start,
        end,
        dt_s,
        attitude_t_p,
    }) = next
    {
        last = LastStep { at: last.at + 1, dt_s };
        // The chain of rotations goes a step ahead of the rest, which fills its pauses.
        next = streams.step(last.at + 1, &end, attitude_t_p, sampling, rate_t);
        let before = *group.kinematics;
        group.kinematics.follow(attitude_t_p, &start, &end, dt_s, group.earth);
        group
            .interval
            .extend(&before, group.kinematics, &start, &end, dt_s, group.earth);
        let [x, y, z] = group.kinematics.position_t_m;
        if !(x + y + z).all_finite() && !hooks.on_non_finite(last.at, dt_s, group) {
            break;
        }
        if group.interval.is_due(dt_s, settings.covariance_period_s) {
            hooks.propagate(group.interval, group.kinematics, group.earth);
            group
                .interval
                .propagate(simd, group.covariance, group.kinematics, &settings.noise, group.earth);
            hooks.propagated(group.covariance);
            if settings.earth.pulling().is_some() {
                *group.earth = settings.earth_of_interval(group.kinematics);
            }
        }
    }
    last
}
