//! What the filter leaves behind for a smoother; asking for it changes no bit of the filter.

use nalgebra::{Cholesky, Const, DMatrix, DVector, SMatrix};

use super::Eskf;
use crate::aiding::Innovation;
use crate::layout::DIM;
use crate::smoother::{Step, Tape};
use crate::state::Covariance;
use crate::water::WATER;

impl Eskf {
    /// Begins a tape.
    pub(crate) fn begin_tape(&mut self) {
        self.tape = Some(Box::default());
    }

    /// Takes the tape out, where there is one.
    pub(crate) fn take_tape(&mut self) -> Option<Tape> {
        self.tape.take().map(|tape| *tape)
    }

    /// Marks a sample on the tape.
    pub(crate) fn record_sample(&mut self) {
        let pending = self.transition();
        let (state, covariance) = (self.state(), self.joint_covariance());
        if let Some(tape) = &mut self.tape {
            tape.push(Step::Sample {
                pending,
                state: Box::new(state),
                covariance,
            });
        }
    }

    pub(super) fn record_transition(&mut self) {
        if self.tape.is_some() && self.interval.duration_s() > 0.0 {
            let phi = self.transition();
            if let Some(tape) = &mut self.tape {
                tape.push(Step::Carry(phi));
            }
        }
    }

    /// `own_gain` is the gain of the further states.
    pub(super) fn record_update<const M: usize>(
        &mut self,
        innovation: &Innovation,
        z: &SMatrix<f64, M, 1>,
        factor: &Cholesky<f64, Const<M>>,
        gain: &SMatrix<f64, DIM, M>,
        own_gain: Option<&SMatrix<f64, WATER, M>>,
    ) {
        let states = self.states();
        let mut h = DMatrix::zeros(M, states);
        let mut whole_gain = DMatrix::zeros(states, M);
        h.view_mut((0, 0), (M, DIM))
            .copy_from(&innovation.jacobian.fixed_rows::<M>(0));
        whole_gain.view_mut((0, 0), (DIM, M)).copy_from(gain);
        if let Some(repeats) = &innovation.repeats {
            let mut own = h.view_mut((0, 0), (M, DIM));
            own += repeats.by_state.fixed_rows::<M>(0);
            if states > DIM {
                h.view_mut((0, DIM), (M, WATER))
                    .copy_from(&repeats.by_water.fixed_rows::<M>(0));
            }
        }
        if let Some(own_gain) = own_gain {
            whole_gain.view_mut((DIM, 0), (WATER, M)).copy_from(own_gain);
        }
        let (weighted, weight) = (factor.solve(z), factor.inverse());
        if let Some(tape) = &mut self.tape {
            tape.push(Step::Update {
                weighted: DVector::from_column_slice(weighted.as_slice()),
                weight: DMatrix::from_column_slice(M, M, weight.as_slice()),
                h,
                gain: whole_gain,
            });
        }
    }

    /// Number of states, the further ones among them.
    fn states(&self) -> usize {
        DIM + if self.water.is_some() { WATER } else { 0 }
    }

    /// Φ over the interval since the covariance was last brought up to date.
    fn transition(&self) -> DMatrix<f64> {
        let states = self.states();
        let mut phi = Covariance::identity();
        self.interval.carry(&mut phi.data.0, &self.kinematics, &self.earth);
        let mut whole = DMatrix::identity(states, states);
        whole.view_mut((0, 0), (DIM, DIM)).copy_from(&phi);
        if let Some(water) = &self.water {
            let decay = water.decay(self.interval.duration_s());
            (0..WATER).for_each(|k| whole[(DIM + k, DIM + k)] = decay[k]);
        }
        whole
    }

    /// The covariance at the time of the state, of the further states too.
    fn joint_covariance(&self) -> DMatrix<f64> {
        let states = self.states();
        let mut joint = DMatrix::zeros(states, states);
        joint.view_mut((0, 0), (DIM, DIM)).copy_from(&self.covariance());
        if let Some(water) = &self.water {
            let mut water = water.clone();
            water.propagate(&self.interval, &self.kinematics, &self.earth);
            joint.view_mut((DIM, DIM), (WATER, WATER)).copy_from(water.covariance());
            joint.view_mut((0, DIM), (DIM, WATER)).copy_from(water.cross());
            joint
                .view_mut((DIM, 0), (WATER, DIM))
                .copy_from(&water.cross().transpose());
        }
        joint
    }
}
