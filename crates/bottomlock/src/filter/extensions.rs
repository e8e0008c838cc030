//! Optional parts of a filter: water states and the tape for a smoother.

use nalgebra::{DMatrix, Matrix3};

use super::tape::{Step, Tape, transition};
use super::water_block::WaterBlock;
use crate::aiding::water::WATER;
use crate::error_model::Interval;
use crate::layout::{ATTITUDE, DIM, POSITION};
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
    /// Follows a move of the error state, δr ← δr + B ρ.
    pub(super) fn move_to_corrected_path(&mut self, by_misalignment: &Matrix3<f64>) {
        if let Some(water) = &mut self.water {
            water.move_to_corrected_path(by_misalignment);
        }
        if let Some(tape) = &mut self.tape {
            let states = DIM + if self.water.is_some() { WATER } else { 0 };
            let mut move_of_states = DMatrix::identity(states, states);
            move_of_states
                .fixed_view_mut::<3, 3>(POSITION, ATTITUDE)
                .copy_from(by_misalignment);
            tape.push(Step::Transition(move_of_states));
        }
    }

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
