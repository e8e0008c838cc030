//! Optional parts of a filter: water states and the tape for a smoother.

use super::tape::{Step, Tape, transition};
use super::water_block::WaterBlock;
use crate::error_model::Interval;
use crate::mechanisation::{EarthTerms, Kinematics};

/// Optional parts of a filter.
#[derive(Debug, Clone, Default)]
pub(super) struct Extensions {
    /// States of the motion through the water.
    pub(super) water: Option<Box<WaterBlock>>,
    /// Tape for a smoother.
    pub(super) tape: Option<Box<Tape>>,
}

impl Extensions {
    pub(super) fn is_empty(&self) -> bool {
        self.water.is_none() && self.tape.is_none()
    }

    /// Records and propagates an interval of the error state that ends at `end`.
    pub(super) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms) {
        if let Some(tape) = &mut self.tape {
            tape.push(Step::Transition(transition(
                interval,
                end,
                earth,
                self.water.as_deref(),
            )));
        }
        if let Some(water) = &mut self.water {
            water.propagate(interval, end, earth);
        }
    }
}
