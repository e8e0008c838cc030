//! The record of a filter for the smoother; recording does not change the filter's results.

use nalgebra::{Cholesky, Const, DMatrix, DVector, SMatrix};

use super::Eskf;
use super::extensions::{DEPTH_BIAS, Extensions, FIRST_CALIBRATION};
use super::update::FurtherGains;
use crate::aiding::Innovation;
use crate::aiding::calibration::CALIBRATION;
use crate::aiding::water::WATER;
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::state::{Covariance, NavState};

/// One entry of a tape; matrices are over the 20 error states, the bias of the depth sensor, and, where
/// they exist, mounting and clock of the DVL (four) and the motion through the water (six).
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
        let pending = transition(&self.interval, &self.kinematics, &self.settings.earth, &self.extensions);
        let (state, covariance) = (self.state(), self.joint_covariance());
        if let Some(tape) = &mut self.extensions.tape {
            tape.push(Step::Sample {
                pending,
                state: Box::new(state),
                covariance,
            });
        }
    }

    /// Records an update; `water_gain` is the gain of the water states.
    pub(super) fn record_update<const M: usize>(
        &mut self,
        innovation: &Innovation,
        z: &SMatrix<f64, M, 1>,
        factor: &Cholesky<f64, Const<M>>,
        gain: &SMatrix<f64, DIM, M>,
        further: &FurtherGains<M>,
    ) {
        let (states, first_water) = (self.extensions.states(), self.extensions.first_water());
        let mut h = DMatrix::zeros(M, states);
        let mut whole_gain = DMatrix::zeros(states, M);
        h.view_mut((0, 0), (M, DIM))
            .copy_from(&innovation.jacobian.fixed_rows::<M>(0));
        whole_gain.view_mut((0, 0), (DIM, M)).copy_from(gain);
        if let Some(correlated_noise) = &innovation.correlated_noise {
            let mut own = h.view_mut((0, 0), (M, DIM));
            own += correlated_noise.by_state.fixed_rows::<M>(0);
            h.view_mut((0, DEPTH_BIAS), (M, 1))
                .copy_from(&correlated_noise.by_depth_bias.fixed_rows::<M>(0));
            if self.extensions.calibration.is_some() {
                h.view_mut((0, FIRST_CALIBRATION), (M, CALIBRATION))
                    .copy_from(&correlated_noise.by_calibration.fixed_rows::<M>(0));
            }
            if states > first_water {
                h.view_mut((0, first_water), (M, WATER))
                    .copy_from(&correlated_noise.by_water.fixed_rows::<M>(0));
            }
        }
        if let Some(gain) = &further.depth_bias {
            whole_gain
                .view_mut((DEPTH_BIAS, 0), (1, M))
                .copy_from(&gain.transpose());
        }
        if let Some(gain) = &further.calibration {
            whole_gain
                .view_mut((FIRST_CALIBRATION, 0), (CALIBRATION, M))
                .copy_from(&gain.transpose());
        }
        if let Some(gain) = &further.water {
            whole_gain.view_mut((first_water, 0), (WATER, M)).copy_from(gain);
        }
        // What corrects the position alone is no information on any other state.
        let informs = if innovation.corrects_position_alone { 0.0 } else { 1.0 };
        let (weighted_innovation, weight) = (factor.solve(z) * informs, factor.inverse() * informs);
        if let Some(tape) = &mut self.extensions.tape {
            tape.push(Step::Update {
                weighted_innovation: DVector::from_column_slice(weighted_innovation.as_slice()),
                weight: DMatrix::from_column_slice(M, M, weight.as_slice()),
                h,
                gain: whole_gain,
            });
        }
    }

    /// Covariance of all states, further states included, at the time of the state.
    fn joint_covariance(&self) -> DMatrix<f64> {
        let mut extensions = Extensions {
            tape: None,
            depth_bias: self.extensions.depth_bias.clone(),
            calibration: self.extensions.calibration.clone(),
            water: self.extensions.water.clone(),
        };
        if self.interval.duration_s() > 0.0 {
            extensions.propagate(&self.interval, &self.kinematics, &self.settings.earth);
        }
        let (states, first_water) = (extensions.states(), extensions.first_water());
        let mut joint = DMatrix::zeros(states, states);
        joint.view_mut((0, 0), (DIM, DIM)).copy_from(&self.covariance());
        if let Some(bias) = &extensions.depth_bias {
            joint.view_mut((0, DEPTH_BIAS), (DIM, 1)).copy_from(bias.cross());
            joint[(DEPTH_BIAS, DEPTH_BIAS)] = bias.variance_m2();
            if extensions.water.is_some() {
                let with_water = bias.cross_with_water().transpose();
                joint
                    .view_mut((DEPTH_BIAS, first_water), (1, WATER))
                    .copy_from(&with_water);
            }
        }
        if let Some(calibration) = &extensions.calibration {
            joint
                .view_mut((0, FIRST_CALIBRATION), (DIM, CALIBRATION))
                .copy_from(calibration.cross());
            joint
                .view_mut((FIRST_CALIBRATION, FIRST_CALIBRATION), (CALIBRATION, CALIBRATION))
                .copy_from(calibration.covariance());
            if extensions.depth_bias.is_some() {
                let with_bias = calibration.cross_with_depth_bias().transpose();
                joint
                    .view_mut((DEPTH_BIAS, FIRST_CALIBRATION), (1, CALIBRATION))
                    .copy_from(&with_bias);
            }
            if extensions.water.is_some() {
                let with_water = calibration.cross_with_water().transpose();
                joint
                    .view_mut((FIRST_CALIBRATION, first_water), (CALIBRATION, WATER))
                    .copy_from(&with_water);
            }
        }
        if let Some(water) = &extensions.water {
            joint
                .view_mut((first_water, first_water), (WATER, WATER))
                .copy_from(water.covariance());
            joint.view_mut((0, first_water), (DIM, WATER)).copy_from(water.cross());
        }
        joint.fill_lower_triangle_with_upper_triangle();
        joint
    }
}

/// Φ over an interval that ends at `end`, further states included.
pub(super) fn transition(
    interval: &Interval,
    end: &Kinematics<f64>,
    earth: &EarthTerms,
    extensions: &Extensions,
) -> DMatrix<f64> {
    let states = extensions.states();
    let mut phi = Covariance::identity();
    interval.carry(&mut phi.data.0, end, earth);
    let mut whole = DMatrix::identity(states, states);
    whole.view_mut((0, 0), (DIM, DIM)).copy_from(&phi);
    if let Some(bias) = &extensions.depth_bias {
        whole[(DEPTH_BIAS, DEPTH_BIAS)] = bias.decay(interval.duration_s());
    }
    if let Some(water) = &extensions.water {
        let decay = water.decay(interval.duration_s());
        let first = extensions.first_water();
        (0..WATER).for_each(|k| whole[(first + k, first + k)] = decay[k]);
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
