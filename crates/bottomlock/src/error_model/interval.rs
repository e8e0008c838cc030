//! The interval since the covariance was last brought up to date.

use super::covariance::{self, Matrix, complete};
use super::noise::HalfNoise;
use super::transition::Transition;
use super::{FirstOrderInterval, ProcessNoise, SecondOrderInterval};
use crate::layout::{DIM, DYNAMIC};
use crate::mechanisation::{EarthTerms, Inertial, Kinematics};
use crate::simd::{Lane, Simd, Strips, with_vectors};

/// What the steps of an interval add up to, and the transition and noise that follow from it.
pub trait CovarianceInterval<T: Lane>: Copy {
    /// Its transition.
    type Phi: Transition<T>;
    /// Begins at a state.
    fn begin(kinematics: &Kinematics<T>, earth: &EarthTerms) -> Self;
    /// Adds a step of `dt_s` between two states, with the readings that it takes at its ends.
    fn extend(
        &mut self,
        before: &Kinematics<T>,
        after: &Kinematics<T>,
        start: &Inertial<T>,
        end: &Inertial<T>,
        dt_s: f64,
        earth: &EarthTerms,
    );
    /// Length so far, s.
    fn duration_s(&self) -> f64;
    /// Φ over the interval, which has come to `end`.
    fn transition(&self, end: &Kinematics<T>, earth: &EarthTerms) -> Self::Phi;
    /// The noise of its first half.
    fn first_noise(&self, noise: &ProcessNoise) -> HalfNoise<T>;
    /// The noise of its second half.
    fn second_noise(&self, end: &Kinematics<T>, noise: &ProcessNoise) -> HalfNoise<T>;
    /// Begins anew at `end`.
    fn empty(&mut self, end: &Kinematics<T>);

    /// True where the covariance is due after a step of `dt_s`.
    ///
    /// Half a step of slack: rounding of the sample times must not lengthen the interval by a step.
    #[inline(always)]
    fn is_due(&self, dt_s: f64, period_s: f64) -> bool {
        self.duration_s() + 0.5 * dt_s >= period_s
    }

    /// P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2, and the interval is empty again; see `covariance::propagate`.
    #[inline(always)]
    fn propagate<S: Simd>(
        &mut self,
        simd: S,
        p: &mut Matrix<T>,
        end: &Kinematics<T>,
        noise: &ProcessNoise,
        earth: &EarthTerms,
    ) where
        T: Strips<S>,
    {
        let (first, second) = (self.first_noise(noise), self.second_noise(end, noise));
        covariance::propagate(simd, p, &self.transition(end, earth), &first, &second);
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

/// The interval of one filter.
// There is one a filter, changed at every step: a box would cost more than the room.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub enum Interval {
    /// Not begun: the state has been corrected, or there was no reading yet.
    #[default]
    Open,
    /// Where the covariance is propagated at every step.
    FirstOrder(FirstOrderInterval<f64>),
    /// Where it is propagated over many steps.
    SecondOrder(SecondOrderInterval<f64>),
}

impl Interval {
    /// Begins at a state.
    #[must_use]
    pub fn begin(kinematics: &Kinematics<f64>, earth: &EarthTerms, many_steps: bool) -> Self {
        if many_steps {
            Self::SecondOrder(SecondOrderInterval::begin(kinematics, earth))
        } else {
            Self::FirstOrder(FirstOrderInterval::begin(kinematics, earth))
        }
    }

    /// Length so far, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Open => 0.0,
            Self::FirstOrder(interval) => interval.duration_s(),
            Self::SecondOrder(interval) => interval.duration_s(),
        }
    }

    /// Adds a step of `dt_s` between two states, with the readings at its ends; nothing where it has not begun.
    pub fn extend(
        &mut self,
        before: &Kinematics<f64>,
        after: &Kinematics<f64>,
        start: &Inertial<f64>,
        end: &Inertial<f64>,
        dt_s: f64,
        earth: &EarthTerms,
    ) {
        match self {
            Self::Open => {}
            Self::FirstOrder(interval) => interval.extend(before, after, start, end, dt_s, earth),
            Self::SecondOrder(interval) => interval.extend(before, after, start, end, dt_s, earth),
        }
    }

    /// Propagates a symmetric covariance over the interval, which has come to `end`, and empties the interval.
    ///
    /// The rows of the DVL's states may be those of an earlier time; after it all of the matrix is right.
    pub fn propagate(&mut self, p: &mut Matrix<f64>, end: &Kinematics<f64>, noise: &ProcessNoise, earth: &EarthTerms) {
        if self.duration_s() > 0.0 {
            match self {
                Self::Open => {}
                Self::FirstOrder(interval) => with_vectors!(simd => interval.propagate(simd, p, end, noise, earth)),
                Self::SecondOrder(interval) => with_vectors!(simd => interval.propagate(simd, p, end, noise, earth)),
            }
        }
        complete(p);
    }

    /// Multiplies columns by the interval's Φ; the interval stays as it is, so this comes before [`Interval::propagate`].
    pub fn carry<const N: usize>(&self, columns: &mut [[f64; DIM]; N], end: &Kinematics<f64>, earth: &EarthTerms) {
        if self.duration_s() <= 0.0 {
            return;
        }
        match self {
            Self::Open => {}
            Self::FirstOrder(interval) => with_vectors!(_simd => interval.carry(columns, end, earth)),
            Self::SecondOrder(interval) => with_vectors!(_simd => interval.carry(columns, end, earth)),
        }
    }
}

impl From<FirstOrderInterval<f64>> for Interval {
    fn from(interval: FirstOrderInterval<f64>) -> Self {
        Self::FirstOrder(interval)
    }
}

impl From<SecondOrderInterval<f64>> for Interval {
    fn from(interval: SecondOrderInterval<f64>) -> Self {
        Self::SecondOrder(interval)
    }
}
