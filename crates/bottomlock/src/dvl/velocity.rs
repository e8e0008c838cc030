//! Velocity by weighted least squares from any set of rows (Eqs. 17–21), with the axes that stay unobserved.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::error::NavError;
use crate::layout::MAX_BEAMS;

/// Number of slots of the row table: the beams, two virtual beams, the sway row and the heave row.
pub const SLOTS: usize = MAX_BEAMS + 4;
/// First slot of the virtual beams.
pub const VIRTUAL_SLOT: usize = MAX_BEAMS;
/// Slot of the row "sway is zero".
pub const SWAY_SLOT: usize = MAX_BEAMS + 2;
/// Slot of the row "heave is the prior's".
pub const HEAVE_SLOT: usize = MAX_BEAMS + 3;

/// Covariance of the row noise, slots by slots, (m/s)².
pub type SlotNoise = SMatrix<f64, SLOTS, SLOTS>;
/// Gain from row values to velocity, 3 by slots.
pub type Gain = SMatrix<f64, 3, SLOTS>;

/// A unit vector lies in the row space if its component outside is shorter than this.
pub const ROW_SPACE_TOLERANCE: f64 = 1e-9;

/// Rows `direction · v = value + noise`; a slot without a direction is empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    /// Direction of each row in the platform frame; `None` for an empty slot.
    pub directions: [Option<Vector3<f64>>; SLOTS],
    /// Noise covariance, (m/s)²; only entries of filled slots are used.
    pub noise: SlotNoise,
}

impl Rows {
    /// A table without rows.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            directions: [None; SLOTS],
            noise: SlotNoise::zeros(),
        }
    }

    /// Puts a row with uncorrelated noise of `variance`, (m/s)², into a slot.
    pub fn put(&mut self, slot: usize, direction: Vector3<f64>, variance: f64) {
        self.directions[slot] = Some(direction);
        self.noise[(slot, slot)] = variance;
    }

    /// Rank of the rows and an orthonormal basis of their null space (columns).
    #[must_use]
    pub fn null_space(&self) -> (usize, Matrix3<f64>) {
        let mut a = SMatrix::<f64, SLOTS, 3>::zeros();
        for (slot, direction) in self.directions.iter().enumerate() {
            if let Some(direction) = direction {
                a.set_row(slot, &direction.transpose());
            }
        }
        let filled = || (0..SLOTS).filter(|&slot| self.directions[slot].is_some());
        // Gram–Schmidt on the rows, largest remainder first: three steps at most, no iteration to fail.
        let mut basis = Vec::with_capacity(3);
        while basis.len() < 3 {
            let (mut best, mut size) = (0, 0.0);
            for slot in filled() {
                let norm = a.row(slot).norm();
                if norm > size {
                    (best, size) = (slot, norm);
                }
            }
            if size < 1e-7 {
                break;
            }
            let mut axis: Vector3<f64> = a.row(best).transpose() / size;
            for earlier in &basis {
                axis -= *earlier * axis.dot(earlier);
            }
            let axis = axis.normalize();
            for slot in filled() {
                let along = a.row(slot).transpose().dot(&axis);
                let remainder = a.row(slot) - axis.transpose() * along;
                a.set_row(slot, &remainder);
            }
            basis.push(axis);
        }
        (basis.len(), complement(&basis))
    }
}

/// Orthonormal columns that complete an orthonormal set; unused columns are zero.
fn complement(basis: &[Vector3<f64>]) -> Matrix3<f64> {
    let mut null = Matrix3::zeros();
    match basis {
        [] => null.fill_with_identity(),
        [a] => {
            // The coordinate axis nearest to orthogonal to a is well conditioned.
            let start = if a.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
            let first = a.cross(&start).normalize();
            null.set_column(0, &first);
            null.set_column(1, &a.cross(&first));
        }
        [a, b] => null.set_column(0, &a.cross(b).normalize()),
        _ => {}
    }
    null
}

/// A weighted least-squares solution: velocity = gain · values.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// The minimum-norm gain (the weighted pseudo-inverse A⁺), one column per slot.
    pub gain: Gain,
    /// A⁺ R A⁺ᵀ; zero along the unobserved axes.
    pub covariance: Matrix3<f64>,
    /// Number of observed axes.
    pub rank: usize,
    /// Unobserved axes, orthonormal columns (the first `3 − rank`).
    pub null: Matrix3<f64>,
}

impl LeastSquares {
    /// Returns true if the rows determine the velocity along `axis`.
    #[must_use]
    pub fn observes(&self, axis: &Vector3<f64>) -> bool {
        (self.null.transpose() * axis).norm() < ROW_SPACE_TOLERANCE
    }

    /// Observable principal axes (the first `rank` columns) and their variances, (m/s)².
    #[must_use]
    pub fn principal_axes(&self) -> (Matrix3<f64>, Vector3<f64>) {
        // A large variance along the null space separates it from the observed axes, whatever their size.
        let large = 1.0 + 1e3 * self.covariance.trace();
        let eigen = (self.covariance + self.null * self.null.transpose() * large).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
        let mut axes = Matrix3::zeros();
        let mut variances = Vector3::zeros();
        for (to, &from) in order.iter().take(self.rank).enumerate() {
            let axis: Vector3<f64> = eigen.eigenvectors.column(from).into();
            // Removes what rounding left of the null space.
            let axis = (axis - self.null * (self.null.transpose() * axis)).normalize();
            axes.set_column(to, &axis);
            variances[to] = (axis.transpose() * self.covariance * axis)[0];
        }
        (axes, variances)
    }
}

/// Solves the rows by weighted least squares (Eqs. 17 and 19), with minimum norm along unobserved axes.
///
/// # Source
/// Tal et al. 2017, Eqs. (17)–(21), with the order of factors of erratum E6: v = (AᵀWA)⁻¹AᵀW y, W = R⁻¹.
///
/// # Errors
/// [`NavError::NotPositiveDefinite`] where the noise covariance of the filled rows is not positive definite.
pub fn least_squares(rows: &Rows) -> Result<LeastSquares, NavError> {
    let (rank, null) = rows.null_space();
    if rank == 0 {
        return Ok(LeastSquares {
            gain: Gain::zeros(),
            covariance: Matrix3::zeros(),
            rank,
            null,
        });
    }
    // Filled rows by increasing variance: the triangularisation loses digits if a row of large weight comes last.
    let mut slots: Vec<usize> = (0..SLOTS).filter(|&slot| rows.directions[slot].is_some()).collect();
    slots.sort_by(|&i, &j| rows.noise[(i, i)].total_cmp(&rows.noise[(j, j)]));
    let count = slots.len();

    let mut noise = SlotNoise::identity();
    let mut stacked = SMatrix::<f64, { SLOTS + 2 }, 3>::zeros();
    for (i, &slot) in slots.iter().enumerate() {
        for (j, &other) in slots.iter().enumerate() {
            noise[(i, j)] = rows.noise[(slot, other)];
        }
        if let Some(direction) = rows.directions[slot] {
            stacked.set_row(i, &direction.transpose());
        }
    }
    let not_definite = NavError::NotPositiveDefinite {
        matrix: "beam noise covariance",
        time_ns: 0,
    };
    let Some(whiten) = whitening(noise, count) else {
        return Err(not_definite);
    };
    let top = whiten * stacked.fixed_rows::<SLOTS>(0);
    stacked.fixed_rows_mut::<SLOTS>(0).copy_from(&top);
    // With rows along the unobserved axes, orthogonal to all others, the least-squares solution is the minimum-norm
    // one. Their weight is that of the other rows, so that the triangular factor is well scaled.
    let weight = top.norm().max(f64::MIN_POSITIVE) / (count.max(1) as f64).sqrt();
    for k in 0..3 - rank {
        stacked.set_row(SLOTS + k, &(null.column(k).transpose() * weight));
    }
    let qr = stacked.qr();
    let (q, r) = (qr.q(), qr.r());
    let solved = r.solve_upper_triangular(&q.transpose()).ok_or(not_definite)?;
    let compact = solved.fixed_columns::<SLOTS>(0) * whiten;
    let mut gain = Gain::zeros();
    for (i, &slot) in slots.iter().enumerate() {
        gain.set_column(slot, &compact.column(i));
    }
    let covariance = gain * rows.noise * gain.transpose();
    Ok(LeastSquares {
        gain,
        covariance: (covariance + covariance.transpose()) * 0.5,
        rank,
        null,
    })
}

/// Inverse of the Cholesky factor of a noise covariance of `count` rows, which whitens them; `None` unless positive
/// definite.
///
/// The operations are those of nalgebra in the same order, without the empty slots.
fn whitening(mut noise: SlotNoise, count: usize) -> Option<SlotNoise> {
    for j in 0..count {
        for k in 0..j {
            let multiple = -noise[(j, k)];
            for i in j..count {
                noise[(i, j)] += multiple * noise[(i, k)];
            }
        }
        if !(noise[(j, j)] > 0.0) {
            return None;
        }
        let pivot = noise[(j, j)].sqrt();
        noise[(j, j)] = pivot;
        for i in j + 1..count {
            noise[(i, j)] /= pivot;
        }
    }
    let mut inverse = SlotNoise::identity();
    for column in 0..count {
        for j in column..count {
            inverse[(j, column)] /= noise[(j, j)];
            let multiple = -inverse[(j, column)];
            for i in j + 1..count {
                inverse[(i, column)] += multiple * noise[(i, j)];
            }
        }
    }
    Some(inverse)
}

#[cfg(test)]
#[path = "velocity_tests.rs"]
mod tests;
