//! What a navigator estimates beside its state, in plain numbers, as Python's dicts and C's structures have it.

use super::Navigator;
use crate::aiding::calibration::CLOCK;
use crate::aiding::{thrust, water};

/// Estimate of the motion through the water, with options of "water_track" or the method sway_current.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct WaterEstimate {
    /// Current north and east at the vehicle's depth, m/s.
    pub current_t_mps: [f64; 2],
    /// Its covariance, in which the heading's error is, (m/s)^2.
    pub current_covariance: [[f64; 2]; 2],
    /// Sway gain, m.
    pub sway_gain_m: f64,
    /// Heave by trim, m/s.
    pub trim_heave_mps: f64,
    /// Slip along sway and heave, m/s.
    pub sway_slip_mps: f64,
    /// The same along heave, m/s.
    pub heave_slip_mps: f64,
    /// Estimated standard deviation of the slip along sway, m/s.
    pub sway_slip_sd_mps: f64,
    /// The same along heave, m/s.
    pub heave_slip_sd_mps: f64,
    /// Estimated time constant of the slip along sway, s.
    pub sway_slip_time_s: f64,
    /// The same along heave, s.
    pub heave_slip_time_s: f64,
    /// Number of restarts of the assumptions.
    pub restarts: u64,
    /// Number of alarms that widened the slip.
    pub alarms: u64,
}

/// The current at one depth, with options of "current_layers.sd_mps" and "water_track".
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct LayerEstimate {
    /// Depth, m.
    pub depth_m: f64,
    /// Current north and east, m/s.
    pub current_t_mps: [f64; 2],
    /// Its covariance, (m/s)^2.
    pub current_covariance: [[f64; 2]; 2],
    /// Time since the layer was measured last, s; infinite for one that was not.
    pub age_s: f64,
}

/// Estimate of the mounting and clock of the DVL, with options of "calibration".
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct CalibrationEstimate {
    /// Rotation from the stated mounting about forward, right and down, rad.
    pub mounting_rad: [f64; 3],
    /// Time to add to the stamps, s.
    pub clock_s: f64,
    /// Covariance of both, mounting first.
    pub covariance: [[f64; 4]; 4],
}

/// What the vehicle's drives make of the speed through the water, with options of "thrust"; along surge, sway and heave each.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct ThrustEstimate {
    /// Speed over that which the drives say; 0 for an axis that is not used.
    pub scale: [f64; 3],
    /// Slip: speed that the drives do not say, m/s.
    pub slip_mps: [f64; 3],
    /// Covariance of both, in this order.
    pub covariance: [[f64; 6]; 6],
}

/// Each after the last update; `None` where it is not estimated.
impl Navigator {
    /// The motion through the water.
    #[must_use]
    pub fn water_estimate(&self) -> Option<WaterEstimate> {
        let (block, (current, covariance)) = self.water().zip(self.filter().current())?;
        let estimate = self.filter().water_states()?.estimate;
        let slip_sd_mps = block.processes().map(|process| process.variance.sqrt());
        let [sway_slip_time_s, heave_slip_time_s] = block.slip_time_s();
        Some(WaterEstimate {
            current_t_mps: current.into(),
            current_covariance: covariance.into(),
            sway_gain_m: estimate[water::GAIN],
            trim_heave_mps: estimate[water::TRIM],
            sway_slip_mps: estimate[water::SWAY],
            heave_slip_mps: estimate[water::HEAVE],
            sway_slip_sd_mps: slip_sd_mps[water::SWAY],
            heave_slip_sd_mps: slip_sd_mps[water::HEAVE],
            sway_slip_time_s,
            heave_slip_time_s,
            restarts: block.restarts(),
            alarms: block.alarms(),
        })
    }

    /// The current by depth, the uppermost layer first; empty where it is not estimated.
    #[must_use]
    pub fn layer_estimates(&self) -> Vec<LayerEstimate> {
        let layers = self.filter().layers().into_iter();
        let plain = layers.map(|(layer, (current, covariance))| LayerEstimate {
            depth_m: layer.depth_m,
            current_t_mps: current.into(),
            current_covariance: covariance.into(),
            age_s: layer.age_s,
        });
        plain.collect()
    }

    /// Scale and slip of the speed by the drives.
    #[must_use]
    pub fn thrust_estimate(&self) -> Option<ThrustEstimate> {
        let (estimate, covariance) = self.filter().thrust()?;
        let three = |first: usize| std::array::from_fn(|axis| estimate[first + axis]);
        Some(ThrustEstimate {
            scale: three(thrust::SCALE),
            slip_mps: three(thrust::SLIP),
            covariance: covariance.into(),
        })
    }

    /// Mounting and clock of the DVL.
    #[must_use]
    pub fn calibration_estimate(&self) -> Option<CalibrationEstimate> {
        let (estimate, covariance) = self.filter().calibration()?;
        let numbers = estimate.numbers();
        Some(CalibrationEstimate {
            mounting_rad: std::array::from_fn(|axis| numbers[axis]),
            clock_s: numbers[CLOCK],
            covariance: covariance.into(),
        })
    }
}
