//! Environment and sensor errors: plain numbers in SI, checked once.

use nalgebra::Matrix4;

use crate::aiding::attitude::MagnetometerModel;
use crate::aiding::beams::DvlModel;
use crate::aiding::depth::DepthModel;
use crate::aiding::gps::GpsModel;
use crate::aiding::registry::{SensorModels, sensor_models};
use crate::aiding::sensor::{Field, WalkTime};
use crate::earth::Environment;
use crate::error::{NavError, require_non_negative};
use crate::error_model::ProcessNoise;
use crate::layout;
use crate::state::Covariance;

/// Errors of the inertial sensors, 1 sigma, per axis.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// Scale factor of a gyro, 1; considered, not estimated.
    #[serde(default)]
    pub gyro_scale_sd: f64,
    /// What a gyro sees of turns about each of the other axes, rad; considered, not estimated.
    #[serde(default)]
    pub gyro_misalignment_sd_rad: f64,
    /// What a gyro sees of the specific force along each axis, rad/s per m/s²; likewise.
    #[serde(default)]
    pub gyro_g_sensitivity_sd_radps_per_mps2: f64,
    /// Scale factor of an accelerometer, 1; likewise.
    #[serde(default)]
    pub accel_scale_sd: f64,
    /// How far the accelerometer biases move while the sensors warm up from the filter's start on, m/s².
    #[serde(default)]
    pub accel_warm_up_sd_mps2: f64,
    /// How far the gyro biases do, rad/s.
    #[serde(default)]
    pub gyro_warm_up_sd_radps: f64,
    /// Time constant of the warm-up, s.
    #[serde(default)]
    pub warm_up_time_s: WalkTime,
}

impl ImuModel {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        let non_negative = [
            ("imu.accel_noise_mps_rts", self.accel_noise_mps_rts),
            ("imu.gyro_noise_rad_rts", self.gyro_noise_rad_rts),
            ("imu.accel_bias_sd_mps2", self.accel_bias_sd_mps2),
            ("imu.gyro_bias_sd_radps", self.gyro_bias_sd_radps),
            ("imu.accel_bias_walk_mps2_rts", self.accel_bias_walk_mps2_rts),
            ("imu.gyro_bias_walk_radps_rts", self.gyro_bias_walk_radps_rts),
            ("imu.gyro_scale_sd", self.gyro_scale_sd),
            ("imu.gyro_misalignment_sd_rad", self.gyro_misalignment_sd_rad),
            (
                "imu.gyro_g_sensitivity_sd_radps_per_mps2",
                self.gyro_g_sensitivity_sd_radps_per_mps2,
            ),
            ("imu.accel_scale_sd", self.accel_scale_sd),
            ("imu.accel_warm_up_sd_mps2", self.accel_warm_up_sd_mps2),
            ("imu.gyro_warm_up_sd_radps", self.gyro_warm_up_sd_radps),
        ];
        non_negative
            .into_iter()
            .try_for_each(|(field, value)| require_non_negative(field, value))?;
        self.warm_up_time_s.check("imu.warm_up_time_s")
    }
}

/// Uncertainty of the initial state, 1 sigma per axis.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitialModel {
    /// Position, tangent frame, m.
    pub position_sd_m: [f64; 3],
    /// Misalignment about north, east, down, rad.
    pub attitude_sd_rad: [f64; 3],
    /// Velocity, platform frame, m/s.
    pub velocity_sd_mps: [f64; 3],
}

impl InitialModel {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        let triples = [
            ("initial.position_sd_m", self.position_sd_m),
            ("initial.attitude_sd_rad", self.attitude_sd_rad),
            ("initial.velocity_sd_mps", self.velocity_sd_mps),
        ];
        triples
            .into_iter()
            .try_for_each(|(field, values)| values.iter().try_for_each(|&value| require_non_negative(field, value)))
    }
}

/// Everything assumed of the environment and the sensors; its keys are the names of the sections.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "Sections", into = "Sections")]
pub struct Model {
    /// Earth rate and gravity.
    pub environment: Environment,
    /// Inertial sensors.
    pub imu: ImuModel,
    /// Initial state.
    pub initial: InitialModel,
    /// Sensors that aid.
    pub sensors: SensorModels,
}

impl Model {
    /// Table 2 of Tal et al. 2017 as read in `docs/equations.md`, at the latitude of Haifa.
    #[must_use]
    // Table 2 says nothing of further sensors.
    #[allow(clippy::needless_update)]
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
                ..ImuModel::default()
            },
            initial: InitialModel {
                position_sd_m: [2.0; 3],
                attitude_sd_rad: [0.01, 0.01, 0.02],
                velocity_sd_mps: [0.05; 3],
            },
            sensors: SensorModels {
                dvl: DvlModel {
                    beam_noise_sd_mps: 0.042,
                    beam_bias_sd_mps: 0.005,
                    beam_bias_walk_mps_rts: 5e-5,
                    scale_factor_sd: 0.007,
                    scale_factor_walk_rts: 5e-5,
                    ..DvlModel::default()
                },
                depth: DepthModel {
                    sd_m: 0.02,
                    ..DepthModel::default()
                },
                magnetometer: MagnetometerModel {
                    yaw_sd_rad: 0.1,
                    roll_pitch_sd_rad: 0.02,
                    ..MagnetometerModel::default()
                },
                gps: GpsModel {
                    position_sd_m: [2.0; 3],
                    velocity_sd_mps: [0.1; 3],
                },
                ..SensorModels::default()
            },
        }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        self.environment.validate()?;
        self.imu.validate()?;
        self.initial.validate()?;
        self.sensors.validate()
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
            dvl_bias: dvl * self.sensors.dvl.beam_bias_walk_mps_rts.powi(2),
            dvl_scale: dvl * self.sensors.dvl.scale_factor_walk_rts.powi(2),
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
            let bias = Matrix4::identity() * self.sensors.dvl.beam_bias_sd_mps.powi(2);
            p.fixed_view_mut::<4, 4>(layout::DVL_BIAS, layout::DVL_BIAS)
                .copy_from(&bias);
            p[(layout::DVL_SCALE, layout::DVL_SCALE)] = self.sensors.dvl.scale_factor_sd.powi(2);
        }
        p
    }
}

/// Declares the sections of a model side by side.
macro_rules! sections {
    ($($field:ident: $model:ty,)+) => {
        /// The sections of a model side by side, as they are written; a sensor that there is not has none.
        #[derive(serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(crate) struct Sections {
            environment: Environment,
            imu: ImuModel,
            initial: InitialModel,
            $(#[serde(default)] $field: Option<$model>,)+
        }

        impl From<Sections> for Model {
            fn from(sections: Sections) -> Self {
                Self {
                    environment: sections.environment,
                    imu: sections.imu,
                    initial: sections.initial,
                    sensors: SensorModels { $($field: sections.$field.unwrap_or_default(),)+ },
                }
            }
        }

        impl From<Model> for Sections {
            fn from(model: Model) -> Self {
                Self {
                    environment: model.environment,
                    imu: model.imu,
                    initial: model.initial,
                    $($field: Some(model.sensors.$field).filter(|section| *section != <$model>::default()),)+
                }
            }
        }
    };
}

sensor_models!(sections);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::ErrorVector;

    fn primes() -> Model {
        let mut model = Model::table_2();
        model.imu = ImuModel {
            accel_noise_mps_rts: 2.0,
            gyro_noise_rad_rts: 3.0,
            accel_bias_sd_mps2: 5.0,
            gyro_bias_sd_radps: 7.0,
            accel_bias_walk_mps2_rts: 11.0,
            gyro_bias_walk_radps_rts: 13.0,
            ..ImuModel::default()
        };
        model.initial = InitialModel {
            position_sd_m: [1.0, 2.0, 3.0],
            attitude_sd_rad: [4.0, 5.0, 6.0],
            velocity_sd_mps: [7.0, 8.0, 9.0],
        };
        model.sensors.dvl = DvlModel {
            beam_noise_sd_mps: 17.0,
            beam_bias_sd_mps: 19.0,
            beam_bias_walk_mps_rts: 23.0,
            scale_factor_sd: 29.0,
            scale_factor_walk_rts: 31.0,
            ..DvlModel::default()
        };
        model
    }

    /// Densities are the squares of the figures per root second.
    #[test]
    fn densities_are_squares() {
        let expected = |dvl_bias, dvl_scale| ProcessNoise {
            accel: 4.0,
            gyro: 9.0,
            accel_bias: 121.0,
            gyro_bias: 169.0,
            dvl_bias,
            dvl_scale,
        };
        assert_eq!(primes().process_noise(true), expected(529.0, 961.0));
        assert_eq!(primes().process_noise(false), expected(0.0, 0.0));
    }

    /// Variances are the squares of the standard deviations, in the order of the state; frozen states have none.
    #[test]
    fn variances_are_squares_in_their_places() {
        for (estimate_dvl, dvl) in [(true, [361.0, 361.0, 361.0, 361.0, 841.0]), (false, [0.0; 5])] {
            let mut expected = vec![1.0, 4.0, 9.0, 16.0, 25.0, 36.0, 49.0, 64.0, 81.0];
            expected.extend([25.0, 25.0, 25.0, 49.0, 49.0, 49.0]);
            expected.extend(dvl);
            let expected = Covariance::from_diagonal(&ErrorVector::from_vec(expected));
            assert_eq!(primes().initial_covariance(estimate_dvl), expected);
        }
    }
}
