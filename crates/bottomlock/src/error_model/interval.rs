//! The interval of one filter since its covariance was last brought up to date.

use super::covariance::{CovarianceInterval, Matrix, complete};
use super::{FirstOrderInterval, ProcessNoise, SecondOrderInterval};
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Inertial, Kinematics};
use crate::simd::with_vectors;

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
    pub fn begin(kinematics: &Kinematics<f64>, earth: &EarthTerms<f64>, many_steps: bool) -> Self {
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
        earth: &EarthTerms<f64>,
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
    pub fn propagate(
        &mut self,
        p: &mut Matrix<f64>,
        end: &Kinematics<f64>,
        noise: &ProcessNoise,
        earth: &EarthTerms<f64>,
    ) {
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
    pub fn carry(&self, columns: &mut [[f64; DIM]], end: &Kinematics<f64>, earth: &EarthTerms<f64>) {
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
