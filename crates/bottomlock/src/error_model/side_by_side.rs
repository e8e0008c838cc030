//! Intervals of several filters gathered into lanes, and taken out again.

use fearless_simd::prelude::*;

use super::{Coefficients, Interval};
use crate::lane::{Lane, Lanes, M3, V3, WIDEST, gather, scatter};

/// Number of coefficients.
const COUNT: usize = 27;

#[inline(always)]
fn vector<T: Lane>(x: &[T; COUNT], from: usize) -> V3<T> {
    [x[from], x[from + 1], x[from + 2]]
}

#[inline(always)]
fn matrix<T: Lane>(x: &[T; COUNT], from: usize) -> M3<T> {
    [vector(x, from), vector(x, from + 3), vector(x, from + 6)]
}

impl<T: Lane> Coefficients<T> {
    #[inline(always)]
    fn to_array(self) -> [T; COUNT] {
        let (a, r, f, w, v) = (self.velocity_t, self.rotation, self.force, self.swing, self.velocity_p);
        [
            a[0], a[1], a[2], r[0][0], r[0][1], r[0][2], r[1][0], r[1][1], r[1][2], r[2][0], r[2][1], r[2][2], f[0][0],
            f[0][1], f[0][2], f[1][0], f[1][1], f[1][2], f[2][0], f[2][1], f[2][2], w[0], w[1], w[2], v[0], v[1], v[2],
        ]
    }

    #[inline(always)]
    fn from_array(x: [T; COUNT]) -> Self {
        Self {
            velocity_t: vector(&x, 0),
            rotation: matrix(&x, 3),
            force: matrix(&x, 12),
            swing: vector(&x, 21),
            velocity_p: vector(&x, 24),
        }
    }
}

impl<T: Lane> Interval<T> {
    /// The intervals of the lanes, all of them as long as that of lane 0 and with coefficients at their ends.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(simd: S, of: &[&Interval<f64>; WIDEST]) -> Self
    where
        T: Lanes<S>,
    {
        let (mut sum, mut last) = ([[0.0; COUNT]; WIDEST], [[0.0; COUNT]; WIDEST]);
        for k in 0..WIDEST {
            sum[k] = of[k].sum.to_array();
            last[k] = of[k].last.unwrap_or(of[k].sum).to_array();
        }
        Self {
            sum: Coefficients::from_array(gather(simd, &sum)),
            last: Some(Coefficients::from_array(gather(simd, &last))),
            duration_s: of[0].duration_s,
        }
    }

    /// The interval in lane k.
    #[inline(always)]
    pub(crate) fn lane<S: Simd>(&self, k: usize) -> Interval<f64>
    where
        T: Lanes<S>,
    {
        let last = self.last.as_ref();
        Interval {
            sum: Coefficients::from_array(scatter(&self.sum.to_array(), k)),
            last: last.map(|last| Coefficients::from_array(scatter(&last.to_array(), k))),
            duration_s: self.duration_s,
        }
    }
}
