//! A depth sensor: depth below the level of the tangent frame's origin, which on the ellipsoid curves away below its plane.
//!
//! Its reading has a bias that lasts for hours: tide, density and barometric pressure, and the sensor's own offset. The
//! filter estimates it as a Gauss–Markov process (`filter/gauss_markov.rs`).
//!
//! Near the surface the pressure also has the waves above, in deep water η e^(−kz) of a wave of the height η and the wave number
//! k. They are a Gauss–Markov process of second order, of the covariance σ² e^(−|τ|/P) cos(2πτ/P) with their mean period P: two
//! states of first order that turn into each other. Its spectrum falls to half of its peak at 0.84 and 1.16 of the peak's
//! frequency, that of fully grown wind waves at the surface at 0.80 and 1.37 (Pierson & Moskowitz 1964), and depth takes the short
//! ones away.

use std::f64::consts::TAU;

use crate::aiding::further::{DEPTH_WAVE, FurtherRows, Process, Processes, block};
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{
    AidingSensor, Column, Reading, Scene, Simulation, SlowSd, TimeConstant, WavePeriod, model_section,
};
use crate::aiding::{Innovation, Motion, TangentRows};
use crate::error::{NavError, require_finite, require_positive};
use crate::frames::{Platform, Vec3};
use crate::layout::{ATTITUDE, POSITION};
#[cfg(feature = "simulation")]
use crate::random::Normals;

model_section! {
    /// Errors of the depth sensor, 1 sigma.
    pub struct DepthModel in "depth" {
        /// White noise, m.
        pub sd_m: f64,
        /// Bias, m; 0 for none.
        pub bias_sd_m: f64,
        /// Correlation time of the bias, s.
        pub bias_time_s: TimeConstant,
        /// What waves add to the reading, m; 0 for none.
        #[serde(default)]
        pub wave_sd_m: SlowSd,
        /// Mean period of the waves, s.
        #[serde(default)]
        pub wave_period_s: WavePeriod,
    }
}

impl DepthModel {
    /// Bias and waves.
    pub(crate) fn processes(&self) -> Vec<Processes> {
        let wave = Process::lasting(self.wave_sd_m.0, self.wave_period_s.0);
        vec![
            (
                block::DEPTH_BIAS,
                vec![Process::lasting(self.bias_sd_m, self.bias_time_s.0)],
            ),
            (block::DEPTH_WAVE, vec![wave; DEPTH_WAVE]),
        ]
    }
}

/// A depth reading.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DepthSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Depth, m.
    pub depth_m: f64,
    /// 1 sigma, m.
    pub sd_m: f64,
}

impl Reading for DepthSample {
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite("depth_m", self.time_ns, &[self.depth_m])?;
        require_positive("depth sd_m", self.sd_m)
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, lever_p_m: &Vec3<Platform>) -> Innovation {
        depth(motion, self.depth_m, self.sd_m, lever_p_m)
    }

    fn numbers(&self) -> Vec<f64> {
        vec![self.depth_m]
    }
}

impl AidingSensor for DepthSample {
    const KIND: SensorKind = SensorKind::Depth;
    const STREAM: &'static str = "depth";
    const LEVER: Option<&'static str> = Some("depth_p_m");
    const LOG: &'static [Column] = &[Column::new("depth_m", 1)];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "depth",
        offset: Some("depth_offset_m"),
        // White noise, bias, then the waves in phase and a quarter of their period behind.
        random: &[7, 13, 34, 35],
        columns: Self::LOG,
    });

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        Self {
            time_ns: motion.state.time_ns,
            depth_m: motion.level.depth_m,
            sd_m: models.depth.sd_m,
        }
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        Some(Self {
            time_ns,
            depth_m: *(*values.first()?)?.first()?,
            sd_m: models.depth.sd_m,
        })
    }

    /// With its offset by density, tide and barometer, and a bias and waves drawn per run.
    #[cfg(feature = "simulation")]
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let [noise, bias, wave @ ..] = random else {
            return None;
        };
        let actual = &scene.actual.depth;
        let bias_m = bias.gauss_markov(actual.bias_sd_m, actual.bias_time_s.0, scene.time_ns);
        let period_s = actual.wave_period_s.0;
        let (sin, cos) = (TAU * (scene.time_ns as f64 * 1e-9 / period_s).fract()).sin_cos();
        let wave_m: f64 = wave
            .iter_mut()
            .zip([cos, sin])
            .map(|(stream, part)| part * stream.gauss_markov(actual.wave_sd_m.0, period_s, scene.time_ns))
            .sum();
        Some(Self {
            time_ns: scene.time_ns,
            depth_m: scene.level.depth_m + scene.offset + bias_m + wave_m + actual.sd_m * noise.one(),
            sd_m: scene.claimed.depth.sd_m,
        })
    }
}

/// z = d_meas − d(p) − D·(R l), of a sensor at `lever_p_m`, with D down at the vehicle; H = Dᵀ.
#[must_use]
pub fn depth(motion: &Motion<'_>, depth_m: f64, sd_m: f64, lever_p_m: &Vec3<Platform>) -> Innovation {
    let lever_t = (motion.state.attitude_t_p * *lever_p_m).0;
    let down_t = motion.level.down_t();
    let mut innovation = Innovation {
        rows: 1,
        degrees: 1,
        tangent_rows: TangentRows::Depth,
        ..Innovation::empty()
    };
    innovation.residual[0] = depth_m - (motion.level.depth_m + down_t.dot(&lever_t));
    // (R l) turns with ρ: D · (ρ × R l) = ρ · (R l × D).
    let by_misalignment = lever_t.cross(&down_t);
    for k in 0..3 {
        innovation.jacobian[(0, POSITION + k)] = down_t[k];
        innovation.jacobian[(0, ATTITUDE + k)] = by_misalignment[k];
    }
    innovation.noise[(0, 0)] = sd_m.powi(2);
    let mut rows = Box::new(FurtherRows::zeros());
    rows[(0, block::DEPTH_BIAS.first)] = 1.0;
    rows[(0, block::DEPTH_WAVE.first)] = 1.0;
    innovation.by_further = Some(rows);
    innovation
}
