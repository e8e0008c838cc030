//! A position fix at the corrected path, once or, where the yaw still moves, up to four times.
//!
//! Since the position was last known the estimate has gone the way p̂ and the error besides it the way s = ∫R̂ δv dt. With a
//! misalignment that is nearly constant the true end is Exp(ρ) (p̂ + s), and the linear model has ρ × p̂ + s. This is the part γ of
//! δr (`Eskf::share_of_way`); what the position's error was before does not turn. Hence
//!
//! ```text
//! r − r̂ = (1 − γ) δr + Exp(ρ) (p̂ + γ δr − ρ × p̂) − p̂.
//! ```
//!
//! The first time this is taken as δr + B ρ with B = −[γ δr̂×] (docs/linear_range.md), which is enough for small angles. Where the
//! correction of the yaw moves by it, it is linearised again at the estimate that it gives, A δr + B ρ + c: Gauss and Newton's
//! method (Bell & Cathey 1993). A fix that does not move the yaw has the bits of the first time.
//!
//! Any other update that corrects the position by δr̂ and the misalignment by ρ̂ turns the path behind it alike: the misalignment that
//! is left moves the end Exp(ρ̂) (p̂ + s), not p̂. Where that is not small against σ, as when beams return after minutes without any,
//! state and P follow it ([`Eskf::follow_corrected_path`]).
//!
//! A depth since the last position has told how deep the path is, along its own axis. On the ellipsoid that is another one at the
//! end of a correction of kilometres: the depth d(r) stays what the update makes of it, d(r̂) + D·δr, and r_z follows from it.

use nalgebra::{Matrix3, Rotation3, RowVector3, SMatrix, Vector3};

use super::Eskf;
use super::joseph::PredictedInnovation;
use crate::aiding::{CorrectedPath, Innovation};
use crate::frames::skew;
use crate::layout::{ATTITUDE, DIM, POSITION, VELOCITY};
use crate::state::{Covariance, ErrorVector};

/// Linearisations of a fix, at most.
const LINEARISATIONS: usize = 4;
/// Change of the correction of the yaw from one to the next, in standard deviations after the update, that asks for another.
const YAW_MOVES: f64 = 0.1;
/// Correction of the yaw, in standard deviations before the update, beyond which a fix is judged as it is: an outlier must not
/// find a yaw that explains it.
const PLAUSIBLE: f64 = 3.0;

/// The error state follows an update of anything but a position where this part of the position's sigma is moved by it. Set on figures
/// of eight after 200 s without beams, where 0.5 leaves out some runs; tested on straight legs after as long, and on lawn mowers
/// after 1 to 3 min, where 0.1 and 0.5 are alike.
const PATH_MOVES: f64 = 0.1;

/// Part of the depth, m, that the curvature of the sea may leave out of an update: a hundredth of the white noise of usual sensors.
const DEPTH_LEFT_OUT_M: f64 = 1e-4;

const YAW: (usize, usize) = (ATTITUDE + 2, ATTITUDE + 2);

/// What an innovation says of the error by itself.
pub(super) struct Explained {
    pub(super) error: ErrorVector,
    /// Variance of the yaw after it, rad².
    yaw_variance: f64,
}

impl Eskf {
    /// Takes a position at the path that it corrects itself.
    pub(super) fn linearise_at_corrected_path(&self, innovation: &mut Innovation) {
        let at_estimate = innovation.clone();
        let Some(mut before) = self.explained_by(innovation) else {
            return;
        };
        let share = self.share_of_way(&self.covariance);
        *innovation = along(&at_estimate, self.first_path(&before.error, share));
        for _ in 1..LINEARISATIONS {
            let Some(after) = self.explained_by(innovation) else {
                return;
            };
            let (from_rad, to_rad) = (before.error[YAW.0], after.error[YAW.0]);
            let moves = (to_rad - from_rad).abs() > YAW_MOVES * after.yaw_variance.sqrt();
            let is_plausible = to_rad.abs() <= PLAUSIBLE * self.covariance[YAW].sqrt();
            if !(moves && is_plausible) {
                return;
            }
            *innovation = along(&at_estimate, self.path_at(&after.error, share));
            before = after;
        }
    }

    /// Moves an error state to the path that an update of anything else has corrected, where the misalignment that is left moves it
    /// far, or the sea curves away below it.
    pub(super) fn follow_corrected_path(&mut self, error: &mut ErrorVector, share_of_way: f64) {
        if self.is_path_moved_far(error, share_of_way) || self.is_sea_curved(error) {
            let path = self.path_at(error, share_of_way);
            self.move_to_corrected_path(&path, error);
        }
    }

    fn is_path_moved_far(&self, correction: &ErrorVector, share_of_way: f64) -> bool {
        let variances = self.covariance.diagonal();
        let [position, misalignment] = [POSITION, ATTITUDE].map(|block| variances.fixed_rows::<3>(block));
        let moved_m2 = (correction.fixed_rows::<3>(POSITION) * share_of_way).norm_squared();
        let far = PATH_MOVES * PATH_MOVES;
        if moved_m2 * misalignment.sum() <= far * position.min() {
            return false;
        }
        let by_misalignment = self.path_by_misalignment(correction, share_of_way);
        let misalignment = self.covariance.fixed_view::<3, 3>(ATTITUDE, ATTITUDE);
        let moves = (by_misalignment * misalignment * by_misalignment.transpose()).diagonal();
        (0..3).any(|k| moves[k] > far * position[k])
    }

    /// Returns true if the sea curves away below a correction, or below what is uncertain at its end, by more than may be left out
    /// where a depth is known.
    fn is_sea_curved(&self, correction: &ErrorVector) -> bool {
        if !self.measured.has_depth_alone() {
            return false;
        }
        let gained_m = correction.fixed_rows::<2>(POSITION).norm();
        let sd_m = self.covariance.fixed_view::<2, 2>(POSITION, POSITION).trace().sqrt();
        self.settings.earth.curvature_pm() * gained_m * (gained_m + sd_m) > DEPTH_LEFT_OUT_M
    }

    /// Moves an error state to the path that a position has corrected: δr ← A δr + B ρ + c.
    pub(super) fn move_to_corrected_path(&mut self, path: &CorrectedPath, error: &mut ErrorVector) {
        path.move_rows(&mut self.covariance);
        self.covariance.transpose_mut();
        path.move_rows(&mut self.covariance);
        self.covariance.transpose_mut();
        self.covariance.fill_lower_triangle_with_upper_triangle();
        path.move_rows(error);
        let mut position = error.fixed_rows_mut::<3>(POSITION);
        position += path.offset_t_m;
        self.extensions.move_to_corrected_path(path);
    }

    /// B = −[γ δr̂×]; a depth since the last position has moved its own axis already, so that only the way since then counts.
    fn path_by_misalignment(&self, correction: &ErrorVector, share_of_way: f64) -> Matrix3<f64> {
        let mut block = -skew(&(correction.fixed_rows::<3>(POSITION) * share_of_way));
        if self.measured.has_depth_alone() {
            block.set_row(2, &self.heave_by_misalignment(correction));
        }
        block
    }

    /// −[∫R̂ δv dt ×] since the last depth, along its axis.
    fn heave_by_misalignment(&self, correction: &ErrorVector) -> RowVector3<f64> {
        let gained_t: Vector3<f64> = self.rotation() * correction.fixed_rows::<3>(VELOCITY) * self.since_depth_s();
        (-skew(&gained_t)).row(2).into_owned()
    }

    /// r − r̂ for small angles.
    fn first_path(&self, correction: &ErrorVector, share_of_way: f64) -> CorrectedPath {
        let mut path = CorrectedPath {
            by_position: None,
            by_misalignment: self.path_by_misalignment(correction, share_of_way),
            offset_t_m: Vector3::zeros(),
        };
        if self.is_sea_curved(correction) {
            self.keep_depth(correction, &mut path);
        }
        path
    }

    /// r − r̂, linearised at an estimate of the error; the axis of a depth as in [`Eskf::keep_depth`].
    fn path_at(&self, error: &ErrorVector, share_of_way: f64) -> CorrectedPath {
        let linear_t = error.fixed_rows::<3>(POSITION).into_owned();
        let rho = error.fixed_rows::<3>(ATTITUDE).into_owned();
        let way_t = way_by_yaw(&self.covariance);
        let rest_t = linear_t * share_of_way - rho.cross(&way_t);
        let turn = Rotation3::from_scaled_axis(rho);
        let turned_t = turn * (way_t + rest_t);
        let end_t = linear_t * (1.0 - share_of_way) + turned_t;
        let by_position = turned_in_part(&turn, share_of_way);
        let by_misalignment = turn * skew(&way_t) - skew(&turned_t) * left_jacobian(&rho);
        let mut path = CorrectedPath {
            by_position: Some(by_position),
            by_misalignment,
            offset_t_m: end_t - way_t - by_position * linear_t - by_misalignment * rho,
        };
        if self.measured.has_depth_alone() {
            self.keep_depth(error, &mut path);
        }
        path
    }

    /// The third row of a path whose depth is known: e_z solves d(r̂ + e) = d(r̂) + D·δr + b, with the heave b since the depth.
    fn keep_depth(&self, error: &ErrorVector, path: &mut CorrectedPath) {
        let linear_t = error.fixed_rows::<3>(POSITION).into_owned();
        let rho = error.fixed_rows::<3>(ATTITUDE).into_owned();
        let by_position = path.by_position.get_or_insert_with(Matrix3::identity);
        let by_heave = self.heave_by_misalignment(error);
        let heave_m = (by_heave * rho).x;
        let mut end_t = *by_position * linear_t + path.by_misalignment * rho + path.offset_t_m;
        end_t.z = linear_t.z + heave_m;

        let earth = &self.settings.earth;
        let mut there_t_m = self.state.position_t_m;
        let before = earth.level(&there_t_m);
        there_t_m.0 += end_t;
        let after = earth.level(&there_t_m);
        let (down_t, new_down_t) = (before.down_t(), after.down_t());
        let too_deep_m = after.depth_m - before.depth_m - down_t.dot(&linear_t) - heave_m;
        end_t.z -= too_deep_m / new_down_t.z;

        let level = RowVector3::new(new_down_t.x, new_down_t.y, 0.0);
        let of_position = (down_t.transpose() - level * *by_position) / new_down_t.z;
        let of_misalignment = (by_heave - level * path.by_misalignment) / new_down_t.z;
        by_position.set_row(2, &of_position);
        path.by_misalignment.set_row(2, &of_misalignment);
        path.offset_t_m.z = end_t.z - (of_position * linear_t + of_misalignment * rho).x;
    }

    /// What an innovation of three rows says of the error; `None` if S is not positive definite.
    pub(super) fn explained_by(&self, innovation: &Innovation) -> Option<Explained> {
        let predicted = PredictedInnovation::<3>::of(&self.covariance, innovation)?;
        let factor = predicted.cholesky();
        let yaw = predicted.cross_covariance.row(YAW.0).transpose();
        Some(Explained {
            error: predicted.cross_covariance * factor.solve(&innovation.residual.fixed_rows::<3>(0).into_owned()),
            yaw_variance: (self.covariance[YAW] - yaw.dot(&factor.solve(&yaw))).max(0.0),
        })
    }
}

impl CorrectedPath {
    /// Moves the rows of a matrix whose rows are those of the error state.
    pub(crate) fn move_rows<const N: usize>(&self, rows: &mut SMatrix<f64, DIM, N>) {
        let turned = self.by_misalignment * rows.fixed_rows::<3>(ATTITUDE);
        let mut position = rows.fixed_rows_mut::<3>(POSITION);
        if let Some(by_position) = &self.by_position {
            let kept = by_position * &position;
            position.copy_from(&kept);
        }
        position += turned;
    }
}

/// (1 − γ) I + γ Exp(ρ), by which the linear error moves the position of (2a).
pub(super) fn turned_in_part(turn: &Rotation3<f64>, share_of_way: f64) -> Matrix3<f64> {
    Matrix3::identity() * (1.0 - share_of_way) + turn.matrix() * share_of_way
}

/// The level part of p̂, m, by which a covariance has the yaw move the position: E[δr | ρ_D] = ρ_D e_D × p̂. Zero for a yaw
/// that is certain.
pub(super) fn way_by_yaw(covariance: &Covariance) -> Vector3<f64> {
    if covariance[YAW] <= 0.0 {
        return Vector3::zeros();
    }
    let by_yaw = covariance.fixed_view::<3, 1>(POSITION, YAW.0) / covariance[YAW];
    Vector3::new(by_yaw[1], -by_yaw[0], 0.0)
}

/// A position's innovation along a path: z − c = A δr + (H_ρ + B) ρ + n.
fn along(at_estimate: &Innovation, path: CorrectedPath) -> Innovation {
    let mut innovation = at_estimate.clone();
    if let Some(by_position) = &path.by_position {
        innovation
            .jacobian
            .fixed_view_mut::<3, 3>(0, POSITION)
            .copy_from(by_position);
    }
    let mut by_misalignment = innovation.jacobian.fixed_view_mut::<3, 3>(0, ATTITUDE);
    by_misalignment += path.by_misalignment;
    let mut residual = innovation.residual.fixed_rows_mut::<3>(0);
    residual -= path.offset_t_m;
    innovation.corrected_path = Some(Box::new(path));
    innovation
}

/// J of Exp(ρ + δρ) = Exp(J δρ) Exp(ρ), to first order.
fn left_jacobian(rho: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (rho.norm(), skew(rho));
    if angle < 1e-4 {
        return Matrix3::identity() + cross * 0.5;
    }
    let square = angle * angle;
    Matrix3::identity()
        + cross * ((1.0 - angle.cos()) / square)
        + cross * cross * ((angle - angle.sin()) / (square * angle))
}

#[cfg(test)]
#[path = "corrected_path_tests.rs"]
mod tests;
