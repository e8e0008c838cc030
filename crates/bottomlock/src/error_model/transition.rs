//! The transition Φ of the error state over an interval, kept as the blocks of Φ − I.

use super::Coefficients;
use crate::layout::{ACCEL_BIAS, ATTITUDE, DYNAMIC, GYRO_BIAS, POSITION, VELOCITY};
use crate::mechanisation::EarthTerms;
use crate::simd::{Lane, M3, V3, add_mul, add_scaled, scale, splat3, sub_cross, sub_mul, three};

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
    #[inline(always)]
    pub(super) fn of<const N: usize>(x: &[T; N]) -> Self {
        Self {
            r: three(x, POSITION),
            rho: three(x, ATTITUDE),
            v: three(x, VELOCITY),
            ba: three(x, ACCEL_BIAS),
            bg: three(x, GYRO_BIAS),
        }
    }
}

/// A transition matrix whose last eleven rows are the identity, by blocks of rows of Φ x.
///
/// Blocks are asked for one at a time, so that the coefficients of one stay in registers over many vectors.
pub trait Transition<T: Lane> {
    /// The rows of position.
    fn position(&self, x: &Parts<T>) -> V3<T>;
    /// The rows of misalignment.
    fn attitude(&self, x: &Parts<T>) -> V3<T>;
    /// The rows of velocity.
    fn velocity(&self, x: &Parts<T>) -> V3<T>;

    /// All dynamic rows.
    #[inline(always)]
    fn apply<const N: usize>(&self, x: &[T; N]) -> [T; DYNAMIC] {
        let x = Parts::of(x);
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
    fn position(&self, x: &Parts<T>) -> V3<T> {
        add_mul(sub_cross(x.r, self.sum.velocity_t, x.rho), &self.sum.rotation, x.v)
    }
    #[inline(always)]
    fn attitude(&self, x: &Parts<T>) -> V3<T> {
        sub_mul(sub_cross(x.rho, self.earth, x.rho), &self.sum.rotation, x.bg)
    }
    #[inline(always)]
    fn velocity(&self, x: &Parts<T>) -> V3<T> {
        let v = add_scaled(sub_cross(x.v, self.sum.coriolis_rate_p, x.v), x.ba, self.minus_duration);
        sub_cross(
            add_mul(v, &self.sum.velocity_by_misalignment, x.rho),
            self.sum.velocity_p,
            x.bg,
        )
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
    fn position(&self, x: &Parts<T>) -> V3<T> {
        add_mul(
            add_mul(add_mul(x.r, &self.r_rho, x.rho), &self.r_v, x.v),
            &self.r_ba,
            x.ba,
        )
    }
    #[inline(always)]
    fn attitude(&self, x: &Parts<T>) -> V3<T> {
        add_mul(add_mul(x.rho, &self.rho_rho, x.rho), &self.rho_bg, x.bg)
    }
    #[inline(always)]
    fn velocity(&self, x: &Parts<T>) -> V3<T> {
        let v = add_mul(add_mul(x.v, &self.v_rho, x.rho), &self.v_v, x.v);
        add_mul(add_mul(v, &self.v_ba, x.ba), &self.v_bg, x.bg)
    }
}
