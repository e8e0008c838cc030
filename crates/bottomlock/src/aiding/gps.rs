//! A GPS receiver: position and, where it gives one, velocity of its antenna in the tangent frame.

use crate::aiding::position::position;
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Reading, Scene, Simulation, model_section};
use crate::aiding::{Innovation, Motion, TangentRows};
use crate::error::{NavError, require_finite, require_positive};
use crate::frames::{Platform, Tangent, Vec3, skew};
use crate::layout::{ATTITUDE, GYRO_BIAS, VELOCITY};
#[cfg(feature = "simulation")]
use crate::random::Normals;

model_section! {
    /// Errors of the GPS receiver, 1 sigma per axis, tangent frame.
    pub struct GpsModel in "gps" {
        /// Position, m.
        pub position_sd_m: [f64; 3],
        /// Velocity, m/s.
        pub velocity_sd_mps: [f64; 3],
    }
}

/// A GPS reading.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GpsSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Position, tangent frame, m.
    pub position_t_m: Vec3<Tangent>,
    /// 1 sigma, m.
    pub position_sd_m: [f64; 3],
    /// None if the receiver gives none.
    pub velocity: Option<GpsVelocity>,
}

/// The velocity of a GPS reading.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GpsVelocity {
    /// Velocity, tangent frame, m/s.
    pub velocity_t_mps: Vec3<Tangent>,
    /// 1 sigma, m/s.
    pub sd_mps: [f64; 3],
}

impl Reading for GpsSample {
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite("gps position_t_m", self.time_ns, &self.position_t_m.to_array())?;
        let positive = |sds: &[f64; 3]| sds.iter().try_for_each(|&sd| require_positive("gps sd", sd));
        if let Some(velocity) = &self.velocity {
            require_finite("gps velocity_t_mps", self.time_ns, &velocity.velocity_t_mps.to_array())?;
            positive(&velocity.sd_mps)?;
        }
        positive(&self.position_sd_m)
    }

    fn gives(&self, report: Sensor) -> bool {
        report == Sensor::GpsPosition || self.velocity.is_some()
    }

    fn innovation(&self, report: Sensor, motion: &Motion<'_>, lever_p_m: &Vec3<Platform>) -> Innovation {
        match (report, &self.velocity) {
            (Sensor::GpsVelocity, Some(velocity)) => {
                gps_velocity(motion, &velocity.velocity_t_mps, &velocity.sd_mps, lever_p_m)
            }
            _ => position(motion, &self.position_t_m, &self.position_sd_m, lever_p_m),
        }
    }

    fn numbers(&self) -> Vec<f64> {
        let velocity = self.velocity.map_or([f64::NAN; 3], |of| of.velocity_t_mps.to_array());
        [self.position_t_m.to_array(), velocity].concat()
    }
}

impl AidingSensor for GpsSample {
    const KIND: SensorKind = SensorKind::Gps;
    const STREAM: &'static str = "gps";
    const LEVER: Option<&'static str> = Some("gps_p_m");
    const LOG: &'static [Column] = &[Column::new("gps_position_t_m", 3)];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "gps",
        offset: None,
        random: &[9, 10],
        columns: &[Column::new("gps_position_t_m", 3), Column::new("gps_velocity_t_mps", 3)],
    });

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        let state = motion.state;
        Self {
            time_ns: state.time_ns,
            position_t_m: state.position_t_m,
            position_sd_m: models.gps.position_sd_m,
            velocity: Some(GpsVelocity {
                velocity_t_mps: state.attitude_t_p * state.velocity_p_mps,
                sd_mps: models.gps.velocity_sd_mps,
            }),
        }
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        Some(Self {
            time_ns,
            position_t_m: Vec3::from_array((*values.first()?)?.try_into().ok()?),
            position_sd_m: models.gps.position_sd_m,
            velocity: None,
        })
    }

    #[cfg(feature = "simulation")]
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let (truth, actual, claimed) = (scene.truth, scene.actual.gps, scene.claimed.gps);
        let [of_position, of_velocity] = random else {
            return None;
        };
        let velocity_t = (truth.attitude_t_p * Vec3::from(truth.velocity_p_mps)).0;
        Some(Self {
            time_ns: scene.time_ns,
            position_t_m: (truth.position_t_m + of_position.each(&actual.position_sd_m)).into(),
            position_sd_m: claimed.position_sd_m,
            velocity: Some(GpsVelocity {
                velocity_t_mps: (velocity_t + of_velocity.each(&actual.velocity_sd_mps)).into(),
                sd_mps: claimed.velocity_sd_mps,
            }),
        })
    }
}

/// z = v_meas − R (v + ω_tp × l): a velocity in the tangent frame of an antenna at `lever_p_m`.
#[must_use]
pub fn gps_velocity(
    motion: &Motion<'_>,
    velocity_t_mps: &Vec3<Tangent>,
    sd_mps: &[f64; 3],
    lever_p_m: &Vec3<Platform>,
) -> Innovation {
    let rotation = motion.rotation();
    let point_p = motion.state.velocity_p_mps.0 + motion.rate_tp().cross(&lever_p_m.0);
    let noise = motion.level.covariance_t(sd_mps);
    let mut innovation = Innovation::vector(velocity_t_mps.0 - rotation * point_p, &noise);
    let by_rate = rotation * skew(&lever_p_m.0);
    innovation.tangent_rows = TangentRows::Velocity;
    innovation.put(VELOCITY, &rotation);
    innovation.put(GYRO_BIAS, &by_rate);
    innovation.put(
        ATTITUDE,
        &(-skew(&(rotation * point_p)) - by_rate * motion.rate_by_misalignment()),
    );
    innovation
}
