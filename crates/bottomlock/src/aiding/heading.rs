//! A heading sensor, such as a gyrocompass: yaw alone, from north at the vehicle. Its slow errors are those of an attitude reference
//! ([`crate::aiding::attitude`]).

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::aiding::attitude::SlowAngleModel;
use crate::aiding::deviation::{DeviationModel, harmonics};
use crate::aiding::further::{FurtherRows, Processes, block};
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Reading, Scene, Simulation, SlowSd, WalkTime, model_section};
use crate::aiding::{Innovation, Motion, TangentRows};
use crate::error::{NavError, require_angle_sd, require_finite, require_plausible};
use crate::frames::{Platform, Vec3};
use crate::layout::{ATTITUDE, POSITION};
#[cfg(feature = "simulation")]
use crate::random::Normals;

model_section! {
    /// Errors of a heading sensor, 1 sigma.
    pub struct HeadingModel in "heading" {
        /// White noise, rad.
        pub sd_rad: f64,
        /// Constant offset, rad; 0 for none.
        #[serde(default)]
        pub offset_sd_rad: SlowSd,
        /// First-order walk, rad; 0 for none.
        #[serde(default)]
        pub walk_sd_rad: SlowSd,
        /// Correlation time of the walk, s.
        #[serde(default)]
        pub walk_time_s: WalkTime,
        /// Deviation by cos ψ and by sin ψ, each, rad; 0 for none.
        #[serde(default)]
        pub semicircular_sd_rad: SlowSd,
        /// Deviation by cos 2ψ and by sin 2ψ, each, rad; 0 for none.
        #[serde(default)]
        pub quadrantal_sd_rad: SlowSd,
    }
}

impl HeadingModel {
    /// Slow error and deviation.
    pub(crate) fn processes(&self) -> Vec<Processes> {
        vec![
            (block::HEADING_ERROR, SlowAngleModel::processes(&[self.yaw()])),
            (block::HEADING_DEVIATION, self.deviation().processes()),
        ]
    }

    /// Its deviation.
    pub(crate) fn deviation(&self) -> DeviationModel {
        DeviationModel {
            semicircular_sd_rad: self.semicircular_sd_rad.0,
            quadrantal_sd_rad: self.quadrantal_sd_rad.0,
        }
    }

    /// Its slow error.
    pub(crate) fn yaw(&self) -> SlowAngleModel {
        SlowAngleModel {
            offset_sd_rad: self.offset_sd_rad.0,
            walk_sd_rad: self.walk_sd_rad.0,
            walk_time_s: self.walk_time_s.0,
        }
    }
}

/// Cosine of the pitch below which yaw is not computed: it would be rounding errors of the quaternion.
const LEAST_COSINE: f64 = 1e-6;

/// A yaw reading alone.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HeadingSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// 1 sigma, rad.
    pub sd_rad: f64,
}

impl Reading for HeadingSample {
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite("yaw_rad", self.time_ns, &[self.yaw_rad])?;
        let hint = " rad, a turn: is it in degrees?";
        require_plausible("yaw_rad", self.time_ns, &[self.yaw_rad], TAU, hint)?;
        require_angle_sd("heading sd_rad", self.time_ns, self.sd_rad)
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, _: &Vec3<Platform>) -> Innovation {
        heading(motion, self.yaw_rad, self.sd_rad)
    }

    fn numbers(&self) -> Vec<f64> {
        vec![self.yaw_rad]
    }
}

impl AidingSensor for HeadingSample {
    const KIND: SensorKind = SensorKind::Heading;
    const STREAM: &'static str = "heading";
    const LOG: &'static [Column] = &[Column::new("heading_rad", 1)];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "heading",
        offset: None,
        // White noise, offset, walk, then the deviation's coefficients.
        random: &[14, 21, 22, 30, 31, 32, 33],
        columns: Self::LOG,
    });

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        let [_, _, yaw_rad] = motion.level.to_euler_rad(motion.state.attitude_t_p);
        Self {
            time_ns: motion.state.time_ns,
            yaw_rad,
            sd_rad: models.heading.sd_rad,
        }
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        Some(Self {
            time_ns,
            yaw_rad: *(*values.first()?)?.first()?,
            sd_rad: models.heading.sd_rad,
        })
    }

    #[cfg(feature = "simulation")]
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let [noise, offset, walk, deviation @ ..] = random else {
            return None;
        };
        let model = &scene.actual.heading;
        let [_, _, yaw_rad] = scene.level.to_euler_rad(scene.truth.attitude_t_p);
        let slow_rad =
            model.yaw().draw(offset, walk, scene.time_ns) + model.deviation().draw(deviation, yaw_rad, scene.time_ns);
        Some(Self {
            time_ns: scene.time_ns,
            yaw_rad: yaw_rad + slow_rad + model.sd_rad * noise.one(),
            sd_rad: scene.claimed.heading.sd_rad,
        })
    }
}

/// Yaw alone. It has no row on end, where yaw is undefined; near there the filter withholds it, see
/// [`crate::filter::near_vertical`].
#[must_use]
pub fn heading(motion: &Motion<'_>, yaw_rad: f64, sd_rad: f64) -> Innovation {
    let [_, pitch, yaw] = motion.level.to_euler_rad(motion.state.attitude_t_p);
    let mut innovation = Innovation {
        tangent_rows: TangentRows::Yaw,
        ..Innovation::empty()
    };
    if pitch.cos() < LEAST_COSINE {
        return innovation;
    }
    (innovation.rows, innovation.degrees) = (1, 1);
    let difference = yaw_rad - yaw;
    innovation.residual[0] = difference.sin().atan2(difference.cos());
    // ψ by a rotation of the platform, resolved in the level axes of the place, which turn with it themselves.
    let by_rotation_n = Vector3::new(yaw.cos() * pitch.tan(), yaw.sin() * pitch.tan(), 1.0);
    let by_misalignment = motion.level.rotation_t_n * by_rotation_n;
    let by_position = -motion.level.turn_t.tr_mul(&by_misalignment);
    for k in 0..3 {
        innovation.jacobian[(0, POSITION + k)] = by_position[k];
        innovation.jacobian[(0, ATTITUDE + k)] = by_misalignment[k];
    }
    innovation.noise[(0, 0)] = sd_rad.powi(2);
    let mut rows = Box::new(FurtherRows::zeros());
    rows.fixed_view_mut::<1, 2>(0, block::HEADING_ERROR.first).fill(1.0);
    for (k, harmonic) in harmonics(yaw).into_iter().enumerate() {
        rows[(0, block::HEADING_DEVIATION.first + k)] = harmonic;
    }
    innovation.by_further = Some(rows);
    innovation
}
