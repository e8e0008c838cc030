//! The covariance of one filter by rows, and its propagation over an interval.

use std::hint::black_box;

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, f64x8};

use super::columns::{LOG, NEAR, READ, Sandwich, each_row, lanes, turned, with_first};
use super::noise::HalfNoise;
use super::transition::Spread;
use super::{Interval, ProcessNoise, Span, Step, Stretch};
use crate::imu::{EarthTerms, Kinematics};
use crate::layout::{ACCEL_BIAS, ATTITUDE, BIASED_BEAMS, DIM, DVL_BIAS, DVL_SCALE, DYNAMIC, GYRO_BIAS, VELOCITY};

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
    pub(super) accel_bias: f64,
    pub(super) gyro_bias: f64,
    pub(super) dvl_bias: f64,
    pub(super) dvl_scale: f64,
}

impl NoiseRows {
    pub(crate) const NONE: Self = Self {
        near: [[NOTHING; NEAR]; NOISY],
        accel_bias: NOTHING,
        gyro_bias: NOTHING,
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
                self.near[3 + i][ATTITUDE - 1 + j] = half.across[j][i];
                self.near[j][VELOCITY - 1 + i] = half.across[j][i];
            }
        }
        self.accel_bias = half.accel_bias;
        self.gyro_bias = half.gyro_bias;
        self.dvl_bias = half.dvl_bias;
        self.dvl_scale = half.dvl_scale;
    }

    /// Noise of row i in `near`.
    #[inline(always)]
    fn add_near<S: Simd>(&self, simd: S, i: usize, row: f64x8<S>) -> f64x8<S> {
        if i < ATTITUDE || i >= DYNAMIC {
            return row;
        }
        row + f64x8::load_array_ref(simd, &self.near[i - ATTITUDE])
    }

    /// Noise of row i in `far`: that of the inertial biases, on the diagonal.
    #[inline(always)]
    fn add_far<S: Simd>(&self, simd: S, i: usize, row: f64x8<S>) -> f64x8<S> {
        if i < ACCEL_BIAS {
            return row;
        }
        let noise = if i < GYRO_BIAS { self.accel_bias } else { self.gyro_bias };
        let own = lanes(simd, 2 << (i - ACCEL_BIAS));
        row + own.select(f64x8::simd_from(simd, noise), f64x8::simd_from(simd, NOTHING))
    }
}

/// A symmetric covariance whose rows can be had as vectors (see [`super::columns`]).
trait Held<S: Simd> {
    /// States 1 to 8 of row i.
    fn near(&self, simd: S, i: usize) -> f64x8<S>;
    /// States 9 to 15 of row i, in the lanes after the first.
    fn far(&self, simd: S, i: usize) -> f64x8<S>;
    /// The last four states of row i.
    fn log(&self, simd: S, i: usize) -> f64x4<S>;
    /// State 0 with state i.
    fn first(&self, i: usize) -> f64;
    /// Puts a new row of an inertial bias.
    fn put_bias(&mut self, i: usize, near: f64x8<S>, far: f64x8<S>);
    /// Puts the new dynamic rows and all else that mirrors them.
    fn put(&mut self, new: &Sandwich<S>);
    /// Noise of the states of the log, on the diagonal.
    fn add_dvl(&mut self, simd: S, first: &NoiseRows, second: &NoiseRows);
}

/// P⁺ = Φ(P + Q₀ T/2)Φᵀ + Q₁ T/2, bit for bit what [`Span::propagate`] makes of it.
#[inline(always)]
fn propagate<S: Simd>(simd: S, p: &mut impl Held<S>, phi: &impl Spread, first: &NoiseRows, second: &NoiseRows) {
    // Columns of Φ P, eight at a time. Each time anew, the coefficients come from memory: kept in registers, they push each
    // other out.
    let near = black_box(phi).apply_over(&each_row!(I => first.add_near(simd, I, p.near(simd, I))));
    let read = each_row!(I => first.add_far(simd, I, with_first(simd, p.far(simd, I), p.first(I))));
    let far = black_box(phi).apply_over(&read);
    let log = black_box(phi).apply_over(&each_row!(I => p.log(simd, I)));
    let mut new = turned(simd, &near, far, log, black_box(phi));
    for i in DYNAMIC..READ {
        p.put_bias(i, new.steady[i - DYNAMIC], second.add_far(simd, i, read[i]));
    }
    for i in ATTITUDE..DYNAMIC {
        new.near[i] = second.add_near(simd, i, new.near[i]);
    }
    p.put(&new);
    p.add_dvl(simd, first, second);
}

/// The covariance of a filter that takes many steps: what of it changes, apart from mirror images.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Rows {
    near: [[f64; NEAR]; READ],
    far: [[f64; NEAR]; READ],
    log: [[f64; LOG]; READ],
    /// Variances of the states of the log; their covariances stay.
    dvl: [f64; DIM - DVL_BIAS],
}

impl Rows {
    /// Of a whole matrix.
    #[inline(always)]
    pub(crate) fn of(p: &[[f64; DIM]; DIM]) -> Self {
        let mut rows = Self {
            near: [[0.0; NEAR]; READ],
            far: [[0.0; NEAR]; READ],
            log: [[0.0; LOG]; READ],
            dvl: [0.0; DIM - DVL_BIAS],
        };
        for i in 0..READ {
            rows.near[i].copy_from_slice(&p[i][1..=NEAR]);
            rows.far[i].copy_from_slice(&p[i][NEAR..2 * NEAR]);
            rows.far[i][0] = p[i][0];
            rows.log[i].copy_from_slice(&p[i][2 * NEAR..]);
        }
        for k in 0..DIM - DVL_BIAS {
            rows.dvl[k] = p[DVL_BIAS + k][DVL_BIAS + k];
        }
        rows
    }

    /// P⁺ = Φ(P + Q₀ T/2)Φᵀ + Q₁ T/2.
    #[inline(always)]
    pub(super) fn propagate<S: Simd>(&mut self, simd: S, phi: &impl Spread, first: &NoiseRows, second: &NoiseRows) {
        propagate(simd, self, phi, first, second);
    }

    /// Writes them into the whole matrix that they were taken from.
    #[inline(always)]
    pub(crate) fn put_into(&self, p: &mut [[f64; DIM]; DIM]) {
        for i in 0..READ {
            p[i][NEAR..2 * NEAR].copy_from_slice(&self.far[i]);
            p[i][1..=NEAR].copy_from_slice(&self.near[i]);
            p[i][2 * NEAR..].copy_from_slice(&self.log[i]);
        }
        p[0][0] = self.far[0][0];
        for i in 0..DYNAMIC {
            for j in 1.max(i + 1)..DIM {
                p[j][i] = p[i][j];
            }
        }
        for k in 0..DIM - DVL_BIAS {
            p[DVL_BIAS + k][DVL_BIAS + k] = self.dvl[k];
        }
    }
}

impl<S: Simd> Held<S> for Rows {
    #[inline(always)]
    fn near(&self, simd: S, i: usize) -> f64x8<S> {
        f64x8::load_array_ref(simd, &self.near[i])
    }
    #[inline(always)]
    fn far(&self, simd: S, i: usize) -> f64x8<S> {
        f64x8::load_array_ref(simd, &self.far[i])
    }
    #[inline(always)]
    fn log(&self, simd: S, i: usize) -> f64x4<S> {
        f64x4::load_array_ref(simd, &self.log[i])
    }
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
    #[inline(always)]
    fn put_bias(&mut self, i: usize, near: f64x8<S>, far: f64x8<S>) {
        near.store_array(&mut self.near[i]);
        far.store_array(&mut self.far[i]);
    }
    #[inline(always)]
    fn put(&mut self, new: &Sandwich<S>) {
        for i in 0..DYNAMIC {
            new.near[i].store_array(&mut self.near[i]);
            new.far[i].store_array(&mut self.far[i]);
            new.log[i].store_array(&mut self.log[i]);
        }
    }
    #[inline(always)]
    fn add_dvl(&mut self, _simd: S, first: &NoiseRows, second: &NoiseRows) {
        for noise in [first, second] {
            for variance in &mut self.dvl[..BIASED_BEAMS] {
                *variance += noise.dvl_bias;
            }
            self.dvl[BIASED_BEAMS] += noise.dvl_scale;
        }
    }
}

impl<S: Simd> Held<S> for [[f64; DIM]; DIM] {
    #[inline(always)]
    fn near(&self, simd: S, i: usize) -> f64x8<S> {
        f64x8::from_slice(simd, &self[i][1..=NEAR])
    }
    #[inline(always)]
    fn far(&self, simd: S, i: usize) -> f64x8<S> {
        f64x8::from_slice(simd, &self[i][NEAR..2 * NEAR])
    }
    #[inline(always)]
    fn log(&self, simd: S, i: usize) -> f64x4<S> {
        f64x4::from_slice(simd, &self[i][2 * NEAR..])
    }
    #[inline(always)]
    fn first(&self, i: usize) -> f64 {
        self[0][i]
    }
    #[inline(always)]
    fn put_bias(&mut self, i: usize, near: f64x8<S>, far: f64x8<S>) {
        // State 8 of `near` overwrites the lane of `far` that is none.
        far.store_slice(&mut self[i][NEAR..2 * NEAR]);
        near.store_slice(&mut self[i][1..=NEAR]);
    }
    #[inline(always)]
    fn put(&mut self, new: &Sandwich<S>) {
        for i in 0..DYNAMIC {
            self.put_bias(i, new.near[i], new.far[i]);
            new.log[i].store_slice(&mut self[i][2 * NEAR..]);
        }
        new.steady[NEAR - 2].store_slice(&mut self[DVL_BIAS][1..=NEAR]);
        let (low, high) = (
            transposed([new.log[1], new.log[2], new.log[3], new.log[4]]),
            transposed([new.log[5], new.log[6], new.log[7], new.log[8]]),
        );
        for k in 0..LOG {
            low[k].store_slice(&mut self[2 * NEAR + k][1..=LOG]);
            high[k].store_slice(&mut self[2 * NEAR + k][1 + LOG..=NEAR]);
        }
        self[0][0] = new.far[0].as_array()[0];
        for i in 1..DIM {
            self[i][0] = self[0][i];
        }
    }
    #[inline(always)]
    fn add_dvl(&mut self, _simd: S, first: &NoiseRows, second: &NoiseRows) {
        for noise in [first, second] {
            for i in DVL_BIAS..DVL_SCALE {
                self[i][i] += noise.dvl_bias;
            }
            self[DVL_SCALE][DVL_SCALE] += noise.dvl_scale;
        }
    }
}

#[inline(always)]
fn transposed<S: Simd>([a, b, c, d]: [f64x4<S>; 4]) -> [f64x4<S>; 4] {
    let (ac, bd) = ((a.zip_low(c), a.zip_high(c)), (b.zip_low(d), b.zip_high(d)));
    [
        ac.0.zip_low(bd.0),
        ac.0.zip_high(bd.0),
        ac.1.zip_low(bd.1),
        ac.1.zip_high(bd.1),
    ]
}

/// The noise of both halves of an interval, worked out before it is needed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Halves {
    first: NoiseRows,
    second: NoiseRows,
}

impl Halves {
    pub(crate) const NONE: Self = Self {
        first: NoiseRows::NONE,
        second: NoiseRows::NONE,
    };
}

/// An interval of one filter alone.
pub(crate) trait Single: Span<f64> + Into<Interval> {
    /// Notes its noise, when it has come to `end`.
    fn note_noise(&self, halves: &mut Halves, end: &Kinematics<f64>, noise: &ProcessNoise);
    /// [`Span::propagate`] with that noise.
    fn propagate_rows<S: Simd>(
        &mut self,
        simd: S,
        rows: &mut Rows,
        halves: &Halves,
        end: &Kinematics<f64>,
        earth: &EarthTerms,
    );
    /// [`Span::propagate`] on a whole matrix.
    fn propagate_dense<S: Simd>(
        &mut self,
        simd: S,
        p: &mut [[f64; DIM]; DIM],
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
            fn note_noise(&self, halves: &mut Halves, end: &Kinematics<f64>, noise: &ProcessNoise) {
                halves.$second.set(&self.second_noise(end, noise));
                halves.first.set(&self.first_noise(noise));
            }
            #[inline(always)]
            fn propagate_rows<S: Simd>(
                &mut self,
                simd: S,
                rows: &mut Rows,
                halves: &Halves,
                end: &Kinematics<f64>,
                earth: &EarthTerms,
            ) {
                propagate(
                    simd,
                    rows,
                    &self.transition(end, earth),
                    &halves.first,
                    &halves.$second,
                );
                self.empty(end);
            }
            #[inline(always)]
            fn propagate_dense<S: Simd>(
                &mut self,
                simd: S,
                p: &mut [[f64; DIM]; DIM],
                end: &Kinematics<f64>,
                noise: &ProcessNoise,
                earth: &EarthTerms,
            ) {
                let mut halves = Halves::NONE;
                self.note_noise(&mut halves, end, noise);
                propagate(
                    simd,
                    p,
                    &self.transition(end, earth),
                    &halves.first,
                    &halves.$second,
                );
                self.empty(end);
            }
        }
    };
}

// The noise of both halves of a step is the same.
single!(Step, first);
single!(Stretch, second);
