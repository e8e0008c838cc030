//! All states beside the 20 of the error state: their estimates, one covariance, and one covariance with the error state.
//!
//! Most are slow errors of sensors. Readings that scatter by little may all be wrong by much: a depth is known to centimetres
//! from one reading to the next, but tide, density and the sensor's own offset move all of them by decimetres; the yaw of a
//! magnetic attitude reference scatters by a tenth of a degree about a value that iron and declination move by degrees. Taken
//! for white noise such an error is averaged away in the covariance, and not in the world. The others belong to the vehicle's
//! motion, to its drives and to the DVL's mounting and clock.
//!
//! Each is a constant, a random walk or a first-order Gauss–Markov process, so that the transition is diagonal, but for the
//! waves in a depth, whose two states turn into each other. A correction is added to the estimate; that of the DVL's mounting
//! turns it, and a current turns with the correction of the yaw.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::{ArrayStorage, Matrix2, Rotation2, SMatrix};

use crate::aiding::CorrectedPath;
use crate::aiding::calibration::{CALIBRATION, Calibration};
use crate::aiding::current_layers::{LAYER_STATES, Layers, Water};
use crate::aiding::further::{Block, DEPTH_WAVE, FURTHER, FurtherVector, Process, Processes, block};
use crate::aiding::water::WATER;
use crate::error::{NavError, require_finite, require_finite_squares, require_non_negative, require_positive};
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};

/// Covariances of the further states that a filter has.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(into = "Saved", try_from = "Saved")]
pub(super) struct FurtherStates {
    /// Their blocks, in order.
    blocks: Vec<Range<usize>>,
    /// Value at the start and, but for constants, in the long run.
    mean: FurtherVector,
    /// Variance at the start and in the long run.
    variance: FurtherVector,
    /// Correlation time, s; infinite for a constant.
    time_s: FurtherVector,
    /// What a random walk adds to the variance, per s.
    walk: FurtherVector,
    estimate: FurtherVector,
    /// C.
    pub(super) covariance: SMatrix<f64, FURTHER, FURTHER>,
    /// X = E[δx δfᵀ].
    pub(super) cross: SMatrix<f64, DIM, FURTHER>,
}

/// The same as saved: the numbers of the states that there are.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Saved {
    blocks: Vec<Range<usize>>,
    /// Mean, variance, correlation time, walk and estimate of each.
    processes: Vec<[f64; 5]>,
    covariance: Vec<f64>,
    cross: Vec<f64>,
}

impl From<FurtherStates> for Saved {
    fn from(further: FurtherStates) -> Self {
        let states: Vec<usize> = further.states().collect();
        let pairs = states.iter().flat_map(|&k| states.iter().map(move |&i| (i, k)));
        let process = |&k: &usize| {
            let [mean, variance, time_s] = [&further.mean, &further.variance, &further.time_s].map(|vector| vector[k]);
            [mean, variance, time_s, further.walk[k], further.estimate[k]]
        };
        Self {
            processes: states.iter().map(process).collect(),
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
        let fits = saved.processes.len() == count
            && saved.covariance.len() == count * count
            && saved.cross.len() == DIM * count;
        if !(fits && states.iter().all(|&k| k < FURTHER)) {
            return Err("numbers of further states that do not fit their blocks".to_owned());
        }
        let mut further = Self::none();
        for (column, &k) in states.iter().enumerate() {
            [
                further.mean[k],
                further.variance[k],
                further.time_s[k],
                further.walk[k],
                further.estimate[k],
            ] = saved.processes[column];
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

/// No further state.
pub(super) static NONE: FurtherStates = FurtherStates::none();

impl FurtherStates {
    /// No further state.
    pub(super) const fn none() -> Self {
        Self {
            blocks: Vec::new(),
            mean: vector(0.0),
            variance: vector(0.0),
            time_s: vector(f64::INFINITY),
            walk: vector(0.0),
            estimate: vector(0.0),
            covariance: SMatrix::from_array_storage(ArrayStorage([[0.0; FURTHER]; FURTHER])),
            cross: SMatrix::from_array_storage(ArrayStorage([[0.0; DIM]; FURTHER])),
        }
    }

    /// Begins a block, or begins it anew: independent of all others.
    pub(super) fn begin(&mut self, (block, processes): &Processes) {
        self.end(*block);
        self.set(*block, processes);
        self.blocks.push(block.range());
        self.blocks.sort_by_key(|block| block.start);
        block.range().for_each(|k| self.renew(k));
    }

    /// Begins every block but those of the water anew.
    pub(super) fn restart(&mut self) {
        let states: Vec<usize> = self.states().filter(|&k| k < block::WATER.first).collect();
        states.into_iter().for_each(|k| self.renew(k));
    }

    /// Replaces the processes of a block; estimates and covariances stay.
    pub(super) fn set(&mut self, block: Block, processes: &[Process]) {
        for (k, process) in block.range().zip(processes) {
            (self.mean[k], self.variance[k]) = (process.mean, process.variance);
            (self.time_s[k], self.walk[k]) = (process.time_s, process.walk);
        }
    }

    /// Begins a state of a block anew: independent of all others, at the start of its process.
    pub(super) fn renew(&mut self, state: usize) {
        self.clear(state);
        self.estimate[state] = self.mean[state];
        self.covariance[(state, state)] = self.variance[state];
    }

    /// Begins a state of a block anew: so much of another one, and an independent part with this variance.
    pub(super) fn follow(&mut self, state: usize, other: usize, factor: f64, variance: f64) {
        let cross = self.cross.column(other) * factor;
        let mut covariance = self.covariance.column(other) * factor;
        covariance[state] = covariance[other] * factor + variance;
        self.estimate[state] = self.estimate[other] * factor;
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
    pub(super) fn end(&mut self, block: Block) {
        self.blocks.retain(|other| *other != block.range());
        self.set(block, &vec![Process::constant(0.0); block.count]);
        for k in block.range() {
            self.estimate[k] = 0.0;
            self.clear(k);
        }
    }

    /// Returns true if there is a block.
    pub(super) fn has(&self, block: Block) -> bool {
        self.blocks.contains(&block.range())
    }

    /// The estimates; zero for a state that there is not.
    pub(super) fn estimate(&self) -> &FurtherVector {
        &self.estimate
    }

    /// Variance of each state at the start and in the long run; zero for one that there is not.
    pub(super) fn variance(&self) -> &FurtherVector {
        &self.variance
    }

    /// Correlation time of each state, s; infinite for a constant.
    pub(super) fn time_s(&self) -> &FurtherVector {
        &self.time_s
    }

    /// How far an estimate is from that at the start, in sigmas at the start; 0 for one that is known.
    pub(super) fn sigmas(&self, state: usize) -> f64 {
        match self.variance[state] {
            0.0 => 0.0,
            variance => (self.estimate[state] - self.mean[state]).abs() / variance.sqrt(),
        }
    }

    /// The estimates that are added to a reading as they are: what it contains of the others the reading's residual has already.
    pub(super) fn added(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let of_beams = block::CALIBRATION.first..block::ATTITUDE_ERROR.first;
        let is_added = move |k: &usize| *k < block::WATER.first && !of_beams.contains(k);
        let with_estimate = self.states().filter(is_added).map(|k| (k, self.estimate[k]));
        with_estimate.filter(|&(_, estimate)| estimate != 0.0)
    }

    /// Adds an error to the estimates, with the yaw that is corrected.
    pub(super) fn inject(&mut self, yaw_rad: f64, error: &FurtherVector) {
        let mut estimate = self.estimate + error;
        if self.has(block::WATER) {
            let mut water = self.water(None);
            let of_layers = error.fixed_rows::<LAYER_STATES>(block::LAYERS.first);
            water.inject(
                yaw_rad,
                &error.fixed_rows::<WATER>(block::WATER.first).into_owned(),
                &of_layers.into_owned(),
            );
            estimate
                .fixed_rows_mut::<WATER>(block::WATER.first)
                .copy_from(&water.estimate);
            estimate
                .fixed_rows_mut::<LAYER_STATES>(block::LAYERS.first)
                .copy_from(&water.by_layer);
        }
        if let Some(mut calibration) = self.calibration() {
            let first = block::CALIBRATION.first;
            calibration.inject(&error.fixed_rows::<CALIBRATION>(first).into_owned());
            estimate
                .fixed_rows_mut::<CALIBRATION>(first)
                .copy_from(&calibration.numbers());
        }
        self.estimate = estimate;
    }

    /// The water states, with the current's layers.
    pub(super) fn water<'a>(&self, layers: Option<&'a Layers>) -> Water<'a> {
        Water {
            estimate: self.estimate.fixed_rows::<WATER>(block::WATER.first).into_owned(),
            layers,
            by_layer: self
                .estimate
                .fixed_rows::<LAYER_STATES>(block::LAYERS.first)
                .into_owned(),
        }
    }

    /// Mounting and clock of the DVL, where they are estimated.
    pub(super) fn calibration(&self) -> Option<Calibration> {
        let numbers = self.estimate.fixed_rows::<CALIBRATION>(block::CALIBRATION.first);
        self.has(block::CALIBRATION)
            .then(|| Calibration::of(&numbers.into_owned()))
    }

    /// Fraction of the error of each state that is left after `duration_s`.
    pub(super) fn left(&self, duration_s: f64) -> FurtherVector {
        let mut left = FurtherVector::repeat(1.0);
        for k in self.states() {
            left[k] = Process::lasting(0.0, self.time_s[k]).left(duration_s);
        }
        left
    }

    /// How the two states of the waves turn into each other in `duration_s`; `None` where there are none.
    pub(super) fn wave_turn(&self, duration_s: f64) -> Option<Matrix2<f64>> {
        let period_s = self.time_s[block::DEPTH_WAVE.first];
        self.has(block::DEPTH_WAVE)
            .then(|| *Rotation2::new(TAU / period_s * duration_s).matrix())
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

    /// Propagates over an interval of the error state that ends at `end`: each state keeps a fraction of its error, its variance
    /// tends to that of the long run, and those of the waves turn.
    pub(super) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) {
        let left = self.left(interval.duration_s());
        for block in &self.blocks {
            interval.carry(&mut self.cross.data.0[block.clone()], end, earth);
        }
        let states: Vec<usize> = self.states().collect();
        for &k in &states {
            if left[k] < 1.0 {
                self.estimate[k] = self.mean[k] + (self.estimate[k] - self.mean[k]) * left[k];
            }
            self.cross.column_mut(k).scale_mut(left[k]);
            for &i in &states {
                self.covariance[(i, k)] *= left[i] * left[k];
            }
            self.covariance[(k, k)] += (1.0 - left[k] * left[k]) * self.variance[k];
            self.covariance[(k, k)] += self.walk[k] * interval.duration_s();
        }
        if let Some(turn) = self.wave_turn(interval.duration_s()) {
            let first = block::DEPTH_WAVE.first;
            let turned = turn * self.estimate.fixed_rows::<DEPTH_WAVE>(first);
            self.estimate.fixed_rows_mut::<DEPTH_WAVE>(first).copy_from(&turned);
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

    /// Follows a move of the error state, δr ← A δr + B ρ.
    pub(super) fn move_to_corrected_path(&mut self, path: &CorrectedPath) {
        path.move_rows(&mut self.cross);
    }

    /// Checks states that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        let known = |range: &Range<usize>| block::ALL.iter().any(|block| block.range() == *range);
        let rising = self.blocks.windows(2).all(|pair| pair[0].end <= pair[1].start);
        if !(rising && self.blocks.iter().all(known)) {
            return Err(NavError::OutOfRange {
                field: "blocks of further states",
                value: self.blocks.len() as f64,
                expected: "each at most once, in order",
            });
        }
        let vectors = [&self.mean, &self.variance, &self.estimate];
        vectors
            .into_iter()
            .try_for_each(|vector| require_finite("further states", time_ns, vector.as_slice()))?;
        for k in self.states() {
            require_non_negative("variance of a further state", self.variance[k])?;
            require_non_negative("walk of a further state", self.walk[k])?;
            if self.time_s[k] != f64::INFINITY {
                require_positive("correlation time of a further state", self.time_s[k])?;
            }
        }
        require_finite_squares("covariance of further states", time_ns, self.covariance.as_slice())?;
        require_finite_squares("covariance of further states", time_ns, self.cross.as_slice())
    }
}

const fn vector(value: f64) -> FurtherVector {
    FurtherVector::from_array_storage(ArrayStorage([[value; FURTHER]]))
}

#[cfg(test)]
#[path = "further_states_tests.rs"]
mod tests;
