//! A symmetric covariance by its lower triangle: what a filter keeps from one update to the next.

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, f64x8, mask64x4};
use nalgebra::SMatrix;

use super::columns::{VECTORS, WIDE, WIDTH};
use crate::layout::DIM;
use crate::simd::{columns_of_eight, columns_of_four, symmetric_of_eight, with_vectors};
use crate::state::Covariance;

/// Elements on and below the diagonal.
pub(super) const PACKED: usize = DIM * (DIM + 1) / 2;

/// Elements on and below the diagonal, column by column.
#[derive(Debug, Clone, Copy)]
pub(super) struct Packed(pub(super) [f64; PACKED]);

/// Where column j would begin if it were whole: the elements above the diagonal are in truth the end of the column before.
const fn start(j: usize) -> usize {
    j * (2 * DIM - 1 - j) / 2
}

/// Where element (i, j) on or below the diagonal is.
#[inline(always)]
pub(super) const fn place(i: usize, j: usize) -> usize {
    start(j) + i
}

impl Packed {
    /// Of a matrix, of which nothing above the diagonal is read.
    pub(super) fn of(matrix: &Covariance) -> Self {
        let mut packed = Self([0.0; PACKED]);
        packed.set(matrix);
        packed
    }

    pub(super) fn set(&mut self, matrix: &Covariance) {
        with_vectors!(simd => self.set_within(simd, &matrix.data.0));
    }

    #[inline(always)]
    pub(super) fn set_within<S: Simd>(&mut self, simd: S, matrix: &[[f64; DIM]; DIM]) {
        // From the last to the first: each column's end overwrites what the one after it has from above the diagonal.
        for j in (0..DIM).rev() {
            let (column, own) = (&matrix[j], &mut self.0[start(j)..start(j) + DIM]);
            f64x8::from_slice(simd, &column[..WIDE]).store_slice(&mut own[..WIDE]);
            f64x8::from_slice(simd, &column[WIDE..2 * WIDE]).store_slice(&mut own[WIDE..2 * WIDE]);
            f64x4::from_slice(simd, &column[2 * WIDE..]).store_slice(&mut own[2 * WIDE..]);
        }
    }

    /// The whole matrix.
    pub(super) fn whole(&self) -> Covariance {
        let mut matrix = Covariance::zeros();
        with_vectors!(simd => self.put_within(simd, &mut matrix.data.0));
        matrix
    }

    /// Every column is written as it will be read: else it would have to cross_covariance memory first.
    #[inline(always)]
    pub(super) fn put_within<S: Simd>(&self, simd: S, matrix: &mut [[f64; DIM]; DIM]) {
        let (a, b) = (triangle::<_, 0>(simd, &self.0), triangle::<_, WIDE>(simd, &self.0));
        let mut below = [a[0]; WIDE];
        let mut ends = [[f64x4::simd_from(simd, 0.0); WIDTH]; VECTORS];
        for k in 0..WIDE {
            below[k] = f64x8::from_slice(simd, &self.0[start(k) + WIDE..start(k) + 2 * WIDE]);
        }
        for j in 0..DIM {
            ends[j / WIDTH][j % WIDTH] = f64x4::from_slice(simd, &self.0[start(j) + 2 * WIDE..start(j) + DIM]);
        }
        let left = columns_of_eight(below);
        for k in 0..WIDE {
            a[k].store_slice(&mut matrix[k][..WIDE]);
            below[k].store_slice(&mut matrix[k][WIDE..2 * WIDE]);
            left[k].store_slice(&mut matrix[WIDE + k][..WIDE]);
            b[k].store_slice(&mut matrix[WIDE + k][WIDE..2 * WIDE]);
        }
        for j in 0..2 * WIDE {
            ends[j / WIDTH][j % WIDTH].store_slice(&mut matrix[j][2 * WIDE..]);
        }
        let last = ends[4];
        for v in 0..VECTORS {
            ends[v] = columns_of_four(ends[v]);
        }
        for k in 0..WIDTH {
            let column = &mut matrix[2 * WIDE + k];
            ends[0][k].combine(ends[1][k]).store_slice(&mut column[..WIDE]);
            ends[2][k].combine(ends[3][k]).store_slice(&mut column[WIDE..2 * WIDE]);
            let below = mask64x4::from_bitmask(simd, 0xf << k & 0xf);
            below.select(last[k], ends[4][k]).store_slice(&mut column[2 * WIDE..]);
        }
    }

    /// Columns from the one at `from` on.
    pub(super) fn columns<const N: usize>(&self, from: usize) -> SMatrix<f64, DIM, N> {
        SMatrix::from_fn(|i, k| self.at(i, from + k))
    }

    /// Element (i, j).
    pub(super) fn at(&self, i: usize, j: usize) -> f64 {
        self.0[place(i.max(j), i.min(j))]
    }

    /// Multiplies the covariance of the first `states` states among themselves.
    pub(super) fn scale_first(&mut self, states: usize, factor: f64) {
        for j in 0..states {
            self.0[place(j, j)..place(states, j)]
                .iter_mut()
                .for_each(|element| *element *= factor);
        }
    }
}

/// The eight states from `FROM` on among themselves.
#[inline(always)]
fn triangle<S: Simd, const FROM: usize>(simd: S, packed: &[f64; PACKED]) -> [f64x8<S>; WIDE] {
    let mut columns = [f64x8::simd_from(simd, 0.0); WIDE];
    for k in 0..WIDE {
        let from = start(FROM + k) + FROM;
        columns[k] = f64x8::from_slice(simd, &packed[from..from + WIDE]);
    }
    symmetric_of_eight(simd, columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::on_every_level;

    fn numbered() -> Covariance {
        Covariance::from_fn(|i, j| (100 * i.max(j) + i.min(j)) as f64)
    }

    /// The triangle holds each element once, in the order of columns, and gives the matrix back.
    #[test]
    fn triangle_and_matrix_are_the_same() {
        let matrix = numbered();
        on_every_level!(simd => {
            let mut packed = Packed([f64::NAN; PACKED]);
            packed.set_within(simd, &matrix.data.0);
            assert_eq!(packed.0[..3], [0.0, 100.0, 200.0]);
            assert_eq!(packed.0[DIM..DIM + 2], [101.0, 201.0]);
            assert_eq!(packed.0[PACKED - 1], 1919.0);
            let mut back = Covariance::repeat(f64::NAN);
            packed.put_within(simd, &mut back.data.0);
            assert_eq!(back, matrix);
        });
        let packed = Packed::of(&matrix);
        assert_eq!((packed.at(7, 12), packed.at(12, 7)), (1207.0, 1207.0));
        assert_eq!(packed.columns::<3>(6), matrix.fixed_columns::<3>(6));
    }

    #[test]
    fn only_the_first_states_are_scaled() {
        let mut packed = Packed::of(&numbered());
        packed.scale_first(15, 2.0);
        let factor = |i: usize, j: usize| if i.max(j) < 15 { 2.0 } else { 1.0 };
        let expected = Covariance::from_fn(|i, j| numbered()[(i, j)] * factor(i, j));
        assert_eq!(packed.whole(), expected);
    }
}
