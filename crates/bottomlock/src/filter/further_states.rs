//! All states beside the 20 of the error state: one covariance, and one covariance with the error state.
//!
//! In an update they count as noise that is correlated with the error state, n = D_x δx + D_f δf + white noise, so the
//! arithmetic of the 20 states is that of any update. With X the covariance of δx and δf, C that of δf, and z = H δx + n,
//!
//! ```text
//! R  += D_f C D_fᵀ + D_x X D_fᵀ + (D_x X D_fᵀ)ᵀ,   E[δx nᵀ] += X D_fᵀ
//! E[δf zᵀ] = Xᵀ (H + D_x)ᵀ + C D_fᵀ,               K_f = E[δf zᵀ] S⁻¹
//! ```
//!
//! Each is a constant or a first-order Gauss–Markov process, so that the transition is diagonal, but for the waves in a depth,
//! whose two states turn into each other. What an estimate is and how a correction is added to it belongs to its block.

use std::ops::Range;

use nalgebra::{ArrayStorage, Cholesky, Const, Matrix2, SMatrix};

use super::gyro_matrix::{MATRIX, Turned};
use crate::aiding::further::{
    DEPTH_WAVE, FIRST_DEPTH_WAVE, FURTHER, FURTHER_BLOCKS, FurtherRows, FurtherVector, GYRO_MATRIX,
};
use crate::aiding::{CorrectedPath, CorrelatedNoise, Innovation, MAX_ROWS};
use crate::error::{NavError, require_finite_squares};
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::state::Covariance;

/// Covariances of the further states that a filter has.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(into = "Saved", try_from = "Saved")]
pub(super) struct FurtherStates {
    /// Their blocks, in order.
    blocks: Vec<Range<usize>>,
    /// C.
    covariance: SMatrix<f64, FURTHER, FURTHER>,
    /// X = E[δx δfᵀ].
    cross: SMatrix<f64, DIM, FURTHER>,
}

/// The same as saved: the numbers of the states that there are.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Saved {
    blocks: Vec<Range<usize>>,
    covariance: Vec<f64>,
    cross: Vec<f64>,
}

impl From<FurtherStates> for Saved {
    fn from(further: FurtherStates) -> Self {
        let states: Vec<usize> = further.states().collect();
        let pairs = states.iter().flat_map(|&k| states.iter().map(move |&i| (i, k)));
        Self {
            covariance: pairs.map(|pair| further.covariance[pair]).collect(),
            cross: states
                .iter()
                .flat_map(|&k| further.cross.column(k).into_owned().data.0[0])
                .collect(),
            blocks: further.blocks,
        }
    }
}

impl TryFrom<Saved> for FurtherStates {
    type Error = String;
    fn try_from(saved: Saved) -> Result<Self, String> {
        let states: Vec<usize> = saved.blocks.iter().cloned().flatten().take(FURTHER + 1).collect();
        let count = states.len();
        let fits = saved.covariance.len() == count * count && saved.cross.len() == DIM * count;
        if !(fits && states.iter().all(|&k| k < FURTHER)) {
            return Err("numbers of further states that do not fit their blocks".to_owned());
        }
        let mut further = Self::none();
        for (column, &k) in states.iter().enumerate() {
            for (row, &i) in states.iter().enumerate() {
                further.covariance[(i, k)] = saved.covariance[column * count + row];
            }
            further
                .cross
                .column_mut(k)
                .copy_from_slice(&saved.cross[column * DIM..(column + 1) * DIM]);
        }
        further.blocks = saved.blocks;
        Ok(further)
    }
}

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

/// No further state.
pub(super) static NONE: FurtherStates = FurtherStates::none();

impl FurtherStates {
    /// No further state.
    pub(super) const fn none() -> Self {
        Self {
            blocks: Vec::new(),
            covariance: SMatrix::from_array_storage(ArrayStorage([[0.0; FURTHER]; FURTHER])),
            cross: SMatrix::from_array_storage(ArrayStorage([[0.0; DIM]; FURTHER])),
        }
    }

    /// Begins a block, or begins it anew: independent of all others, with these variances.
    pub(super) fn begin(&mut self, block: Range<usize>, variance: &[f64]) {
        self.end(&block);
        for (k, variance) in block.clone().zip(variance) {
            self.covariance[(k, k)] = *variance;
        }
        self.blocks.push(block);
        self.blocks.sort_by_key(|block| block.start);
    }

    /// Begins a state of a block anew: independent of all others, with this variance.
    pub(super) fn renew(&mut self, state: usize, variance: f64) {
        self.clear(state);
        self.covariance[(state, state)] = variance;
    }

    /// Begins a state of a block anew: so much of another one, and an independent part with this variance.
    pub(super) fn follow(&mut self, state: usize, other: usize, factor: f64, variance: f64) {
        let cross = self.cross.column(other) * factor;
        let mut covariance = self.covariance.column(other) * factor;
        covariance[state] = covariance[other] * factor + variance;
        self.cross.column_mut(state).copy_from(&cross);
        self.covariance.column_mut(state).copy_from(&covariance);
        self.covariance.row_mut(state).tr_copy_from(&covariance);
    }

    fn clear(&mut self, state: usize) {
        self.cross.column_mut(state).fill(0.0);
        self.covariance.column_mut(state).fill(0.0);
        self.covariance.row_mut(state).fill(0.0);
    }

    /// Ends a block, if there is one.
    pub(super) fn end(&mut self, block: &Range<usize>) {
        self.blocks.retain(|other| other != block);
        block.clone().for_each(|k| self.clear(k));
    }

    /// Returns true if there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// The states that there are, in order.
    pub(super) fn states(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.blocks.iter().cloned().flatten()
    }

    /// C.
    pub(super) fn covariance(&self) -> &SMatrix<f64, FURTHER, FURTHER> {
        &self.covariance
    }

    /// X = E[δx δfᵀ].
    pub(super) fn cross(&self) -> &SMatrix<f64, DIM, FURTHER> {
        &self.cross
    }

    /// Adds to the variance of a state.
    pub(super) fn add_variance(&mut self, state: usize, variance: f64) {
        self.covariance[(state, state)] += variance;
    }

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

    /// Adds to the covariances with the error state, which have been propagated, what the gyros' scale factors and misalignments
    /// did over the interval; returns what they add to the covariance of the error state.
    pub(super) fn consider(&mut self, turned: &Turned) -> Covariance {
        let added = turned.added(&self.cross.fixed_columns(MATRIX.start).into_owned(), &self.of_matrix());
        let covariance = self.covariance.fixed_rows::<GYRO_MATRIX>(MATRIX.start).into_owned();
        self.cross += turned.times(&covariance);
        added
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
        turned.added(&cross, &self.of_matrix())
    }

    /// Covariance of the gyros' scale factors and misalignments.
    fn of_matrix(&self) -> SMatrix<f64, GYRO_MATRIX, GYRO_MATRIX> {
        self.covariance
            .fixed_view::<GYRO_MATRIX, GYRO_MATRIX>(MATRIX.start, MATRIX.start)
            .into_owned()
    }

    /// Propagates over an interval of the error state that ends at `end`: each state keeps the fraction `left` of its error,
    /// its variance tends to `steady`, and those of the waves turn.
    pub(super) fn propagate(
        &mut self,
        interval: &Interval,
        end: &Kinematics<f64>,
        earth: &EarthTerms<f64>,
        left: &FurtherVector,
        steady: &FurtherVector,
        wave_turn: Option<&Matrix2<f64>>,
    ) {
        for block in &self.blocks {
            interval.carry(&mut self.cross.data.0[block.clone()], end, earth);
        }
        let states: Vec<usize> = self.states().collect();
        for &k in &states {
            self.cross.column_mut(k).scale_mut(left[k]);
            for &i in &states {
                self.covariance[(i, k)] *= left[i] * left[k];
            }
            self.covariance[(k, k)] += (1.0 - left[k] * left[k]) * steady[k];
        }
        if let Some(turn) = wave_turn {
            let first = FIRST_DEPTH_WAVE;
            let cross = self.cross.fixed_columns::<DEPTH_WAVE>(first) * turn.transpose();
            self.cross.fixed_columns_mut::<DEPTH_WAVE>(first).copy_from(&cross);
            let columns = self.covariance.fixed_columns::<DEPTH_WAVE>(first) * turn.transpose();
            self.covariance
                .fixed_columns_mut::<DEPTH_WAVE>(first)
                .copy_from(&columns);
            let rows = turn * self.covariance.fixed_rows::<DEPTH_WAVE>(first);
            self.covariance.fixed_rows_mut::<DEPTH_WAVE>(first).copy_from(&rows);
        }
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

    /// Follows a move of the error state, δr ← A δr + B ρ.
    pub(super) fn move_to_corrected_path(&mut self, path: &CorrectedPath) {
        path.move_rows(&mut self.cross);
    }

    /// Checks states that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        let known = |block: &Range<usize>| FURTHER_BLOCKS.iter().any(|(_, range)| range == block);
        let rising = self.blocks.windows(2).all(|pair| pair[0].end <= pair[1].start);
        if !(rising && self.blocks.iter().all(known)) {
            return Err(NavError::OutOfRange {
                field: "blocks of further states",
                value: self.blocks.len() as f64,
                expected: "each at most once, in order",
            });
        }
        require_finite_squares("covariance of further states", time_ns, self.covariance.as_slice())?;
        require_finite_squares("covariance of further states", time_ns, self.cross.as_slice())
    }
}

#[cfg(test)]
#[path = "further_states_tests.rs"]
mod tests;
