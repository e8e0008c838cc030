//! Everything that can arrive at a navigator, with its own time.

use nalgebra::Matrix3;

use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error::{NavError, require_finite, require_positive};
use crate::frames::{Platform, Rot, Tangent, Vec3};
use crate::mechanisation::ImuSample;

/// Number of streams within which time rises.
pub const STREAMS: usize = 7;
/// Their names.
pub const STREAM_NAMES: [&str; STREAMS] = ["imu", "dvl", "velocity", "depth", "attitude", "heading", "gps"];

/// A depth reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Depth, m.
    pub depth_m: f64,
    /// 1 sigma, m.
    pub sd_m: f64,
}

/// An attitude reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Attitude, platform to tangent.
    pub attitude_t_p: Rot<Tangent, Platform>,
    /// Roll and pitch, 1 sigma, rad.
    pub roll_pitch_sd_rad: f64,
    /// Yaw, 1 sigma, rad.
    pub yaw_sd_rad: f64,
}

/// A GPS reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpsSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Position, tangent frame, m.
    pub position_t_m: Vec3<Tangent>,
    /// 1 sigma, m.
    pub position_sd_m: [f64; 3],
    /// Velocity, tangent frame, m/s.
    pub velocity_t_mps: Vec3<Tangent>,
    /// 1 sigma, m/s.
    pub velocity_sd_mps: [f64; 3],
}

/// A position alone: a receiver that gives no velocity, or an acoustic fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Position, tangent frame, m.
    pub position_t_m: Vec3<Tangent>,
    /// 1 sigma, m.
    pub position_sd_m: [f64; 3],
}

/// A velocity that an instrument solved itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocitySample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Velocity over ground, platform frame, m/s.
    pub velocity_p_mps: Vec3<Platform>,
    /// Its covariance, (m/s)².
    pub cov_m2ps2: Matrix3<f64>,
}

/// A yaw reading alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadingSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// 1 sigma, rad.
    pub sd_rad: f64,
}

/// Anything that arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// Inertial reading.
    Imu(ImuSample),
    /// Ping.
    Beams(BeamSample),
    /// Velocity.
    Velocity(VelocitySample),
    /// Depth.
    Depth(DepthSample),
    /// Attitude.
    Attitude(AttitudeSample),
    /// Heading.
    Heading(HeadingSample),
    /// GPS position and velocity.
    Gps(GpsSample),
    /// GPS position without velocity.
    Position(PositionSample),
}

impl Event {
    /// Time of validity, ns.
    #[must_use]
    pub fn time_ns(&self) -> i64 {
        match self {
            Self::Imu(sample) => sample.time_ns,
            Self::Beams(sample) => sample.time_ns,
            Self::Velocity(sample) => sample.time_ns,
            Self::Depth(sample) => sample.time_ns,
            Self::Attitude(sample) => sample.time_ns,
            Self::Heading(sample) => sample.time_ns,
            Self::Gps(sample) => sample.time_ns,
            Self::Position(sample) => sample.time_ns,
        }
    }

    /// Name and number of the stream that the event belongs to.
    pub(crate) fn stream(&self) -> (&'static str, usize) {
        let index = match self {
            Self::Imu(_) => 0,
            Self::Beams(_) => 1,
            Self::Velocity(_) => 2,
            Self::Depth(_) => 3,
            Self::Attitude(_) => 4,
            Self::Heading(_) => 5,
            Self::Gps(_) | Self::Position(_) => 6,
        };
        (STREAM_NAMES[index], index)
    }

    /// Checks the numbers of the event.
    pub(crate) fn validate(&self, geometry: &BeamGeometry) -> Result<(), NavError> {
        let time = self.time_ns();
        match self {
            Self::Imu(sample) => sample.validate(),
            Self::Beams(sample) => sample.validate(geometry),
            Self::Velocity(sample) => {
                require_finite("velocity_p_mps", time, &sample.velocity_p_mps.to_array())?;
                require_finite("velocity cov_m2ps2", time, sample.cov_m2ps2.as_slice())?;
                let definite = sample.cov_m2ps2.cholesky().is_some();
                let not = NavError::NotPositiveDefinite {
                    matrix: "velocity cov_m2ps2",
                    time_ns: time,
                };
                if definite { Ok(()) } else { Err(not) }
            }
            Self::Depth(sample) => {
                require_finite("depth_m", time, &[sample.depth_m])?;
                require_positive("depth sd_m", sample.sd_m)
            }
            Self::Attitude(sample) => {
                require_finite("attitude_t_p", time, &sample.attitude_t_p.to_quaternion_wxyz())?;
                require_positive("attitude roll_pitch_sd_rad", sample.roll_pitch_sd_rad)?;
                require_positive("attitude yaw_sd_rad", sample.yaw_sd_rad)
            }
            Self::Heading(sample) => {
                require_finite("yaw_rad", time, &[sample.yaw_rad])?;
                require_positive("heading sd_rad", sample.sd_rad)
            }
            Self::Gps(sample) => {
                require_finite("gps position_t_m", time, &sample.position_t_m.to_array())?;
                require_finite("gps velocity_t_mps", time, &sample.velocity_t_mps.to_array())?;
                let mut sds = sample.position_sd_m.iter().chain(&sample.velocity_sd_mps);
                sds.try_for_each(|&sd| require_positive("gps sd", sd))
            }
            Self::Position(sample) => {
                require_finite("gps position_t_m", time, &sample.position_t_m.to_array())?;
                sample
                    .position_sd_m
                    .iter()
                    .try_for_each(|&sd| require_positive("gps sd", sd))
            }
        }
    }
}
