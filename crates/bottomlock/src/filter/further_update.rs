//! The further states in an update, and what they add to the noise of a reading.
//!
//! In an update they count as noise that is correlated with the error state, n = D_x δx + D_f δf + white noise, so the
//! arithmetic of the 20 states is that of any update. With X the covariance of δx and δf, C that of δf, and z = H δx + n,
//!
//! ```text
//! R  += D_f C D_fᵀ + D_x X D_fᵀ + (D_x X D_fᵀ)ᵀ,   E[δx nᵀ] += X D_fᵀ
//! E[δf zᵀ] = Xᵀ (H + D_x)ᵀ + C D_fᵀ,               K_f = E[δf zᵀ] S⁻¹
//! ```

use std::ops::AddAssign;

use nalgebra::{Cholesky, Const, SMatrix};

use super::further_states::FurtherStates;
use super::imu_matrix::{MATRIX, Turned};
use crate::aiding::further::{CONSIDERED, FURTHER, FurtherRows, FurtherVector};
use crate::aiding::{CorrelatedNoise, Innovation, MAX_ROWS};
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::state::Covariance;

/// Matrices of the error state's update.
pub(super) struct Update<'a, const M: usize> {
    /// Innovation.
    pub(super) z: &'a SMatrix<f64, M, 1>,
    /// Innovation covariance.
    pub(super) s: &'a SMatrix<f64, M, M>,
    /// Cholesky factor of the innovation covariance.
    pub(super) factor: &'a Cholesky<f64, Const<M>>,
    /// E[δx zᵀ].
    pub(super) cross_covariance: &'a SMatrix<f64, DIM, M>,
    /// Gain K = E[δx zᵀ] S⁻¹.
    pub(super) gain: &'a SMatrix<f64, DIM, M>,
}

impl FurtherStates {
    /// Adds what the further states add to the noise of rows with the Jacobian D_f.
    pub(super) fn add_to(&self, innovation: &mut Innovation, rows: &FurtherRows) {
        let (x, own) = self.by_rows(rows, innovation.rows);
        innovation.noise += own;
        if let Some(noise) = &mut innovation.correlated_noise {
            let half = noise.by_state * x;
            innovation.noise += half + half.transpose();
            noise.by_further += rows;
        } else {
            innovation.correlated_noise = Some(Box::new(CorrelatedNoise {
                by_further: *rows,
                ..CorrelatedNoise::default()
            }));
        }
        *innovation
            .cross
            .get_or_insert_with(|| Box::new(SMatrix::zeros()))
            .as_mut() += x;
    }

    /// H E[δx nᵀ] and its transpose, and the covariance of n = D_f δf: what they add to S.
    pub(super) fn added_to_innovation(
        &self,
        jacobian: &SMatrix<f64, MAX_ROWS, DIM>,
        rows: &FurtherRows,
    ) -> SMatrix<f64, MAX_ROWS, MAX_ROWS> {
        let (x, own) = self.by_rows(rows, MAX_ROWS);
        let half = jacobian * x;
        own + half + half.transpose()
    }

    /// X D_fᵀ and D_f C D_fᵀ of the first rows of D_f.
    fn by_rows(
        &self,
        rows: &FurtherRows,
        count: usize,
    ) -> (SMatrix<f64, DIM, MAX_ROWS>, SMatrix<f64, MAX_ROWS, MAX_ROWS>) {
        let mut x = SMatrix::<f64, DIM, MAX_ROWS>::zeros();
        let mut own = SMatrix::<f64, MAX_ROWS, MAX_ROWS>::zeros();
        for row in 0..count {
            let mut with_states = FurtherVector::zeros();
            for k in self.states().filter(|&k| rows[(row, k)] != 0.0) {
                x.column_mut(row).axpy(rows[(row, k)], &self.cross.column(k), 1.0);
                for j in self.states() {
                    with_states[j] += rows[(row, k)] * self.covariance[(j, k)];
                }
            }
            for other in row..count {
                let product = self.states().map(|j| rows[(other, j)] * with_states[j]).sum();
                own[(row, other)] = product;
                own[(other, row)] = product;
            }
        }
        (x, own)
    }

    /// Adds to the covariances with the error state, which have been propagated, what the considered errors of the
    /// inertial sensors did over the interval; returns what they add to the covariance of the error state.
    pub(super) fn consider(&mut self, turned: &Turned) -> Covariance {
        let unknown = self.unknown();
        let cross = self.cross.fixed_columns(MATRIX.start).into_owned();
        let added = turned.added(&unknown, &cross, &self.of_matrix());
        for n in self.states().collect::<Vec<_>>() {
            let moved = turned.times(&unknown, |k| self.covariance[(MATRIX.start + k, n)]);
            self.cross.column_mut(n).add_assign(&moved);
        }
        added
    }

    /// The considered errors that are unknown, counted from the first.
    fn unknown(&self) -> Vec<usize> {
        let considered = self.states().filter(|k| MATRIX.contains(k));
        considered.map(|k| k - MATRIX.start).collect()
    }

    /// What they add to the covariance of the error state over an interval that ends at `end`, over which nothing has been propagated.
    pub(super) fn considered(
        &self,
        turned: &Turned,
        interval: &Interval,
        end: &Kinematics<f64>,
        earth: &EarthTerms<f64>,
    ) -> Covariance {
        let mut cross = self.cross.fixed_columns(MATRIX.start).into_owned();
        interval.carry(&mut cross.data.0, end, earth);
        turned.added(&self.unknown(), &cross, &self.of_matrix())
    }

    /// Covariance of the considered errors of the inertial sensors.
    fn of_matrix(&self) -> SMatrix<f64, CONSIDERED, CONSIDERED> {
        self.covariance
            .fixed_view::<CONSIDERED, CONSIDERED>(MATRIX.start, MATRIX.start)
            .into_owned()
    }

    /// Updates with an update of the error state; returns the gain, transposed, which is zero for a state that is none.
    ///
    /// The gain is zero too for a state that the rows do not correct.
    pub(super) fn update<const M: usize>(
        &mut self,
        update: &Update<'_, M>,
        innovation: &Innovation,
    ) -> SMatrix<f64, M, FURTHER> {
        let noise = innovation.correlated_noise.as_deref();
        let mut h = innovation.jacobian.fixed_rows::<M>(0).into_owned();
        if let Some(noise) = noise {
            h += noise.by_state.fixed_rows::<M>(0);
        }
        let (mut x, mut gain, mut s_gain) = (
            SMatrix::<f64, M, FURTHER>::zeros(),
            SMatrix::<f64, M, FURTHER>::zeros(),
            SMatrix::<f64, M, FURTHER>::zeros(),
        );
        let states: Vec<usize> = self.states().collect();
        for &k in &states {
            let mut own = h * self.cross.column(k);
            if let Some(noise) = noise {
                for &j in &states {
                    own += noise.by_further.fixed_rows::<M>(0).column(j) * self.covariance[(j, k)];
                }
            }
            x.set_column(k, &own);
            if innovation.corrects.further_states().contains(&k) && !MATRIX.contains(&k) {
                let solved = update.factor.solve(&own);
                s_gain.set_column(k, &(update.s * solved));
                gain.set_column(k, &solved);
            }
        }
        // Joseph's form in S: an error of a gain enters squared.
        for &k in &states {
            let change = update.gain * (s_gain.column(k) - x.column(k)) - update.cross_covariance * gain.column(k);
            let mut cross = self.cross.column_mut(k);
            cross += change;
            for &i in states.iter().take_while(|&&i| i <= k) {
                let half = |a: usize, b: usize| gain.column(a).dot(&(s_gain.column(b) * 0.5 - x.column(b)));
                self.covariance[(i, k)] += half(i, k) + half(k, i);
                self.covariance[(k, i)] = self.covariance[(i, k)];
            }
        }
        gain
    }
}
