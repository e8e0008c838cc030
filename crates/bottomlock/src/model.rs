//! What is assumed of the environment and the sensors: plain numbers in SI, checked once.

use nalgebra::Matrix4;

use crate::earth::Environment;
use crate::error::{NavError, require_non_negative};
use crate::error_model::ProcessNoise;
use crate::layout;
use crate::state::Covariance;

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
