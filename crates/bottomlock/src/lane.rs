//! The lane type: one filter (`f64`) or several filters side by side (a vector of `f64`).
//!
//! Propagation is written once over [`Lane`]; a lane of a vector does the very operations of the scalar, in the same
//! order and without fused multiply–add, so that lane results equal scalar results bit for bit.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// One number per filter.
pub trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> + AddAssign
{
    /// The same number in every lane.
    fn splat(value: f64) -> Self;
    /// Square root, lane by lane.
    fn sqrt(self) -> Self;
    /// Reciprocal, lane by lane.
    fn recip(self) -> Self;
    /// True where some lane exceeds `limit`.
    fn any_above(self, limit: f64) -> bool;
    /// Applies a scalar function lane by lane (for rare paths only).
    fn map(self, function: impl Fn(f64) -> f64) -> Self;
}

impl Lane for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        1.0 / self
    }
    #[inline(always)]
    fn any_above(self, limit: f64) -> bool {
        self > limit
    }
    #[inline(always)]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        function(self)
    }
}

/// Four filters side by side.
pub type Four = wide::f64x4;

impl Lane for Four {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Four::splat(value)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Four::sqrt(self)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Four::splat(1.0) / self
    }
    #[inline(always)]
    fn any_above(self, limit: f64) -> bool {
        self.to_array().iter().any(|&value| value > limit)
    }
    #[inline(always)]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        Four::from(self.to_array().map(function))
    }
}

/// Three-vector of lanes.
pub(crate) type V3<T> = [T; 3];
/// Three-by-three matrix of lanes, row by row.
pub(crate) type M3<T> = [[T; 3]; 3];

#[inline(always)]
pub(crate) fn add<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale<T: Lane>(a: V3<T>, s: T) -> V3<T> {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(crate) fn cross<T: Lane>(a: V3<T>, b: V3<T>) -> V3<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
pub(crate) fn dot<T: Lane>(a: V3<T>, b: V3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// M a.
#[inline(always)]
pub(crate) fn mul<T: Lane>(m: &M3<T>, a: V3<T>) -> V3<T> {
    [dot(m[0], a), dot(m[1], a), dot(m[2], a)]
}

/// Mᵀ a.
#[inline(always)]
pub(crate) fn tmul<T: Lane>(m: &M3<T>, a: V3<T>) -> V3<T> {
    [
        m[0][0] * a[0] + m[1][0] * a[1] + m[2][0] * a[2],
        m[0][1] * a[0] + m[1][1] * a[1] + m[2][1] * a[2],
        m[0][2] * a[0] + m[1][2] * a[1] + m[2][2] * a[2],
    ]
}

/// A B.
#[inline(always)]
pub(crate) fn mat_mul<T: Lane>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    [tmul(b, a[0]), tmul(b, a[1]), tmul(b, a[2])]
}

/// A + s B.
#[inline(always)]
pub(crate) fn mat_axpy<T: Lane>(a: &M3<T>, s: T, b: &M3<T>) -> M3<T> {
    [
        add(a[0], scale(b[0], s)),
        add(a[1], scale(b[1], s)),
        add(a[2], scale(b[2], s)),
    ]
}

/// The cross-product matrix `[a×]`.
#[inline(always)]
pub(crate) fn skew<T: Lane>(a: V3<T>) -> M3<T> {
    let zero = T::splat(0.0);
    [[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]]
}

/// Zero matrix.
#[inline(always)]
pub(crate) fn zero3<T: Lane>() -> M3<T> {
    [[T::splat(0.0); 3]; 3]
}
