//! Each aiding sensor as an innovation: residual, Jacobian, noise (Eqs. 7, 18, 22 in the full form of erratum E7).

mod innovation;
pub mod outliers;
pub mod water;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamMotion, BeamSample};
use crate::dvl::partial::{BeamNoise, FixEstimator, Port};
use crate::dvl::velocity::{HEAVE_SLOT, SLOTS, SWAY_SLOT, VIRTUAL_SLOT};
use crate::frames::{Platform, Rot, Tangent, Vec3, skew};
use crate::layout::{ATTITUDE, BIASED_BEAMS, DIM, DVL_BIAS, DVL_SCALE, GYRO_BIAS, POSITION, VELOCITY};
use crate::state::NavState;

pub use self::innovation::{CorrelatedNoise, Innovation};

/// Largest number of rows of one measurement.
pub const MAX_ROWS: usize = 8;

/// What the information form hands to the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum InformationPort {
    /// The observable principal axes only.
    #[default]
    Axes,
    /// All three axes, the unobserved ones with a very large variance, kept factored by axis.
    Full,
}

/// Jacobian of up to [`MAX_ROWS`] rows.
pub type RowJacobian = SMatrix<f64, MAX_ROWS, DIM>;

/// The state of motion at a measurement.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// The estimate.
    pub state: &'a NavState,
    /// ω_ip less the estimated bias, platform frame, rad/s.
    pub rate_ip_p_radps: Vector3<f64>,
    /// Earth rate, tangent frame, rad/s.
    pub earth_rate_t_radps: Vector3<f64>,
    /// Variance of one gyro reading, (rad/s)².
    pub gyro_variance: f64,
}

impl Motion<'_> {
    pub(crate) fn rotation(&self) -> Matrix3<f64> {
        self.state.attitude_t_p.matrix()
    }
    /// ω_tp = ω_ip − Rᵀω_ie.
    pub(crate) fn rate_tp(&self) -> Vector3<f64> {
        self.rate_ip_p_radps - self.rotation().transpose() * self.earth_rate_t_radps
    }
    /// ∂ω_tp/∂ρ = −Rᵀ[ω_ie×]; ∂ω_tp/∂b_g = −I.
    pub(crate) fn rate_by_misalignment(&self) -> Matrix3<f64> {
        -self.rotation().transpose() * skew(&self.earth_rate_t_radps)
    }
}

/// Residual, Jacobian and noise of every valid beam, indexed by beam.
#[derive(Debug, Clone, PartialEq)]
pub struct BeamTerms {
    residual: SVector<f64, MAX_ROWS>,
    jacobian: RowJacobian,
    /// Eq. 20: sensor noise and the gyro noise that all beams share through their lever methods.
    pub noise: BeamNoise,
}

/// Expected readings, Jacobian and noise of the beams (Eqs. 15, 20, 22; erratum E7).
#[must_use]
pub fn beam_terms(motion: &Motion<'_>, geometry: &BeamGeometry, ping: &BeamSample) -> BeamTerms {
    let state = motion.state;
    let beam_motion = BeamMotion {
        velocity_p_mps: state.velocity_p_mps.0,
        rate_tp_p_radps: motion.rate_tp(),
        beam_bias_mps: state.dvl_bias_mps.into(),
        scale_factor: state.dvl_scale_factor,
    };
    let by_misalignment = motion.rate_by_misalignment();
    let scale = 1.0 / geometry.sound_speed_scale();
    let mut terms = BeamTerms {
        residual: SVector::zeros(),
        jacobian: RowJacobian::zeros(),
        noise: BeamNoise::zeros(),
    };
    let mut lever_rows = [Vector3::zeros(); MAX_ROWS];
    for beam in ping.valid.iter() {
        let direction = geometry.direction_p(beam);
        // b · (δω × l) = (l × b) · δω, with δω = −δb_g + ∂ω/∂ρ ρ; bᵀ[l×] = (b × l)ᵀ is its negative.
        let lever = geometry.lever_arm_p_m(beam).cross(direction);
        lever_rows[beam] = lever;
        terms.residual[beam] = ping.velocity_mps[beam] * scale - geometry.beam_velocity_mps(beam, &beam_motion);
        let mut row = terms.jacobian.row_mut(beam);
        for k in 0..3 {
            row[VELOCITY + k] = direction[k] * (1.0 + state.dvl_scale_factor);
            row[GYRO_BIAS + k] = -lever[k];
            row[ATTITUDE + k] = lever.dot(&by_misalignment.column(k));
        }
        if beam < BIASED_BEAMS {
            row[DVL_BIAS + beam] = 1.0;
        }
        row[DVL_SCALE] = direction.dot(&state.velocity_p_mps.0);
        terms.noise[(beam, beam)] = (ping.sd_mps[beam] * scale).powi(2);
    }
    for i in ping.valid.iter() {
        for j in ping.valid.iter() {
            terms.noise[(i, j)] += motion.gyro_variance * lever_rows[i].dot(&lever_rows[j]);
        }
    }
    terms
}

/// TC: one row per valid beam.
#[must_use]
pub fn tightly_coupled(terms: &BeamTerms, ping: &BeamSample) -> Innovation {
    let count = ping.valid.count();
    if ping.valid != BeamMask::all(count) {
        return Innovation::picked((&terms.residual, &terms.jacobian, &terms.noise), ping.valid.iter());
    }
    // Where no beam is missing before another, rows stand in their places already.
    Innovation {
        rows: count,
        degrees: count,
        residual: terms.residual,
        jacobian: terms.jacobian,
        noise: terms.noise,
        cross: None,
        correlated_noise: None,
    }
}

/// Variance of an unobserved axis where a port wants all three, (m/s)².
const UNOBSERVED_VARIANCE_M2PS2: f64 = 1e12;

/// LC and ELC: the fix of a plan against the filter's velocity, with the DVL's columns carried through the gain (erratum E7).
///
/// `exact_cross` is P_xv, the covariance of the whole state with the velocity, where the correlation of Eq. 26 is to be kept.
#[must_use]
pub fn loosely_coupled(
    state: &NavState,
    geometry: &BeamGeometry,
    terms: &BeamTerms,
    plan: &FixEstimator,
    port: InformationPort,
    exact_cross: Option<&SMatrix<f64, DIM, 3>>,
) -> Innovation {
    // Residuals are in beam units: dividing by 1 + SF makes the velocity block of a row its direction.
    let unscale = 1.0 / (1.0 + state.dvl_scale_factor);
    let mut residual = SVector::<f64, SLOTS>::zeros();
    let mut jacobian = SMatrix::<f64, SLOTS, DIM>::zeros();
    for beam in 0..MAX_ROWS {
        residual[beam] = terms.residual[beam] * unscale;
        jacobian.set_row(beam, &(terms.jacobian.row(beam) * unscale));
    }
    let mut set = |slot: usize, direction: &Vector3<f64>| {
        for k in 0..3 {
            jacobian[(slot, VELOCITY + k)] = direction[k];
        }
    };
    // A virtual beam and the virtual heave repeat the prior: their residual is zero. The sway row says that sway is zero.
    for (index, beam) in plan.virtual_beams.iter().enumerate() {
        if let Some(beam) = beam {
            set(VIRTUAL_SLOT + index, geometry.direction_p(*beam));
        }
    }
    set(SWAY_SLOT, &Vector3::y());
    set(HEAVE_SLOT, &Vector3::z());
    residual[SWAY_SLOT] = -state.velocity_p_mps.0.y;

    let z = plan.gain * residual;
    let h = plan.gain * jacobian;
    let mut innovation = Innovation::empty();
    let mut push = |axis: &Vector3<f64>, observed: bool| {
        let row = innovation.rows;
        innovation.rows += 1;
        if observed {
            innovation.degrees += 1;
            innovation.residual[row] = axis.dot(&z);
            innovation.jacobian.set_row(row, &(axis.transpose() * h));
        } else {
            for k in 0..3 {
                innovation.jacobian[(row, VELOCITY + k)] = axis[k];
            }
            innovation.noise[(row, row)] = UNOBSERVED_VARIANCE_M2PS2;
        }
    };
    match plan.port {
        Port::Components => {
            let solved: Vec<usize> = (0..3).filter(|&k| plan.is_solved(k)).collect();
            solved.iter().for_each(|&k| push(&Vector3::ith(k, 1.0), true));
            for (i, &k) in solved.iter().enumerate() {
                for (j, &l) in solved.iter().enumerate() {
                    innovation.noise[(i, j)] = plan.covariance[(k, l)];
                }
            }
            if let Some(p_xv) = exact_cross {
                // n = −J_virtual B δv: the noise of the virtual beams is minus the prior's own error.
                let mut repeated = Matrix3::zeros();
                for (index, beam) in plan.virtual_beams.iter().enumerate() {
                    if let Some(beam) = beam {
                        repeated += plan.gain.column(VIRTUAL_SLOT + index) * geometry.direction_p(*beam).transpose();
                    }
                }
                let mut cross = SMatrix::<f64, DIM, MAX_ROWS>::zeros();
                cross
                    .fixed_columns_mut::<3>(0)
                    .copy_from(&(-p_xv * repeated.transpose()));
                innovation.cross = Some(Box::new(cross));
                let mut by_state = RowJacobian::zeros();
                by_state.fixed_view_mut::<3, 3>(0, VELOCITY).copy_from(&-repeated);
                innovation.correlated_noise = Some(Box::new(CorrelatedNoise {
                    by_state,
                    by_water: SMatrix::zeros(),
                }));
            }
        }
        Port::Axes => {
            let (axes, variances) = plan.solution.principal_axes();
            let rank = plan.solution.rank;
            (0..rank).for_each(|k| push(&axes.column(k).into(), true));
            if port == InformationPort::Full {
                (0..3 - rank).for_each(|k| push(&plan.solution.null.column(k).into(), false));
            }
            for k in 0..rank {
                innovation.noise[(k, k)] = variances[k];
            }
        }
    }
    innovation
}

/// A velocity in the platform frame from an instrument that gives no beams.
#[must_use]
pub fn velocity(state: &NavState, velocity_p_mps: &Vec3<Platform>, cov_m2ps2: &Matrix3<f64>) -> Innovation {
    let scale = 1.0 + state.dvl_scale_factor;
    let mut innovation = Innovation::vector(velocity_p_mps.0 - state.velocity_p_mps.0 * scale, cov_m2ps2);
    innovation.put(VELOCITY, &(Matrix3::identity() * scale));
    innovation
        .jacobian
        .fixed_view_mut::<3, 1>(0, DVL_SCALE)
        .copy_from(&state.velocity_p_mps.0);
    innovation
}

/// Depth below the tangent plane's origin, m, of a sensor at `lever_p_m`.
#[must_use]
pub fn depth(state: &NavState, depth_m: f64, sd_m: f64, lever_p_m: &Vec3<Platform>) -> Innovation {
    let method_t = (state.attitude_t_p * *lever_p_m).0;
    let mut innovation = Innovation {
        rows: 1,
        degrees: 1,
        ..Innovation::empty()
    };
    innovation.residual[0] = depth_m - (state.position_t_m.0.z + method_t.z);
    innovation.jacobian[(0, POSITION + 2)] = 1.0;
    // (R l) turns with ρ: ρ × (R l), third component.
    innovation.jacobian[(0, ATTITUDE)] = method_t.y;
    innovation.jacobian[(0, ATTITUDE + 1)] = -method_t.x;
    innovation.noise[(0, 0)] = sd_m.powi(2);
    innovation
}

/// Attitude by Euler angles with independent errors (magnetometer and tilt sensor), as a rotation: no angle is subtracted, so the
/// vertical is no special place.
#[must_use]
pub fn attitude(
    state: &NavState,
    measured_t_p: &Rot<Tangent, Platform>,
    roll_pitch_sd_rad: f64,
    yaw_sd_rad: f64,
) -> Innovation {
    let rho = (*measured_t_p * state.attitude_t_p.inverse()).log();
    let [_, pitch, yaw] = measured_t_p.to_euler_rad();
    // Columns: the tangent-frame axes about which roll, pitch and yaw turn.
    let axes = Matrix3::new(
        yaw.cos() * pitch.cos(),
        -yaw.sin(),
        0.0,
        yaw.sin() * pitch.cos(),
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
    innovation
}

/// Yaw alone; `None` where the vehicle stands on end and yaw has no meaning.
#[must_use]
pub fn heading(state: &NavState, yaw_rad: f64, sd_rad: f64) -> Option<Innovation> {
    let [_, pitch, yaw] = state.attitude_t_p.to_euler_rad();
    if pitch.cos() < 1e-6 {
        return None;
    }
    let difference = yaw_rad - yaw;
    let mut innovation = Innovation {
        rows: 1,
        degrees: 1,
        ..Innovation::empty()
    };
    innovation.residual[0] = difference.sin().atan2(difference.cos());
    innovation.jacobian[(0, ATTITUDE)] = yaw.cos() * pitch.tan();
    innovation.jacobian[(0, ATTITUDE + 1)] = yaw.sin() * pitch.tan();
    innovation.jacobian[(0, ATTITUDE + 2)] = 1.0;
    innovation.noise[(0, 0)] = sd_rad.powi(2);
    Some(innovation)
}

/// Position in the tangent frame of an antenna at `lever_p_m`.
#[must_use]
pub fn gps_position(
    state: &NavState,
    position_t_m: &Vec3<Tangent>,
    sd_m: &[f64; 3],
    lever_p_m: &Vec3<Platform>,
) -> Innovation {
    let method_t = state.attitude_t_p * *lever_p_m;
    let noise = Matrix3::from_diagonal(&Vector3::from(sd_m.map(|sd| sd * sd)));
    let mut innovation = Innovation::vector((*position_t_m - state.position_t_m - method_t).0, &noise);
    innovation.put(POSITION, &Matrix3::identity());
    innovation.put(ATTITUDE, &-skew(&method_t.0));
    innovation
}

/// Velocity in the tangent frame of an antenna at `lever_p_m`.
#[must_use]
pub fn gps_velocity(
    motion: &Motion<'_>,
    velocity_t_mps: &Vec3<Tangent>,
    sd_mps: &[f64; 3],
    lever_p_m: &Vec3<Platform>,
) -> Innovation {
    let rotation = motion.rotation();
    let point_p = motion.state.velocity_p_mps.0 + motion.rate_tp().cross(&lever_p_m.0);
    let noise = Matrix3::from_diagonal(&Vector3::from(sd_mps.map(|sd| sd * sd)));
    let mut innovation = Innovation::vector(velocity_t_mps.0 - rotation * point_p, &noise);
    let method = rotation * skew(&lever_p_m.0);
    innovation.put(VELOCITY, &rotation);
    innovation.put(GYRO_BIAS, &method);
    innovation.put(
        ATTITUDE,
        &(-skew(&(rotation * point_p)) - method * motion.rate_by_misalignment()),
    );
    innovation
}

#[cfg(test)]
mod tests;
