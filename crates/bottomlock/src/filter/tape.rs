//! The record of a filter for the smoother; recording does not change the filter's results.

use nalgebra::{DMatrix, DVector, SMatrix};

use super::Eskf;
use super::extensions::Extensions;
use super::further_update::Update;
use super::imu_matrix::MATRIX;
use crate::aiding::further::{DEPTH_WAVE, FURTHER, block};
use crate::aiding::{Corrects, Innovation};
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::state::{Covariance, NavState};

/// One entry of a tape; matrices are over the 20 error states and the further states that the filter has.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Step {
    /// Φ since the previous entry.
    Transition(DMatrix<f64>),
    /// An update: S⁻¹z, S⁻¹, H including the noise that depends on the error state, and K.
    Update {
        weighted_innovation: DVector<f64>,
        weight: DMatrix<f64>,
        h: DMatrix<f64>,
        gain: DMatrix<f64>,
    },
    /// A sample: Φ since the previous entry (not yet applied to the filter's covariance), the estimate and its
    /// covariance.
    Sample {
        pending: DMatrix<f64>,
        state: Box<NavState>,
        covariance: DMatrix<f64>,
    },
}

/// The record of a filter, in order of time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tape {
    pub(crate) steps: Vec<Step>,
}

impl Tape {
    /// Adds an entry; consecutive transitions are multiplied, so the tape grows with the updates and not with the IMU
    /// samples.
    pub(crate) fn push(&mut self, step: Step) {
        if let (Some(Step::Transition(before)), Step::Transition(phi)) = (self.steps.last_mut(), &step)
            && before.nrows() == phi.nrows()
        {
            *before = phi * &*before;
            return;
        }
        self.steps.push(step);
    }

    /// Size of the numbers on the tape, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let numbers = self.steps.iter().map(|step| match step {
            Step::Transition(phi) => phi.len(),
            Step::Update {
                weighted_innovation,
                weight,
                h,
                gain,
            } => weighted_innovation.len() + weight.len() + h.len() + gain.len(),
            Step::Sample {
                pending, covariance, ..
            } => pending.len() + covariance.len() + size_of::<NavState>() / size_of::<f64>(),
        });
        numbers.sum::<usize>() * size_of::<f64>()
    }
}

impl Eskf {
    /// Starts a tape.
    pub(crate) fn begin_tape(&mut self) {
        self.extensions.tape = Some(Box::default());
    }

    /// Takes the tape, if there is one.
    pub(crate) fn take_tape(&mut self) -> Option<Tape> {
        self.extensions.tape.take().map(|tape| *tape)
    }

    /// Records a sample on the tape.
    pub(crate) fn record_sample(&mut self) {
        let pending = transition(&self.interval, &self.kinematics, &self.earth, &self.extensions);
        let (state, covariance) = (self.state(), self.joint_covariance());
        if let Some(tape) = &mut self.extensions.tape {
            tape.push(Step::Sample {
                pending,
                state: Box::new(state),
                covariance,
            });
        }
    }

    /// Records an update; `further_gain` is that of the further states, transposed.
    pub(super) fn record_update<const M: usize>(
        &mut self,
        innovation: &Innovation,
        update: &Update<'_, M>,
        further_gain: &SMatrix<f64, M, FURTHER>,
    ) {
        let (rows, states) = (innovation.rows, self.extensions.states());
        let mut h = DMatrix::zeros(rows, states);
        let mut gain = DMatrix::zeros(states, rows);
        h.view_mut((0, 0), (rows, DIM))
            .copy_from(&innovation.jacobian.rows(0, rows));
        gain.view_mut((0, 0), (DIM, rows))
            .copy_from(&update.gain.columns(0, rows));
        if let Some(noise) = &innovation.correlated_noise {
            let mut own = h.view_mut((0, 0), (rows, DIM));
            own += noise.by_state.rows(0, rows);
            for (at, k) in (DIM..).zip(self.extensions.further().states()) {
                h.column_mut(at).copy_from(&noise.by_further.rows(0, rows).column(k));
            }
        }
        for (at, k) in (DIM..).zip(self.extensions.further().states()) {
            gain.row_mut(at)
                .copy_from(&further_gain.rows(0, rows).column(k).transpose());
        }
        // What corrects some states alone is no information on any other.
        let informs = if innovation.corrects == Corrects::All { 1.0 } else { 0.0 };
        let (weighted_innovation, weight) = (
            update.factor.solve(update.z) * informs,
            update.factor.inverse() * informs,
        );
        if let Some(tape) = &mut self.extensions.tape {
            tape.push(Step::Update {
                weighted_innovation: DVector::from_column_slice(&weighted_innovation.as_slice()[..rows]),
                weight: DMatrix::from_fn(rows, rows, |m, n| weight[(m, n)]),
                h,
                gain,
            });
        }
    }

    /// Covariance of all states, further states included, at the time of the state.
    pub(super) fn joint_covariance(&self) -> DMatrix<f64> {
        let mut extensions = Extensions {
            further: self.extensions.further.clone(),
            change: self.extensions.change.clone(),
            inertial: self.extensions.inertial.clone(),
            warm_up: None,
            added: None,
            water: self.extensions.water.clone(),
            tape: None,
        };
        if self.interval.duration_s() > 0.0 {
            extensions.propagate(&self.interval, &self.kinematics, &self.earth);
        }
        let further = extensions.further();
        let mut joint = DMatrix::zeros(extensions.states(), extensions.states());
        joint.view_mut((0, 0), (DIM, DIM)).copy_from(&self.covariance());
        for (column, k) in (DIM..).zip(further.states()) {
            joint
                .view_mut((0, column), (DIM, 1))
                .copy_from(&further.cross().column(k));
            for (row, i) in (DIM..=column).zip(further.states()) {
                joint[(row, column)] = further.covariance()[(i, k)];
            }
        }
        joint.fill_lower_triangle_with_upper_triangle();
        joint
    }
}

/// Φ over an interval that ends at `end`, further states included.
pub(super) fn transition(
    interval: &Interval,
    end: &Kinematics<f64>,
    earth: &EarthTerms<f64>,
    extensions: &Extensions,
) -> DMatrix<f64> {
    let states = extensions.states();
    let mut phi = Covariance::identity();
    interval.carry(&mut phi.data.0, end, earth);
    let mut whole = DMatrix::identity(states, states);
    whole.view_mut((0, 0), (DIM, DIM)).copy_from(&phi);
    let left = extensions.further().left(interval.duration_s());
    for (at, k) in (DIM..).zip(extensions.further().states()) {
        whole[(at, at)] = left[k];
    }
    let place = |state: usize| DIM + extensions.further().states().take_while(|&k| k < state).count();
    if let Some(turn) = extensions.further().wave_turn(interval.duration_s()) {
        let first = place(block::DEPTH_WAVE.first);
        let turned = turn * left[block::DEPTH_WAVE.first];
        whole
            .fixed_view_mut::<DEPTH_WAVE, DEPTH_WAVE>(first, first)
            .copy_from(&turned);
    }
    if let Some(turned) = extensions.turned(interval, end, earth) {
        let by_matrix = turned.by_matrix();
        for (at, k) in (DIM..)
            .zip(extensions.further().states())
            .filter(|(_, k)| MATRIX.contains(k))
        {
            whole
                .view_mut((0, at), (DIM, 1))
                .copy_from(&by_matrix.column(k - MATRIX.start));
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Consecutive transitions are one, the later to the left; of other states they stand beside each other.
    #[test]
    fn transitions_are_multiplied() {
        let transition = |numbers: &[f64]| Step::Transition(DMatrix::from_row_slice(2, 2, numbers));
        let mut tape = Tape::default();
        tape.push(transition(&[1.0, 2.0, 0.0, 1.0]));
        tape.push(transition(&[1.0, 0.0, 3.0, 1.0]));
        assert_eq!(tape.steps, vec![transition(&[1.0, 2.0, 3.0, 7.0])]);
        tape.push(Step::Transition(DMatrix::identity(3, 3)));
        assert_eq!(tape.steps.len(), 2);
        assert_eq!(tape.bytes(), (4 + 9) * 8);
        let sized = |rows, columns| DMatrix::zeros(rows, columns);
        tape.push(Step::Update {
            weighted_innovation: DVector::zeros(2),
            weight: sized(2, 2),
            h: sized(2, 20),
            gain: sized(20, 2),
        });
        assert_eq!(tape.bytes(), (13 + 2 + 4 + 40 + 40) * 8);
        tape.push(Step::Sample {
            pending: sized(3, 3),
            state: Box::new(NavState::at_rest(0)),
            covariance: sized(4, 4),
        });
        assert_eq!(tape.bytes(), (99 + 9 + 16) * 8 + size_of::<NavState>());
    }
}
