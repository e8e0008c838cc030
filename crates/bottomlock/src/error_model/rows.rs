//! The covariance of one filter by rows, and its propagation over an interval.

use std::hint::black_box;

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, f64x8};

use super::columns::{LOG, NEAR, READ, each_row, lanes, turned};
use super::noise::HalfNoise;
use super::transition::Spread;
use super::{Interval, ProcessNoise, Span, Step, Stretch};
use crate::layout::{ATTITUDE, BIASED_BEAMS, DIM, DVL_BIAS, DYNAMIC, VELOCITY};
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::simd::columns_of_four;

/// Dynamic rows to which there is noise.
pub(super) const NOISY: usize = DYNAMIC - ATTITUDE;
/// What added to any number leaves its bits.
pub(super) const NOTHING: f64 = -0.0;

/// [`HalfNoise`] as it is added to rows.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct NoiseRows {
    /// Of misalignment and velocity.
    pub(super) near: [[f64; NEAR]; NOISY],
    /// Of the inertial biases, on the diagonal.
    far: [[f64; NEAR]; READ - DYNAMIC],
    pub(super) dvl_bias: f64,
    pub(super) dvl_scale: f64,
}

impl NoiseRows {
    pub(crate) const NONE: Self = Self {
        near: [[NOTHING; NEAR]; NOISY],
        far: [[NOTHING; NEAR]; READ - DYNAMIC],
        dvl_bias: NOTHING,
        dvl_scale: NOTHING,
    };

    #[inline(always)]
    fn set(&mut self, half: &HalfNoise<f64>) {
        for i in 0..3 {
            self.near[i][ATTITUDE - 1 + i] = half.attitude;
            for j in 0..3 {
                let (low, high) = (i.max(j), i.min(j));
                self.near[3 + i][VELOCITY - 1 + j] = half.velocity[low][high];
                self.near[3 + i][ATTITUDE - 1 + j] = half.across[i][j];
                self.near[j][VELOCITY - 1 + i] = half.across[i][j];
            }
        }
        self.set_walks([half.accel_bias, half.gyro_bias, half.dvl_bias, half.dvl_scale]);
    }

    /// Random walks of the biases of accelerometers, gyros and beams, and of the scale factor.
    #[inline(always)]
    pub(super) fn set_walks(&mut self, [accel_bias, gyro_bias, dvl_bias, dvl_scale]: [f64; 4]) {
        for i in 0..3 {
            self.far[i][1 + i] = accel_bias;
            self.far[3 + i][4 + i] = gyro_bias;
        }
        (self.dvl_bias, self.dvl_scale) = (dvl_bias, dvl_scale);
    }

    /// Noise of row i in `near`.
    #[inline(always)]
    fn add_near<S: Simd>(&self, simd: S, i: usize, row: f64x8<S>) -> f64x8<S> {
        if !(ATTITUDE..DYNAMIC).contains(&i) {
            return row;
        }
        row + f64x8::load_array_ref(simd, &self.near[i - ATTITUDE])
    }

    /// Noise of row i in `far`: that of the inertial biases, on the diagonal.
    #[inline(always)]
    fn add_far<S: Simd>(&self, simd: S, i: usize, row: f64x8<S>) -> f64x8<S> {
        if i < DYNAMIC {
            return row;
        }
        row + f64x8::load_array_ref(simd, &self.far[i - DYNAMIC])
    }
}

/// The covariance of one filter: what of it changes, apart from mirror images (see [`super::columns`] for its rows).
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Rows {
    near: [[f64; NEAR]; READ],
    /// The first lane counts in row 0 alone; in others it is what row 0 has of their state.
    far: [[f64; NEAR]; READ],
    log: [[f64; LOG]; READ],
    /// Variances of the states of the log; their covariances stay.
    dvl: [f64; DIM - DVL_BIAS],
}

impl Rows {
    /// Of a whole matrix.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(simd: S, p: &[[f64; DIM]; DIM]) -> Self {
        let mut rows = Self {
            near: [[0.0; NEAR]; READ],
            far: [[0.0; NEAR]; READ],
            log: [[0.0; LOG]; READ],
            dvl: [0.0; DIM - DVL_BIAS],
        };
        for i in 0..READ {
            f64x8::from_slice(simd, &p[i][1..=NEAR]).store_array(&mut rows.near[i]);
            f64x8::from_slice(simd, &p[i][NEAR..2 * NEAR]).store_array(&mut rows.far[i]);
            f64x4::from_slice(simd, &p[i][2 * NEAR..]).store_array(&mut rows.log[i]);
        }
        let first = lanes(simd, 1).select(
            f64x8::simd_from(simd, p[0][0]),
            f64x8::load_array_ref(simd, &rows.far[0]),
        );
        first.store_array(&mut rows.far[0]);
        for k in 0..DIM - DVL_BIAS {
            rows.dvl[k] = p[DVL_BIAS + k][DVL_BIAS + k];
        }
        rows
    }

    /// Writes them into the whole matrix that they were taken from.
    #[inline(always)]
    pub(crate) fn put_into<S: Simd>(&self, simd: S, p: &mut [[f64; DIM]; DIM]) {
        for i in 0..READ {
            // State 8 of `near` overwrites the first lane of `far`.
            f64x8::load_array_ref(simd, &self.far[i]).store_slice(&mut p[i][NEAR..2 * NEAR]);
            f64x8::load_array_ref(simd, &self.near[i]).store_slice(&mut p[i][1..=NEAR]);
            f64x4::load_array_ref(simd, &self.log[i]).store_slice(&mut p[i][2 * NEAR..]);
        }
        let low = columns_of_four(self.logs(simd, 1));
        let high = columns_of_four(self.logs(simd, 1 + LOG));
        for k in 0..LOG {
            low[k].store_slice(&mut p[2 * NEAR + k][1..=LOG]);
            high[k].store_slice(&mut p[2 * NEAR + k][1 + LOG..=NEAR]);
        }
        for i in 1..DYNAMIC {
            p[DVL_BIAS][i] = self.far[i][NEAR - 1];
        }
        p[0][0] = self.far[0][0];
        for i in 1..DIM {
            p[i][0] = p[0][i];
        }
        for k in 0..DIM - DVL_BIAS {
            p[DVL_BIAS + k][DVL_BIAS + k] = self.dvl[k];
        }
    }

    /// Four rows of `log`.
    #[inline(always)]
    fn logs<S: Simd>(&self, simd: S, from: usize) -> [f64x4<S>; LOG] {
        let mut rows = [f64x4::simd_from(simd, 0.0); LOG];
        for k in 0..LOG {
            rows[k] = f64x4::load_array_ref(simd, &self.log[from + k]);
        }
        rows
    }

    /// Element (i, j), both of them dynamic states but the first.
    pub(crate) fn at(&self, i: usize, j: usize) -> f64 {
        self.near[i][j - 1]
    }

    /// State 0 with state i.
    #[inline(always)]
    fn first(&self, i: usize) -> f64 {
        if i == 0 {
            self.far[0][0]
        } else if i < DYNAMIC {
            self.near[0][i - 1]
        } else {
            self.far[0][1 + i - DYNAMIC]
        }
    }

    /// P⁺ = Φ(P + Q₀ T/2)Φᵀ + Q₁ T/2, bit for bit what [`Span::propagate`] makes of it.
    ///
    /// Memory is read [`anew`] wherever registers are to be free again: else the compiler puts off arithmetic, or keeps coefficients
    /// and rows, until they push each other out.
    #[inline(always)]
    pub(super) fn propagate<S: Simd>(&mut self, simd: S, phi: &impl Spread, first: &NoiseRows, second: &NoiseRows) {
        // Φ P eight columns at a time; with the steady states that is all.
        anew(phi);
        let log = phi.apply_over(&each_row!(I => f64x4::load_array_ref(simd, &self.log[I])));
        for i in 0..DYNAMIC {
            log[i].store_array(&mut self.log[i]);
        }
        anew(&*self);
        anew(phi);
        // A mask that is not known beforehand is a masked load; one that is, is two shuffles.
        let alone = lanes(simd, black_box(1));
        let old = each_row!(I => {
            let row = f64x8::load_array_ref(simd, &self.far[I]);
            let row = if I == 0 { row } else { alone.select(f64x8::simd_from(simd, self.first(I)), row) };
            first.add_far(simd, I, row)
        });
        let mut far = phi.apply_over(&old);
        for i in 1..DYNAMIC {
            far[i].store_array(&mut self.far[i]);
        }
        for i in DYNAMIC..READ {
            second.add_far(simd, i, old[i]).store_array(&mut self.far[i]);
        }
        anew(&*self);
        anew(phi);
        let near = phi.apply_over(&each_row!(I => first.add_near(simd, I, f64x8::load_array_ref(simd, &self.near[I]))));
        for i in 1..DYNAMIC {
            far[i] = f64x8::load_array_ref(simd, &self.far[i]);
        }
        // (Φ P) Φᵀ.
        anew(phi);
        let new = turned(simd, &near, &far, phi);
        for i in 0..DYNAMIC {
            second.add_near(simd, i, new.near[i]).store_array(&mut self.near[i]);
        }
        for i in DYNAMIC..READ {
            new.biases[i - DYNAMIC].store_array(&mut self.near[i]);
        }
        alone
            .select(f64x8::simd_from(simd, new.first), far[0])
            .store_array(&mut self.far[0]);
        for noise in [first, second] {
            for variance in &mut self.dvl[..BIASED_BEAMS] {
                *variance += noise.dvl_bias;
            }
            self.dvl[BIASED_BEAMS] += noise.dvl_scale;
        }
    }
}

/// What follows reads memory anew. The address is not taken from the black box: stores whose address comes late let loads run ahead
/// of them in vain.
#[inline(always)]
fn anew<T>(thing: &T) {
    let _ = black_box(thing);
}

/// The noise of both halves of an interval.
#[derive(Debug, Clone, Copy)]
struct Halves {
    first: NoiseRows,
    second: NoiseRows,
}

/// A covariance that is propagated again and again before anything else is asked of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Underway {
    pub(crate) rows: Rows,
    halves: Halves,
}

impl Underway {
    /// Of a whole matrix.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(simd: S, p: &[[f64; DIM]; DIM]) -> Self {
        Self {
            rows: Rows::of(simd, p),
            halves: Halves {
                first: NoiseRows::NONE,
                second: NoiseRows::NONE,
            },
        }
    }
}

/// An interval of one filter alone.
pub(crate) trait Single: Span<f64> + Into<Interval> {
    /// [`Span::propagate`], bit for bit.
    fn propagate_rows<S: Simd>(
        &mut self,
        simd: S,
        p: &mut Underway,
        end: &Kinematics<f64>,
        noise: &ProcessNoise,
        earth: &EarthTerms,
    );
}

macro_rules! single {
    ($kind:ident, $second:ident) => {
        impl From<$kind<f64>> for Interval {
            #[inline(always)]
            fn from(interval: $kind<f64>) -> Self {
                Self::$kind(interval)
            }
        }

        impl Single for $kind<f64> {
            #[inline(always)]
            fn propagate_rows<S: Simd>(
                &mut self,
                simd: S,
                p: &mut Underway,
                end: &Kinematics<f64>,
                noise: &ProcessNoise,
                earth: &EarthTerms,
            ) {
                let halves = &mut p.halves;
                halves.$second.set(&self.second_noise(end, noise));
                halves.first.set(&self.first_noise(noise));
                p.rows
                    .propagate(simd, &self.transition(end, earth), &halves.first, &halves.$second);
                self.empty(end);
            }
        }
    };
}

// The noise of both halves of a step is the same.
single!(Step, first);
single!(Stretch, second);

#[cfg(test)]
#[path = "rows_tests.rs"]
mod tests;
