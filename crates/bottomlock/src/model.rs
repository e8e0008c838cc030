//! What is assumed of the sensors and the filter's options: plain numbers in SI, checked once.

use nalgebra::{Matrix4, Vector3};
use std::cell::Cell;

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::dvl::partial::Assumptions;
use crate::earth::Environment;
use crate::error::{NavError, require_finite, require_non_negative, require_positive};
use crate::error_model::ProcessNoise;
use crate::frames::Vec3;
use crate::imu::Sampling;
use crate::layout;
use crate::robust::Robust;
use crate::state::Covariance;
use crate::water::WaterPrior;

/// Errors of the inertial sensors, 1 sigma, per axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuModel {
    /// Velocity random walk, m/s/√s.
    pub accel_noise_mps_rts: f64,
    /// Angle random walk, rad/√s.
    pub gyro_noise_rad_rts: f64,
    /// Accelerometer bias at the start, m/s².
    pub accel_bias_sd_mps2: f64,
    /// Gyro bias at the start, rad/s.
    pub gyro_bias_sd_radps: f64,
    /// Accelerometer bias random walk, m/s²/√s.
    pub accel_bias_walk_mps2_rts: f64,
    /// Gyro bias random walk, rad/s/√s.
    pub gyro_bias_walk_radps_rts: f64,
}

/// Errors of the DVL, 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DvlModel {
    /// White noise of a beam, m/s.
    pub beam_noise_sd_mps: f64,
    /// Bias of a beam at the start, m/s.
    pub beam_bias_sd_mps: f64,
    /// Random walk of a beam bias, m/s/√s.
    pub beam_bias_walk_mps_rts: f64,
    /// Scale factor error at the start.
    pub scale_factor_sd: f64,
    /// Random walk of the scale factor, 1/√s.
    pub scale_factor_walk_rts: f64,
}

/// Uncertainty of the initial state, 1 sigma per axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InitialModel {
    /// Position, tangent frame, m.
    pub position_sd_m: [f64; 3],
    /// Misalignment about north, east, down, rad.
    pub attitude_sd_rad: [f64; 3],
    /// Velocity, platform frame, m/s.
    pub velocity_sd_mps: [f64; 3],
}

/// Errors of the depth sensor, 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthModel {
    /// White noise, m.
    pub sd_m: f64,
}

/// Errors of the magnetometer used as an attitude sensor, 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MagnetometerModel {
    /// Yaw, rad.
    pub yaw_sd_rad: f64,
    /// Roll and pitch, rad.
    pub roll_pitch_sd_rad: f64,
}

/// Errors of the GPS receiver, 1 sigma per axis, tangent frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpsModel {
    /// Position, m.
    pub position_sd_m: [f64; 3],
    /// Velocity, m/s.
    pub velocity_sd_mps: [f64; 3],
}

/// Everything assumed of the environment and the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// Earth rate and gravity.
    pub environment: Environment,
    /// Inertial sensors.
    pub imu: ImuModel,
    /// Doppler velocity log.
    pub dvl: DvlModel,
    /// Initial state.
    pub initial: InitialModel,
    /// Depth sensor.
    pub depth: DepthModel,
    /// Magnetometer.
    pub magnetometer: MagnetometerModel,
    /// GPS receiver.
    pub gps: GpsModel,
}

impl Model {
    /// Table 2 of Tal et al. 2017 as read in `docs/equations.md`, at the latitude of Haifa.
    #[must_use]
    pub fn table_2() -> Self {
        let degree = std::f64::consts::PI / 180.0;
        let root_hour = 60.0;
        Self {
            environment: Environment::normal(32.8 * degree, 0.0),
            imu: ImuModel {
                accel_noise_mps_rts: 0.072 / root_hour,
                gyro_noise_rad_rts: 0.34 * degree / root_hour,
                accel_bias_sd_mps2: 0.5e-3 * 9.806_65,
                gyro_bias_sd_radps: 3.0 * degree / 3600.0,
                accel_bias_walk_mps2_rts: 1e-5,
                gyro_bias_walk_radps_rts: 2.8e-5 * degree,
            },
            dvl: DvlModel {
                beam_noise_sd_mps: 0.042,
                beam_bias_sd_mps: 0.005,
                beam_bias_walk_mps_rts: 5e-5,
                scale_factor_sd: 0.007,
                scale_factor_walk_rts: 5e-5,
            },
            initial: InitialModel {
                position_sd_m: [2.0; 3],
                attitude_sd_rad: [0.01, 0.01, 0.02],
                velocity_sd_mps: [0.05; 3],
            },
            depth: DepthModel { sd_m: 0.02 },
            magnetometer: MagnetometerModel {
                yaw_sd_rad: 0.1,
                roll_pitch_sd_rad: 0.02,
            },
            gps: GpsModel {
                position_sd_m: [2.0; 3],
                velocity_sd_mps: [0.1; 3],
            },
        }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        self.environment.validate()?;
        let non_negative = [
            ("imu.accel_noise_mps_rts", self.imu.accel_noise_mps_rts),
            ("imu.gyro_noise_rad_rts", self.imu.gyro_noise_rad_rts),
            ("imu.accel_bias_sd_mps2", self.imu.accel_bias_sd_mps2),
            ("imu.gyro_bias_sd_radps", self.imu.gyro_bias_sd_radps),
            ("imu.accel_bias_walk_mps2_rts", self.imu.accel_bias_walk_mps2_rts),
            ("imu.gyro_bias_walk_radps_rts", self.imu.gyro_bias_walk_radps_rts),
            ("dvl.beam_noise_sd_mps", self.dvl.beam_noise_sd_mps),
            ("dvl.beam_bias_sd_mps", self.dvl.beam_bias_sd_mps),
            ("dvl.beam_bias_walk_mps_rts", self.dvl.beam_bias_walk_mps_rts),
            ("dvl.scale_factor_sd", self.dvl.scale_factor_sd),
            ("dvl.scale_factor_walk_rts", self.dvl.scale_factor_walk_rts),
            ("depth.sd_m", self.depth.sd_m),
            ("magnetometer.yaw_sd_rad", self.magnetometer.yaw_sd_rad),
            ("magnetometer.roll_pitch_sd_rad", self.magnetometer.roll_pitch_sd_rad),
        ];
        for (field, value) in non_negative {
            require_non_negative(field, value)?;
        }
        let triples = [
            ("initial.position_sd_m", self.initial.position_sd_m),
            ("initial.attitude_sd_rad", self.initial.attitude_sd_rad),
            ("initial.velocity_sd_mps", self.initial.velocity_sd_mps),
            ("gps.position_sd_m", self.gps.position_sd_m),
            ("gps.velocity_sd_mps", self.gps.velocity_sd_mps),
        ];
        for (field, values) in triples {
            values
                .iter()
                .try_for_each(|&value| require_non_negative(field, value))?;
        }
        Ok(())
    }

    /// Power spectral densities of the process noise; the DVL's are zero where its states are not estimated.
    #[must_use]
    pub fn process_noise(&self, estimate_dvl: bool) -> ProcessNoise {
        let dvl = f64::from(u8::from(estimate_dvl));
        ProcessNoise {
            accel: self.imu.accel_noise_mps_rts.powi(2),
            gyro: self.imu.gyro_noise_rad_rts.powi(2),
            accel_bias: self.imu.accel_bias_walk_mps2_rts.powi(2),
            gyro_bias: self.imu.gyro_bias_walk_radps_rts.powi(2),
            dvl_bias: dvl * self.dvl.beam_bias_walk_mps_rts.powi(2),
            dvl_scale: dvl * self.dvl.scale_factor_walk_rts.powi(2),
        }
    }

    /// P at the start; the DVL's states have none where they are not estimated, which freezes them.
    #[must_use]
    pub fn initial_covariance(&self, estimate_dvl: bool) -> Covariance {
        let mut p = Covariance::zeros();
        let mut put = |start: usize, sd: [f64; 3]| {
            for k in 0..3 {
                p[(start + k, start + k)] = sd[k].powi(2);
            }
        };
        put(layout::POSITION, self.initial.position_sd_m);
        put(layout::ATTITUDE, self.initial.attitude_sd_rad);
        put(layout::VELOCITY, self.initial.velocity_sd_mps);
        put(layout::ACCEL_BIAS, [self.imu.accel_bias_sd_mps2; 3]);
        put(layout::GYRO_BIAS, [self.imu.gyro_bias_sd_radps; 3]);
        if estimate_dvl {
            let bias = Matrix4::identity() * self.dvl.beam_bias_sd_mps.powi(2);
            p.fixed_view_mut::<4, 4>(layout::DVL_BIAS, layout::DVL_BIAS)
                .copy_from(&bias);
            p[(layout::DVL_SCALE, layout::DVL_SCALE)] = self.dvl.scale_factor_sd.powi(2);
        }
        p
    }
}

/// How an innovation is judged; always on its own covariance S.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gate {
    /// The normalised innovation squared of the whole fix against a chi-squared quantile.
    Joint {
        /// Probability with which a good fix passes.
        probability: f64,
    },
    /// Each component against three of its standard deviations (the papers' rule).
    PerRow,
    /// Nothing is rejected.
    Off,
}

/// Largest number of rows of one measurement.
pub const MAX_ROWS: usize = 8;

/// A gate with its thresholds worked out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateTable {
    /// The rule.
    pub gate: Gate,
    /// Chi-squared quantile for 1, 2, … [`MAX_ROWS`] degrees of freedom (joint gate).
    quantiles: [f64; MAX_ROWS],
}

impl GateTable {
    /// Works out the thresholds.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] unless the probability lies strictly between 0 and 1.
    pub fn new(gate: Gate) -> Result<Self, NavError> {
        let mut quantiles = [f64::INFINITY; MAX_ROWS];
        if let Gate::Joint { probability } = gate {
            if !(probability > 0.0 && probability < 1.0) {
                return Err(NavError::OutOfRange {
                    field: "gate_probability",
                    value: probability,
                    expected: "strictly between 0 and 1",
                });
            }
            quantiles = chi_squared_quantiles(probability);
        }
        Ok(Self { gate, quantiles })
    }

    /// A gate that lets everything pass.
    #[must_use]
    pub fn open() -> Self {
        Self {
            gate: Gate::Off,
            quantiles: [f64::INFINITY; MAX_ROWS],
        }
    }

    /// Threshold of the normalised innovation squared for a number of degrees of freedom.
    #[must_use]
    pub fn threshold(&self, degrees: usize) -> f64 {
        self.quantiles[degrees.clamp(1, MAX_ROWS) - 1]
    }
}

thread_local! {
    /// The last probability asked for and its quantiles: every filter of a campaign asks for the same ones.
    static QUANTILES: Cell<(f64, [f64; MAX_ROWS])> = const { Cell::new((f64::NAN, [f64::INFINITY; MAX_ROWS])) };
}

/// Quantiles of chi-squared for 1, 2, … [`MAX_ROWS`] degrees of freedom.
fn chi_squared_quantiles(probability: f64) -> [f64; MAX_ROWS] {
    let (known, mut quantiles) = QUANTILES.get();
    if known != probability {
        for (index, quantile) in quantiles.iter_mut().enumerate() {
            if let Ok(distribution) = ChiSquared::new((index + 1) as f64) {
                *quantile = distribution.inverse_cdf(probability);
            }
        }
        QUANTILES.set((probability, quantiles));
    }
    quantiles
}

/// What the information form hands to the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum InformationPort {
    /// The observable principal axes only.
    #[default]
    Axes,
    /// All three axes, the unobserved ones with a very large variance, kept factored by axis.
    Full,
}

/// The filter's options.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Innovation gate.
    pub gate: Gate,
    /// After so many refused fixes of velocity in a row the covariance of the inertial states is
    /// widened by what they showed; 0 for never.
    pub gate_reopen_fixes: u32,
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
    /// Place of the depth sensor and of the GPS antenna, platform frame, m.
    pub depth_lever_p_m: Vec3<crate::frames::Platform>,
    /// Place of the GPS antenna, platform frame, m.
    pub gps_lever_p_m: Vec3<crate::frames::Platform>,
}

impl Default for Options {
    /// Joint gate at 99.73 % that reopens after five refusals in a row, covariance at 10 Hz, 20 states.
    fn default() -> Self {
        Self {
            gate: Gate::Joint { probability: 0.9973 },
            gate_reopen_fixes: 5,
            covariance_period_ns: 100_000_000,
            sampling: Sampling::Instantaneous,
            estimate_dvl: true,
            assumptions: Assumptions::default(),
            information_port: InformationPort::Axes,
            water: WaterPrior::default(),
            robust: Robust::default(),
            depth_lever_p_m: Vec3::zeros(),
            gps_lever_p_m: Vec3::zeros(),
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
        if self.gate_reopen_fixes == 1 {
            return Err(NavError::OutOfRange {
                field: "gate_reopen_fixes",
                value: 1.0,
                expected: "0 (never), or 2 or more",
            });
        }
        require_positive("virtual_beam_factor", self.assumptions.virtual_beam_factor)?;
        require_positive("nullified_sway_var_m2ps2", self.assumptions.nullified_sway_var_m2ps2)?;
        require_positive("weak_sway_var_m2ps2", self.assumptions.weak_sway_var_m2ps2)?;
        self.water.validate()?;
        self.robust.validate()?;
        let levers: Vector3<f64> = self.depth_lever_p_m.0 + self.gps_lever_p_m.0;
        require_finite("lever arm", 0, levers.as_slice())?;
        GateTable::new(self.gate).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chi-squared quantiles as tabulated: 99 % of one degree of freedom is 6.635, of three 11.345.
    #[test]
    fn gate_thresholds_are_the_tabulated_quantiles() {
        let table = GateTable::new(Gate::Joint { probability: 0.99 }).unwrap();
        assert!((table.threshold(1) - 6.634_896_6).abs() < 1e-5);
        assert!((table.threshold(3) - 11.344_866_7).abs() < 1e-5);
        assert!(GateTable::new(Gate::Joint { probability: 1.0 }).is_err());
        assert_eq!(GateTable::new(Gate::Off).unwrap().threshold(2), f64::INFINITY);
    }
}
