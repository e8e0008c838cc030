//! Packaged beam geometries and grades of IMUs, in the units of their sources. The package has the same with those sources
//! (`python/bottomlock/config/geometries`, `python/bottomlock/config/grades/imu.toml`); a test holds both equal to the last bit.

use bottomlock::NavError;
use bottomlock::dvl::geometry::BeamGeometry;
use bottomlock::model::ImuModel;

use crate::calls::{Failure, Outcome, Status};
use crate::names::hint;

/// A packaged geometry: its name, and tilts and azimuths of its beams, deg.
pub(crate) struct Beams {
    pub(crate) name: &'static str,
    tilts_deg: &'static [f64],
    azimuths_deg: &'static [f64],
}

const fn beams(name: &'static str, tilts_deg: &'static [f64], azimuths_deg: &'static [f64]) -> Beams {
    Beams {
        name,
        tilts_deg,
        azimuths_deg,
    }
}

/// In the order of their names.
pub(crate) const GEOMETRIES: [Beams; 7] = [
    beams("linkquest_navquest", &[22.0; 4], &[180.0, 90.0, 0.0, 270.0]),
    beams("nortek_dvl1000", &[25.0; 4], &[45.0, -45.0, -135.0, 135.0]),
    beams("sontek_argonaut", &[25.0; 3], &[0.0, 120.0, 240.0]),
    beams("teledyne_20", &[20.0; 4], &[270.0, 90.0, 0.0, 180.0]),
    beams("teledyne_30", &[30.0; 4], &[270.0, 90.0, 0.0, 180.0]),
    beams("waterlinked_a50", &[22.5; 4], &[135.0, -135.0, -45.0, 45.0]),
    beams("x_janus_20", &[20.0; 4], &[45.0, 135.0, 225.0, 315.0]),
];

impl Beams {
    pub(crate) fn geometry(&self) -> Result<BeamGeometry, NavError> {
        let radians = |degrees: &[f64]| degrees.iter().map(|angle| angle.to_radians()).collect::<Vec<_>>();
        BeamGeometry::from_angles(&radians(self.tilts_deg), &radians(self.azimuths_deg))
    }
}

/// A grade of IMUs, 1 sigma per axis.
pub(crate) struct Grade {
    pub(crate) name: &'static str,
    gyro_bias_deg_per_h: f64,
    gyro_noise_deg_per_rt_h: f64,
    gyro_bias_walk_deg_per_s_per_rt_s: f64,
    accel_bias_mg: f64,
    accel_noise_mps_per_rt_h: f64,
    accel_bias_walk_mps2_per_rt_s: f64,
}

/// In the order of the keys of the file: gyro bias, noise and bias walk, then those of the accelerometer.
const fn grade(name: &'static str, gyro: [f64; 3], accel: [f64; 3]) -> Grade {
    Grade {
        name,
        gyro_bias_deg_per_h: gyro[0],
        gyro_noise_deg_per_rt_h: gyro[1],
        gyro_bias_walk_deg_per_s_per_rt_s: gyro[2],
        accel_bias_mg: accel[0],
        accel_noise_mps_per_rt_h: accel[1],
        accel_bias_walk_mps2_per_rt_s: accel[2],
    }
}

/// The coarsest first.
pub(crate) const GRADES: [Grade; 6] = [
    grade("phone", [10800.0, 0.48, 5e-4], [40.0, 0.094, 1.6e-4]),
    grade("autopilot", [1800.0, 0.66, 9.5e-5], [20.0, 0.11, 5.8e-5]),
    grade("mti", [3600.0, 3.0, 6.5e-5], [2.0, 0.12, 3.5e-6]),
    grade("tactical", [4.0, 0.15, 3.3e-6], [0.75, 0.07, 1.2e-5]),
    grade("fibre_optic", [0.75, 0.1, 4.9e-6], [1.0, 0.03, 2.3e-5]),
    grade("ring_laser", [0.01, 0.002, 6.5e-9], [0.1, 0.012, 2.3e-6]),
];

impl Grade {
    pub(crate) fn imu(&self) -> ImuModel {
        const STANDARD_GRAVITY_MPS2: f64 = 9.806_65;
        let root_hour = 3600_f64.sqrt();
        ImuModel {
            accel_noise_mps_rts: self.accel_noise_mps_per_rt_h / root_hour,
            gyro_noise_rad_rts: (self.gyro_noise_deg_per_rt_h / root_hour).to_radians(),
            accel_bias_sd_mps2: self.accel_bias_mg * 1e-3 * STANDARD_GRAVITY_MPS2,
            gyro_bias_sd_radps: self.gyro_bias_deg_per_h.to_radians() / 3600.0,
            accel_bias_walk_mps2_rts: self.accel_bias_walk_mps2_per_rt_s,
            gyro_bias_walk_radps_rts: self.gyro_bias_walk_deg_per_s_per_rt_s.to_radians(),
        }
    }
}

/// The entry of a name.
pub(crate) fn named<'a, T>(what: &str, name: &str, all: &'a [T], of: impl Fn(&T) -> &'static str) -> Outcome<&'a T> {
    all.iter().find(|one| of(one) == name).ok_or_else(|| {
        let known: Vec<_> = all.iter().map(of).collect();
        let message = format!("unknown {what} '{name}' ({})", hint(name, &known));
        Failure::new(Status::UnknownName, message).about(format!("{what}.preset"))
    })
}
