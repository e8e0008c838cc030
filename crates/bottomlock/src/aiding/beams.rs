//! The beams of a DVL: residual, Jacobian and noise of each beam, and the methods' rows from them (Eqs. 15, 18–22; E7).

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::aiding::further::FurtherRows;
use crate::aiding::sensor::{Fraction, model_section};
use crate::aiding::{CorrelatedNoise, Innovation, MAX_ROWS, Motion, RowJacobian};
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamMotion, BeamSample};
use crate::dvl::partial::{BeamNoise, FixEstimator, Port};
use crate::dvl::velocity::{HEAVE_SLOT, SLOTS, SWAY_SLOT, VIRTUAL_SLOT};
use crate::layout::{ATTITUDE, BIASED_BEAMS, DIM, DVL_BIAS, DVL_SCALE, GYRO_BIAS, VELOCITY};
use crate::state::NavState;

model_section! {
    /// Errors of the DVL, 1 sigma.
    pub struct DvlModel in "dvl" {
        /// White noise of a beam, m/s.
        pub beam_noise_sd_mps: f64,
        /// What grows with the range along the beam, beside it, m/s of each m.
        #[serde(default)]
        pub beam_noise_sd_mps_per_m: f64,
        /// Bias of a beam at the start, m/s.
        pub beam_bias_sd_mps: f64,
        /// Random walk of a beam bias, m/s/√s.
        pub beam_bias_walk_mps_rts: f64,
        /// Scale factor error at the start.
        pub scale_factor_sd: f64,
        /// Random walk of the scale factor, 1/√s.
        pub scale_factor_walk_rts: f64,
    }
}

impl DvlModel {
    /// White noise of a beam that meets the bottom at a range, m/s.
    #[must_use]
    pub fn noise_sd_mps(&self, range_m: f64) -> f64 {
        self.beam_noise_sd_mps.hypot(self.beam_noise_sd_mps_per_m * range_m)
    }
}

model_section! {
    /// Outliers among simulated beams; the filter does not model them.
    pub struct DvlOutlierModel in "dvl_outliers" {
        /// Fraction of readings of a beam that are outliers.
        pub outlier_fraction: Fraction,
        /// Noise of an outlier over that of a good reading.
        pub outlier_factor: f64,
    }
}

/// Axes that the information form passes to the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InformationPort {
    /// The observable principal axes only.
    #[default]
    Axes,
    /// All three axes, the unobserved ones with a very large variance, kept factored by axis.
    Full,
}

/// Residual, Jacobian and noise of every valid beam, indexed by beam.
#[derive(Debug, Clone, PartialEq)]
pub struct BeamTerms {
    /// Reading minus expected reading, m/s.
    pub residual: SVector<f64, MAX_ROWS>,
    /// By the error states, one row per beam.
    pub jacobian: RowJacobian,
    /// Eq. 20: sensor noise and the gyro noise that all beams share through their lever arms.
    pub noise: BeamNoise,
    /// Jacobian by the further states, where there are any; what these add to the noise is left to the filter.
    pub by_further: Option<Box<FurtherRows>>,
}

/// Expected readings, Jacobian and noise of the beams (Eqs. 15, 20, 22; erratum E7).
#[must_use]
pub fn beam_terms(motion: &Motion<'_>, geometry: &BeamGeometry, ping: &BeamSample) -> BeamTerms {
    let state = motion.state;
    let beam_motion = BeamMotion {
        velocity_p_mps: state.velocity_p_mps.0,
        omega_tp_p_radps: motion.rate_tp(),
        beam_bias_mps: state.dvl_bias_mps.into(),
        scale_factor: state.dvl_scale_factor,
    };
    let by_misalignment = motion.rate_by_misalignment();
    let scale = 1.0 / geometry.sound_speed_scale();
    let mut terms = BeamTerms {
        residual: SVector::zeros(),
        jacobian: RowJacobian::zeros(),
        noise: BeamNoise::zeros(),
        by_further: None,
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
        let mut picked = Innovation::picked((&terms.residual, &terms.jacobian, &terms.noise), ping.valid.iter());
        picked.by_further = terms.by_further.as_ref().map(|rows| {
            let mut in_order = Box::new(FurtherRows::zeros());
            (ping.valid.iter().enumerate()).for_each(|(to, beam)| in_order.set_row(to, &rows.row(beam)));
            in_order
        });
        return picked;
    }
    // Where no beam is missing before another, rows stand in their places already.
    Innovation {
        rows: count,
        degrees: count,
        residual: terms.residual,
        jacobian: terms.jacobian,
        noise: terms.noise,
        by_further: terms.by_further.clone(),
        ..Innovation::empty()
    }
}

/// Variance of an unobserved axis if all three axes are passed, (m/s)².
const UNOBSERVED_VARIANCE_M2PS2: f64 = 1e12;

/// Residual and Jacobian of every row that a fix weighs, in beam units.
type SlotRows = (SVector<f64, SLOTS>, SMatrix<f64, SLOTS, DIM>);

/// LC and ELC: the velocity fix minus the filter's velocity, with the DVL's columns carried through the gain (erratum E7).
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
    let (residual, jacobian) = slot_rows(state, geometry, terms, plan);
    let (z, h) = (plan.gain * residual, plan.gain * jacobian);
    let mut innovation = match plan.port {
        Port::Components => component_rows(&z, &h, plan),
        Port::Axes => axis_rows(&z, &h, plan, port),
    };
    if let Some(p_xv) = exact_cross.filter(|_| plan.port == Port::Components) {
        correlate_with_prior(&mut innovation, geometry, plan, p_xv);
    }
    if let Some(beams) = &terms.by_further {
        let unscale = 1.0 / (1.0 + state.dvl_scale_factor);
        let of_fix = plan.gain.fixed_columns::<MAX_ROWS>(0) * **beams * unscale;
        let mut rows = Box::new(FurtherRows::zeros());
        (axes_of(plan).iter().enumerate()).for_each(|(row, axis)| rows.set_row(row, &(axis.transpose() * of_fix)));
        innovation.by_further = Some(rows);
    }
    innovation
}

/// The axis of each row of a fix that is observed, in order.
fn axes_of(plan: &FixEstimator) -> Vec<Vector3<f64>> {
    match plan.port {
        Port::Components => (0..3)
            .filter(|&k| plan.is_solved(k))
            .map(|k| Vector3::ith(k, 1.0))
            .collect(),
        Port::Axes => {
            let (axes, _) = plan.solution.principal_axes();
            (0..plan.solution.rank).map(|k| axes.column(k).into()).collect()
        }
    }
}

/// Beams, virtual beams, sway and heave.
fn slot_rows(state: &NavState, geometry: &BeamGeometry, terms: &BeamTerms, plan: &FixEstimator) -> SlotRows {
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
    (residual, jacobian)
}

/// The row of the fix along an axis.
fn push_observed(innovation: &mut Innovation, axis: &Vector3<f64>, z: &Vector3<f64>, h: &SMatrix<f64, 3, DIM>) {
    let row = innovation.rows;
    innovation.rows += 1;
    innovation.degrees += 1;
    innovation.residual[row] = axis.dot(z);
    innovation.jacobian.set_row(row, &(axis.transpose() * h));
}

/// Surge, sway and heave, those that are solved.
fn component_rows(z: &Vector3<f64>, h: &SMatrix<f64, 3, DIM>, plan: &FixEstimator) -> Innovation {
    let mut innovation = Innovation::empty();
    let solved: Vec<usize> = (0..3).filter(|&k| plan.is_solved(k)).collect();
    for (i, &k) in solved.iter().enumerate() {
        push_observed(&mut innovation, &Vector3::ith(k, 1.0), z, h);
        for (j, &l) in solved.iter().enumerate() {
            innovation.noise[(i, j)] = plan.covariance[(k, l)];
        }
    }
    innovation
}

/// The observable principal axes; of a full port the others too, with a very large variance.
fn axis_rows(z: &Vector3<f64>, h: &SMatrix<f64, 3, DIM>, plan: &FixEstimator, port: InformationPort) -> Innovation {
    let mut innovation = Innovation::empty();
    let (axes, variances) = plan.solution.principal_axes();
    let rank = plan.solution.rank;
    for k in 0..rank {
        push_observed(&mut innovation, &axes.column(k).into(), z, h);
        innovation.noise[(k, k)] = variances[k];
    }
    if port == InformationPort::Full {
        for unobserved in 0..3 - rank {
            let row = rank + unobserved;
            innovation.rows += 1;
            for k in 0..3 {
                innovation.jacobian[(row, VELOCITY + k)] = plan.solution.null[(k, unobserved)];
            }
            innovation.noise[(row, row)] = UNOBSERVED_VARIANCE_M2PS2;
        }
    }
    innovation
}

/// Eq. 26: n = −J_virtual B δv, the noise of the virtual beams is minus the prior's own error.
fn correlate_with_prior(
    innovation: &mut Innovation,
    geometry: &BeamGeometry,
    plan: &FixEstimator,
    p_xv: &SMatrix<f64, DIM, 3>,
) {
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
        ..CorrelatedNoise::default()
    }));
}

#[cfg(test)]
#[path = "beams_tests.rs"]
mod tests;
