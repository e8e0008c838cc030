//! The beams that the water returns: the velocity relative to the water in the cell of each.

use nalgebra::{Matrix3, Vector3};

use crate::aiding::water_track::WaterTrackModel;
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamMotion, BeamSample, MAX_BEAMS};
use crate::earth::LocalLevel;
use crate::random::Normals;

/// The random streams of the beams, apart from those of the bottom's.
#[derive(Debug)]
pub(super) struct Water {
    pub(super) noise: Vec<Normals>,
    pub(super) outliers: Vec<Normals>,
    pub(super) loss: Vec<Normals>,
}

/// The water around the vehicle, and how the platform lies in it.
#[derive(Debug)]
pub(super) struct WaterAround {
    pub(super) level: LocalLevel,
    pub(super) rotation_t_p: Matrix3<f64>,
    /// Current at depth 0, north and east, m/s.
    pub(super) current_n_mps: [f64; 2],
    /// Its change with depth, 1/s.
    pub(super) shear_n_ps: [f64; 2],
}

impl WaterAround {
    /// The current at a point of the platform frame, m, in that frame, m/s.
    fn current_p_mps(&self, point_p_m: &Vector3<f64>) -> Vector3<f64> {
        let depth_m = self.level.depth_m + self.level.down_t().dot(&(self.rotation_t_p * point_p_m));
        let [north, east] = [0, 1].map(|axis| self.current_n_mps[axis] + self.shear_n_ps[axis] * depth_m);
        let current_t = self.level.rotation_t_n * Vector3::new(north, east, 0.0);
        self.rotation_t_p.tr_mul(&current_t)
    }
}

impl Water {
    /// y = (1 + SF) bᵀ (1 − wake) (v − Rᵀ c) + bᵀ (ω × l) + bias + n, with c at the depth of the cell of each beam.
    ///
    /// `motion` is that over ground; time and standard deviation of the sample are left to the caller.
    pub(super) fn ping(
        &mut self,
        geometry: &BeamGeometry,
        motion: &BeamMotion,
        water: &WaterAround,
        errors: &WaterTrackModel,
        bias_mps: &[f64; MAX_BEAMS],
    ) -> BeamSample {
        let mut velocity_mps = [f64::NAN; MAX_BEAMS];
        let mut is_lost = [false; MAX_BEAMS];
        for beam in 0..geometry.beams() {
            let cell_p_m = geometry.lever_arm_p_m(beam) + geometry.direction_p(beam) * errors.range_m;
            let relative_p_mps = motion.velocity_p_mps - water.current_p_mps(&cell_p_m);
            let through_water = BeamMotion {
                velocity_p_mps: relative_p_mps * (1.0 - errors.wake.0),
                ..*motion
            };
            is_lost[beam] = self.loss[beam].uniform() < errors.lost_fraction.0;
            let is_outlier = self.outliers[beam].uniform() < errors.outlier_fraction.0;
            let factor = if is_outlier { errors.outlier_factor } else { 1.0 };
            let error = factor * errors.beam_noise_sd_mps * self.noise[beam].one();
            let reading = geometry.beam_velocity_mps(beam, &through_water) + bias_mps[beam] + error;
            velocity_mps[beam] = reading * geometry.sound_speed_scale();
        }
        BeamSample {
            time_ns: 0,
            velocity_mps,
            sd_mps: [errors.beam_noise_sd_mps; MAX_BEAMS],
            valid: (0..geometry.beams())
                .filter(|&beam| !is_lost[beam])
                .collect::<BeamMask>(),
        }
    }
}
