//! The interval since the covariance was last brought up to date.

use fearless_simd::Simd;

use super::noise::HalfNoise;
use super::transition::Transition;
use super::{Partitioned, ProcessNoise, Single, Step, Stretch, Underway};
use crate::layout::{DIM, DYNAMIC};
use crate::mechanisation::{EarthTerms, Inertial, Kinematics};
use crate::simd::{Lane, with_vectors};

/// What an interval of one kind gathers, and the transition and noise that follow from it.
pub trait Span<T: Lane>: Copy {
    /// Its transition.
    type Phi<'a>: Transition<T>
    where
        Self: 'a;
    /// What it takes from a step.
    type Taken: Copy;
    /// Begins at a state and rate.
    fn begin(kinematics: &Kinematics<T>, inertial: &Inertial<T>, earth: &EarthTerms) -> Self;
    /// What it will take from the step between two states, that ends with a rate.
    fn take(before: &Kinematics<T>, after: &Kinematics<T>, inertial: &Inertial<T>, earth: &EarthTerms) -> Self::Taken;
    /// Adds a step of `dt_s`.
    fn add(&mut self, taken: &Self::Taken, dt_s: f64);
    /// Length so far, s.
    fn duration_s(&self) -> f64;
    /// Φ over the interval, which has come to `end`.
    fn transition(&self, end: &Kinematics<T>, earth: &EarthTerms) -> Self::Phi<'_>;
    /// The noise of its first half.
    fn first_noise(&self, noise: &ProcessNoise) -> HalfNoise<T>;
    /// The noise of its second half.
    fn second_noise(&self, end: &Kinematics<T>, noise: &ProcessNoise) -> HalfNoise<T>;
    /// Begins anew at `end`.
    fn empty(&mut self, end: &Kinematics<T>);

    /// P⁺ = Φ(P + Q₀ T/2)Φᵀ + Q₁ T/2, and the interval is empty again.
    #[inline(always)]
    fn propagate(&mut self, p: &mut Partitioned<T>, end: &Kinematics<T>, noise: &ProcessNoise, earth: &EarthTerms) {
        self.first_noise(noise).add_to(p);
        p.sandwich(&self.transition(end, earth), &self.second_noise(end, noise));
        self.empty(end);
    }

    /// Multiplies columns of 20 by Φ.
    #[inline(always)]
    fn carry<const N: usize>(&self, columns: &mut [[T; DIM]; N], end: &Kinematics<T>, earth: &EarthTerms) {
        let phi = self.transition(end, earth);
        for column in columns {
            let image = phi.apply(column);
            column[..DYNAMIC].copy_from_slice(&image);
        }
    }
}

/// The interval of one filter: a step where its covariance keeps up with every step, else a stretch of many.
// There is one a filter, worked on at every step: a box would cost more than the room.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, Copy, Default)]
pub enum Interval {
    /// Not begun: the state has been corrected, or there was no reading yet.
    #[default]
    Open,
    /// One step, to first order.
    Step(Step<f64>),
    /// Many steps, to second order.
    Stretch(Stretch<f64>),
}

impl Interval {
    /// Begins at a state and rate.
    #[must_use]
    pub fn begin(kinematics: &Kinematics<f64>, inertial: &Inertial<f64>, earth: &EarthTerms, many_steps: bool) -> Self {
        if many_steps {
            Self::Stretch(Stretch::begin(kinematics, inertial, earth))
        } else {
            Self::Step(Step::begin(kinematics, inertial, earth))
        }
    }

    /// Length so far, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Open => 0.0,
            Self::Step(step) => step.duration_s(),
            Self::Stretch(stretch) => stretch.duration_s(),
        }
    }

    /// Adds a step of `dt_s` between two states, that ends with a rate; nothing where it has not begun.
    #[inline(always)]
    pub fn extend(
        &mut self,
        before: &Kinematics<f64>,
        after: &Kinematics<f64>,
        inertial: &Inertial<f64>,
        dt_s: f64,
        earth: &EarthTerms,
    ) {
        match self {
            Self::Open => {}
            Self::Step(step) => step.add(&Step::take(before, after, inertial, earth), dt_s),
            Self::Stretch(stretch) => stretch.add(&Stretch::take(before, after, inertial, earth), dt_s),
        }
    }

    /// Propagates a symmetric covariance over the interval, which has come to `end`, and empties the interval.
    ///
    /// The noise is trapezoidal: P⁺ = Φ(P + Q T/2)Φᵀ + Q T/2.
    pub fn propagate(
        &mut self,
        p: &mut [[f64; DIM]; DIM],
        end: &Kinematics<f64>,
        noise: &ProcessNoise,
        earth: &EarthTerms,
    ) {
        if self.duration_s() <= 0.0 {
            return;
        }
        with_vectors!(simd => {
            let mut underway = Underway::of(simd, p);
            self.propagate_rows(simd, &mut underway, end, noise, earth);
            underway.rows.put_into(simd, p);
        });
    }

    /// The same for a covariance that is underway.
    #[inline(always)]
    pub(crate) fn propagate_rows<S: Simd>(
        &mut self,
        simd: S,
        p: &mut Underway,
        end: &Kinematics<f64>,
        noise: &ProcessNoise,
        earth: &EarthTerms,
    ) {
        match self {
            Self::Open => {}
            Self::Step(step) => step.propagate_rows(simd, p, end, noise, earth),
            Self::Stretch(stretch) => stretch.propagate_rows(simd, p, end, noise, earth),
        }
    }

    /// Multiplies columns by the interval's Φ; the interval stays as it is, so this comes before [`Interval::propagate`].
    pub fn carry<const N: usize>(&self, columns: &mut [[f64; DIM]; N], end: &Kinematics<f64>, earth: &EarthTerms) {
        if self.duration_s() <= 0.0 {
            return;
        }
        match self {
            Self::Open => {}
            Self::Step(step) => with_vectors!(_simd => step.carry(columns, end, earth)),
            Self::Stretch(stretch) => with_vectors!(_simd => stretch.carry(columns, end, earth)),
        }
    }
}
