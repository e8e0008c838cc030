//! The arithmetic of an update over columns of the covariance: the predicted innovation, then the correction.
//!
//! The noise n of an innovation z = H δx + n may be correlated with the error state, C = E[δx nᵀ] (Eq. 26). With
//! X = P Hᵀ + C and S = H X + CᵀHᵀ + R, Joseph's form of any gain K is
//!
//! ```text
//! P⁺ = (I − K H) P (I − K H)ᵀ + K R Kᵀ − (I − K H) C Kᵀ − K Cᵀ (I − K H)ᵀ
//!    = A − (A Hᵀ + C − K (R + H C)) Kᵀ,   A = P − K Xᵀ.
//! ```
//!
//! That is 2 M products per element instead of 40. A Hᵀ is computed from the rounded A, so a rounding error E of A
//! enters as E (I − K H)ᵀ: the variance after a precise measurement keeps its digits, as in the dense product. Forms
//! without A, P − K S Kᵀ and P − K Xᵀ − X Kᵀ + K S Kᵀ, leave errors of 2e-16 P there.

use std::ops::Range;

use nalgebra::{Cholesky, Const, SMatrix};

use super::definite::factorises;
use crate::aiding::MAX_ROWS;
use crate::aiding::{Corrects, Innovation, RowJacobian};
use crate::layout::DIM;
use crate::simd::{Column, Simd, WIDTH, are_zero, four, load_four, make_symmetric, plus, with_vectors};
use crate::state::{Covariance, ErrorVector};

/// A square matrix, column by column.
type Columns<const M: usize> = [[f64; M]; M];

/// The statistics that the filter predicts for an innovation of at most M rows.
pub(super) struct PredictedInnovation<const M: usize> {
    /// X = E[δx zᵀ].
    pub(super) cross_covariance: SMatrix<f64, DIM, M>,
    /// S, the innovation covariance, symmetric.
    pub(super) s: SMatrix<f64, M, M>,
    /// zᵀS⁻¹z.
    pub(super) nis: f64,
    /// R + H C.
    noise: Columns<M>,
    factor: Factor<M>,
    observed: ObservedStates,
}

/// S = L D Lᵀ.
struct Factor<const M: usize> {
    /// −L below the diagonal.
    minus_l: Columns<M>,
    d: [f64; M],
    inverse_d: [f64; M],
}

/// The gain and the estimated error of an update.
pub(super) struct Correction<const M: usize> {
    pub(super) gain: SMatrix<f64, DIM, M>,
    /// K z, the estimated error.
    pub(super) error: ErrorVector,
}

/// A corrected covariance is not positive definite.
pub(super) struct Indefinite {
    /// A state with a negative variance, if there is one.
    pub(super) negative: Option<usize>,
}

/// The states whose column of H is not zero.
struct ObservedStates {
    states: [usize; DIM],
    count: usize,
}

impl ObservedStates {
    #[inline(always)]
    fn by<S: Simd, const M: usize>(simd: S, h: &RowJacobian) -> Self {
        let (mut states, mut count) = ([0; DIM], 0);
        for (k, column) in h.data.0.iter().enumerate() {
            let mut is_observed = false;
            for from in (0..M).step_by(WIDTH) {
                is_observed |= !are_zero(load_four(simd, column, from));
            }
            states[count] = k;
            count += usize::from(is_observed);
        }
        Self { states, count }
    }

    #[inline(always)]
    fn states(&self) -> &[usize] {
        &self.states[..self.count]
    }
}

impl<const M: usize> PredictedInnovation<M> {
    /// The predicted innovation; `None` if S is not positive definite.
    pub(super) fn of(p: &Covariance, innovation: &Innovation) -> Option<Self> {
        with_vectors!(simd => Self::within(simd, p, innovation))
    }

    #[inline(always)]
    fn within<S: Simd>(simd: S, p: &Covariance, innovation: &Innovation) -> Option<Self> {
        let h = &innovation.jacobian;
        let observed = ObservedStates::by::<S, M>(simd, h);
        let mut cross_covariance = SMatrix::zeros();
        let p_h = times_transposed::<S, M>(simd, &p.data.0, h, &observed);
        for m in 0..M {
            p_h[m].store(&mut cross_covariance.data.0[m]);
        }
        let mut s = times::<S, M>(simd, h, &cross_covariance.data.0, &observed);
        let mut noise = [[0.0; M]; M];
        for n in 0..M {
            for m in 0..M {
                noise[n][m] = innovation.noise[(m, n)];
                s[n][m] += noise[n][m];
            }
        }
        // A row that is not there has no Jacobian, no residual and a variance of one: its gain is zero.
        for n in innovation.rows..M {
            (noise[n][n], s[n][n]) = (1.0, 1.0);
        }
        if let Some(cross) = &innovation.cross {
            let h_c = times::<S, M>(simd, h, &cross.data.0, &observed);
            for n in 0..M {
                for m in 0..M {
                    noise[n][m] += h_c[n][m];
                    s[n][m] += h_c[n][m] + h_c[m][n];
                }
                for i in 0..DIM {
                    cross_covariance[(i, n)] += cross[(i, n)];
                }
            }
        }
        for n in 0..M {
            for m in 0..n {
                s[n][m] = s[m][n];
            }
        }
        let factor = Factor::of(&s)?;
        Some(Self {
            cross_covariance,
            s: s.into(),
            nis: factor.norm_squared(&innovation.residual.data.0[0]),
            noise,
            factor,
            observed,
        })
    }

    /// Cholesky factor of S.
    pub(super) fn cholesky(&self) -> Cholesky<f64, Const<M>> {
        let mut l = SMatrix::zeros();
        for k in 0..M {
            let root = self.factor.d[k].sqrt();
            l[(k, k)] = root;
            for i in k + 1..M {
                l[(i, k)] = -self.factor.minus_l[k][i] * root;
            }
        }
        Cholesky::pack_dirty(l)
    }

    /// Corrects a covariance, where the result is proven to be one, and leaves it alone elsewhere.
    pub(super) fn correct(
        &self,
        covariance: &mut Covariance,
        innovation: &Innovation,
    ) -> Result<Correction<M>, Indefinite> {
        with_vectors!(simd => self.correct_within(simd, covariance, innovation))
    }

    #[inline(always)]
    fn correct_within<S: Simd>(
        &self,
        simd: S,
        covariance: &mut Covariance,
        innovation: &Innovation,
    ) -> Result<Correction<M>, Indefinite> {
        let mut gain = self.factor.solve(simd, &self.cross_covariance.data.0);
        if innovation.corrects != Corrects::All {
            keep(simd, &mut gain, innovation.corrects.states());
        }
        let mut corrected = *covariance;
        let p = &mut corrected.data.0;
        self.joseph(simd, p, innovation, &gain);
        make_symmetric(simd, p);
        if !factorises(simd, p) {
            return Err(Indefinite {
                negative: (0..DIM).find(|&k| p[k][k] < 0.0),
            });
        }
        *covariance = corrected;
        let mut correction = Correction {
            gain: SMatrix::zeros(),
            error: ErrorVector::zeros(),
        };
        let mut error = Column::zero(simd);
        for m in 0..M {
            gain[m].store(&mut correction.gain.data.0[m]);
            error = error.plus(innovation.residual[m], &gain[m]);
        }
        error.store(&mut correction.error.data.0[0]);
        Ok(correction)
    }

    /// Joseph's form for a given gain, in place; the result is not symmetric to the last bit.
    #[inline(always)]
    fn joseph<S: Simd>(&self, simd: S, p: &mut [[f64; DIM]; DIM], innovation: &Innovation, gain: &[Column<S>; M]) {
        let (mut minus_gain, mut gain_rows) = ([Column::zero(simd); M], [[0.0; DIM]; M]);
        for m in 0..M {
            gain[m].store(&mut gain_rows[m]);
            minus_gain[m] = gain[m].times(-1.0);
        }
        for (j, column) in p.iter_mut().enumerate() {
            let mut sum = Column::load(simd, column);
            for m in 0..M {
                sum = sum.plus(self.cross_covariance[(j, m)], &minus_gain[m]);
            }
            sum.store(column);
        }
        // A Hᵀ + C − K (R + H C), which is zero up to rounding for the optimal gain.
        let mut rest = times_transposed::<S, M>(simd, p, &innovation.jacobian, &self.observed);
        for m in 0..M {
            for n in 0..M {
                rest[m] = rest[m].plus(self.noise[m][n], &minus_gain[n]);
            }
            if let Some(cross) = &innovation.cross {
                rest[m] = rest[m].plus(1.0, &Column::load(simd, &cross.data.0[m]));
            }
            rest[m] = rest[m].times(-1.0);
        }
        for (j, column) in p.iter_mut().enumerate() {
            let mut sum = Column::load(simd, column);
            for m in 0..M {
                sum = sum.plus(gain_rows[m][j], &rest[m]);
            }
            sum.store(column);
        }
    }
}

impl<const M: usize> Factor<M> {
    #[inline(always)]
    fn of(s: &Columns<M>) -> Option<Self> {
        let mut factor = Self {
            minus_l: [[0.0; M]; M],
            d: [0.0; M],
            inverse_d: [0.0; M],
        };
        let mut left = *s;
        for k in 0..M {
            if !(left[k][k] > 0.0) {
                return None;
            }
            factor.d[k] = left[k][k];
            factor.inverse_d[k] = 1.0 / left[k][k];
            for j in k + 1..M {
                factor.minus_l[k][j] = -left[k][j] * factor.inverse_d[k];
                for i in j..M {
                    left[j][i] = factor.minus_l[k][j].mul_add(left[k][i], left[j][i]);
                }
            }
        }
        Some(factor)
    }

    /// zᵀS⁻¹z.
    #[inline(always)]
    fn norm_squared(&self, z: &[f64; MAX_ROWS]) -> f64 {
        let (mut left, mut sum) = (*z, 0.0);
        for k in 0..M {
            for i in k + 1..M {
                left[i] = self.minus_l[k][i].mul_add(left[k], left[i]);
            }
            sum = (left[k] * self.inverse_d[k]).mul_add(left[k], sum);
        }
        sum
    }

    /// X S⁻¹.
    #[inline(always)]
    fn solve<S: Simd>(&self, simd: S, x: &[[f64; DIM]; M]) -> [Column<S>; M] {
        let mut out = [Column::zero(simd); M];
        for i in 0..M {
            let mut own = Column::load(simd, &x[i]);
            for k in 0..i {
                own = own.plus(self.minus_l[k][i], &out[k]);
            }
            out[i] = own;
        }
        for i in (0..M).rev() {
            let mut own = out[i].times(self.inverse_d[i]);
            for k in i + 1..M {
                own = own.plus(self.minus_l[i][k], &out[k]);
            }
            out[i] = own;
        }
        out
    }
}

/// Zeroes a gain but for some states.
fn keep<S: Simd>(simd: S, gain: &mut [Column<S>], states: Range<usize>) {
    for column in gain {
        let mut numbers = [0.0; DIM];
        column.store(&mut numbers);
        numbers[..states.start].fill(0.0);
        numbers[states.end..].fill(0.0);
        *column = Column::load(simd, &numbers);
    }
}

/// A Hᵀ.
#[inline(always)]
fn times_transposed<S: Simd, const M: usize>(
    simd: S,
    a: &[[f64; DIM]; DIM],
    h: &RowJacobian,
    observed: &ObservedStates,
) -> [Column<S>; M] {
    let mut sums = [Column::zero(simd); M];
    for &k in observed.states() {
        let column = Column::load(simd, &a[k]);
        for m in 0..M {
            sums[m] = sums[m].plus(h.data.0[k][m], &column);
        }
    }
    sums
}

/// H X, column by column.
#[inline(always)]
fn times<S: Simd, const M: usize>(simd: S, h: &RowJacobian, x: &[[f64; DIM]], observed: &ObservedStates) -> Columns<M> {
    let mut out = [[0.0; M]; M];
    for from in (0..M).step_by(WIDTH) {
        let mut sums = [four(simd, 0.0); M];
        for &k in observed.states() {
            let rows = load_four(simd, &h.data.0[k], from);
            for n in 0..M {
                sums[n] = plus(sums[n], x[n][k], rows);
            }
        }
        for n in 0..M {
            for m in from..M.min(from + WIDTH) {
                out[n][m] = sums[n][m - from];
            }
        }
    }
    out
}

#[cfg(test)]
#[path = "joseph_tests.rs"]
mod tests;
