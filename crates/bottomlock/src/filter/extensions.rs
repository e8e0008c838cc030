//! Optional parts of a filter: further states and the tape for a smoother.

use nalgebra::DMatrix;

use super::calibration::CalibrationBlock;
use super::depth_bias::DepthBias;
use super::tape::{Step, Tape, transition};
use super::water_block::WaterBlock;
use crate::aiding::CorrectedPath;
use crate::aiding::calibration::CALIBRATION;
use crate::aiding::water::{WATER, WaterVector};
use crate::error_model::Interval;
use crate::layout::{ATTITUDE, DIM, POSITION};
use crate::mechanisation::{EarthTerms, Kinematics};

/// Index of the depth sensor's bias among all states of a tape; there is always one.
pub(super) const DEPTH_BIAS: usize = DIM;
/// First index of mounting and clock of the DVL among all states of a tape that has them; then come the water states.
pub(super) const FIRST_CALIBRATION: usize = DIM + 1;

/// Optional parts of a filter.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Extensions {
    /// The bias of the depth sensor, from the first depth on.
    pub(super) depth_bias: Option<Box<DepthBias>>,
    /// Mounting and clock of the DVL, from the start on.
    pub(super) calibration: Option<Box<CalibrationBlock>>,
    /// States of the motion through the water.
    pub(super) water: Option<Box<WaterBlock>>,
    /// Tape for a smoother; a saved filter has none.
    #[serde(skip)]
    pub(super) tape: Option<Box<Tape>>,
}

impl Extensions {
    /// First index of the water states among all states of a tape that has them.
    pub(super) fn first_water(&self) -> usize {
        FIRST_CALIBRATION + if self.calibration.is_some() { CALIBRATION } else { 0 }
    }

    /// Number of states of a tape.
    pub(super) fn states(&self) -> usize {
        self.first_water() + if self.water.is_some() { WATER } else { 0 }
    }

    /// Follows a move of the error state, δr ← A δr + B ρ.
    pub(super) fn move_to_corrected_path(&mut self, path: &CorrectedPath) {
        let states = self.states();
        if let Some(bias) = &mut self.depth_bias {
            bias.move_to_corrected_path(path);
        }
        if let Some(calibration) = &mut self.calibration {
            calibration.move_to_corrected_path(path);
        }
        if let Some(water) = &mut self.water {
            water.move_to_corrected_path(path);
        }
        if let Some(tape) = &mut self.tape {
            let mut move_of_states = DMatrix::identity(states, states);
            move_of_states
                .fixed_view_mut::<3, 3>(POSITION, ATTITUDE)
                .copy_from(&path.by_misalignment);
            if let Some(by_position) = &path.by_position {
                move_of_states
                    .fixed_view_mut::<3, 3>(POSITION, POSITION)
                    .copy_from(by_position);
            }
            tape.push(Step::Transition(move_of_states));
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.depth_bias.is_none() && self.calibration.is_none() && self.water.is_none() && self.tape.is_none()
    }

    /// Records and propagates an interval of the error state that ends at `end`.
    pub(super) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms) {
        if self.tape.is_some() {
            let whole = transition(interval, end, earth, self);
            if let Some(tape) = &mut self.tape {
                tape.push(Step::Transition(whole));
            }
        }
        let water = self.water.as_deref();
        let water_decay = || water.map_or_else(WaterVector::zeros, |water| water.decay(interval.duration_s()));
        if let Some(calibration) = &mut self.calibration {
            let bias = self.depth_bias.as_deref();
            let bias_decay = bias.map_or(0.0, |bias| bias.decay(interval.duration_s()));
            calibration.propagate(interval, end, earth, bias_decay, &water_decay());
        }
        if let Some(bias) = &mut self.depth_bias {
            let decay = water_decay();
            bias.propagate(interval, end, earth, &decay);
        }
        if let Some(water) = &mut self.water {
            water.propagate(interval, end, earth);
        }
    }
}
