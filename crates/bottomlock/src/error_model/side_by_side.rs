//! Intervals of several filters gathered into lanes, and taken out again.

use super::second_order::Start;
use super::{Coefficients, CovarianceInterval, FirstOrderInterval, Interval, SecondOrderInterval};
use crate::simd::{Lane, Lanes, M3, Simd, WIDEST, gather, scatter, three};

/// Numbers of [`Coefficients`].
const COEFFICIENTS: usize = 27;

/// Intervals of one kind that can sit side by side.
pub(crate) trait SideBySide<S: Simd, T: Lanes<S>>: CovarianceInterval<T> {
    /// The intervals of the lanes, all of them as long as that of lane 0; nothing where one is of another kind.
    fn gathered(simd: S, of: &[Interval; WIDEST]) -> Option<Self>;
    /// The interval in lane k.
    fn lane(&self, k: usize) -> Interval;
}

impl<S: Simd, T: Lanes<S>> SideBySide<S, T> for FirstOrderInterval<T> {
    #[inline]
    fn gathered(simd: S, of: &[Interval; WIDEST]) -> Option<Self> {
        let (mut sum, mut last) = ([[0.0; COEFFICIENTS]; WIDEST], [[0.0; COEFFICIENTS]; WIDEST]);
        for k in 0..WIDEST {
            let Interval::FirstOrder(own) = &of[k] else { return None };
            (sum[k], last[k]) = (own.sum.to_array(), own.last.to_array());
        }
        Some(Self {
            sum: Coefficients::from_array(gather(simd, sum.each_ref())),
            last: Coefficients::from_array(gather(simd, last.each_ref())),
            duration_s: of[0].duration_s(),
        })
    }

    #[inline]
    fn lane(&self, k: usize) -> Interval {
        Interval::FirstOrder(FirstOrderInterval {
            sum: Coefficients::from_array(scatter(&self.sum.to_array(), k)),
            last: Coefficients::from_array(scatter(&self.last.to_array(), k)),
            duration_s: self.duration_s,
        })
    }
}

impl<S: Simd, T: Lanes<S>> SideBySide<S, T> for SecondOrderInterval<T> {
    #[inline]
    fn gathered(simd: S, of: &[Interval; WIDEST]) -> Option<Self> {
        let (mut start, mut integral) = ([[0.0; 18]; WIDEST], [[0.0; 9]; WIDEST]);
        for k in 0..WIDEST {
            let Interval::SecondOrder(own) = &of[k] else {
                return None;
            };
            (start[k], integral[k]) = (own.start.to_array(), flat(&own.rotation_integral));
        }
        let integral: [T; 9] = gather(simd, integral.each_ref());
        Some(Self {
            start: Start::from_array(gather(simd, start.each_ref())),
            rotation_integral: matrix(&integral, 0),
            duration_s: of[0].duration_s(),
        })
    }

    #[inline]
    fn lane(&self, k: usize) -> Interval {
        Interval::SecondOrder(SecondOrderInterval {
            start: Start::from_array(scatter(&self.start.to_array(), k)),
            rotation_integral: matrix(&scatter(&flat(&self.rotation_integral), k), 0),
            duration_s: self.duration_s,
        })
    }
}

#[inline]
fn matrix<T: Copy, const N: usize>(x: &[T; N], from: usize) -> M3<T> {
    [three(x, from), three(x, from + 3), three(x, from + 6)]
}

#[inline]
fn flat<T: Copy>(m: &M3<T>) -> [T; 9] {
    let [x, y, z] = m;
    [x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]]
}

impl<T: Lane> Start<T> {
    #[inline]
    fn to_array(self) -> [T; 18] {
        let (r, u, v, m) = (self.position_t, self.velocity_t, self.velocity_p, self.rotation);
        [
            r[0], r[1], r[2], u[0], u[1], u[2], v[0], v[1], v[2], m[0][0], m[0][1], m[0][2], m[1][0], m[1][1], m[1][2],
            m[2][0], m[2][1], m[2][2],
        ]
    }

    #[inline]
    fn from_array(x: [T; 18]) -> Self {
        Self {
            position_t: three(&x, 0),
            velocity_t: three(&x, 3),
            velocity_p: three(&x, 6),
            rotation: matrix(&x, 9),
        }
    }
}

impl<T: Lane> Coefficients<T> {
    #[inline]
    pub(super) fn to_array(self) -> [T; COEFFICIENTS] {
        let (a, r, f, w, v) = (
            self.velocity_t,
            self.rotation,
            self.velocity_by_misalignment,
            self.coriolis_rate_p,
            self.velocity_p,
        );
        [
            a[0], a[1], a[2], r[0][0], r[0][1], r[0][2], r[1][0], r[1][1], r[1][2], r[2][0], r[2][1], r[2][2], f[0][0],
            f[0][1], f[0][2], f[1][0], f[1][1], f[1][2], f[2][0], f[2][1], f[2][2], w[0], w[1], w[2], v[0], v[1], v[2],
        ]
    }

    #[inline]
    pub(super) fn from_array(x: [T; COEFFICIENTS]) -> Self {
        Self {
            velocity_t: three(&x, 0),
            rotation: matrix(&x, 3),
            velocity_by_misalignment: matrix(&x, 12),
            coriolis_rate_p: three(&x, 21),
            velocity_p: three(&x, 24),
        }
    }
}
