//! P ← Φ P Φᵀ: several filters in the lanes of vectors, or one filter with four columns in them.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f64x4};

use super::transition::{FirstOrder, Parts, SecondOrder, Spread, Transition};
use super::{HalfNoise, Interval, ProcessNoise};
use crate::imu::EarthTerms;
use crate::lane::{Lane, V3, level};
use crate::layout::{ATTITUDE, DIM, DYNAMIC, POSITION, VELOCITY};

/// P ← Φ P Φᵀ for a symmetric P, result exactly symmetric.
///
/// In place. Velocity and position go before what they read: position reads old misalignment and velocity, velocity reads old
/// misalignment.
#[inline(always)]
pub(super) fn sandwich<T: Lane>(p: &mut [[T; DIM]; DIM], phi: &impl Transition<T>) {
    // Φ P, column by column: only the dynamic rows change.
    for column in p.iter_mut() {
        put(column, POSITION, phi.position(&Parts::of(column)));
    }
    for column in p.iter_mut() {
        put(column, VELOCITY, phi.velocity(&Parts::of(column)));
    }
    for column in p.iter_mut() {
        put(column, ATTITUDE, phi.attitude(&Parts::of(column)));
    }
    // (Φ P) Φᵀ, row by row, below the diagonal; what is written above it no later row reads.
    for i in POSITION..DYNAMIC {
        mirror(p, i, POSITION, phi.position(&Parts::of(&row_of(p, i))));
    }
    for i in VELOCITY..DYNAMIC {
        mirror(p, i, VELOCITY, phi.velocity(&Parts::of(&row_of(p, i))));
    }
    for i in ATTITUDE..DYNAMIC {
        mirror(p, i, ATTITUDE, phi.attitude(&Parts::of(&row_of(p, i))));
    }
    for i in 0..DYNAMIC {
        for j in DYNAMIC..DIM {
            p[i][j] = p[j][i];
        }
    }
}

#[inline(always)]
fn put<T: Lane>(column: &mut [T; DIM], from: usize, image: V3<T>) {
    column[from] = image[0];
    column[from + 1] = image[1];
    column[from + 2] = image[2];
}

/// Writes three elements of row i, as far as the diagonal, and their mirror images.
#[inline(always)]
fn mirror<T: Lane>(p: &mut [[T; DIM]; DIM], i: usize, from: usize, image: V3<T>) {
    for k in 0..3 {
        if from + k <= i {
            p[i][from + k] = image[k];
            p[from + k][i] = image[k];
        }
    }
}

#[inline(always)]
fn row_of<T: Lane>(columns: &[[T; DIM]; DIM], i: usize) -> [T; DIM] {
    let mut row = columns[0];
    for j in 0..DIM {
        row[j] = columns[j][i];
    }
    row
}

/// Columns side by side.
const WIDTH: usize = 4;
/// The dynamic rows, filled up to whole vectors.
const ROWS: usize = DYNAMIC.next_multiple_of(WIDTH);

/// [`sandwich`] of one filter: the same operations on every element, four elements at a time.
#[inline(always)]
fn sandwich_by_columns<S: Simd>(simd: S, p: &mut [[f64; DIM]; DIM], phi: &impl Spread) {
    let zero = f64x4::simd_from(simd, 0.0);
    let phi = phi.over(zero);
    // Columns of the dynamic rows of Φ P, as in `sandwich`, and the same by rows.
    let mut columns = [[0.0; ROWS]; DIM];
    let mut rows = [[0.0; DIM]; DYNAMIC];
    for j in (0..DIM).step_by(WIDTH) {
        let mut x = [zero; DIM];
        for i in 0..DIM {
            // P is symmetric: four elements of a row stand in a row of the storage.
            x[i] = f64x4::from_slice(simd, &p[i][j..j + WIDTH]);
        }
        let image = phi.apply(&x);
        for i in 0..DYNAMIC {
            image[i].store_slice(&mut rows[i][j..j + WIDTH]);
            for lane in 0..WIDTH {
                columns[j + lane][i] = image[i][lane];
            }
        }
    }
    for i in (0..ROWS).step_by(WIDTH) {
        let mut x = [zero; DIM];
        for j in 0..DIM {
            x[j] = f64x4::from_slice(simd, &columns[j][i..i + WIDTH]);
        }
        let image = phi.apply(&x);
        for lane in 0..WIDTH.min(DYNAMIC - i) {
            for k in 0..=i + lane {
                p[i + lane][k] = image[k][lane];
                p[k][i + lane] = image[k][lane];
            }
        }
    }
    for i in 0..DYNAMIC {
        for j in DYNAMIC..DIM {
            p[i][j] = rows[i][j];
            p[j][i] = rows[i][j];
        }
    }
}

impl Interval<f64> {
    /// [`Interval::propagate`] for one filter, bit for bit, with its columns in the lanes of the machine's vectors.
    pub fn propagate_one(
        &mut self,
        p: &mut [[f64; DIM]; DIM],
        noise: &ProcessNoise,
        earth: &EarthTerms,
        second_order: bool,
    ) {
        if self.duration_s <= 0.0 {
            return;
        }
        dispatch!(level(), simd => self.by_columns(simd, p, noise, earth, second_order));
        self.empty_again();
    }

    #[inline(always)]
    fn by_columns<S: Simd>(
        &self,
        simd: S,
        p: &mut [[f64; DIM]; DIM],
        noise: &ProcessNoise,
        earth: &EarthTerms,
        second_order: bool,
    ) {
        let half = HalfNoise::new(&self.mean(), noise, self.duration_s);
        half.add_to(p);
        if second_order {
            sandwich_by_columns(simd, p, &SecondOrder::new(&self.sum, self.duration_s, earth));
        } else {
            sandwich_by_columns(simd, p, &FirstOrder::new(&self.sum, self.duration_s, earth));
        }
        half.add_to(p);
    }
}
