//! Acoustic position (USBL, LBL): a position fix in the tangent frame, whose noise grows with the slant range.
//!
//! # Equations
//! With p the position, R the attitude, l the lever arm of the transponder and t the position of the transceiver:
//!
//! - measurement z = p + R l + n, Jacobian I by position and −[(R l)×] by misalignment;
//! - standard deviation of each axis √(σ₀² + (k r)²), slant range r = |p + R l − t|.
//!
//! A filter takes r from the fix itself, |z − t|: a wrong estimate then changes no weight.

use crate::aiding::position::position;
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Fraction, Reading, Scene, Simulation, model_section};
use crate::aiding::{Innovation, Motion};
use crate::error::{NavError, require_finite, require_positive};
use crate::frames::{Platform, Tangent, Vec3};
#[cfg(feature = "simulation")]
use crate::random::Normals;

model_section! {
    /// Errors of acoustic position fixes, 1 sigma per axis, tangent frame.
    pub struct AcousticPositionModel in "acoustic_position" {
        /// Noise at zero range, σ₀, m.
        pub sd_m: f64,
        /// Noise per slant range, k.
        pub sd_per_range: f64,
        /// Position of the transceiver, of a ship or on the seabed, m.
        pub transceiver_t_m: Vec3<Tangent>,
        /// Fraction of simulated fixes that are outliers.
        pub outlier_fraction: Fraction,
        /// Noise of an outlier over that of a good fix.
        pub outlier_factor: f64,
    }
}

impl AcousticPositionModel {
    /// Standard deviation of each axis of a fix at a place, m.
    #[must_use]
    pub fn sd_at_m(&self, position_t_m: &Vec3<Tangent>) -> f64 {
        let slant_range_m = (*position_t_m - self.transceiver_t_m).0.norm();
        self.sd_m.hypot(self.sd_per_range * slant_range_m)
    }
}

/// An acoustic position fix.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AcousticPositionSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Position of the transponder, tangent frame, m.
    pub position_t_m: Vec3<Tangent>,
    /// 1 sigma, m.
    pub sd_m: [f64; 3],
}

impl AcousticPositionSample {
    /// A fix; without standard deviations, with those of the model at its slant range.
    #[must_use]
    pub fn new(
        time_ns: i64,
        position_t_m: Vec3<Tangent>,
        sd_m: Option<[f64; 3]>,
        model: &AcousticPositionModel,
    ) -> Self {
        Self {
            time_ns,
            position_t_m,
            sd_m: sd_m.unwrap_or_else(|| [model.sd_at_m(&position_t_m); 3]),
        }
    }
}

impl Reading for AcousticPositionSample {
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite(
            "acoustic_position position_t_m",
            self.time_ns,
            &self.position_t_m.to_array(),
        )?;
        self.sd_m
            .iter()
            .try_for_each(|&sd| require_positive("acoustic_position sd_m", sd))
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, lever_p_m: &Vec3<Platform>) -> Innovation {
        position(motion, &self.position_t_m, &self.sd_m, lever_p_m)
    }

    fn numbers(&self) -> Vec<f64> {
        [self.position_t_m.to_array(), self.sd_m].concat()
    }
}

impl AidingSensor for AcousticPositionSample {
    const KIND: SensorKind = SensorKind::AcousticPosition;
    const STREAM: &'static str = "acoustic_position";
    const LEVER: Option<&'static str> = Some("acoustic_position_p_m");
    const LOG: &'static [Column] = &[
        Column::new("acoustic_position_t_m", 3),
        Column {
            optional: true,
            ..Column::new("acoustic_position_sd_m", 3)
        },
    ];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "acoustic_position",
        offset: None,
        random: &[11, 12],
        columns: Self::LOG,
    });

    fn of_truth(motion: &Motion<'_>, lever_p_m: &Vec3<Platform>, models: &SensorModels) -> Self {
        let state = motion.state;
        let transponder_t_m = state.position_t_m + state.attitude_t_p * *lever_p_m;
        Self::new(state.time_ns, transponder_t_m, None, &models.acoustic_position)
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        let [position, sd] = values else { return None };
        let sd_m = sd.and_then(|sd| sd.try_into().ok());
        let position_t_m = Vec3::from_array((*position)?.try_into().ok()?);
        Some(Self::new(time_ns, position_t_m, sd_m, &models.acoustic_position))
    }

    /// Each fix draws the same number of random values, outlier or not, so that outliers do not change the noise of other fixes.
    #[cfg(feature = "simulation")]
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let [noise, outliers] = random else { return None };
        let (truth, actual) = (scene.truth, &scene.actual.acoustic_position);
        let transponder_t_m = Vec3::from(truth.position_t_m) + truth.attitude_t_p * scene.lever_p_m;
        let is_outlier = outliers.uniform() < actual.outlier_fraction.0;
        let factor = if is_outlier { actual.outlier_factor } else { 1.0 };
        let sd_m = factor * actual.sd_at_m(&transponder_t_m);
        let fix_t_m = transponder_t_m + Vec3::from(noise.each(&[sd_m; 3]));
        Some(Self::new(
            scene.time_ns,
            fix_t_m,
            None,
            &scene.claimed.acoustic_position,
        ))
    }
}

#[cfg(test)]
#[path = "acoustic_position_tests.rs"]
mod tests;
