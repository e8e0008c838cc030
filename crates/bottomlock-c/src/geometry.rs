//! Beam geometries.

use std::f64::consts::TAU;
use std::ffi::c_char;
use std::ptr;

use bottomlock::dvl::geometry::{BeamGeometry, Janus};
use bottomlock::frames::{Dvl, Platform, Rot, Vec3};

use crate::calls::{Failure, Outcome, Status, free, made, status, value};
use crate::names::c_name;
use crate::pointers::{at, at_mut, fill, numbers, text, values};
use crate::presets::{GEOMETRIES, named};

/// Directions and places of the beams of a DVL, 1 to 8 beams.
#[derive(Debug, Clone)]
pub struct Geometry {
    pub(crate) inner: BeamGeometry,
}

impl From<BeamGeometry> for Geometry {
    fn from(inner: BeamGeometry) -> Self {
        Self { inner }
    }
}

/// A packaged geometry by its name, such as "waterlinked_a50"; `bl_geometry_preset_name` lists them. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_preset(name: *const c_char) -> *mut Geometry {
    made(|| {
        // SAFETY: as the header asks.
        let name = unsafe { text("name", name) }?;
        let preset = named("geometry", name, &GEOMETRIES, |one| one.name)?;
        Ok(preset.geometry()?.into())
    })
}

/// Name of a packaged geometry by its number from 0, NULL beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn bl_geometry_preset_name(number: usize) -> *const c_char {
    GEOMETRIES.get(number).map_or(ptr::null(), |preset| c_name(preset.name))
}

/// Four beams of equal tilt from the vertical, rad: "x" at azimuths 45, 135, 225, 315 deg, "+" at 0, 90, 180, 270 deg. NULL
/// for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_janus(configuration: *const c_char, tilt_rad: f64) -> *mut Geometry {
    made(|| {
        // SAFETY: as the header asks.
        let layout = match unsafe { text("configuration", configuration) }? {
            "x" => Janus::X,
            "+" => Janus::Plus,
            other => {
                return Err(Failure::invalid(format!(
                    "configuration is '{other}', expected 'x' or '+'"
                )));
            }
        };
        Ok(BeamGeometry::janus(layout, tilt_rad)?.into())
    })
}

/// Beams by tilt from the vertical and azimuth from the bow towards starboard, `beams` numbers each, rad. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_from_angles(
    beams: usize,
    tilts_rad: *const f64,
    azimuths_rad: *const f64,
) -> *mut Geometry {
    made(|| {
        // SAFETY: as the header asks.
        let (tilts, azimuths) = unsafe {
            (
                values("tilts_rad", tilts_rad, beams)?,
                values("azimuths_rad", azimuths_rad, beams)?,
            )
        };
        Ok(BeamGeometry::from_angles(tilts, azimuths)?.into())
    })
}

/// Rows of three numbers.
unsafe fn rows<'a>(name: &str, pointer: *const f64, count: usize) -> Outcome<&'a [[f64; 3]]> {
    // SAFETY: as the header asks.
    unsafe { values(name, pointer.cast::<[f64; 3]>(), count) }
}

/// Beams by unit vectors from the transducer, DVL frame, `beams` rows of 3 numbers. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_from_directions(beams: usize, directions_d: *const f64) -> *mut Geometry {
    made(|| {
        // SAFETY: as the header asks.
        let rows = unsafe { rows("directions_d", directions_d, beams) }?;
        let directions: Vec<_> = rows.iter().map(|&row| Vec3::<Dvl>::from_array(row)).collect();
        Ok(BeamGeometry::from_directions(&directions)?.into())
    })
}

/// A copy. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_copy(geometry: *const Geometry) -> *mut Geometry {
    // SAFETY: as the header asks.
    made(|| unsafe { at("geometry", geometry) }.cloned())
}

/// Turns the beams from the DVL frame to the platform frame: roll, pitch and yaw (z-y-x) of the mounting, 3 numbers, rad. To be
/// called once, before lever arms are set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_mount(geometry: *mut Geometry, roll_pitch_yaw_rad: *const f64) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let (geometry, angles) = unsafe {
            (
                at_mut("geometry", geometry)?,
                numbers::<3>("roll_pitch_yaw_rad", roll_pitch_yaw_rad)?,
            )
        };
        if let Some(angle) = angles.into_iter().find(|angle| !(angle.abs() <= TAU)) {
            return Err(Failure::invalid(format!(
                "roll_pitch_yaw_rad has {angle}, expected three angles of -2 pi to 2 pi: is it in degrees?"
            )));
        }
        let [roll, pitch, yaw] = angles;
        let mounting = Rot::<Platform, Dvl>::from_euler_rad(roll, pitch, yaw);
        geometry.inner = geometry.inner.clone().mounted(mounting);
        Ok(())
    })
}

/// Sets the place of each transducer, platform frame, `beams` rows of 3 numbers, m.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_set_lever_arms(
    geometry: *mut Geometry,
    beams: usize,
    lever_arms_p_m: *const f64,
) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let (geometry, rows) = unsafe {
            (
                at_mut("geometry", geometry)?,
                rows("lever_arms_p_m", lever_arms_p_m, beams)?,
            )
        };
        let levers: Vec<_> = rows.iter().map(|&row| Vec3::<Platform>::from_array(row)).collect();
        geometry.inner = geometry
            .inner
            .clone()
            .with_lever_arms(&levers)
            .map_err(|error| Failure::timeless(&error))?;
        Ok(())
    })
}

/// Sets the ratio of the assumed to the true speed of sound.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_set_sound_speed_scale(geometry: *mut Geometry, sound_speed_scale: f64) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let geometry = unsafe { at_mut("geometry", geometry) }?;
        geometry.inner = geometry.inner.clone().with_sound_speed_scale(sound_speed_scale)?;
        Ok(())
    })
}

/// Number of beams; 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_beams(geometry: *const Geometry) -> usize {
    // SAFETY: as the header asks.
    value(0, || Ok(unsafe { at("geometry", geometry) }?.inner.beams()))
}

/// Unit vector of a beam, counted from 0, platform frame, mounting applied: 3 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_direction(
    geometry: *const Geometry,
    beam: usize,
    direction_p: *mut f64,
) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let inner = &unsafe { at("geometry", geometry) }?.inner;
        if beam >= inner.beams() {
            let last = inner.beams() - 1;
            return Err(Failure::invalid(format!("beam is {beam}, expected 0 to {last}")));
        }
        // SAFETY: as the header asks.
        unsafe { fill("direction_p", direction_p, 3, inner.direction_p(beam).as_slice()) }
    })
}

/// Frees a geometry; NULL is none. Navigators made with it stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_geometry_free(geometry: *mut Geometry) {
    // SAFETY: as the header asks.
    unsafe { free(geometry) }
}
