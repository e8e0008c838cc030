//! Beam directions, lever arms and the beam model (Eqs. 12–16) for 1 to [`MAX_BEAMS`] beams.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::Vector3;

pub use super::beam_mask::BeamMask;
use super::velocity::Rows;
use crate::error::{LARGEST, NavError, require_finite, require_magnitude, require_positive};
use crate::frames::{Dvl, Platform, Rot, Vec3};
use crate::layout::BIASED_BEAMS;
pub use crate::layout::MAX_BEAMS;
use crate::saved::Kind;

/// What [`NavError::BadBeam`] expects of a beam number.
pub(crate) const BEAM_EXISTS: &str = "a beam of the geometry";

/// Speed along a beam, m/s, that no DVL measures and no vehicle under water reaches.
pub const MAX_BEAM_SPEED_MPS: f64 = 50.0;
/// Greatest 1 sigma of a beam, m/s: it then says nothing of the vehicle.
const MAX_BEAM_SD_MPS: f64 = 10.0;
/// What is expected of a speed along a beam.
pub(crate) const SLOW_ENOUGH: &str = "less than 50 m/s: is it in mm/s or cm/s, or a code for a lost beam?";

/// Azimuths of the four beams of a Janus configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Janus {
    /// Azimuths 45°, 135°, 225°, 315° (Eq. 14).
    X,
    /// Azimuths 0°, 90°, 180°, 270°.
    Plus,
}

/// Beam directions and lever arms, resolved in the platform frame.
///
/// ```
/// use bottomlock::dvl::geometry::{BeamGeometry, Janus};
/// let geometry = BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap();
/// assert_eq!(geometry.beams(), 4);
/// // Beam 1 points forward, right and down.
/// assert!(geometry.direction_p(0).iter().all(|&c| c > 0.0));
/// ```
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BeamGeometry {
    directions_p: Vec<Vector3<f64>>,
    lever_arms_p_m: Vec<Vector3<f64>>,
    sound_speed_scale: f64,
}

const GEOMETRY: Kind = Kind {
    mark: *b"BLGEO\r\n\x1a",
    name: "beam geometry",
};

impl BeamGeometry {
    /// A geometry from unit vectors in the DVL frame.
    ///
    /// # Errors
    /// [`NavError::WrongCount`] for 0 or more than [`MAX_BEAMS`] beams, [`NavError::NotUnit`] for a vector whose length
    /// is not 1.
    pub fn from_directions(directions_d: &[Vec3<Dvl>]) -> Result<Self, NavError> {
        if directions_d.is_empty() || directions_d.len() > MAX_BEAMS {
            return Err(NavError::WrongCount {
                field: "beams",
                got: directions_d.len(),
                expected: format!("1 to {MAX_BEAMS}"),
            });
        }
        for (index, direction) in directions_d.iter().enumerate() {
            let norm = direction.0.norm();
            if !((norm - 1.0).abs() <= 1e-6) {
                return Err(NavError::NotUnit { beam: index + 1, norm });
            }
        }
        Ok(Self {
            directions_p: directions_d.iter().map(|direction| direction.0.normalize()).collect(),
            lever_arms_p_m: vec![Vector3::zeros(); directions_d.len()],
            sound_speed_scale: 1.0,
        })
    }

    /// A geometry from the tilt of each beam from the vertical and its azimuth from the bow, rad (Eq. 13; erratum E9:
    /// the angle is a tilt).
    ///
    /// # Errors
    /// As [`BeamGeometry::from_directions`]; [`NavError::NotFinite`] for an angle that is not finite;
    /// [`NavError::OutOfRange`] for a tilt of 90° or more, or an azimuth of more than a turn.
    pub fn from_angles(tilts_rad: &[f64], azimuths_rad: &[f64]) -> Result<Self, NavError> {
        if tilts_rad.len() != azimuths_rad.len() {
            return Err(NavError::WrongCount {
                field: "azimuths_rad",
                got: azimuths_rad.len(),
                expected: format!("{} as for the tilts", tilts_rad.len()),
            });
        }
        require_finite("tilts_rad", 0, tilts_rad)?;
        require_finite("azimuths_rad", 0, azimuths_rad)?;
        require_magnitude("tilt_rad", tilts_rad, FRAC_PI_2, "less than pi/2: is it in degrees?")?;
        require_magnitude("azimuth_rad", azimuths_rad, TAU, "-2 pi to 2 pi: is it in degrees?")?;
        let directions: Vec<_> = tilts_rad
            .iter()
            .zip(azimuths_rad)
            .map(|(tilt, azimuth)| Vec3::new(azimuth.cos() * tilt.sin(), azimuth.sin() * tilt.sin(), tilt.cos()))
            .collect();
        Self::from_directions(&directions)
    }

    /// A Janus geometry: four beams of equal tilt, rad (Eqs. 13 and 14).
    ///
    /// # Errors
    /// As [`BeamGeometry::from_angles`].
    pub fn janus(layout: Janus, tilt_rad: f64) -> Result<Self, NavError> {
        let first = match layout {
            Janus::X => std::f64::consts::FRAC_PI_4,
            Janus::Plus => 0.0,
        };
        let azimuths = [0.0, 1.0, 2.0, 3.0].map(|quarter| first + quarter * std::f64::consts::FRAC_PI_2);
        Self::from_angles(&[tilt_rad; 4], &azimuths)
    }

    /// Rotates the beam directions from the DVL frame to the platform frame.
    #[must_use]
    pub fn mounted(mut self, mounting: Rot<Platform, Dvl>) -> Self {
        for direction in &mut self.directions_p {
            *direction = (mounting * Vec3::<Dvl>::from(*direction)).0;
        }
        self
    }

    /// Rotates the beam directions once more, within the platform frame; the lever arms stay.
    #[must_use]
    pub(crate) fn turned(mut self, by: Rot<Platform, Platform>) -> Self {
        for direction in &mut self.directions_p {
            *direction = (by * Vec3::<Platform>::from(*direction)).0;
        }
        self
    }

    /// Mounts the beams by roll, pitch and yaw (z-y-x), rad, from the DVL frame to the platform frame.
    ///
    /// # Errors
    /// [`NavError::Setting`], which calls the angles `name`, for one beyond a turn.
    pub fn mounted_by(self, name: &str, [roll, pitch, yaw]: [f64; 3]) -> Result<Self, NavError> {
        match [roll, pitch, yaw].into_iter().find(|angle| !(angle.abs() <= TAU)) {
            None => Ok(self.mounted(Rot::from_euler_rad(roll, pitch, yaw))),
            Some(angle) => Err(NavError::setting(
                name,
                format!("has {angle}"),
                "three angles of -2 pi to 2 pi: is it in degrees?",
            )),
        }
    }

    /// Sets the lever arm of each transducer, platform frame, m.
    ///
    /// # Errors
    /// [`NavError::WrongCount`] unless there is one per beam; [`NavError::NotFinite`].
    pub fn with_lever_arms(mut self, lever_arms_p_m: &[Vec3<Platform>]) -> Result<Self, NavError> {
        if lever_arms_p_m.len() != self.beams() {
            return Err(NavError::WrongCount {
                field: "lever_arms_p_m",
                got: lever_arms_p_m.len(),
                expected: format!("{}, one for each beam", self.beams()),
            });
        }
        for lever_arm in lever_arms_p_m {
            require_finite("lever_arms_p_m", 0, &lever_arm.to_array())?;
        }
        self.lever_arms_p_m = lever_arms_p_m.iter().map(|lever_arm| lever_arm.0).collect();
        Ok(self)
    }

    /// Sets the ratio of assumed to true sound speed, which multiplies every reading (Eq. 12).
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] unless positive and finite.
    pub fn with_sound_speed_scale(mut self, sound_speed_scale: f64) -> Result<Self, NavError> {
        require_positive("sound_speed_scale", sound_speed_scale)?;
        self.sound_speed_scale = sound_speed_scale;
        Ok(self)
    }

    /// The geometry as bytes.
    ///
    /// # Errors
    /// As `Kind::seal`.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NavError> {
        GEOMETRY.seal(self)
    }

    /// A geometry from bytes.
    ///
    /// # Errors
    /// [`NavError::NotRestored`] for bytes that are damaged, cut short, of another format or no geometry.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, NavError> {
        let geometry: Self = GEOMETRY.open(bytes)?;
        geometry.validate()?;
        Ok(geometry)
    }

    /// Checks the directions, the lever arms and the scale.
    ///
    /// # Errors
    /// As [`BeamGeometry::from_directions`], [`BeamGeometry::with_lever_arms`] and
    /// [`BeamGeometry::with_sound_speed_scale`].
    pub(crate) fn validate(&self) -> Result<(), NavError> {
        let directions: Vec<_> = self
            .directions_p
            .iter()
            .map(|&direction| Vec3::from(direction))
            .collect();
        let levers: Vec<_> = self.lever_arms_p_m.iter().map(|&lever| Vec3::from(lever)).collect();
        Self::from_directions(&directions)?
            .with_lever_arms(&levers)?
            .with_sound_speed_scale(self.sound_speed_scale)
            .map(|_| ())
    }

    /// Number of beams.
    #[must_use]
    pub fn beams(&self) -> usize {
        self.directions_p.len()
    }
    /// Number of independent directions: 3 if all beams together determine a velocity.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank_of(BeamMask::all(self.beams()))
    }
    /// Number of independent directions among the beams of a mask.
    #[must_use]
    pub fn rank_of(&self, valid: BeamMask) -> usize {
        let mut rows = Rows::empty();
        for (beam, direction) in self.directions_p.iter().enumerate() {
            if valid.contains(beam) {
                rows.put(beam, *direction, 1.0);
            }
        }
        rows.null_space().0
    }
    /// Direction of a beam (counted from 0), unit vector, platform frame.
    #[must_use]
    pub fn direction_p(&self, beam: usize) -> &Vector3<f64> {
        &self.directions_p[beam]
    }
    /// Lever arm of a transducer (beam counted from 0), platform frame, m.
    #[must_use]
    pub fn lever_arm_p_m(&self, beam: usize) -> &Vector3<f64> {
        &self.lever_arms_p_m[beam]
    }
    /// Ratio of the assumed to the true sound speed.
    #[must_use]
    pub fn sound_speed_scale(&self) -> f64 {
        self.sound_speed_scale
    }

    /// Noise-free reading of beam `beam`, m/s, before the sound-speed scale (Eq. 15, as a dot product: erratum E6).
    #[must_use]
    pub fn beam_velocity_mps(&self, beam: usize, motion: &BeamMotion) -> f64 {
        let point = motion.velocity_p_mps * (1.0 + motion.scale_factor)
            + motion.omega_tp_p_radps.cross(&self.lever_arms_p_m[beam]);
        let bias = if beam < BIASED_BEAMS {
            motion.beam_bias_mps[beam]
        } else {
            0.0
        };
        self.directions_p[beam].dot(&point) + bias
    }
}

impl Janus {
    /// The configuration of a name.
    ///
    /// # Errors
    /// [`NavError::Setting`] of `key`.
    pub fn named(key: &str, name: &str) -> Result<Self, NavError> {
        match name {
            "x" => Ok(Self::X),
            "+" => Ok(Self::Plus),
            other => Err(NavError::setting(key, format!("is '{other}'"), "'x' or '+'")),
        }
    }
}

impl BeamGeometry {
    /// Noise-free readings of a motion, with the sound-speed scale; `bias_mps` is that of each beam.
    ///
    /// # Errors
    /// As [`BeamMotion::validate`].
    pub fn readings_mps(&self, motion: &BeamMotion, bias_mps: &[f64]) -> Result<Vec<f64>, NavError> {
        motion.validate()?;
        let biased = bias_mps.iter().enumerate();
        let readings = biased.map(|(beam, bias)| self.beam_velocity_mps(beam, motion) + bias);
        Ok(readings.map(|reading| reading * self.sound_speed_scale).collect())
    }
}

/// Quantities that a beam reading depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamMotion {
    /// Velocity over ground, platform frame, m/s.
    pub velocity_p_mps: Vector3<f64>,
    /// Angular rate ω_tp, platform frame, rad/s.
    pub omega_tp_p_radps: Vector3<f64>,
    /// Bias of each of the first four beams, m/s; further beams have none.
    pub beam_bias_mps: [f64; BIASED_BEAMS],
    /// Scale factor error.
    pub scale_factor: f64,
}

impl BeamMotion {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::NotFinite`] or [`NavError::TooLarge`], which names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        require_finite("velocity_p_mps", 0, self.velocity_p_mps.as_slice())?;
        require_finite("omega_tp_p_radps", 0, self.omega_tp_p_radps.as_slice())?;
        require_finite("beam_bias_mps", 0, &self.beam_bias_mps)?;
        require_finite("scale_factor", 0, &[self.scale_factor])
    }
}

/// The beam velocities of one ping.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BeamSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Beam velocities, m/s; entries of invalid beams are ignored and may be NaN.
    pub velocity_mps: [f64; MAX_BEAMS],
    /// Standard deviation of each beam, m/s.
    pub sd_mps: [f64; MAX_BEAMS],
    /// Beams with a valid velocity.
    pub valid: BeamMask,
}

impl BeamSample {
    /// A ping from the readings of each beam, at most [`MAX_BEAMS`]; the others are not valid.
    #[must_use]
    pub fn new(time_ns: i64, velocity_mps: &[f64], sd_mps: &[f64], valid: BeamMask) -> Self {
        let padded = |values: &[f64]| std::array::from_fn(|beam| values.get(beam).copied().unwrap_or(f64::NAN));
        Self {
            time_ns,
            velocity_mps: padded(velocity_mps),
            sd_mps: padded(sd_mps),
            valid,
        }
    }

    /// Checks that every valid beam exists and carries a finite velocity and a positive standard deviation.
    ///
    /// # Errors
    /// [`NavError::BadBeam`], which names the beam and the time.
    pub fn validate(&self, geometry: &BeamGeometry) -> Result<(), NavError> {
        for beam in self.valid.iter() {
            let bad = |field, value, expected| NavError::BadBeam {
                beam: beam + 1,
                time_ns: self.time_ns,
                field,
                value,
                expected,
            };
            if beam >= geometry.beams() {
                return Err(bad("number", (beam + 1) as f64, BEAM_EXISTS));
            }
            if !(self.velocity_mps[beam].abs() < LARGEST) {
                let expected = "a finite number: flag a lost beam invalid";
                return Err(bad("velocity", self.velocity_mps[beam], expected));
            }
            if self.velocity_mps[beam].abs() > MAX_BEAM_SPEED_MPS {
                return Err(bad("velocity", self.velocity_mps[beam], SLOW_ENOUGH));
            }
            if !(self.sd_mps[beam] > 0.0 && self.sd_mps[beam] < LARGEST) {
                return Err(bad("standard deviation", self.sd_mps[beam], "a finite number > 0"));
            }
            if self.sd_mps[beam] > MAX_BEAM_SD_MPS {
                let expected = "at most 10 m/s: is it in mm/s? Flag a beam that says nothing invalid";
                return Err(bad("standard deviation", self.sd_mps[beam], expected));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "geometry_tests.rs"]
mod tests;
