//! The transition Φ of the error state over an interval, kept as the blocks of Φ − I.

use super::Coefficients;
use crate::imu::EarthTerms;
use crate::lane::{Lane, M3, V3, add, cross, mat_axpy, mat_mul, mul, scale, skew, splat3, sub, zero3};
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, DYNAMIC, GYRO_BIAS, POSITION, VELOCITY};

/// The part of a vector in error-state order that a transition reads.
#[derive(Clone, Copy)]
pub(super) struct Parts<T> {
    r: V3<T>,
    rho: V3<T>,
    v: V3<T>,
    ba: V3<T>,
    bg: V3<T>,
}

impl<T: Lane> Parts<T> {
    #[inline(always)]
    pub(super) fn of(x: &[T; DIM]) -> Self {
        Self {
            r: part(x, POSITION),
            rho: part(x, ATTITUDE),
            v: part(x, VELOCITY),
            ba: part(x, ACCEL_BIAS),
            bg: part(x, GYRO_BIAS),
        }
    }
}

/// A transition matrix whose last eleven rows are the identity, by blocks of rows of Φ x.
///
/// Blocks are asked for one at a time, so that the coefficients of one stay in registers over many vectors.
pub(super) trait Transition<T: Lane> {
    /// The rows of position.
    fn position(&self, x: &Parts<T>) -> V3<T>;
    /// The rows of misalignment.
    fn attitude(&self, x: &Parts<T>) -> V3<T>;
    /// The rows of velocity.
    fn velocity(&self, x: &Parts<T>) -> V3<T>;

    /// All dynamic rows.
    #[inline(always)]
    fn apply(&self, x: &[T; DIM]) -> [T; DYNAMIC] {
        let x = Parts::of(x);
        let (r, rho, v) = (self.position(&x), self.attitude(&x), self.velocity(&x));
        [r[0], r[1], r[2], rho[0], rho[1], rho[2], v[0], v[1], v[2]]
    }
}

/// Φ = I + F T, F with its skew and identity blocks.
pub(super) struct FirstOrder<T> {
    velocity_t: V3<T>,
    rotation: M3<T>,
    earth: V3<T>,
    force: M3<T>,
    swing: V3<T>,
    velocity_p: V3<T>,
    duration: T,
}

impl<T: Lane> FirstOrder<T> {
    #[inline(always)]
    pub(super) fn new(sum: &Coefficients<T>, duration_s: f64, earth: &EarthTerms) -> Self {
        let like = sum.velocity_p[0];
        Self {
            velocity_t: sum.velocity_t,
            rotation: sum.rotation,
            earth: splat3(like, scale(earth.rate_t, duration_s)),
            force: sum.force,
            swing: sum.swing,
            velocity_p: sum.velocity_p,
            duration: like.splat(duration_s),
        }
    }
}

#[inline(always)]
fn part<T: Lane>(x: &[T; DIM], start: usize) -> V3<T> {
    [x[start], x[start + 1], x[start + 2]]
}

impl<T: Lane> Transition<T> for FirstOrder<T> {
    #[inline(always)]
    fn position(&self, x: &Parts<T>) -> V3<T> {
        add(sub(x.r, cross(self.velocity_t, x.rho)), mul(&self.rotation, x.v))
    }
    #[inline(always)]
    fn attitude(&self, x: &Parts<T>) -> V3<T> {
        sub(sub(x.rho, cross(self.earth, x.rho)), mul(&self.rotation, x.bg))
    }
    #[inline(always)]
    fn velocity(&self, x: &Parts<T>) -> V3<T> {
        let v = sub(add(x.v, mul(&self.force, x.rho)), cross(self.swing, x.v));
        sub(sub(v, scale(x.ba, self.duration)), cross(self.velocity_p, x.bg))
    }
}

/// Φ = I + F T + (F T)²/2; the blocks are those of Φ − I.
pub(super) struct SecondOrder<T> {
    r_rho: M3<T>,
    r_v: M3<T>,
    r_ba: M3<T>,
    r_bg: M3<T>,
    rho_rho: M3<T>,
    rho_bg: M3<T>,
    v_rho: M3<T>,
    v_v: M3<T>,
    v_ba: M3<T>,
    v_bg: M3<T>,
}

#[inline(always)]
fn negative<T: Lane>(like: T, m: &M3<T>) -> M3<T> {
    mat_axpy(&zero3(like), like.splat(-1.0), m)
}

/// X Y + Z U.
#[inline(always)]
fn two_products<T: Lane>(x: &M3<T>, y: &M3<T>, z: &M3<T>, u: &M3<T>) -> M3<T> {
    mat_axpy(&mat_mul(x, y), x[0][0].splat(1.0), &mat_mul(z, u))
}

/// s I.
#[inline(always)]
fn identity_times<T: Lane>(s: T) -> M3<T> {
    let zero = s.splat(0.0);
    [[s, zero, zero], [zero, s, zero], [zero, zero, s]]
}

impl<T: Lane> SecondOrder<T> {
    #[inline(always)]
    pub(super) fn new(sum: &Coefficients<T>, duration_s: f64, earth: &EarthTerms) -> Self {
        let like = sum.velocity_p[0];
        let half = like.splat(0.5);
        // Blocks of F T.
        let a = negative(like, &skew(sum.velocity_t));
        let b = sum.rotation;
        let w = negative(like, &skew(splat3(like, scale(earth.rate_t, duration_s))));
        let n = negative(like, &sum.rotation);
        let c = sum.force;
        let d = negative(like, &skew(sum.swing));
        let e = like.splat(-duration_s);
        let g = negative(like, &skew(sum.velocity_p));
        // Blocks of (F T)²/2 added to them.
        Self {
            r_rho: mat_axpy(&a, half, &two_products(&a, &w, &b, &c)),
            r_v: mat_axpy(&b, half, &mat_mul(&b, &d)),
            r_ba: mat_axpy(&zero3(like), half * e, &b),
            r_bg: mat_axpy(&zero3(like), half, &two_products(&a, &n, &b, &g)),
            rho_rho: mat_axpy(&w, half, &mat_mul(&w, &w)),
            rho_bg: mat_axpy(&n, half, &mat_mul(&w, &n)),
            v_rho: mat_axpy(&c, half, &two_products(&c, &w, &d, &c)),
            v_v: mat_axpy(&d, half, &mat_mul(&d, &d)),
            v_ba: mat_axpy(&identity_times(e), half * e, &d),
            v_bg: mat_axpy(&g, half, &two_products(&c, &n, &d, &g)),
        }
    }
}

impl<T: Lane> Transition<T> for SecondOrder<T> {
    #[inline(always)]
    fn position(&self, x: &Parts<T>) -> V3<T> {
        let r = add(add(x.r, mul(&self.r_rho, x.rho)), mul(&self.r_v, x.v));
        add(add(r, mul(&self.r_ba, x.ba)), mul(&self.r_bg, x.bg))
    }
    #[inline(always)]
    fn attitude(&self, x: &Parts<T>) -> V3<T> {
        add(add(x.rho, mul(&self.rho_rho, x.rho)), mul(&self.rho_bg, x.bg))
    }
    #[inline(always)]
    fn velocity(&self, x: &Parts<T>) -> V3<T> {
        let v = add(add(x.v, mul(&self.v_rho, x.rho)), mul(&self.v_v, x.v));
        add(add(v, mul(&self.v_ba, x.ba)), mul(&self.v_bg, x.bg))
    }
}

/// A transition whose numbers can be put into every lane of a vector.
pub(super) trait Spread {
    /// The transition with vectors for numbers.
    type Over<V: Lane>: Transition<V>;
    /// The same numbers in every lane of vectors like `like`.
    fn over<V: Lane>(&self, like: V) -> Self::Over<V>;
}

#[inline(always)]
fn over3<V: Lane>(like: V, m: &M3<f64>) -> M3<V> {
    [splat3(like, m[0]), splat3(like, m[1]), splat3(like, m[2])]
}

impl Spread for FirstOrder<f64> {
    type Over<V: Lane> = FirstOrder<V>;

    #[inline(always)]
    fn over<V: Lane>(&self, like: V) -> FirstOrder<V> {
        FirstOrder {
            velocity_t: splat3(like, self.velocity_t),
            rotation: over3(like, &self.rotation),
            earth: splat3(like, self.earth),
            force: over3(like, &self.force),
            swing: splat3(like, self.swing),
            velocity_p: splat3(like, self.velocity_p),
            duration: like.splat(self.duration),
        }
    }
}

impl Spread for SecondOrder<f64> {
    type Over<V: Lane> = SecondOrder<V>;

    #[inline(always)]
    fn over<V: Lane>(&self, like: V) -> SecondOrder<V> {
        SecondOrder {
            r_rho: over3(like, &self.r_rho),
            r_v: over3(like, &self.r_v),
            r_ba: over3(like, &self.r_ba),
            r_bg: over3(like, &self.r_bg),
            rho_rho: over3(like, &self.rho_rho),
            rho_bg: over3(like, &self.rho_bg),
            v_rho: over3(like, &self.v_rho),
            v_v: over3(like, &self.v_v),
            v_ba: over3(like, &self.v_ba),
            v_bg: over3(like, &self.v_bg),
        }
    }
}
