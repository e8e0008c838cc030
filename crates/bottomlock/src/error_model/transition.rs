//! The transition Φ of the error state over an interval, kept as the blocks of Φ − I.

use super::Coefficients;
use crate::layout::{ACCEL_BIAS, ATTITUDE, DYNAMIC, GYRO_BIAS, POSITION, VELOCITY};
use crate::mechanisation::EarthTerms;
use crate::simd::{Lane, Lift, M3, V3, add_mul, add_scaled, scale, splat3, sub_cross, sub_mul};

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
    pub(super) fn from_fn(element: impl Fn(usize) -> T) -> Self {
        Self {
            r: [element(POSITION), element(POSITION + 1), element(POSITION + 2)],
            rho: [element(ATTITUDE), element(ATTITUDE + 1), element(ATTITUDE + 2)],
            v: [element(VELOCITY), element(VELOCITY + 1), element(VELOCITY + 2)],
            ba: [element(ACCEL_BIAS), element(ACCEL_BIAS + 1), element(ACCEL_BIAS + 2)],
            bg: [element(GYRO_BIAS), element(GYRO_BIAS + 1), element(GYRO_BIAS + 2)],
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

/// Φ = I + F T, F with its skew and identity blocks.
#[derive(Debug, Clone, Copy)]
pub struct FirstOrder<T> {
    sum: Coefficients<T>,
    earth: V3<T>,
    minus_duration: T,
}

impl<T: Lane> FirstOrder<T> {
    #[inline(always)]
    pub(super) fn new(sum: Coefficients<T>, duration_s: f64, earth: &EarthTerms) -> Self {
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

/// Φ with all its blocks filled; those of Φ − I are kept.
#[derive(Debug, Clone, Copy)]
pub struct SecondOrder<T> {
    pub(super) r_rho: M3<T>,
    pub(super) r_v: M3<T>,
    pub(super) r_ba: M3<T>,
    pub(super) rho_rho: M3<T>,
    pub(super) rho_bg: M3<T>,
    pub(super) v_rho: M3<T>,
    pub(super) v_v: M3<T>,
    pub(super) v_ba: M3<T>,
    pub(super) v_bg: M3<T>,
}

impl<T: Lane> Transition<T> for SecondOrder<T> {
    #[inline(always)]
    fn position<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let r = add_mul(add_mul(x.r, &lift3(x, &self.r_rho), x.rho), &lift3(x, &self.r_v), x.v);
        add_mul(r, &lift3(x, &self.r_ba), x.ba)
    }
    #[inline(always)]
    fn attitude<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let rho = add_mul(x.rho, &lift3(x, &self.rho_rho), x.rho);
        add_mul(rho, &lift3(x, &self.rho_bg), x.bg)
    }
    #[inline(always)]
    fn velocity<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let v = add_mul(add_mul(x.v, &lift3(x, &self.v_rho), x.rho), &lift3(x, &self.v_v), x.v);
        add_mul(add_mul(v, &lift3(x, &self.v_ba), x.ba), &lift3(x, &self.v_bg), x.bg)
    }
}

/// Three factors for strips like those of `x`.
#[inline(always)]
fn lift<T: Copy, W: Lift<T>>(x: &Parts<W>, a: V3<T>) -> V3<W> {
    [x.r[0].lift(a[0]), x.r[0].lift(a[1]), x.r[0].lift(a[2])]
}

/// A matrix of them.
#[inline(always)]
fn lift3<T: Copy, W: Lift<T>>(x: &Parts<W>, m: &M3<T>) -> M3<W> {
    [lift(x, m[0]), lift(x, m[1]), lift(x, m[2])]
}
