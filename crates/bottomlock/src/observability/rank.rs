//! Rank, gap and unobservable subspace of a stack of rows H(t_k) Φ(t_k, t_0).
//!
//! Singular values of the scaled stack, not of the Gramian: squaring would push what is weakly observable below rounding. A rank
//! is claimed only where the smallest kept value stands a thousand times above the largest dropped one and above what the
//! quadrature and rounding can have made of a zero (Weyl's bound), and where no step between kept values is wider than that gap:
//! a window whose values come down in wider steps than it has left above the noise may hide a further one below it; nor where a
//! dropped value stands out of rounding and the gap is not far wider than those steps, since it may be a state that is seen too
//! weakly. Otherwise the rank is undecided, and the
//! values speak for themselves.

use nalgebra::{DMatrix, DVector};

use super::{StateKind, System};
use crate::error::{NavError, require_positive};

/// Smallest ratio of kept to dropped singular values for which a rank is claimed.
pub const MIN_GAP: f64 = 1e3;

/// A dropped value so many times above the next one, and above an ulp of the largest, stands out.
const STANDING_OUT: f64 = 10.0;

/// A window's verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct Observability {
    /// Number of singular values above the noise.
    pub rank: usize,
    /// True where the gap is at least [`MIN_GAP`] and at least `widest_step`, and no dropped value stands out
    /// (unless the gap is [`MIN_GAP`] times wider than any step between kept values, so that it is no further step).
    pub decided: bool,
    /// Smallest kept over largest dropped singular value, or over the noise floor where that is larger or nothing is dropped.
    pub gap: f64,
    /// Largest ratio between neighbours among the kept singular values; 1 for fewer than two.
    pub widest_step: f64,
    /// Singular values of the scaled stack, falling.
    pub singular_values: DVector<f64>,
    /// What rounding and quadrature can make of a zero singular value.
    pub noise_floor: f64,
    /// Basis of the unobservable subspace, a row per direction, in SI: reduced row echelon form, each pivot 1.
    pub basis: DMatrix<f64>,
    /// State of the pivot of each row of the basis.
    pub pivots: Vec<usize>,
    /// For each state the length of its own unobservable part, 0 (observable by itself) to 1 (nothing is known of it), scaled.
    pub unobservable_fraction: DVector<f64>,
    /// Scale of each state.
    pub scales: DVector<f64>,
}

/// Stacked rows H Φ, scaled by rows and columns, with what the coarser quadrature changes.
fn stack(system: &System, epochs: usize, scales: &DVector<f64>) -> (DMatrix<f64>, f64) {
    let count: usize = system.epochs[..epochs].iter().map(|epoch| epoch.rows.nrows()).sum();
    let mut matrix = DMatrix::zeros(count, system.states());
    let mut difference = 0.0;
    let mut row = 0;
    for epoch in &system.epochs[..epochs] {
        let mut h = epoch.rows.clone();
        for (k, mut line) in h.row_iter_mut().enumerate() {
            line /= epoch.row_scale[k];
        }
        let mut image = &h * &epoch.transition;
        let mut change = &image - &h * &epoch.coarse;
        for (k, scale) in scales.iter().enumerate() {
            image.column_mut(k).scale_mut(*scale);
            change.column_mut(k).scale_mut(*scale);
        }
        difference += change.norm_squared();
        matrix.rows_mut(row, h.nrows()).copy_from(&image);
        row += h.nrows();
    }
    (matrix, difference.sqrt())
}

/// The stacked rows H(t_k) Φ(t_k, t_0) in SI, unscaled: what propagates an initial error to the readings.
#[must_use]
pub fn rows(system: &System) -> DMatrix<f64> {
    let parts: Vec<DMatrix<f64>> = system
        .epochs
        .iter()
        .map(|epoch| &epoch.rows * &epoch.transition)
        .collect();
    let mut all = DMatrix::zeros(parts.iter().map(DMatrix::nrows).sum(), system.states());
    let mut row = 0;
    for part in &parts {
        all.rows_mut(row, part.nrows()).copy_from(part);
        row += part.nrows();
    }
    all
}

/// The Gramian of 2015, Eq. (1) over the window, in SI, by the trapezoidal rule over the epochs.
#[must_use]
pub fn gramian(system: &System) -> DMatrix<f64> {
    let mut total = DMatrix::zeros(system.states(), system.states());
    let epochs = &system.epochs;
    for (k, epoch) in epochs.iter().enumerate() {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(epochs.len() - 1));
        let weight_s = 0.5e-9 * (epochs[after].time_ns - epochs[before].time_ns) as f64;
        let image = &epoch.rows * &epoch.transition;
        total += image.transpose() * image * weight_s;
    }
    total
}

/// Judges the first `epochs` epochs of a window (2015, Eqs. 2 and 3).
///
/// `rescale` multiplies the natural scale of each state, as other units would, before columns are brought to one length: a rank
/// must not depend on it.
///
/// # Errors
/// [`NavError::WrongCount`] for fewer than two epochs or a scale vector of another length; [`NavError::OutOfRange`] for a scale that
/// is not positive; [`NavError::NotFinite`] where the motion makes the transition matrix overflow; [`NavError::OutOfRange`] where
/// the rows are all zero.
pub fn observe(system: &System, epochs: usize, rescale: Option<&[f64]>) -> Result<Observability, NavError> {
    let states = system.states();
    if epochs < 2 || epochs > system.epochs.len() {
        return Err(NavError::WrongCount {
            field: "epochs of the window",
            got: epochs,
            expected: format!("2 to {}", system.epochs.len()),
        });
    }
    let elapsed_s = (system.epochs[epochs - 1].time_ns - system.epochs[0].time_ns) as f64 * 1e-9;
    let mut scales = system.scales(elapsed_s);
    if let Some(factors) = rescale {
        if factors.len() != states {
            return Err(NavError::WrongCount {
                field: "scale",
                got: factors.len(),
                expected: format!("{states}, one for each state"),
            });
        }
        for (scale, factor) in scales.iter_mut().zip(factors) {
            require_positive("scale", *factor)?;
            *scale *= factor;
        }
    }
    let (mut matrix, change) = stack(system, epochs, &scales);
    if !(change.is_finite() && matrix.iter().all(|value| value.is_finite())) {
        return Err(NavError::NotFinite {
            field: "stacked rows of the window",
            time_ns: system.epochs[epochs - 1].time_ns,
        });
    }
    let count = matrix.nrows();
    if count < states {
        // Zero rows change nothing and leave room for every right singular vector.
        matrix = matrix.insert_rows(count, states - count, 0.0);
    }
    let factor = |k: usize| rescale.map_or(1.0, |factors| factors[k]);
    let lengths: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
    // In natural scales: what is seen does not depend on the units.
    let size = (0..states)
        .map(|k| (lengths[k] / factor(k)).powi(2))
        .sum::<f64>()
        .sqrt();
    if !(size > 0.0) {
        return Err(NavError::OutOfRange {
            field: "norm of the stacked rows",
            value: size,
            expected: "> 0: the aiding set reads no state of the model",
        });
    }
    // Columns of one length: no scaling is more than √n better for the condition (van der Sluis 1969).
    for (k, &seen) in lengths.iter().enumerate() {
        let length = if seen > 1e-9 * size * factor(k) {
            seen
        } else {
            size * factor(k)
        };
        matrix.column_mut(k).unscale_mut(length);
        scales[k] /= length;
    }
    let difference = stack(system, epochs, &scales).1;
    let triangle = matrix.qr().r();
    let svd = triangle.svd(false, true);
    let values = svd.singular_values;
    let Some(vectors) = svd.v_t else {
        return Err(NavError::NotFinite {
            field: "singular vectors of the window",
            time_ns: system.epochs[epochs - 1].time_ns,
        });
    };
    let mut order: Vec<usize> = (0..states).collect();
    order.sort_by(|&i, &j| values[j].total_cmp(&values[i]));
    let singular_values = DVector::from_iterator(states, order.iter().map(|&i| values[i]));
    // Rounding: each of the products behind an entry costs an ulp; their number grows with the epochs.
    let rounding = 4.0 * f64::EPSILON * singular_values[0] * (states as f64).sqrt() * (epochs as f64).sqrt();
    let noise_floor = difference.max(rounding);
    let rank = singular_values.iter().filter(|&&value| value > noise_floor).count();
    let dropped = if rank < states { singular_values[rank] } else { 0.0 };
    let gap = if rank > 0 {
        singular_values[rank - 1] / dropped.max(noise_floor)
    } else {
        0.0
    };
    // Zeros come out alike, near an ulp of the largest; one well above the next is perhaps no zero.
    let next = singular_values.get(rank + 1).copied().unwrap_or(0.0);
    let stands_out = dropped > STANDING_OUT * next.max(f64::EPSILON * singular_values[0]);
    let kept = &singular_values.as_slice()[..rank];
    let widest_step = kept.windows(2).map(|pair| pair[0] / pair[1]).fold(1.0, f64::max);
    let null = DMatrix::from_fn(states - rank, states, |i, j| vectors[(order[rank + i], j)]);
    let unobservable_fraction = DVector::from_iterator(states, null.column_iter().map(|column| column.norm()));
    let (basis, pivots) = echelon(null, &scales, &naming_order(system));
    Ok(Observability {
        rank,
        decided: gap >= MIN_GAP.max(widest_step) && (!stands_out || gap >= MIN_GAP * widest_step),
        gap,
        widest_step,
        singular_values,
        noise_floor,
        basis,
        pivots,
        unobservable_fraction,
        scales,
    })
}

/// Rank, gap and claim of a window that ends at an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowRank {
    /// Number of singular values above the noise.
    pub rank: usize,
    /// As [`Observability::gap`]; infinite where nothing has been read yet.
    pub gap: f64,
    /// As [`Observability::decided`].
    pub decided: bool,
}

/// Judges the windows that end at each epoch from the second on; where nothing has been read yet the rank is zero.
///
/// # Errors
/// As [`observe`].
pub fn growing_windows(system: &System, rescale: Option<&[f64]>) -> Result<Vec<WindowRank>, NavError> {
    let silent = system
        .epochs
        .iter()
        .take_while(|epoch| epoch.rows.amax() == 0.0)
        .count();
    (2..=system.epochs.len())
        .map(|end| {
            if end <= silent {
                return Ok(WindowRank {
                    rank: 0,
                    gap: f64::INFINITY,
                    decided: true,
                });
            }
            observe(system, end, rescale).map(|found| WindowRank {
                rank: found.rank,
                gap: found.gap,
                decided: found.decided,
            })
        })
        .collect()
}

/// States in the order in which they are wanted as names of a direction: misalignment first, since the others follow from it.
fn naming_order(system: &System) -> Vec<usize> {
    let place = |kind: StateKind| match kind {
        StateKind::Tilt => 0,
        StateKind::Position => 1,
        StateKind::Velocity => 2,
        StateKind::GyroBias => 3,
        StateKind::AccelBias => 4,
        StateKind::ScaleFactor => 5,
        StateKind::BeamBias => 6,
    };
    let mut order: Vec<usize> = (0..system.states()).collect();
    order.sort_by_key(|&k| place(system.kinds[k]));
    order
}

/// Reduced row echelon form of a basis in scaled states, then in SI with each pivot 1.
///
/// The pivot is the first state in `naming` that comes near the largest entry left, so that no row is divided by something small.
fn echelon(mut rows: DMatrix<f64>, scales: &DVector<f64>, naming: &[usize]) -> (DMatrix<f64>, Vec<usize>) {
    let (count, states) = rows.shape();
    let mut pivots: Vec<usize> = Vec::with_capacity(count);
    for done in 0..count {
        let left = rows.rows(done, count - done);
        let largest = left.amax();
        let near = |column: &&usize| !pivots.contains(column) && left.column(**column).amax() >= 0.3 * largest;
        let column = naming.iter().find(near).copied().unwrap_or(0);
        let row = done + left.column(column).iamax();
        rows.swap_rows(done, row);
        let lead = rows[(done, column)];
        let line = rows.row(done) / lead;
        rows.set_row(done, &line);
        for other in (0..count).filter(|&other| other != done) {
            let reduced = rows.row(other) - &line * rows[(other, column)];
            rows.set_row(other, &reduced);
        }
        pivots.push(column);
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&row| pivots[row]);
    let basis = DMatrix::from_fn(count, states, |i, j| {
        let row = order[i];
        rows[(row, j)] * scales[j] / scales[pivots[row]]
    });
    (basis, order.iter().map(|&row| pivots[row]).collect())
}
