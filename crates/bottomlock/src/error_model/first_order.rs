//! The transition to first order: Φ = I + F T with the mean of F at the ends of each step (as the paper has it).
//!
//! All is inlined always: with `inline` alone `compare_filters` takes 5.7 times as long at `one`, and 12 times at `methods 8`.

use super::covariance::{CovarianceInterval, Parts, Transition, lift, lift3};
use super::noise::HalfNoise;
use super::{Coefficients, ProcessNoise};
use crate::mechanisation::{EarthTerms, Inertial, Kinematics};
use crate::simd::{Lane, Lift, V3, add_mul, add_scaled, scale, splat3, sub_cross, sub_mul};

/// F T by the trapezoidal rule, for a covariance that keeps up with every step.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub struct FirstOrderInterval<T> {
    /// ∫F dt; without meaning while the interval is empty.
    pub(super) sum: Coefficients<T>,
    /// F at the end but for the rate: an averaged reading is of its own step alone.
    pub(super) last: Coefficients<T>,
    pub(super) duration_s: f64,
}

impl<T: Lane> CovarianceInterval<T> for FirstOrderInterval<T> {
    type Phi = FirstOrder<T>;

    #[inline(always)]
    fn begin(kinematics: &Kinematics<T>, earth: &EarthTerms<T>) -> Self {
        let last = Coefficients::without_rate(kinematics, earth);
        Self {
            sum: last,
            last,
            duration_s: 0.0,
        }
    }

    #[inline(always)]
    fn extend(
        &mut self,
        _before: &Kinematics<T>,
        after: &Kinematics<T>,
        start: &Inertial<T>,
        end: &Inertial<T>,
        dt_s: f64,
        earth: &EarthTerms<T>,
    ) {
        let now = Coefficients::without_rate(after, earth);
        let (first, last) = (self.last.with_rate(start), now.with_rate(end));
        let half = now.velocity_p[0].splat(0.5 * dt_s);
        if self.duration_s > 0.0 {
            self.sum.add_sum(&first, &last, half);
        } else {
            self.sum = Coefficients::scaled_sum(&first, &last, half);
        }
        self.last = now;
        self.duration_s += dt_s;
    }

    #[inline(always)]
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    #[inline(always)]
    fn transition(&self, _end: &Kinematics<T>, earth: &EarthTerms<T>) -> FirstOrder<T> {
        FirstOrder::new(self.sum, self.duration_s, earth)
    }

    /// Noise of half the interval. The sums hold R and v times the duration, and `weight` divides their products by its square.
    #[inline(always)]
    fn first_noise(&self, noise: &ProcessNoise) -> HalfNoise<T> {
        let duration = self.sum.velocity_p[0].splat(self.duration_s);
        let half = duration * duration.splat(0.5);
        let weight = (duration * duration).recip();
        HalfNoise::new(&self.sum.rotation, self.sum.velocity_p, noise, half, weight)
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

/// Φ = I + F T, F with its skew and identity blocks.
#[derive(Debug, Clone, Copy)]
pub struct FirstOrder<T> {
    sum: Coefficients<T>,
    earth: V3<T>,
    minus_duration: T,
}

impl<T: Lane> FirstOrder<T> {
    #[inline(always)]
    fn new(sum: Coefficients<T>, duration_s: f64, earth: &EarthTerms<T>) -> Self {
        let like = sum.velocity_p[0];
        Self {
            sum,
            earth: splat3(like, scale(earth.rate_t, duration_s)),
            minus_duration: like.splat(-duration_s),
        }
    }
}

impl<T: Lane> Transition<T> for FirstOrder<T> {
    #[inline(always)]
    fn position<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let (velocity_t, rotation) = (lift(x, self.sum.velocity_t), lift3(x, &self.sum.rotation));
        add_mul(sub_cross(x.r, velocity_t, x.rho), &rotation, x.v)
    }
    #[inline(always)]
    fn attitude<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let (earth, rotation) = (lift(x, self.earth), lift3(x, &self.sum.rotation));
        sub_mul(sub_cross(x.rho, earth, x.rho), &rotation, x.bg)
    }
    #[inline(always)]
    fn velocity<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let coriolis_rate_p = lift(x, self.sum.coriolis_rate_p);
        let by_misalignment = lift3(x, &self.sum.velocity_by_misalignment);
        let minus_duration = x.v[0].lift(self.minus_duration);
        let v = add_scaled(sub_cross(x.v, coriolis_rate_p, x.v), x.ba, minus_duration);
        sub_cross(add_mul(v, &by_misalignment, x.rho), lift(x, self.sum.velocity_p), x.bg)
    }
}
