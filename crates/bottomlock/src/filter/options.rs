//! The filter's options: plain numbers in SI, checked once.

use crate::aiding::InformationPort;
use crate::aiding::outliers::Robust;
use crate::aiding::registry::Levers;
use crate::aiding::water::WaterPrior;
use crate::dvl::partial::Assumptions;
use crate::error::{NavError, require_non_negative, require_positive};
use crate::filter::gate::{Gate, GateTable};
use crate::mechanisation::Sampling;

/// The filter's options.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Innovation gate.
    pub gate: Gate,
    /// After so many refused fixes of velocity in a row the covariance of the inertial states is
    /// inflation by what they showed; 0 for never.
    pub inflate_after_rejections: u32,
    /// Interval of the covariance propagation, ns; zero for every IMU step.
    pub covariance_period_ns: i64,
    /// What an IMU sample means.
    pub sampling: Sampling,
    /// Whether the DVL's biases and scale factor are states (20) or frozen (15).
    pub estimate_dvl: bool,
    /// Parameters of the partial-beam methods.
    pub assumptions: Assumptions,
    /// What the information form hands over.
    pub information_port: InformationPort,
    /// What is assumed of the motion through the water.
    pub water: WaterPrior,
    /// What is done against outliers among the beams.
    pub robust: Robust,
    /// Place of each sensor, platform frame, m.
    pub levers: Levers,
}

impl Default for Options {
    /// Joint gate at 99.73 % that reopens after five consecutive_rejections in a row, covariance at 10 Hz, 20 states.
    fn default() -> Self {
        Self {
            gate: Gate::Joint { probability: 0.9973 },
            inflate_after_rejections: 5,
            covariance_period_ns: 100_000_000,
            sampling: Sampling::Instantaneous,
            estimate_dvl: true,
            assumptions: Assumptions::default(),
            information_port: InformationPort::Axes,
            water: WaterPrior::default(),
            robust: Robust::default(),
            levers: Levers::default(),
        }
    }
}

impl Options {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] or [`NavError::NotFinite`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        require_non_negative("covariance_period_ns", self.covariance_period_ns as f64)?;
        if self.inflate_after_rejections == 1 {
            return Err(NavError::OutOfRange {
                field: "inflate_after_rejections",
                value: 1.0,
                expected: "0 (never), or 2 or more",
            });
        }
        require_positive("virtual_beam_factor", self.assumptions.virtual_beam_factor)?;
        require_positive("nullified_sway_var_m2ps2", self.assumptions.nullified_sway_var_m2ps2)?;
        require_positive("weak_sway_var_m2ps2", self.assumptions.weak_sway_var_m2ps2)?;
        self.water.validate()?;
        self.robust.validate()?;
        self.levers.validate()?;
        GateTable::new(self.gate).map(|_| ())
    }
}
