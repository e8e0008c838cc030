//! What the filter leaves behind for a smoother; asking for it changes no bit of the filter.

use nalgebra::{Cholesky, Const, DMatrix, DVector, SMatrix};

use super::Eskf;
use super::water_block::WaterBlock;
use crate::aiding::Innovation;
use crate::aiding::water::WATER;
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::state::{Covariance, NavState};

/// One entry of a tape; matrices are over 20 error states, or over 26 where the motion through the water is estimated too.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Step {
    /// Φ since the entry before.
    Carry(DMatrix<f64>),
    /// An update: S⁻¹z, S⁻¹, H with all that the noise repeats, and K.
    Update {
        weighted: DVector<f64>,
        weight: DMatrix<f64>,
        h: DMatrix<f64>,
        gain: DMatrix<f64>,
    },
    /// A sample: Φ since the entry before (which the filter has not taken yet), the estimate and its covariance.
    Sample {
        pending: DMatrix<f64>,
        state: Box<NavState>,
        covariance: DMatrix<f64>,
    },
}

/// What a filter has done, for the way back.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tape {
    pub(crate) steps: Vec<Step>,
}

impl Tape {
    /// Adds an entry; transitions that follow each other become one, so the tape grows with the updates and not with the IMU.
    pub(crate) fn push(&mut self, step: Step) {
        if let (Some(Step::Carry(before)), Step::Carry(phi)) = (self.steps.last_mut(), &step)
            && before.nrows() == phi.nrows()
        {
            *before = phi * &*before;
            return;
        }
        self.steps.push(step);
    }

    /// Bytes of numbers that the tape holds.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let numbers = self.steps.iter().map(|step| match step {
            Step::Carry(phi) => phi.len(),
            Step::Update {
                weighted,
                weight,
                h,
                gain,
            } => weighted.len() + weight.len() + h.len() + gain.len(),
            Step::Sample {
                pending, covariance, ..
            } => pending.len() + covariance.len() + size_of::<NavState>() / size_of::<f64>(),
        });
        numbers.sum::<usize>() * size_of::<f64>()
    }
}

impl Eskf {
    /// Begins a tape.
    pub(crate) fn begin_tape(&mut self) {
        self.extensions.tape = Some(Box::default());
    }

    /// Takes the tape out, where there is one.
    pub(crate) fn take_tape(&mut self) -> Option<Tape> {
        self.extensions.tape.take().map(|tape| *tape)
    }

    /// Marks a sample on the tape.
    pub(crate) fn record_sample(&mut self) {
        let water = self.extensions.water.as_deref();
        let pending = transition(&self.interval, &self.kinematics, &self.settings.earth, water);
        let (state, covariance) = (self.state(), self.joint_covariance());
        if let Some(tape) = &mut self.extensions.tape {
            tape.push(Step::Sample {
                pending,
                state: Box::new(state),
                covariance,
            });
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
        if let Some(correlated_noise) = &innovation.correlated_noise {
            let mut own = h.view_mut((0, 0), (M, DIM));
            own += correlated_noise.by_state.fixed_rows::<M>(0);
            if states > DIM {
                h.view_mut((0, DIM), (M, WATER))
                    .copy_from(&correlated_noise.by_water.fixed_rows::<M>(0));
            }
        }
        if let Some(own_gain) = own_gain {
            whole_gain.view_mut((DIM, 0), (WATER, M)).copy_from(own_gain);
        }
        let (weighted, weight) = (factor.solve(z), factor.inverse());
        if let Some(tape) = &mut self.extensions.tape {
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
        DIM + if self.extensions.water.is_some() { WATER } else { 0 }
    }

    /// The covariance at the time of the state, of the further states too.
    fn joint_covariance(&self) -> DMatrix<f64> {
        let states = self.states();
        let mut joint = DMatrix::zeros(states, states);
        joint.view_mut((0, 0), (DIM, DIM)).copy_from(&self.covariance());
        if let Some(water) = &self.extensions.water {
            let mut water = water.clone();
            water.propagate(&self.interval, &self.kinematics, &self.settings.earth);
            joint.view_mut((DIM, DIM), (WATER, WATER)).copy_from(water.covariance());
            joint.view_mut((0, DIM), (DIM, WATER)).copy_from(water.cross());
            joint
                .view_mut((DIM, 0), (WATER, DIM))
                .copy_from(&water.cross().transpose());
        }
        joint
    }
}

/// Φ over an interval that has come to `end`, of the further states too.
pub(super) fn transition(
    interval: &Interval,
    end: &Kinematics<f64>,
    earth: &EarthTerms,
    water: Option<&WaterBlock>,
) -> DMatrix<f64> {
    let states = DIM + if water.is_some() { WATER } else { 0 };
    let mut phi = Covariance::identity();
    interval.carry(&mut phi.data.0, end, earth);
    let mut whole = DMatrix::identity(states, states);
    whole.view_mut((0, 0), (DIM, DIM)).copy_from(&phi);
    if let Some(water) = water {
        let decay = water.decay(interval.duration_s());
        (0..WATER).for_each(|k| whole[(DIM + k, DIM + k)] = decay[k]);
    }
    whole
}
