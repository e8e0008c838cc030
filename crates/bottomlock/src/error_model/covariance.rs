//! One step of the covariance: P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2 (Groves 2013, Eq. 3.46).
//!
//! What Φ and Q are stands in `first_order.rs`, `second_order.rs` and `noise.rs`; when the step is due, in
//! `filter/prediction.rs`.
//!
//! With several filters, one column is taken at a time, a filter in each lane. With one filter, as many neighbouring columns
//! are taken at a time as fill a vector (`Strip`). The formula is the same.
//!
//! All of it must be inlined into code compiled for the machine's vectors, closures too: with those alone left to the compiler,
//! `compare_filters` takes 1.9 times as long at `one`, and 2.9 times at `methods 8`.

use std::hint::black_box;
use std::ops::Range;

use super::ProcessNoise;
use super::noise::HalfNoise;
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, DVL_BIAS, DYNAMIC, GYRO_BIAS, POSITION, VELOCITY};
use crate::mechanisation::{EarthTerms, Inertial, Kinematics};
use crate::simd::{Lane, Lift, M3, Simd, Strip, Strips, V3, dot, mat_mul, mat_scale, mul, three, transposed};

/// A symmetric covariance of one filter (as nalgebra stores it) or of several side by side.
pub type Matrix<T> = [[T; DIM]; DIM];

/// What the steps of an interval add up to, and the transition and noise that follow from it.
pub trait CovarianceInterval<T: Lane>: Copy {
    /// Its transition.
    type Phi: Transition<T>;
    /// Begins at a state.
    fn begin(kinematics: &Kinematics<T>, earth: &EarthTerms<T>) -> Self;
    /// Adds a step of `dt_s` between two states, with the readings that it takes at its ends.
    fn extend(
        &mut self,
        before: &Kinematics<T>,
        after: &Kinematics<T>,
        start: &Inertial<T>,
        end: &Inertial<T>,
        dt_s: f64,
        earth: &EarthTerms<T>,
    );
    /// Length so far, s.
    fn duration_s(&self) -> f64;
    /// Φ over the interval, which has come to `end`.
    fn transition(&self, end: &Kinematics<T>, earth: &EarthTerms<T>) -> Self::Phi;
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

    /// P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2, and the interval is empty again.
    #[inline(always)]
    fn propagate<S: Simd>(
        &mut self,
        simd: S,
        p: &mut Matrix<T>,
        end: &Kinematics<T>,
        noise: &ProcessNoise,
        earth: &EarthTerms<T>,
    ) where
        T: Strips<S>,
    {
        let (first, second) = (self.first_noise(noise), self.second_noise(end, noise));
        propagate(simd, p, &self.transition(end, earth), &first, &second);
        if let Some(pull) = pull(end, earth, self.duration_s()) {
            pull_covariance(p, &pull);
        }
        self.empty(end);
    }

    /// Multiplies columns of 20 by Φ.
    #[inline(always)]
    fn carry(&self, columns: &mut [[T; DIM]], end: &Kinematics<T>, earth: &EarthTerms<T>) {
        let phi = self.transition(end, earth);
        let pull = pull(end, earth, self.duration_s());
        for column in columns {
            let image = phi.apply(column);
            column[..DYNAMIC].copy_from_slice(&image);
            if let Some(pull) = &pull {
                let gained = mul(pull, three(column, POSITION));
                for k in 0..3 {
                    column[VELOCITY + k] += gained[k];
                }
            }
        }
    }
}

/// What the gradient of gravity makes of a position error over an interval: δv += Rᵀ ∂g/∂p T δr.
///
/// It is taken by itself after the rest of Φ, at the position error of the interval's end: T is four orders below the period of
/// the Schuler oscillation, and so taken it neither grows nor decays (semi-implicit Euler, whose determinant is 1).
#[inline(always)]
fn pull<T: Lane>(end: &Kinematics<T>, earth: &EarthTerms<T>, duration_s: f64) -> Option<M3<T>> {
    let gradient = earth.gradient_t.as_ref()?;
    let duration = end.velocity_p_mps[0].splat(duration_s);
    Some(mat_scale(duration, &mat_mul(&transposed(&end.rotation_t_p), gradient)))
}

/// P ← S P Sᵀ with S that of [`pull`], on the rows of the dynamic states.
#[inline(always)]
fn pull_covariance<T: Lane>(p: &mut Matrix<T>, pull: &M3<T>) {
    for k in 0..3 {
        for j in 0..DIM {
            let gained = dot(pull[k], [p[POSITION][j], p[POSITION + 1][j], p[POSITION + 2][j]]);
            p[VELOCITY + k][j] += gained;
        }
        // What the next transition of one filter reads of the biases, as `complete_biases` leaves it.
        for j in DYNAMIC..DVL_BIAS {
            p[j][VELOCITY + k] = p[VELOCITY + k][j];
        }
    }
    for row in &mut p[..DYNAMIC] {
        let gained = mul(pull, three(row, POSITION));
        for k in 0..3 {
            row[VELOCITY + k] += gained[k];
        }
    }
    for i in 1..3 {
        for k in 0..i {
            p[VELOCITY + i][VELOCITY + k] = p[VELOCITY + k][VELOCITY + i];
        }
    }
}

/// A transition matrix whose last eleven rows are the identity, by blocks of rows of Φ x.
///
/// Blocks are asked for one at a time, so that the coefficients of one stay in registers over many vectors.
pub trait Transition<T: Lane> {
    /// The rows of position.
    fn position<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W>;
    /// The rows of misalignment.
    fn attitude<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W>;
    /// The rows of velocity.
    fn velocity<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W>;

    /// All dynamic rows.
    #[inline(always)]
    fn apply<const N: usize>(&self, x: &[T; N]) -> [T; DYNAMIC] {
        let x = Parts::from_fn(
            #[inline(always)]
            |l| x[l],
        );
        let (r, rho, v) = (self.position(&x), self.attitude(&x), self.velocity(&x));
        [r[0], r[1], r[2], rho[0], rho[1], rho[2], v[0], v[1], v[2]]
    }
}

/// The part of a vector in error-state order that a transition reads.
#[derive(Debug, Clone, Copy)]
pub struct Parts<T> {
    /// Position.
    pub r: V3<T>,
    /// Misalignment.
    pub rho: V3<T>,
    /// Velocity.
    pub v: V3<T>,
    /// Accelerometer bias.
    pub ba: V3<T>,
    /// Gyro bias.
    pub bg: V3<T>,
}

impl<T: Lane> Parts<T> {
    /// Of the vector with these elements.
    #[inline(always)]
    fn from_fn(element: impl Fn(usize) -> T) -> Self {
        Self {
            r: [element(POSITION), element(POSITION + 1), element(POSITION + 2)],
            rho: [element(ATTITUDE), element(ATTITUDE + 1), element(ATTITUDE + 2)],
            v: [element(VELOCITY), element(VELOCITY + 1), element(VELOCITY + 2)],
            ba: [element(ACCEL_BIAS), element(ACCEL_BIAS + 1), element(ACCEL_BIAS + 2)],
            bg: [element(GYRO_BIAS), element(GYRO_BIAS + 1), element(GYRO_BIAS + 2)],
        }
    }
}

/// Three factors for strips like those of `x`.
#[inline(always)]
pub(super) fn lift<T: Copy, W: Lift<T>>(x: &Parts<W>, a: V3<T>) -> V3<W> {
    [x.r[0].lift(a[0]), x.r[0].lift(a[1]), x.r[0].lift(a[2])]
}

/// A matrix of them.
#[inline(always)]
pub(super) fn lift3<T: Copy, W: Lift<T>>(x: &Parts<W>, m: &M3<T>) -> M3<W> {
    [lift(x, m[0]), lift(x, m[1]), lift(x, m[2])]
}

/// P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2, exactly symmetric once [`complete`] has mirrored the dynamic rows.
///
/// (Φ P) Φᵀ is taken on and above the diagonal alone. The products go by blocks of three rows, whose coefficients stay in registers
/// over all columns.
#[inline(always)]
fn propagate<S: Simd, T: Strips<S>>(
    simd: S,
    p: &mut Matrix<T>,
    phi: &impl Transition<T>,
    first: &HalfNoise<T>,
    second: &HalfNoise<T>,
) {
    let wide = DYNAMIC.next_multiple_of(<T::Wide as Strip<S, T>>::WIDTH);
    if <T::Wide as Strip<S, T>>::WIDTH == 1 {
        first.add_to(p);
    } else {
        first.add_to_rows::<S, T::Wide>(simd, p, wide);
    }
    multiply::<S, T, T::Wide>(simd, p, phi, 0..wide);
    multiply::<S, T, T::Rest>(simd, p, phi, wide..DIM);
    multiply_transposed::<S, T, T::Wide>(simd, p, phi);
    second.add_to_upper(p);
    for i in 0..DYNAMIC {
        for k in 0..i {
            p[i][k] = p[k][i];
        }
    }
}

/// P ← Φ P in place: position and velocity go before the misalignment, which they read, and the columns of the dynamic states before
/// the others, in which they may read the rows of the biases.
#[inline(always)]
fn multiply<S: Simd, T: Strips<S>, W: Strip<S, T>>(
    simd: S,
    p: &mut Matrix<T>,
    phi: &impl Transition<T>,
    range: Range<usize>,
) {
    for j in range.clone().step_by(W::WIDTH) {
        let image = phi.position(&columns::<S, T, W>(simd, p, j));
        put::<S, T, W>(p, POSITION, j, image);
    }
    anew::<S, T, W>(p);
    for j in range.clone().step_by(W::WIDTH) {
        let image = phi.velocity(&columns::<S, T, W>(simd, p, j));
        put::<S, T, W>(p, VELOCITY, j, image);
    }
    anew::<S, T, W>(p);
    for j in range.step_by(W::WIDTH) {
        let image = phi.attitude(&columns::<S, T, W>(simd, p, j));
        put::<S, T, W>(p, ATTITUDE, j, image);
    }
    anew::<S, T, W>(p);
}

/// What follows reads the matrix of one filter anew: else the compiler keeps rows from one pass to the next and spills them, which
/// takes an eighth longer.
#[inline(always)]
fn anew<S: Simd, T: Lane, W: Strip<S, T>>(p: &Matrix<T>) {
    if W::WIDTH > 1 {
        black_box(p);
    }
}

/// P ← P Φᵀ, row by row in place, on and above the diagonal. A block reads nothing that those before it have written.
///
/// The first row has one element there; by itself it leaves whole strips of the others.
#[inline(always)]
fn multiply_transposed<S: Simd, T: Strips<S>, W: Strip<S, T>>(simd: S, p: &mut Matrix<T>, phi: &impl Transition<T>) {
    p[0][0] = phi.position(&Parts::from_fn(
        #[inline(always)]
        |l| p[0][l],
    ))[0];
    T::turn_matrix(simd, p);
    for i in strips::<S, T, W>(POSITION) {
        let image = phi.position(&rows::<S, T, W>(simd, p, i));
        put_upper::<S, T, W>(p, POSITION, i, image);
    }
    anew::<S, T, W>(p);
    for i in strips::<S, T, W>(VELOCITY) {
        let image = phi.velocity(&rows::<S, T, W>(simd, p, i));
        put_upper::<S, T, W>(p, VELOCITY, i, image);
    }
    anew::<S, T, W>(p);
    for i in strips::<S, T, W>(ATTITUDE) {
        let image = phi.attitude(&rows::<S, T, W>(simd, p, i));
        put_upper::<S, T, W>(p, ATTITUDE, i, image);
    }
}

/// Where strips of the dynamic states after the first begin that hold `from` and those after it.
#[inline(always)]
fn strips<S: Simd, T: Lane, W: Strip<S, T>>(from: usize) -> impl Iterator<Item = usize> {
    let skipped = from.saturating_sub(1) / W::WIDTH;
    (1 + skipped * W::WIDTH..DYNAMIC).step_by(W::WIDTH)
}

/// Mirrors what the rows of the dynamic states have of the others.
#[inline(always)]
pub(crate) fn complete<T: Lane>(p: &mut Matrix<T>) {
    mirror(p, DYNAMIC..DIM);
}

/// The same of the inertial biases alone: all that a transition reads, and all that it leaves right for one filter.
#[inline(always)]
pub(crate) fn complete_biases<T: Lane>(p: &mut Matrix<T>) {
    mirror(p, DYNAMIC..DVL_BIAS);
}

#[inline(always)]
fn mirror<T: Lane>(p: &mut Matrix<T>, states: Range<usize>) {
    for i in 0..DYNAMIC {
        for k in states.clone() {
            p[k][i] = p[i][k];
        }
    }
}

/// What a transition reads of the strip of columns from j on.
#[inline(always)]
fn columns<S: Simd, T: Lane, W: Strip<S, T>>(simd: S, p: &Matrix<T>, j: usize) -> Parts<W> {
    Parts::from_fn(
        #[inline(always)]
        |l| {
            if l < DYNAMIC {
                W::take(simd, &p[l][j..])
            } else {
                W::turned(simd, p, j, l)
            }
        },
    )
}

/// What a transition reads of the strip of rows from i on.
#[inline(always)]
fn rows<S: Simd, T: Lane, W: Strip<S, T>>(simd: S, p: &Matrix<T>, i: usize) -> Parts<W> {
    Parts::from_fn(
        #[inline(always)]
        |l| W::turned(simd, p, i, l),
    )
}

/// Writes three rows of a strip of columns, from j on.
#[inline(always)]
fn put<S: Simd, T: Lane, W: Strip<S, T>>(p: &mut Matrix<T>, from: usize, j: usize, image: V3<W>) {
    for k in 0..3 {
        image[k].put(&mut p[from + k][j..]);
    }
}

/// The same as far as they reach the diagonal.
#[inline(always)]
fn put_upper<S: Simd, T: Lane, W: Strip<S, T>>(p: &mut Matrix<T>, from: usize, j: usize, image: V3<W>) {
    for k in 0..3 {
        if from + k < j + W::WIDTH {
            image[k].put(&mut p[from + k][j..]);
        }
    }
}
