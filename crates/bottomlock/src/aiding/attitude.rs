//! An attitude reference: AHRS, or magnetometer and tilt sensor, by Euler angles with independent errors.
//!
//! Its errors are slow: mounting, iron and declination give an offset, and accelerations that are taken for tilt, or
//! iron that changes with the heading, errors that last for minutes. From one reading to the next it scatters by little.
//! The error of each angle is an offset, a first-order walk and white noise, that of the yaw also a deviation
//! (`aiding/deviation.rs`); the filter estimates all but the noise (`filter/gauss_markov.rs`) where they are not zero.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::aiding::deviation::{DeviationModel, harmonics};
use crate::aiding::further::{ATTITUDE_ERROR, FurtherRows, Process, Processes, block};
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Reading, Scene, Simulation, SlowSd, WalkTime, model_section};
use crate::aiding::{Innovation, Motion};
use crate::error::{NavError, require_angle_sd, require_finite};
use crate::frames::{Platform, Rot, Tangent, Vec3};
use crate::layout::{ATTITUDE, POSITION};
#[cfg(feature = "simulation")]
use crate::random::Normals;

model_section! {
    /// Errors of the attitude reference, 1 sigma.
    pub struct MagnetometerModel in "magnetometer" {
        /// White noise of the yaw, rad.
        pub yaw_sd_rad: f64,
        /// White noise of roll and pitch, rad.
        pub roll_pitch_sd_rad: f64,
        /// Constant offset of the yaw, rad; 0 for none.
        #[serde(default)]
        pub yaw_offset_sd_rad: SlowSd,
        /// Constant offset of roll and pitch, rad; 0 for none.
        #[serde(default)]
        pub roll_pitch_offset_sd_rad: SlowSd,
        /// First-order walk of the yaw, rad; 0 for none.
        #[serde(default)]
        pub yaw_walk_sd_rad: SlowSd,
        /// First-order walk of roll and pitch, rad; 0 for none.
        #[serde(default)]
        pub roll_pitch_walk_sd_rad: SlowSd,
        /// Correlation time of the walks, s.
        #[serde(default)]
        pub walk_time_s: WalkTime,
        /// Deviation of the yaw by cos ψ and by sin ψ, each, rad; 0 for none.
        #[serde(default)]
        pub yaw_semicircular_sd_rad: SlowSd,
        /// Deviation of the yaw by cos 2ψ and by sin 2ψ, each, rad; 0 for none.
        #[serde(default)]
        pub yaw_quadrantal_sd_rad: SlowSd,
    }
}

/// Slow error of one angle, 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SlowAngleModel {
    /// Constant offset, rad.
    pub(crate) offset_sd_rad: f64,
    /// First-order walk, rad.
    pub(crate) walk_sd_rad: f64,
    /// Correlation time of the walk, s.
    pub(crate) walk_time_s: f64,
}

impl SlowAngleModel {
    /// Offsets of angles, then their walks.
    pub(crate) fn processes(angles: &[Self]) -> Vec<Process> {
        let offsets = angles.iter().map(|angle| Process::constant(angle.offset_sd_rad));
        let walk = |angle: &Self| Process::lasting(angle.walk_sd_rad, angle.walk_time_s);
        offsets.chain(angles.iter().map(walk)).collect()
    }

    /// A drawn error at a time, rad, of the streams of offset and walk.
    #[cfg(feature = "simulation")]
    pub(crate) fn draw(&self, offset: &mut Normals, walk: &mut Normals, time_ns: i64) -> f64 {
        offset.gauss_markov(self.offset_sd_rad, f64::INFINITY, time_ns)
            + walk.gauss_markov(self.walk_sd_rad, self.walk_time_s, time_ns)
    }
}

impl MagnetometerModel {
    /// Slow errors of the three angles, and the deviation of the yaw.
    pub(crate) fn processes(&self) -> Vec<Processes> {
        let angles = [self.roll_pitch(), self.roll_pitch(), self.yaw()];
        vec![
            (block::ATTITUDE_ERROR, SlowAngleModel::processes(&angles)),
            (block::ATTITUDE_DEVIATION, self.deviation().processes()),
        ]
    }

    /// Slow error of the roll, and of the pitch.
    pub(crate) fn roll_pitch(&self) -> SlowAngleModel {
        SlowAngleModel {
            offset_sd_rad: self.roll_pitch_offset_sd_rad.0,
            walk_sd_rad: self.roll_pitch_walk_sd_rad.0,
            walk_time_s: self.walk_time_s.0,
        }
    }

    /// Deviation of the yaw.
    pub(crate) fn deviation(&self) -> DeviationModel {
        DeviationModel {
            semicircular_sd_rad: self.yaw_semicircular_sd_rad.0,
            quadrantal_sd_rad: self.yaw_quadrantal_sd_rad.0,
        }
    }

    /// Slow error of the yaw.
    pub(crate) fn yaw(&self) -> SlowAngleModel {
        SlowAngleModel {
            offset_sd_rad: self.yaw_offset_sd_rad.0,
            walk_sd_rad: self.yaw_walk_sd_rad.0,
            walk_time_s: self.walk_time_s.0,
        }
    }
}

/// An attitude reading.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AttitudeSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Attitude against north, east and down at the vehicle.
    pub attitude_t_p: Rot<Tangent, Platform>,
    /// Roll and pitch, 1 sigma, rad.
    pub roll_pitch_sd_rad: f64,
    /// Yaw, 1 sigma, rad.
    pub yaw_sd_rad: f64,
}

impl AttitudeSample {
    fn new(time_ns: i64, attitude_t_p: Rot<Tangent, Platform>, model: &MagnetometerModel) -> Self {
        Self {
            time_ns,
            attitude_t_p,
            roll_pitch_sd_rad: model.roll_pitch_sd_rad,
            yaw_sd_rad: model.yaw_sd_rad,
        }
    }
}

impl Reading for AttitudeSample {
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite("attitude_t_p", self.time_ns, &self.attitude_t_p.to_quaternion_wxyz())?;
        require_angle_sd("attitude roll_pitch_sd_rad", self.time_ns, self.roll_pitch_sd_rad)?;
        require_angle_sd("attitude yaw_sd_rad", self.time_ns, self.yaw_sd_rad)
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, _: &Vec3<Platform>) -> Innovation {
        attitude(motion, &self.attitude_t_p, self.roll_pitch_sd_rad, self.yaw_sd_rad)
    }

    fn numbers(&self) -> Vec<f64> {
        self.attitude_t_p.to_quaternion_wxyz().to_vec()
    }
}

impl AidingSensor for AttitudeSample {
    const KIND: SensorKind = SensorKind::Attitude;
    const STREAM: &'static str = "attitude";
    const LOG: &'static [Column] = &[Column::new("attitude_t_p", 4)];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "magnetometer",
        offset: Some("yaw_offset_rad"),
        // White noise, then offset and walk of each angle, then the deviation's coefficients.
        random: &[8, 15, 16, 17, 18, 19, 20, 26, 27, 28, 29],
        columns: &[Column::new("magnetometer_attitude_t_p", 4)],
    });

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        Self::new(
            motion.state.time_ns,
            motion.level.rotation_n_t() * motion.state.attitude_t_p,
            &models.magnetometer,
        )
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        let quaternion = Rot::from_quaternion_wxyz((*values.first()?)?.try_into().ok()?);
        Some(Self::new(time_ns, quaternion, &models.magnetometer))
    }

    /// With its yaw offset by declination and iron, and its slow errors drawn per run.
    #[cfg(feature = "simulation")]
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let model = scene.actual.magnetometer;
        let [roll, pitch, yaw] = scene.level.to_euler_rad(scene.truth.attitude_t_p);
        let tilt = model.roll_pitch_sd_rad;
        let [noise, slow @ ..] = random else { return None };
        let (slow, deviation) = slow.split_at_mut_checked(ATTITUDE_ERROR)?;
        let mut error = noise.each(&[tilt, tilt, model.yaw_sd_rad]);
        let angles = [model.roll_pitch(), model.roll_pitch(), model.yaw()];
        for (k, (angle, streams)) in angles.iter().zip(slow.chunks_exact_mut(2)).enumerate() {
            let [offset, walk] = streams else { return None };
            error[k] += angle.draw(offset, walk, scene.time_ns);
        }
        error.z += model.deviation().draw(deviation, yaw, scene.time_ns);
        let quaternion =
            UnitQuaternion::from_euler_angles(roll + error.x, pitch + error.y, yaw + scene.offset + error.z);
        Some(Self::new(
            scene.time_ns,
            Rot::from_quaternion_wxyz([quaternion.w, quaternion.i, quaternion.j, quaternion.k]),
            &scene.claimed.magnetometer,
        ))
    }
}

/// The residual is a rotation: no angle is subtracted, so it is regular at vertical pitch.
///
/// Towards the vertical roll and yaw turn about the same axis, and the tilt across the bow would come out as known without
/// error, roll times cos(pitch). The errors' own products remain there, yaw or pitch times roll or pitch: the cosine of the
/// noise is therefore never less than the angle by which the reading may be wrong.
#[must_use]
pub fn attitude(
    motion: &Motion<'_>,
    measured_n_p: &Rot<Tangent, Platform>,
    roll_pitch_sd_rad: f64,
    yaw_sd_rad: f64,
) -> Innovation {
    let level = &motion.level;
    let measured_t_p = level.rotation_n_t().inverse() * *measured_n_p;
    let rho = (measured_t_p * motion.state.attitude_t_p.inverse()).log();
    let [_, pitch, yaw] = measured_n_p.to_euler_rad();
    let cosine = pitch.cos().max(roll_pitch_sd_rad.hypot(yaw_sd_rad).min(1.0));
    // Columns: the tangent-frame axes about which roll, pitch and yaw turn.
    let axes = level.rotation_t_n
        * Matrix3::new(
            yaw.cos() * cosine,
            -yaw.sin(),
            0.0,
            yaw.sin() * cosine,
            yaw.cos(),
            0.0,
            -pitch.sin(),
            0.0,
            1.0,
        );
    let tilt = roll_pitch_sd_rad.powi(2);
    let noise = axes * Matrix3::from_diagonal(&Vector3::new(tilt, tilt, yaw_sd_rad.powi(2))) * axes.transpose();
    let mut innovation = Innovation::vector(rho, &noise);
    innovation.put(ATTITUDE, &Matrix3::identity());
    // Level and north turn with the position.
    innovation.put(POSITION, &-level.turn_t);
    let mut rows = Box::new(FurtherRows::zeros());
    for first in [block::ATTITUDE_ERROR.first, block::ATTITUDE_ERROR.first + 3] {
        rows.fixed_view_mut::<3, 3>(0, first).copy_from(&axes);
    }
    let [_, _, estimated_yaw] = level.to_euler_rad(motion.state.attitude_t_p);
    for (k, harmonic) in harmonics(estimated_yaw).into_iter().enumerate() {
        rows.fixed_view_mut::<3, 1>(0, block::ATTITUDE_DEVIATION.first + k)
            .copy_from(&(axes.column(2) * harmonic));
    }
    innovation.by_further = Some(rows);
    innovation
}
