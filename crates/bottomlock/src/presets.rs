//! Packaged beam geometries and grades of IMUs, in the units of their sources. The package has the same with those sources
//! (`python/bottomlock/config/geometries`, `python/bottomlock/config/grades/imu.toml`); a test holds both equal to the last bit.

use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::model::ImuModel;

/// A packaged geometry: its name, and tilts and azimuths of its beams, deg.
#[derive(Debug, Clone, Copy)]
pub struct Beams(pub &'static str, &'static [f64], &'static [f64]);

/// In the order of their names.
pub const GEOMETRIES: [Beams; 7] = [
    Beams("linkquest_navquest", &[22.0; 4], &[180.0, 90.0, 0.0, 270.0]),
    Beams("nortek_dvl1000", &[25.0; 4], &[45.0, -45.0, -135.0, 135.0]),
    Beams("sontek_argonaut", &[25.0; 3], &[0.0, 120.0, 240.0]),
    Beams("teledyne_20", &[20.0; 4], &[270.0, 90.0, 0.0, 180.0]),
    Beams("teledyne_30", &[30.0; 4], &[270.0, 90.0, 0.0, 180.0]),
    Beams("waterlinked_a50", &[22.5; 4], &[135.0, -135.0, -45.0, 45.0]),
    Beams("x_janus_20", &[20.0; 4], &[45.0, 135.0, 225.0, 315.0]),
];

impl Beams {
    /// The beams in the frame of the DVL.
    ///
    /// # Errors
    /// As [`BeamGeometry::from_angles`].
    pub fn geometry(&self) -> Result<BeamGeometry, NavError> {
        let radians = |degrees: &[f64]| degrees.iter().map(|angle| angle.to_radians()).collect::<Vec<_>>();
        BeamGeometry::from_angles(&radians(self.1), &radians(self.2))
    }
}

/// A grade of IMUs, 1 sigma per axis: its name, and of gyro and accelerometer, in the order and units of the file, bias (deg/h; mg),
/// noise (deg/√h; m/s/√h) and bias walk (deg/s/√s; m/s²/√s); then of the gyros scale factor (ppm), misalignment (mrad) and
/// g-sensitivity (deg/h/g), of the accelerometers scale factor (ppm); then warm-up of both (mg; deg/h).
#[derive(Debug, Clone, Copy)]
pub struct Grade(pub &'static str, [f64; 3], [f64; 3], [f64; 6]);

/// The coarsest first.
pub const GRADES: [Grade; 6] = [
    Grade(
        "phone",
        [10800.0, 0.48, 5e-4],
        [40.0, 0.094, 1.6e-4],
        [10000.0, 7.0, 360.0, 13000.0, 0.0, 0.0],
    ),
    Grade(
        "autopilot",
        [1800.0, 0.66, 9.5e-5],
        [20.0, 0.11, 5.8e-5],
        [3300.0, 0.9, 54.0, 3300.0, 0.0, 0.0],
    ),
    Grade(
        "mti",
        [3600.0, 3.0, 6.5e-5],
        [2.0, 0.12, 3.5e-6],
        [1000.0, 1.7, 10.8, 300.0, 0.0, 0.0],
    ),
    Grade(
        "tactical",
        [4.0, 0.15, 3.3e-6],
        [0.75, 0.07, 1.2e-5],
        [500.0, 1.0, 10.0, 200.0, 0.2, 1.0],
    ),
    Grade(
        "fibre_optic",
        [0.75, 0.1, 4.9e-6],
        [1.0, 0.03, 2.3e-5],
        [300.0, 0.1, 0.0, 300.0, 0.0, 0.0],
    ),
    Grade(
        "ring_laser",
        [0.01, 0.002, 6.5e-9],
        [0.1, 0.012, 2.3e-6],
        [5.0, 0.02, 0.0, 100.0, 0.0, 0.0],
    ),
];

impl Grade {
    /// The model of its errors, SI.
    #[must_use]
    pub fn imu(&self) -> ImuModel {
        const STANDARD_GRAVITY_MPS2: f64 = 9.806_65;
        let Self(_, gyro, accel, others) = self;
        let [
            scale_ppm,
            misalignment_mrad,
            by_force,
            accel_scale_ppm,
            accel_warm_up,
            gyro_warm_up,
        ] = others;
        let root_hour = 3600_f64.sqrt();
        ImuModel {
            accel_noise_mps_rts: accel[1] / root_hour,
            gyro_noise_rad_rts: (gyro[1] / root_hour).to_radians(),
            accel_bias_sd_mps2: accel[0] * 1e-3 * STANDARD_GRAVITY_MPS2,
            gyro_bias_sd_radps: gyro[0].to_radians() / 3600.0,
            accel_bias_walk_mps2_rts: accel[2],
            gyro_bias_walk_radps_rts: gyro[2].to_radians(),
            gyro_scale_sd: scale_ppm * 1e-6,
            gyro_misalignment_sd_rad: misalignment_mrad * 1e-3,
            gyro_g_sensitivity_sd_radps_per_mps2: by_force.to_radians() / 3600.0 / STANDARD_GRAVITY_MPS2,
            accel_scale_sd: accel_scale_ppm * 1e-6,
            accel_warm_up_sd_mps2: accel_warm_up * 1e-3 * STANDARD_GRAVITY_MPS2,
            gyro_warm_up_sd_radps: gyro_warm_up.to_radians() / 3600.0,
            ..ImuModel::default()
        }
    }
}
