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

    /// The rows and one more.
    #[must_use]
    pub fn with(&self, slot: usize, direction: Vector3<f64>, variance: f64) -> Self {
        let mut rows = self.clone();
        rows.put(slot, direction, variance);
        rows
    }

    /// Rank of the rows and an orthonormal basis of their null space (columns).
    #[must_use]
    pub fn null_space(&self) -> (usize, Matrix3<f64>) {
        let mut remainders = [Vector3::zeros(); SLOTS];
        let mut count = 0;
        for direction in self.directions.iter().flatten() {
            remainders[count] = *direction;
            count += 1;
        }
        let remainders = &mut remainders[..count];
        // Gram–Schmidt on the rows, largest remainder first: three steps at most, no iteration to fail.
        let mut basis = [Vector3::zeros(); 3];
        let mut rank = 0;
        while rank < 3 {
            let (mut largest, mut square) = (Vector3::zeros(), 0.0);
            for remainder in remainders.iter() {
                let own = remainder.norm_squared();
                if own > square {
                    (largest, square) = (*remainder, own);
                }
            }
            let size = square.sqrt();
            if size < 1e-7 {
                break;
            }
            let mut axis = largest / size;
            for earlier in &basis[..rank] {
                axis -= earlier * axis.dot(earlier);
            }
            let axis = axis.normalize();
            for remainder in remainders.iter_mut() {
                *remainder -= axis * remainder.dot(&axis);
            }
            basis[rank] = axis;
            rank += 1;
        }
        (rank, complement(&basis[..rank]))
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
    for (i, &slot) in slots.iter().enumerate() {
        for (j, &other) in slots.iter().enumerate() {
            noise[(i, j)] = rows.noise[(slot, other)];
        }
    }
    let not_definite = NavError::NotPositiveDefinite {
        matrix: "beam noise covariance",
        time_ns: 0,
    };
    let Some(whiten) = whitening(noise, count) else {
        return Err(not_definite);
    };
    let mut whitened = [Vector3::zeros(); SLOTS + 2];
    for i in 0..count {
        for (j, &slot) in slots.iter().enumerate().take(i + 1) {
            whitened[i] += rows.directions[slot].unwrap_or_default() * whiten[(i, j)];
        }
    }
    // With rows along the unobserved axes, orthogonal to all others, the least-squares solution is the minimum-norm
    // one. Their weight is that of the other rows, so that the triangular factor is well scaled.
    let size = whitened[..count].iter().map(Vector3::norm_squared).sum::<f64>().sqrt();
    let weight = size.max(f64::MIN_POSITIVE) / (count as f64).sqrt();
    for k in 0..3 - rank {
        whitened[count + k] = null.column(k) * weight;
    }
    let reflected = Householder::of(&mut whitened[..count + 3 - rank]).ok_or(not_definite)?;
    let mut gain = Gain::zeros();
    for (j, &slot) in slots.iter().enumerate() {
        let mut value = [0.0; SLOTS + 2];
        value[..count].copy_from_slice(&whiten.data.0[j][..count]);
        gain.set_column(slot, &reflected.solve(value));
    }
    let mut covariance = Matrix3::zeros();
    for &slot in &slots {
        for &other in &slots {
            covariance += gain.column(slot) * rows.noise[(slot, other)] * gain.column(other).transpose();
        }
    }
    Ok(LeastSquares {
        gain,
        covariance: (covariance + covariance.transpose()) * 0.5,
        rank,
        null,
    })
}

/// Rows of rank 3, A = Q R, by Householder reflections (Golub & Van Loan, sect. 5.2), whatever their number.
struct Householder<'a> {
    /// A vector of each reflection, column by column; above it R without its diagonal.
    rows: &'a [Vector3<f64>],
    diagonal: Vector3<f64>,
    /// 2/vᵀv of each reflection.
    scale: Vector3<f64>,
}

impl<'a> Householder<'a> {
    /// `None` where a column is zero or not finite.
    fn of(rows: &'a mut [Vector3<f64>]) -> Option<Self> {
        let (mut diagonal, mut scale) = (Vector3::zeros(), Vector3::zeros());
        for k in 0..3 {
            let size = rows[k..].iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
            diagonal[k] = -size.copysign(rows[k][k]);
            rows[k][k] -= diagonal[k];
            scale[k] = -1.0 / (diagonal[k] * rows[k][k]);
            if !scale[k].is_finite() {
                return None;
            }
            for j in k + 1..3 {
                let along = rows[k..].iter().map(|row| row[k] * row[j]).sum::<f64>() * scale[k];
                rows[k..].iter_mut().for_each(|row| row[j] -= along * row[k]);
            }
        }
        Some(Self { rows, diagonal, scale })
    }

    /// R⁻¹ of the first three of Qᵀ `value`.
    fn solve(&self, mut value: [f64; SLOTS + 2]) -> Vector3<f64> {
        for k in 0..3 {
            let rows = &self.rows[k..];
            let along = rows
                .iter()
                .zip(&value[k..])
                .map(|(row, value)| row[k] * value)
                .sum::<f64>()
                * self.scale[k];
            value[k..]
                .iter_mut()
                .zip(rows)
                .for_each(|(value, row)| *value -= along * row[k]);
        }
        let [u, v, w] = [self.rows[0], self.rows[1], self.diagonal];
        let z = value[2] / w[2];
        let y = (value[1] - v[2] * z) / w[1];
        Vector3::new((value[0] - u[1] * y - u[2] * z) / w[0], y, z)
    }
}

/// Inverse of the Cholesky factor of a noise covariance of `count` rows, which whitens them; `None` unless positive
/// definite.
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
