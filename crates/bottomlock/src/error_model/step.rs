//! One inertial step: Φ = I + F T with the mean of F at its ends (first order, as the paper has it).

use super::interval::Span;
use super::noise::HalfNoise;
use super::transition::FirstOrder;
use super::{Coefficients, ProcessNoise};
use crate::mechanisation::{EarthTerms, Inertial, Kinematics};
use crate::simd::Lane;

/// F T by the trapezoidal rule; an empty one does not look at its sum.
#[derive(Debug, Clone, Copy)]
pub struct Step<T> {
    pub(super) sum: Coefficients<T>,
    pub(super) last: Coefficients<T>,
    pub(super) duration_s: f64,
}

impl<T: Lane> Span<T> for Step<T> {
    type Phi<'a>
        = FirstOrder<'a, T>
    where
        T: 'a;
    type Taken = Coefficients<T>;

    #[inline(always)]
    fn begin(kinematics: &Kinematics<T>, inertial: &Inertial<T>, earth: &EarthTerms) -> Self {
        let last = Coefficients::at(kinematics, inertial, earth);
        Self {
            sum: last,
            last,
            duration_s: 0.0,
        }
    }

    #[inline(always)]
    fn take(
        _before: &Kinematics<T>,
        after: &Kinematics<T>,
        inertial: &Inertial<T>,
        earth: &EarthTerms,
    ) -> Coefficients<T> {
        Coefficients::at(after, inertial, earth)
    }

    #[inline(always)]
    fn add(&mut self, taken: &Coefficients<T>, dt_s: f64) {
        let half = taken.velocity_p[0].splat(0.5 * dt_s);
        if self.duration_s > 0.0 {
            self.sum.add_sum(&self.last, taken, half);
        } else {
            self.sum = Coefficients::scaled_sum(&self.last, taken, half);
        }
        self.last = *taken;
        self.duration_s += dt_s;
    }

    #[inline(always)]
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    #[inline(always)]
    fn transition(&self, _end: &Kinematics<T>, earth: &EarthTerms) -> FirstOrder<'_, T> {
        FirstOrder::new(&self.sum, self.duration_s, earth)
    }

    #[inline(always)]
    fn first_noise(&self, noise: &ProcessNoise) -> HalfNoise<T> {
        let duration = self.sum.velocity_p[0].splat(self.duration_s);
        self.sum.noise(duration, noise)
    }

    #[inline(always)]
    fn second_noise(&self, _end: &Kinematics<T>, noise: &ProcessNoise) -> HalfNoise<T> {
        self.first_noise(noise)
    }

    #[inline(always)]
    fn empty(&mut self, _end: &Kinematics<T>) {
        self.duration_s = 0.0;
    }
}

impl<T: Lane> Coefficients<T> {
    /// The noise of half a step, where these are sums: means times the duration. The noise goes with their squares.
    #[inline(always)]
    pub(super) fn noise(&self, duration: T, noise: &ProcessNoise) -> HalfNoise<T> {
        let half = duration * duration.splat(0.5);
        HalfNoise::new(
            &self.rotation,
            self.velocity_p,
            noise,
            half,
            (duration * duration).recip(),
        )
    }
}
