//! What goes along with a filter that has more than its error state.

use super::tape::{Step, Tape, transition};
use super::water_block::WaterBlock;
use crate::error_model::Interval;
use crate::mechanisation::{EarthTerms, Kinematics};

/// What most filters do without.
#[derive(Debug, Clone, Default)]
pub(super) struct Extensions {
    /// Further states, where assumptions are made on the motion through the water.
    pub(super) water: Option<Box<WaterBlock>>,
    /// What a smoother goes back over, where there is to be one.
    pub(super) tape: Option<Box<Tape>>,
}

impl Extensions {
    pub(super) fn is_empty(&self) -> bool {
        self.water.is_none() && self.tape.is_none()
    }

    /// Follows the covariance over an interval, which has come to `end` (before it is emptied).
    pub(super) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms) {
        if let Some(tape) = &mut self.tape {
            tape.push(Step::Carry(transition(interval, end, earth, self.water.as_deref())));
        }
        if let Some(water) = &mut self.water {
            water.propagate(interval, end, earth);
        }
    }
}
