//! Filter options, in SI units.

use crate::aiding::InformationPort;
use crate::aiding::calibration::CalibrationPrior;
use crate::aiding::current_layers::LayersPrior;
use crate::aiding::motion_prior::MotionPrior;
use crate::aiding::outliers::Robust;
use crate::aiding::registry::Levers;
use crate::aiding::speed_bound::SpeedBound;
use crate::aiding::thrust::ThrustUse;
use crate::aiding::water::WaterPrior;
use crate::dvl::partial::Assumptions;
use crate::error::NavError;
use crate::filter::gate::{Gate, GateTable};
use crate::mechanisation::{ImuLimits, Sampling};

/// Filter options, in SI units.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Innovation gate.
    pub gate: Gate,
    /// Probability with which a good measurement passes the joint gate.
    pub gate_probability: f64,
    /// Number of consecutive rejections by a sensor after which the covariance is inflated; 0 for never, nor by the
    /// mean of what is accepted.
    pub inflate_after_rejections: u32,
    /// Interval of the covariance propagation, ns; 0 for every IMU step.
    pub covariance_period_ns: i64,
    /// Limits of the inertial readings of a live navigator or a recorded log.
    pub imu_limits: ImuLimits,
    /// Whether an IMU sample is instantaneous or an average over the interval before it.
    pub imu_sampling: Sampling,
    /// True to estimate the beam biases and the scale factor (20 states), false to freeze them (15 states).
    pub estimate_dvl: bool,
    /// Parameters of the partial-beam methods.
    pub assumptions: Assumptions,
    /// Form in which the method `info` passes its velocity to the filter.
    pub information_port: InformationPort,
    /// Prior of the motion through the water.
    pub water: WaterPrior,
    /// Whether beams that the water returns are used: every method then has the current of `water` as states.
    pub water_track: bool,
    /// What speeds by the vehicle's drives correct; where they are used, every method has the current of `water` as states.
    pub thrust: ThrustUse,
    /// Prior of the current by depth, with `water_track` or `thrust`.
    pub current_layers: LayersPrior,
    /// Prior of the DVL's mounting and clock, as states beside the others; off where all of it is zero.
    pub calibration: CalibrationPrior,
    /// Bound on the speed, where the beams leave a direction unobserved beyond the linear range.
    pub speed_bound: SpeedBound,
    /// Prior of the velocity of a vehicle without usable accelerometers; off where all of it is zero.
    pub motion: MotionPrior,
    /// Treatment of outliers among the beams; `None` is none.
    pub robust: Option<Robust>,
    /// Place of each sensor, platform frame, m.
    pub levers: Levers,
}

impl Default for Options {
    /// Joint gate at 99.73 %, inflation after five consecutive rejections, covariance at 10 Hz, 20 states, and the
    /// recommended treatment of outliers among the beams.
    fn default() -> Self {
        Self {
            gate: Gate::Joint,
            gate_probability: 0.9973,
            inflate_after_rejections: 5,
            covariance_period_ns: 100_000_000,
            imu_limits: ImuLimits::default(),
            imu_sampling: Sampling::Instantaneous,
            estimate_dvl: true,
            assumptions: Assumptions::default(),
            information_port: InformationPort::Axes,
            water: WaterPrior::default(),
            water_track: false,
            thrust: ThrustUse::Off,
            current_layers: LayersPrior::default(),
            calibration: CalibrationPrior::default(),
            speed_bound: SpeedBound::default(),
            motion: MotionPrior::default(),
            robust: Some(Robust::default()),
            levers: Levers::default(),
        }
    }
}

impl Options {
    /// Whether a reading tells of the current, so that every method has it as states.
    #[must_use]
    pub fn measures_current(&self) -> bool {
        self.water_track || self.thrust != ThrustUse::Off
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] or [`NavError::NotFinite`], which names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        if self.covariance_period_ns < 0 {
            return Err(NavError::OutOfRange {
                field: "options.covariance_period_ns",
                value: self.covariance_period_ns as f64,
                expected: "0 (every IMU step) or a positive number of nanoseconds",
            });
        }
        if self.inflate_after_rejections == 1 {
            return Err(NavError::OutOfRange {
                field: "options.inflate_after_rejections",
                value: 1.0,
                expected: "0 (never), or 2 or more: single correct fixes are rejected by chance",
            });
        }
        self.assumptions.validate()?;
        self.imu_limits.validate()?;
        self.water.validate()?;
        self.current_layers.validate()?;
        self.calibration.validate()?;
        self.speed_bound.validate()?;
        self.motion.validate()?;
        self.robust.map_or(Ok(()), |robust| robust.validate())?;
        self.levers.validate("options.levers")?;
        // That of a gate which is not chosen, too.
        GateTable::new(Gate::Joint, self.gate_probability).map(|_| ())
    }
}
