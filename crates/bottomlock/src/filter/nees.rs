//! Normalised estimation error squared (NEES), of several filters side by side.

use std::ops::Range;

use crate::layout::DIM;
use crate::simd::{Lane, Lanes, Simd, WIDEST, gather, widest_lanes, with_lanes, with_vectors};
use crate::state::{Covariance, ErrorVector};

/// Normalised estimation error squared δxᵀP⁻¹δx over the states `range`, of each pair of P and δx; `None` where P is not
/// positive definite there.
///
/// Frozen states (zero variance) are left out. N, at least 8, is not less than the length of the range. A value has the same
/// bits whatever its neighbours are.
#[must_use]
pub fn nees<const N: usize>(estimates: &[(&Covariance, &ErrorVector)], range: Range<usize>) -> Vec<Option<f64>> {
    let mut squares = Vec::with_capacity(estimates.len());
    for group in estimates.chunks(widest_lanes()) {
        let window = |k: usize| Window::<N>::of(group[k.min(group.len() - 1)], &range);
        let windows: [Window<'_, N>; WIDEST] = std::array::from_fn(window);
        let solved = match group {
            [_] => alone(&windows),
            _ => with_lanes!(side_by_side<N>, &windows, else alone(&windows)),
        };
        squares.extend((0..group.len()).map(|k| Some(solved[k]).filter(|square| square.is_finite())));
    }
    squares
}

/// N states in a row of P and δx, those of a range among them.
struct Window<'a, const N: usize> {
    covariance: &'a Covariance,
    from: usize,
    /// One over the standard deviation; zero for a state that is frozen or outside the range.
    scale: [f64; N],
    /// What the variance lacks then: one.
    lack: [f64; N],
    /// δx in standard deviations.
    error: [f64; N],
}

impl<'a, const N: usize> Window<'a, N> {
    fn of((covariance, error): (&'a Covariance, &ErrorVector), range: &Range<usize>) -> Self {
        let from = range.start.min(DIM - N);
        let counts = |i: usize| range.contains(&(from + i)) && covariance[(from + i, from + i)] > 0.0;
        let inverse_sd = |i: usize| covariance[(from + i, from + i)].sqrt().recip();
        let scale = std::array::from_fn(|i| if counts(i) { inverse_sd(i) } else { 0.0 });
        Self {
            covariance,
            from,
            scale,
            lack: scale.map(|scale| f64::from(u8::from(scale == 0.0))),
            error: std::array::from_fn(|i| error[from + i] * scale[i]),
        }
    }

    /// Column j of P.
    fn column(&self, j: usize) -> &[f64; N] {
        let column = &self.covariance.data.0[self.from + j];
        // A window lies within P.
        column[self.from..].first_chunk().unwrap_or(&[f64::NAN; N])
    }
}

/// The first window, not in lanes.
fn alone<const N: usize>([first, ..]: &[Window<'_, N>; WIDEST]) -> [f64; WIDEST] {
    let columns = std::array::from_fn(|j| *first.column(j));
    with_vectors!(_simd => [normalised_square(columns, &first.scale, &first.lack, first.error); WIDEST])
}

#[inline(always)]
fn side_by_side<S: Simd, T: Lanes<S>, const N: usize>(simd: S, windows: &[Window<'_, N>; WIDEST]) -> [f64; WIDEST] {
    let columns: [[T; N]; N] = std::array::from_fn(|j| gather(simd, windows.each_ref().map(|window| window.column(j))));
    let [scale, lack, error] = [
        gather(simd, windows.each_ref().map(|window| &window.scale)),
        gather(simd, windows.each_ref().map(|window| &window.lack)),
        gather(simd, windows.each_ref().map(|window| &window.error)),
    ];
    let square = normalised_square(columns, &scale, &lack, error);
    std::array::from_fn(|k| if k < T::COUNT { square.get(k) } else { f64::NAN })
}

/// Σ wᵢ² of the scaled P = L Lᵀ and L w = δx; not finite unless P is positive definite.
#[inline(always)]
fn normalised_square<T: Lane, const N: usize>(
    mut columns: [[T; N]; N],
    scale: &[T; N],
    lack: &[T; N],
    mut error: [T; N],
) -> T {
    for j in 0..N {
        for i in j..N {
            columns[j][i] = columns[j][i] * scale[i] * scale[j];
        }
        columns[j][j] += lack[j];
    }
    let mut sum = error[0].splat(0.0);
    for j in 0..N {
        // The root of a negative pivot is not a number, and the reciprocal of zero not finite.
        let inverse = columns[j][j].sqrt().recip();
        let whitened = error[j] * inverse;
        sum = whitened.mul_add(whitened, sum);
        for i in j + 1..N {
            columns[j][i] = columns[j][i] * inverse;
            error[i] = (-whitened).mul_add(columns[j][i], error[i]);
        }
        for k in j + 1..N {
            let minus = -columns[j][k];
            for i in k..N {
                columns[k][i] = minus.mul_add(columns[j][i], columns[k][i]);
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::on_every_level;
    use proptest::prelude::*;

    fn one(covariance: &Covariance, error: &ErrorVector, range: Range<usize>) -> Option<f64> {
        nees::<DIM>(&[(covariance, error)], range)[0]
    }

    /// 3² over 4 and 1 over 0.25; a frozen state and states outside the range do not count, and a negative variance has none.
    #[test]
    fn by_hand() {
        let mut covariance = Covariance::identity();
        (covariance[(2, 2)], covariance[(3, 3)], covariance[(4, 4)]) = (4.0, 0.25, 0.0);
        let mut error = ErrorVector::repeat(100.0);
        (error[2], error[3]) = (3.0, 1.0);
        assert_eq!(one(&covariance, &error, 2..5), Some(2.25 + 4.0));
        assert_eq!(one(&covariance, &error, 4..5), Some(0.0));
        assert_eq!(nees::<8>(&[(&covariance, &error)], 14..DIM), [Some(6e4)]);
        (covariance[(2, 3)], covariance[(3, 2)]) = (1.5, 1.5);
        assert_eq!(one(&covariance, &error, 2..5), None);
        (covariance[(2, 3)], covariance[(3, 2)]) = (1.0, 1.0);
        assert_eq!(one(&covariance, &error, 2..5), None);
    }

    fn estimate(numbers: &[f64]) -> (Covariance, ErrorVector) {
        let root = Covariance::from_column_slice(&numbers[..DIM * DIM]);
        let covariance = root * root.transpose() + Covariance::identity() * 0.1;
        (covariance, ErrorVector::from_column_slice(&numbers[DIM * DIM..]))
    }

    proptest! {
        /// Against a dense inverse of the states of the range.
        #[test]
        fn dense(numbers in prop::collection::vec(-1.0_f64..1.0, DIM * (DIM + 1)), from in 0..DIM, length in 1..=DIM) {
            let range = from..(from + length).min(DIM);
            let (covariance, error) = estimate(&numbers);
            let size = range.len();
            let block = covariance.view((from, from), (size, size)).into_owned();
            let x = error.rows(from, size).into_owned();
            let expected = x.dot(&(block.try_inverse().unwrap() * &x));
            prop_assert!((one(&covariance, &error, range).unwrap() / expected - 1.0).abs() < 1e-9);
        }

        /// Beside others, of which one is not positive definite, a filter has the bits that it has alone.
        #[test]
        fn bits_do_not_depend_on_company(numbers in prop::collection::vec(prop::collection::vec(-1.0_f64..1.0, DIM * (DIM + 1)), 1..11)) {
            let mut estimates: Vec<_> = numbers.iter().map(|own| estimate(own)).collect();
            estimates[0].0[(7, 7)] = 1e-9;
            let pairs: Vec<_> = estimates.iter().map(|(covariance, error)| (covariance, error)).collect();
            on_every_level(|| {
                for range in [0..DIM, 3..9] {
                    let alone: Vec<_> = pairs.iter().map(|pair| nees::<DIM>(&[*pair], range.clone())[0]).collect();
                    assert_eq!(nees::<DIM>(&pairs, range), alone);
                    assert_eq!(alone[0], None);
                }
            });
        }
    }
}
