//! Rank, gap and unobservable subspace of a stack of rows H(t_k) Φ(t_k, t_0).
//!
//! The singular values are those of the scaled stack. Those of the Gramian are their squares, which puts weakly
//! observable directions below rounding.
//!
//! Values above the noise floor are kept. The noise floor bounds the singular value that quadrature and rounding can
//! make of a zero (Weyl's bound). The rank is decided if three conditions hold:
//!
//! - The gap, the smallest kept value over the largest dropped one or the noise floor, is at least a thousand.
//! - No ratio between neighbouring kept values exceeds the gap. Otherwise a further value may lie below the noise
//!   floor.
//! - No dropped value stands out from rounding, unless the gap is a thousand times the largest of those ratios.
//!   Otherwise that value may belong to a weakly observable state.

use nalgebra::{DMatrix, DVector};

use super::{StateKind, System};
use crate::error::{NavError, require_positive};
use crate::stop::Stop;

/// Smallest gap for which a rank is decided.
pub const MIN_GAP: f64 = 1e3;

/// Ratio of a dropped value to the next one, and to an ulp of the largest, from which it stands out.
const STANDING_OUT: f64 = 10.0;

/// Observability of a window.
#[derive(Debug, Clone, PartialEq)]
pub struct Observability {
    /// Number of singular values above the noise floor.
    pub rank: usize,
    /// True if the gap is at least [`MIN_GAP`] and at least `widest_step`, and no dropped value stands out (or the gap
    /// is at least [`MIN_GAP`] times `widest_step`).
    pub decided: bool,
    /// Smallest kept singular value over the largest dropped one, or over the noise floor if that is larger or none is
    /// dropped.
    pub gap: f64,
    /// Largest ratio between neighbouring kept singular values; 1 for fewer than two.
    pub widest_step: f64,
    /// Singular values of the scaled stack, decreasing.
    pub singular_values: DVector<f64>,
    /// Bound on the singular value that rounding and quadrature can make of a zero.
    pub noise_floor: f64,
    /// Basis of the unobservable subspace, a row per direction, SI: reduced row echelon form with pivots of 1.
    pub basis: DMatrix<f64>,
    /// State index of the pivot of each row of the basis.
    pub pivots: Vec<usize>,
    /// Length of the unobservable component of each scaled state: 0 for an observable state, 1 for an unobservable one.
    pub unobservable_fraction: DVector<f64>,
    /// Scale of each state, SI.
    pub scales: DVector<f64>,
}

/// Stacked rows H Φ, scaled by rows and columns, and the norm of their change with the coarser quadrature.
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

/// Stacked rows H(t_k) Φ(t_k, t_0), SI, unscaled: they map an initial error to the readings.
#[must_use]
pub fn rows(system: &System) -> DMatrix<f64> {
    let blocks: Vec<DMatrix<f64>> = system
        .epochs
        .iter()
        .map(|epoch| &epoch.rows * &epoch.transition)
        .collect();
    let mut all = DMatrix::zeros(blocks.iter().map(DMatrix::nrows).sum(), system.states());
    let mut row = 0;
    for block in &blocks {
        all.rows_mut(row, block.nrows()).copy_from(block);
        row += block.nrows();
    }
    all
}

/// Observability Gramian of 2015, Eq. (1) over the window, SI, by the trapezoidal rule over the epochs.
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

/// Analyses the first `epochs` epochs of a window (2015, Eqs. 2 and 3).
///
/// `rescale` (one factor per state) multiplies the natural scale of each state, as other units would, before columns
/// are brought to one length. A rank must not depend on it.
///
/// # Errors
/// [`NavError::WrongCount`] for fewer than two epochs or a scale vector of the wrong length; [`NavError::OutOfRange`]
/// for a scale that is not positive, or if all rows are zero; [`NavError::NotFinite`] if the motion makes the
/// transition matrix overflow.
pub fn observe(system: &System, epochs: usize, rescale: Option<&[f64]>) -> Result<Observability, NavError> {
    let states = system.states();
    let mut scales = initial_scales(system, epochs, rescale)?;
    let (mut matrix, change) = stack(system, epochs, &scales);
    let time_ns = system.epochs[epochs - 1].time_ns;
    if !(change.is_finite() && matrix.iter().all(|value| value.is_finite())) {
        let field = "stacked rows of the window";
        return Err(NavError::NotFinite { field, time_ns });
    }
    let count = matrix.nrows();
    if count < states {
        // Zero rows do not change the result and leave room for every right singular vector.
        matrix = matrix.insert_rows(count, states - count, 0.0);
    }
    normalise_columns(&mut matrix, &mut scales, rescale)?;
    let difference = stack(system, epochs, &scales).1;
    let triangle = matrix.qr().r();
    let svd = triangle.svd(false, true);
    let values = svd.singular_values;
    let vectors = svd.v_t.ok_or(NavError::NotFinite {
        field: "singular vectors of the window",
        time_ns,
    })?;
    let mut order: Vec<usize> = (0..states).collect();
    order.sort_by(|&i, &j| values[j].total_cmp(&values[i]));
    let singular_values = DVector::from_iterator(states, order.iter().map(|&i| values[i]));
    // Each product behind an element costs one rounding; the number of products grows with the epochs.
    let rounding = 4.0 * f64::EPSILON * singular_values[0] * (states as f64).sqrt() * (epochs as f64).sqrt();
    let noise_floor = difference.max(rounding);
    let decision = decide(singular_values.as_slice(), noise_floor);
    let rank = decision.rank;
    let null = DMatrix::from_fn(states - rank, states, |i, j| vectors[(order[rank + i], j)]);
    let unobservable_fraction = DVector::from_iterator(states, null.column_iter().map(|column| column.norm()));
    let (basis, pivots) = echelon(null, &scales, &naming_order(system));
    Ok(Observability {
        rank,
        decided: decision.decided,
        gap: decision.gap,
        widest_step: decision.widest_step,
        singular_values,
        noise_floor,
        basis,
        pivots,
        unobservable_fraction,
        scales,
    })
}

/// The natural scale of each state over the first `epochs` epochs, times its factor of `rescale`.
fn initial_scales(system: &System, epochs: usize, rescale: Option<&[f64]>) -> Result<DVector<f64>, NavError> {
    if epochs < 2 || epochs > system.epochs.len() {
        return Err(NavError::WrongCount {
            field: "epochs of the window",
            got: epochs,
            expected: format!("2 to {}", system.epochs.len()),
        });
    }
    let elapsed_s = (system.epochs[epochs - 1].time_ns - system.epochs[0].time_ns) as f64 * 1e-9;
    let mut scales = system.scales(elapsed_s);
    let Some(factors) = rescale else { return Ok(scales) };
    if factors.len() != scales.len() {
        return Err(NavError::WrongCount {
            field: "scale",
            got: factors.len(),
            expected: format!("{}, one for each state", scales.len()),
        });
    }
    for (scale, factor) in scales.iter_mut().zip(factors) {
        require_positive("scale", *factor)?;
        *scale *= factor;
    }
    Ok(scales)
}

/// Brings the columns of the stack to length 1, and the scales with them; columns that are nearly zero keep their
/// proportion.
///
/// No other scaling reduces the condition number by more than √n (van der Sluis 1969).
fn normalise_columns(
    matrix: &mut DMatrix<f64>,
    scales: &mut DVector<f64>,
    rescale: Option<&[f64]>,
) -> Result<(), NavError> {
    let factor = |k: usize| rescale.map_or(1.0, |factors| factors[k]);
    let lengths: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
    // In natural scales, so that the threshold does not depend on the units.
    let size = (0..lengths.len())
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
    for (k, &own) in lengths.iter().enumerate() {
        let length = if own > 1e-9 * size * factor(k) {
            own
        } else {
            size * factor(k)
        };
        matrix.column_mut(k).unscale_mut(length);
        scales[k] /= length;
    }
    Ok(())
}

/// Rank of a window and how clearly it stands out.
struct Decision {
    rank: usize,
    decided: bool,
    gap: f64,
    widest_step: f64,
}

/// The rank from singular values in decreasing order; see the module documentation.
fn decide(singular_values: &[f64], noise_floor: f64) -> Decision {
    let rank = singular_values.iter().filter(|&&value| value > noise_floor).count();
    let dropped = singular_values.get(rank).copied().unwrap_or(0.0);
    let gap = if rank > 0 {
        singular_values[rank - 1] / dropped.max(noise_floor)
    } else {
        0.0
    };
    // Zeros are computed alike, near an ulp of the largest value; one well above the next may be a weakly observable
    // state.
    let next = singular_values.get(rank + 1).copied().unwrap_or(0.0);
    let stands_out = dropped > STANDING_OUT * next.max(f64::EPSILON * singular_values[0]);
    let kept = &singular_values[..rank];
    let widest_step = kept.windows(2).map(|pair| pair[0] / pair[1]).fold(1.0, f64::max);
    Decision {
        rank,
        decided: gap >= MIN_GAP.max(widest_step) && (!stands_out || gap >= MIN_GAP * widest_step),
        gap,
        widest_step,
    }
}

/// Rank of a window that ends at an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowRank {
    /// Number of singular values above the noise floor.
    pub rank: usize,
    /// As [`Observability::gap`]; infinite before the first reading.
    pub gap: f64,
    /// As [`Observability::decided`].
    pub decided: bool,
}

/// Analyses the windows that end at each epoch from the second on; before the first reading the rank is zero.
///
/// # Errors
/// As [`observe`]; [`NavError::Interrupted`] where `stop` asks for an early end.
pub fn growing_windows(system: &System, rescale: Option<&[f64]>, stop: &Stop) -> Result<Vec<WindowRank>, NavError> {
    let without_reading = system
        .epochs
        .iter()
        .take_while(|epoch| epoch.rows.amax() == 0.0)
        .count();
    (2..=system.epochs.len())
        .map(|end| {
            stop.check()?;
            if end <= without_reading {
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

/// States in the order of preference as pivots: misalignment first, since the other states follow from it.
fn naming_order(system: &System) -> Vec<usize> {
    let preference = |kind: StateKind| match kind {
        StateKind::Tilt => 0,
        StateKind::Position => 1,
        StateKind::Velocity => 2,
        StateKind::GyroBias => 3,
        StateKind::AccelBias => 4,
        StateKind::ScaleFactor => 5,
        StateKind::BeamBias => 6,
    };
    let mut order: Vec<usize> = (0..system.states()).collect();
    order.sort_by_key(|&k| preference(system.kinds[k]));
    order
}

/// Reduced row echelon form of a basis in scaled states, returned in SI with pivots of 1.
///
/// The pivot is the first state in `naming` whose entry is at least 0.3 of the largest one left, so no row is divided
/// by a small number.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Kept 1 and 0.5 above a floor of 3.95e-4, a gap of 1,266: a value that is dropped leaves the rank open where it is more than ten
    /// times the next one, or than rounding. With a gap of a thousand times the widest step, 2, it does not.
    #[test]
    fn a_dropped_value_that_stands_out_leaves_the_rank_open() {
        let decided = |dropped: &[f64], floor: f64| {
            let decision = decide(&[&[1.0, 0.5][..], dropped].concat(), floor);
            assert_eq!((decision.rank, decision.widest_step), (2, 2.0));
            decision.decided
        };
        for (next, is_decided) in [(4e-5, true), (3.8e-5, false)] {
            assert_eq!(decided(&[3.9e-4, next], 3.95e-4), is_decided, "{next}");
            assert!(decided(&[1e-4, 0.1 * next], 1e-4));
        }
        for (ulps, is_decided) in [(9.0, true), (11.0, false)] {
            assert_eq!(decided(&[ulps * f64::EPSILON], 3.95e-4), is_decided, "{ulps}");
        }
    }
}
