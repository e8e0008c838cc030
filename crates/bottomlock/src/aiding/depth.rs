//! A depth sensor: depth below the tangent plane's origin.
//!
//! Its reading has a bias that lasts for hours: tide, density and barometric pressure, and the sensor's own offset. The
//! filter estimates it as a Gauss–Markov process (`filter/gauss_markov.rs`).

use crate::aiding::declare::model_section;
use crate::aiding::further::{DEPTH_BIAS, FurtherRows};
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Quantity, Report, Scene, Simulation, TimeConstant};
use crate::aiding::{Innovation, Motion, TangentRows};
use crate::error::{NavError, require_finite, require_positive};
use crate::frames::{Platform, Vec3};
use crate::layout::{ATTITUDE, POSITION};
use crate::random::Normals;
use crate::state::NavState;

model_section! {
    /// Errors of the depth sensor, 1 sigma.
    pub struct DepthModel in "depth" {
        /// White noise, m.
        pub sd_m: f64,
        /// Bias, m; 0 for none.
        pub bias_sd_m: f64,
        /// Correlation time of the bias, s.
        pub bias_time_s: TimeConstant,
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

impl AidingSensor for DepthSample {
    const KIND: SensorKind = SensorKind::Depth;
    const STREAM: &'static str = "depth";
    const REPORTS: &'static [Report] = &[Report {
        sensor: Sensor::Depth,
        quantity: Quantity::Position,
    }];
    const LEVER: Option<&'static str> = Some("depth_lever_p_m");
    const LOG: &'static [Column] = &[Column::new("depth_m", 1)];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "depth",
        offset: Some("depth_offset_m"),
        random: &[7, 13],
        columns: Self::LOG,
    });

    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite("depth_m", self.time_ns, &[self.depth_m])?;
        require_positive("depth sd_m", self.sd_m)
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, lever_p_m: &Vec3<Platform>) -> Innovation {
        depth(motion.state, self.depth_m, self.sd_m, lever_p_m)
    }

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        Self {
            time_ns: motion.state.time_ns,
            depth_m: motion.state.position_t_m.0.z,
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

    /// With its offset by density, tide and barometer, and a bias drawn per run.
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let [noise, bias] = random else { return None };
        let actual = &scene.actual.depth;
        let bias_m = bias.gauss_markov(actual.bias_sd_m, actual.bias_time_s.0, scene.time_ns);
        Some(Self {
            time_ns: scene.time_ns,
            depth_m: scene.truth.position_t_m.z + scene.offset + bias_m + actual.sd_m * noise.one(),
            sd_m: scene.claimed.depth.sd_m,
        })
    }

    fn numbers(&self) -> Vec<f64> {
        vec![self.depth_m]
    }
}

/// z = d_meas − (p + R l)_z, of a sensor at `lever_p_m`.
#[must_use]
pub fn depth(state: &NavState, depth_m: f64, sd_m: f64, lever_p_m: &Vec3<Platform>) -> Innovation {
    let lever_t = (state.attitude_t_p * *lever_p_m).0;
    let mut innovation = Innovation {
        rows: 1,
        degrees: 1,
        tangent_rows: TangentRows::Depth,
        ..Innovation::empty()
    };
    innovation.residual[0] = depth_m - (state.position_t_m.0.z + lever_t.z);
    innovation.jacobian[(0, POSITION + 2)] = 1.0;
    // (R l) turns with ρ: ρ × (R l), third component.
    innovation.jacobian[(0, ATTITUDE)] = lever_t.y;
    innovation.jacobian[(0, ATTITUDE + 1)] = -lever_t.x;
    innovation.noise[(0, 0)] = sd_m.powi(2);
    let mut rows = Box::new(FurtherRows::zeros());
    rows[(0, DEPTH_BIAS)] = 1.0;
    innovation.by_further = Some(rows);
    innovation
}
