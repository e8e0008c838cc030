//! The lane type: one filter (`f64`) or several filters side by side (a vector of `f64`).
//!
//! Propagation is written once over [`Lane`]; a lane of a vector does the very operations of the scalar in the same order,
//! products and sums fused where the code says [`Lane::mul_add`] and nowhere else, so that lane results equal scalar results
//! bit for bit. That holds on every machine: which vectors there are is found at run time, and a machine that cannot
//! fuse works out the fused result in software, slowly.

mod algebra;
mod column;
mod dispatch;
mod strip;
mod transpose;

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use fearless_simd::Level;
use fearless_simd::prelude::*;

pub(crate) use fearless_simd::{Simd, f64x4, f64x8};

pub(crate) use self::algebra::*;
pub(crate) use self::column::*;
pub(crate) use self::dispatch::{Vectors, vectors, widest_lanes, with_lanes, with_vectors};
#[cfg(test)]
pub(crate) use self::dispatch::{on_every_level, on_one_level};
pub use self::strip::{Lift, Strip, Strips};
pub(crate) use self::transpose::{columns_of_eight, columns_of_four};

/// True where the machine fuses products and sums by itself.
#[inline(always)]
fn fuses(level: Level) -> bool {
    #[cfg(target_arch = "x86_64")]
    return matches!(level, Level::Avx2(_) | Level::Avx512(_));
    #[cfg(target_arch = "aarch64")]
    return matches!(level, Level::Neon(_));
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    return false;
}

/// The fused result all the same; not inlined, since it is long and rare.
#[inline(never)]
fn in_software<S: Simd, T: SimdFloat<S>>(value: T, factor: T, term: T) -> T {
    value.mul_add_precise(factor, term)
}

/// One number per filter.
pub trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> + AddAssign
{
    /// The same number in every lane of a vector like this one; which number this one holds does not matter.
    #[must_use]
    fn splat(self, value: f64) -> Self;
    /// Square root, lane by lane.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Reciprocal, lane by lane.
    #[must_use]
    fn recip(self) -> Self;
    /// `self` × `factor` + `term`, rounded once.
    #[must_use]
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// True where some lane exceeds `limit`.
    fn any_above(self, limit: f64) -> bool;
    /// True where every lane holds a finite number.
    fn all_finite(self) -> bool;
    /// Applies a scalar function lane by lane (for rare paths only).
    #[must_use]
    fn map(self, function: impl Fn(f64) -> f64) -> Self;
    /// A vector like this one with `value(k)` in lane k.
    #[must_use]
    fn each(self, value: impl Fn(usize) -> f64) -> Self;
}

impl Lane for f64 {
    #[inline(always)]
    fn splat(self, value: f64) -> Self {
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
    fn mul_add(self, factor: Self, term: Self) -> Self {
        f64::mul_add(self, factor, term)
    }
    #[inline(always)]
    fn any_above(self, limit: f64) -> bool {
        self > limit
    }
    #[inline(always)]
    fn all_finite(self) -> bool {
        self.is_finite()
    }
    #[inline(always)]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        function(self)
    }
    #[inline(always)]
    fn each(self, value: impl Fn(usize) -> f64) -> Self {
        value(0)
    }
}

/// Several filters side by side.
pub trait Lanes<S: Simd>: Strips<S> {
    /// Number of filters.
    const COUNT: usize;
    /// A vector with `value(k)` in lane k.
    fn gather(simd: S, value: impl Fn(usize) -> f64) -> Self;
    /// The number in lane k.
    fn get(&self, k: usize) -> f64;
    /// As many numbers as there are lanes.
    fn load(simd: S, from: &[f64]) -> Self;
    /// The same way back.
    fn store(&self, into: &mut [f64]);
    /// Turns as many vectors as there are lanes, rows of a square, into its columns.
    fn turn(rows: &mut [Self; WIDEST]);
}

/// The widest vector's number of lanes.
pub(crate) const WIDEST: usize = 8;

/// Numbers of several filters, `of` lane k, as vectors.
#[inline(always)]
pub(crate) fn gather<S: Simd, T: Lanes<S>, const M: usize>(simd: S, of: [&[f64; M]; WIDEST]) -> [T; M] {
    let zero = T::gather(simd, |_| 0.0);
    let mut lanes = [zero; M];
    for from in squares::<M>(T::COUNT) {
        let mut square = [zero; WIDEST];
        for k in 0..T::COUNT {
            square[k] = T::load(simd, &of[k][from..from + T::COUNT]);
        }
        T::turn(&mut square);
        for (lane, column) in lanes[from..from + T::COUNT].iter_mut().zip(square) {
            *lane = column;
        }
    }
    lanes
}

/// The inverse of [`gather`]: `put` gets the numbers of each of the first `count` lanes, as many at a time as there are lanes.
#[inline(always)]
pub(crate) fn scatter_rows<S: Simd, T: Lanes<S>, const M: usize>(
    lanes: &[T; M],
    count: usize,
    mut put: impl FnMut(usize, std::ops::Range<usize>, &T),
) {
    for from in squares::<M>(T::COUNT) {
        let mut square = [lanes[0]; WIDEST];
        for (row, lane) in square.iter_mut().zip(&lanes[from..from + T::COUNT]) {
            *row = *lane;
        }
        T::turn(&mut square);
        for (k, column) in square.iter().enumerate().take(count) {
            put(k, from..from + T::COUNT, column);
        }
    }
}

/// Where squares of `side` begin that cover M numbers, no fewer; the last may overlap the one before.
#[inline(always)]
fn squares<const M: usize>(side: usize) -> impl Iterator<Item = usize> {
    (0..M).step_by(side).map(move |from| from.min(M - side))
}

/// The numbers in lane k.
#[inline(always)]
pub(crate) fn scatter<S: Simd, T: Lanes<S>, const M: usize>(lanes: &[T; M], k: usize) -> [f64; M] {
    let mut own = [0.0; M];
    for i in 0..M {
        own[i] = lanes[i].get(k);
    }
    own
}

macro_rules! vectors {
    ($vector:ident, $count:literal, $columns:ident) => {
        impl<S: Simd> Lane for $vector<S> {
            #[inline(always)]
            fn splat(self, value: f64) -> Self {
                <Self as SimdBase<S>>::splat(self.simd, value)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <Self as SimdFloat<S>>::sqrt(self)
            }
            #[inline(always)]
            fn recip(self) -> Self {
                <Self as SimdBase<S>>::splat(self.simd, 1.0) / self
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                if fuses(self.simd.level()) {
                    <Self as SimdFloat<S>>::mul_add(self, factor, term)
                } else {
                    in_software(self, factor, term)
                }
            }
            #[inline(always)]
            fn any_above(self, limit: f64) -> bool {
                self.simd_gt(<Self as SimdBase<S>>::splat(self.simd, limit))
                    .any_true()
            }
            #[inline(always)]
            fn all_finite(self) -> bool {
                // ∞ − ∞ and NaN − NaN are NaN.
                (self - self)
                    .simd_eq(<Self as SimdBase<S>>::splat(self.simd, 0.0))
                    .all_true()
            }
            #[inline(always)]
            fn map(self, function: impl Fn(f64) -> f64) -> Self {
                <Self as SimdBase<S>>::from_fn(self.simd, |k| function(self[k]))
            }
            #[inline(always)]
            fn each(self, value: impl Fn(usize) -> f64) -> Self {
                <Self as SimdBase<S>>::from_fn(self.simd, value)
            }
        }

        impl<S: Simd> Lanes<S> for $vector<S> {
            const COUNT: usize = $count;
            #[inline(always)]
            fn gather(simd: S, value: impl Fn(usize) -> f64) -> Self {
                <Self as SimdBase<S>>::from_fn(simd, value)
            }
            #[inline(always)]
            fn get(&self, k: usize) -> f64 {
                self[k]
            }
            #[inline(always)]
            fn load(simd: S, from: &[f64]) -> Self {
                Self::from_slice(simd, from)
            }
            #[inline(always)]
            fn store(&self, into: &mut [f64]) {
                self.store_slice(into);
            }
            #[inline(always)]
            fn turn(rows: &mut [Self; WIDEST]) {
                let mut square = [rows[0]; $count];
                square.copy_from_slice(&rows[..$count]);
                rows[..$count].copy_from_slice(&$columns(square));
            }
        }
    };
}

vectors!(f64x4, 4, columns_of_four);
vectors!(f64x8, 8, columns_of_eight);

/// c + a x, fused.
#[inline(always)]
pub(crate) fn plus<T: Lane>(c: T, a: f64, x: T) -> T {
    x.mul_add(x.splat(a), c)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<S: Simd, T: Lanes<S>>(simd: S) {
        let values = [4.0, -0.25, f64::INFINITY, 0.0, 2.0, f64::NAN, 1e-300, -7.0];
        let lanes = T::gather(simd, |k| values[k]);
        for (k, value) in values.into_iter().enumerate().take(T::COUNT) {
            assert_eq!(lanes.get(k).to_bits(), value.to_bits());
            assert_eq!(Lane::sqrt(lanes).get(k).to_bits() << 1, value.sqrt().to_bits() << 1);
            assert_eq!(lanes.recip().get(k).to_bits(), (1.0 / value).to_bits());
            assert_eq!(lanes.map(|x| x + 1.0).get(k).to_bits(), (value + 1.0).to_bits());
            assert_eq!(lanes.splat(3.0).get(k).to_bits(), 3.0_f64.to_bits());
            // 1/3 × 3 − 1 is a rounding where it is fused, and nothing where it is not.
            let fused = lanes.splat(1.0 / 3.0).mul_add(lanes.splat(3.0), lanes.splat(-1.0));
            assert_eq!(fused.get(k).to_bits(), (-f64::EPSILON / 4.0).to_bits());
        }
        assert!(lanes.any_above(3.0) && !lanes.splat(3.0).any_above(3.0));
        assert!(!lanes.all_finite() && lanes.splat(f64::MAX).all_finite());
        assert!(!lanes.splat(f64::NAN).all_finite());
    }

    /// Gravity of lanes is that of each alone, bit for bit.
    #[test]
    fn gravity_of_lanes_is_that_of_one() {
        let earth = crate::earth::Earth::from(
            &crate::earth::Environment::normal(0.7, 0.0).on(crate::earth::EarthModel::Ellipsoid),
        );
        let position = |k: usize| [100.0 * k as f64 - 250.3, 33.3 * k as f64, 20.1 + k as f64 / 3.0];
        on_every_level(|| {
            with_vectors!(simd => {
                let lanes: [f64x4<_>; 3] = std::array::from_fn(|i| <f64x4<_> as Lanes<_>>::gather(simd, |k| position(k)[i]));
                let there = earth.terms(lanes).to_array();
                for k in 0..4 {
                    let one = earth.terms(position(k)).to_array();
                    for i in 0..12 { assert_eq!(Lanes::get(&there[i], k).to_bits(), one[i].to_bits(), "{i} {k} {}", one[i]); }
                }
            });
        });
    }

    /// Every kind of vector does lane by lane what `f64` does, infinities and NaN included (whose sign is nobody's).
    #[test]
    fn vectors_do_what_scalars_do() {
        on_every_level(|| {
            with_vectors!(simd => {
                check::<_, f64x4<_>>(simd);
                check::<_, f64x8<_>>(simd);
            })
        });
    }
}
