//! Beam geometries.

use std::ffi::c_char;
use std::ptr;

use bottomlock::dvl::geometry::{BeamGeometry, Janus};
use bottomlock::frames::{Platform, Vec3};
use bottomlock::presets::GEOMETRIES;
use serde::{Deserialize, Serialize};

use crate::calls::{Failure, Outcome, Status, call, free};
use crate::names::{c_name, named};
use crate::pointers::{at, put, text};
use crate::settings::Settings;

/// Directions and places of the beams of a DVL, 1 to 8 beams; nothing changes them.
#[derive(Debug, Clone)]
pub struct Geometry(pub(crate) BeamGeometry);

/// What an object of JSON says of the beams.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Beams {
    preset: Option<String>,
    configuration: Option<String>,
    tilt_rad: Option<f64>,
    tilts_rad: Option<Vec<f64>>,
    azimuths_rad: Option<Vec<f64>>,
    directions_d: Option<Vec<[f64; 3]>>,
    roll_pitch_yaw_rad: Option<[f64; 3]>,
    lever_arms_p_m: Option<Vec<[f64; 3]>>,
    sound_speed_scale: Option<f64>,
}

impl Settings for Beams {
    const NAME: &'static str = "geometry";
}

/// Vectors of a frame.
fn vectors<F>(rows: &[[f64; 3]]) -> Vec<Vec3<F>> {
    rows.iter().copied().map(Vec3::from_array).collect()
}

impl Beams {
    /// The beams in the frame of the DVL.
    fn directions(&self) -> Outcome<BeamGeometry> {
        let configuration = self.configuration.as_deref();
        let angles = (configuration, self.tilt_rad, &self.tilts_rad, &self.azimuths_rad);
        match (&self.preset, angles, &self.directions_d) {
            (Some(name), (None, None, None, None), None) => {
                let preset = named("geometry", name, &GEOMETRIES, |preset| preset.0)?;
                Ok(preset.geometry()?)
            }
            (None, (Some(configuration), Some(tilt_rad), None, None), None) => {
                let layout = Janus::named("configuration", configuration);
                let layout = layout.map_err(|error| Failure::from(error).about("geometry.configuration"))?;
                Ok(BeamGeometry::janus(layout, tilt_rad)?)
            }
            (None, (None, None, Some(tilts), Some(azimuths)), None) => Ok(BeamGeometry::from_angles(tilts, azimuths)?),
            (None, (None, None, None, None), Some(rows)) => Ok(BeamGeometry::from_directions(&vectors(rows))?),
            _ => Err(Failure::invalid(
                "the beams of the geometry are expected once, as 'preset', 'configuration' with 'tilt_rad', 'tilts_rad' with \
                 'azimuths_rad', or 'directions_d'",
            )
            .about("geometry")),
        }
    }

    fn geometry(&self) -> Outcome<Geometry> {
        let mut made = self.directions()?;
        if let Some(angles) = self.roll_pitch_yaw_rad {
            made = made
                .mounted_by("roll_pitch_yaw_rad", angles)
                .map_err(|error| Failure::from(error).about("geometry.roll_pitch_yaw_rad"))?;
        }
        if let Some(rows) = &self.lever_arms_p_m {
            made = made
                .with_lever_arms(&vectors::<Platform>(rows))
                .map_err(|error| Failure::timeless(&error))?;
        }
        if let Some(scale) = self.sound_speed_scale {
            made = made.with_sound_speed_scale(scale)?;
        }
        Ok(Geometry(made))
    }
}

impl Geometry {
    pub(crate) fn from_json(text: &str) -> Outcome<Self> {
        Beams::from_json(text)?.geometry()
    }
}

/// A geometry from an object of JSON with its beams in one of four ways: "preset", a packaged name such as "waterlinked_a50"
/// (`bl_geometry_preset_name` lists them); "configuration" with "tilt_rad", four beams of equal tilt from the vertical, "x" at
/// azimuths 45, 135, 225, 315 deg, "+" at 0, 90, 180, 270 deg; "tilts_rad" and "azimuths_rad", from the vertical, and from the bow
/// towards starboard; or "directions_d", unit vectors from the transducer, DVL frame. Further keys: "roll_pitch_yaw_rad" (z-y-x) of
/// the mounting, from the DVL frame to the platform frame; "lever_arms_p_m", the place of each transducer, platform frame;
/// "sound_speed_scale", the ratio of the assumed to the true speed of sound. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_from_json(json: *const c_char) -> Option<Box<Geometry>> {
    call!(made, Geometry::from_json(text("json", json)?))
}

/// Name of a packaged geometry by its number from 0, NULL beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn bl_geometry_preset_name(number: usize) -> *const c_char {
    GEOMETRIES.get(number).map_or(ptr::null(), |preset| c_name(preset.0))
}

/// Number of beams; 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_beams(geometry: *const Geometry) -> usize {
    call!(count, Ok(at("geometry", geometry)?.0.beams()))
}

/// Unit vector of a beam, counted from 0, platform frame, mounting applied: 3 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_direction(
    geometry: *const Geometry,
    beam: usize,
    direction_p: *mut f64,
) -> Status {
    call!(status, {
        let inner = &at("geometry", geometry)?.0;
        if beam >= inner.beams() {
            let last = inner.beams() - 1;
            return Err(Failure::invalid(format!("beam is {beam}, expected 0 to {last}")));
        }
        put("direction_p", direction_p.cast(), inner.direction_p(beam).data.0)
    })
}

/// Frees a geometry; NULL is none. Navigators made with it stay.
#[unsafe(no_mangle)]
pub extern "C" fn bl_geometry_free(geometry: Option<Box<Geometry>>) {
    free(geometry);
}
