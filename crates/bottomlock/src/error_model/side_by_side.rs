//! Intervals of several filters gathered into lanes, and taken out again.

use fearless_simd::prelude::*;

use super::stretch::Start;
use super::{Coefficients, Interval, Span, Step, Stretch};
use crate::simd::{Lane, Lanes, M3, WIDEST, gather, scatter, three};

/// Intervals of one kind that can sit side by side.
pub(crate) trait SideBySide<S: Simd, T: Lanes<S>>: Span<T> {
    /// The interval of one filter.
    type One: Copy;
    /// That of a filter, if it is of this kind.
    fn one(interval: &Interval) -> Option<Self::One>;
    /// The intervals of the lanes, all of them as long as that of lane 0.
    fn gathered(simd: S, of: &[Self::One; WIDEST]) -> Self;
    /// The interval in lane k.
    fn lane(&self, k: usize) -> Interval;
}

impl<S: Simd, T: Lanes<S>> SideBySide<S, T> for Step<T> {
    type One = Step<f64>;

    #[inline(always)]
    fn one(interval: &Interval) -> Option<Step<f64>> {
        if let Interval::Step(step) = interval {
            Some(*step)
        } else {
            None
        }
    }

    #[inline(always)]
    fn gathered(simd: S, of: &[Step<f64>; WIDEST]) -> Self {
        Self {
            sum: Coefficients::from_array(gather(simd, of.map(|step| step.sum.to_array()).each_ref())),
            last: Coefficients::from_array(gather(simd, of.map(|step| step.last.to_array()).each_ref())),
            duration_s: of[0].duration_s,
        }
    }

    #[inline(always)]
    fn lane(&self, k: usize) -> Interval {
        Interval::Step(Step {
            sum: Coefficients::from_array(scatter(&self.sum.to_array(), k)),
            last: Coefficients::from_array(scatter(&self.last.to_array(), k)),
            duration_s: self.duration_s,
        })
    }
}

impl<S: Simd, T: Lanes<S>> SideBySide<S, T> for Stretch<T> {
    type One = Stretch<f64>;

    #[inline(always)]
    fn one(interval: &Interval) -> Option<Stretch<f64>> {
        if let Interval::Stretch(stretch) = interval {
            Some(*stretch)
        } else {
            None
        }
    }

    #[inline(always)]
    fn gathered(simd: S, of: &[Stretch<f64>; WIDEST]) -> Self {
        let turned: [T; 9] = gather(simd, of.map(|stretch| flat(&stretch.turned)).each_ref());
        Self {
            start: Start::from_array(gather(simd, of.map(|stretch| stretch.start.to_array()).each_ref())),
            turned: matrix(&turned, 0),
            duration_s: of[0].duration_s,
        }
    }

    #[inline(always)]
    fn lane(&self, k: usize) -> Interval {
        Interval::Stretch(Stretch {
            start: Start::from_array(scatter(&self.start.to_array(), k)),
            turned: matrix(&scatter(&flat(&self.turned), k), 0),
            duration_s: self.duration_s,
        })
    }
}

#[inline(always)]
fn matrix<T: Copy, const N: usize>(x: &[T; N], from: usize) -> M3<T> {
    [three(x, from), three(x, from + 3), three(x, from + 6)]
}

#[inline(always)]
fn flat<T: Copy>(m: &M3<T>) -> [T; 9] {
    let [x, y, z] = m;
    [x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]]
}

impl<T: Lane> Start<T> {
    #[inline(always)]
    fn to_array(self) -> [T; 18] {
        let (r, u, v, m) = (self.position_t, self.velocity_t, self.velocity_p, self.rotation);
        [
            r[0], r[1], r[2], u[0], u[1], u[2], v[0], v[1], v[2], m[0][0], m[0][1], m[0][2], m[1][0], m[1][1], m[1][2],
            m[2][0], m[2][1], m[2][2],
        ]
    }

    #[inline(always)]
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
    #[inline(always)]
    pub(super) fn to_array(self) -> [T; 27] {
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

    #[inline(always)]
    pub(super) fn from_array(x: [T; 27]) -> Self {
        Self {
            velocity_t: three(&x, 0),
            rotation: matrix(&x, 3),
            velocity_by_misalignment: matrix(&x, 12),
            coriolis_rate_p: three(&x, 21),
            velocity_p: three(&x, 24),
        }
    }
}
