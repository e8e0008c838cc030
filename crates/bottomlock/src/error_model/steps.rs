//! Eight intervals of one step each, their coefficients and noise worked out side by side.

use fearless_simd::f64x8;
use fearless_simd::prelude::*;

use super::columns::NEAR;
use super::noise::HalfNoise;
use super::rows::{NOISY, NOTHING, NoiseRows, Rows};
use super::transition::{FirstOrder, Parts, Spread, Transition};
use super::{Coefficients, Interval, ProcessNoise, Step};
use crate::layout::{ATTITUDE, DVL_BIAS, DYNAMIC, VELOCITY};
use crate::mechanisation::EarthTerms;
use crate::mechanisation::step_block::{Course, STEPS, Table, before};
use crate::simd::{Lane, V3, columns_of_eight, scale, splat3};

/// Numbers of [`Coefficients`].
const COEFFICIENTS: usize = 27;

/// Transitions and noise of eight steps.
pub(crate) struct Steps {
    /// The coefficients, ω_ie T and T.
    of: Table<{ COEFFICIENTS + 4 }>,
    /// Coefficients at the ends.
    ends: Table<COEFFICIENTS>,
    noise: [NoiseRows; STEPS],
}

/// Coefficients at the end of the step before each of eight.
pub(crate) struct Last<S: Simd>([f64x8<S>; COEFFICIENTS]);

impl<S: Simd> Last<S> {
    /// Those that an empty interval has kept.
    #[inline(always)]
    pub(crate) fn of(simd: S, step: &Step<f64>) -> Self {
        let own = step.last.to_array();
        let mut last = [f64x8::simd_from(simd, 0.0); COEFFICIENTS];
        for i in 0..COEFFICIENTS {
            last[i] = f64x8::simd_from(simd, own[i]);
        }
        Self(last)
    }
}

impl Steps {
    pub(crate) const EMPTY: Self = Self {
        of: Table::EMPTY,
        ends: Table::EMPTY,
        noise: [NoiseRows::NONE; STEPS],
    };

    /// Takes the steps of a course, as [`Step`] takes one.
    #[inline(always)]
    pub(crate) fn take<S: Simd>(
        &mut self,
        course: &Course<S>,
        last: &mut Last<S>,
        noise: &ProcessNoise,
        earth: &EarthTerms,
    ) {
        let dt = course.dt_s;
        let taken = Coefficients::at(&course.after, &course.end, earth);
        let ends = taken.to_array();
        for i in 0..COEFFICIENTS {
            last.0[i] = before(last.0[i], ends[i]);
        }
        let half = dt * dt.splat(0.5);
        let sum = Coefficients::scaled_sum(&Coefficients::from_array(last.0), &taken, half);
        last.0 = ends;
        self.ends.put(&ends);
        let all = sum.to_array();
        let turn_t = scale(splat3(dt, earth.rate_t), dt);
        let mut of = [dt; COEFFICIENTS + 4];
        of[..COEFFICIENTS].copy_from_slice(&all);
        of[COEFFICIENTS..COEFFICIENTS + 3].copy_from_slice(&turn_t);
        self.of.put(&of);
        self.take_noise(dt, &sum.noise(dt, noise));
    }

    #[inline(always)]
    fn take_noise<S: Simd>(&mut self, dt: f64x8<S>, half: &HalfNoise<f64x8<S>>) {
        let nothing = dt.splat(NOTHING);
        let mut near = [[nothing; NEAR]; NOISY];
        for i in 0..3 {
            near[i][ATTITUDE - 1 + i] = half.attitude;
            for j in 0..3 {
                near[3 + i][VELOCITY - 1 + j] = half.velocity[i.max(j)][i.min(j)];
                near[3 + i][ATTITUDE - 1 + j] = half.across[i][j];
                near[j][VELOCITY - 1 + i] = half.across[i][j];
            }
        }
        for i in 0..NOISY {
            let rows = columns_of_eight(near[i]);
            for k in 0..STEPS {
                rows[k].store_array(&mut self.noise[k].near[i]);
            }
        }
        let mut walks = Table::<4>::EMPTY;
        walks.put(&[half.accel_bias, half.gyro_bias, half.dvl_bias, half.dvl_scale]);
        for k in 0..STEPS {
            self.noise[k].set_walks(walks.of(k));
        }
    }

    /// Propagates the covariance over step k.
    #[inline(always)]
    pub(crate) fn propagate<S: Simd>(&self, simd: S, k: usize, rows: &mut Rows) {
        let noise = &self.noise[k];
        rows.propagate(simd, &AtStep { steps: self, k }, noise, noise);
    }

    /// Step k as an interval that has come to its end.
    #[inline(always)]
    pub(crate) fn interval(&self, k: usize) -> Interval {
        let at = AtStep { steps: self, k };
        Interval::Step(Step {
            sum: at.coefficients(0.0),
            last: Coefficients::from_array(self.ends.of(k)),
            duration_s: at.duration_s(),
        })
    }

    /// The interval that is empty after step k.
    #[inline(always)]
    pub(crate) fn empty_after(&self, k: usize) -> Interval {
        let last = Coefficients::from_array(self.ends.of(k));
        Interval::Step(Step {
            sum: last,
            last,
            duration_s: 0.0,
        })
    }
}

/// The transition of step k.
struct AtStep<'a> {
    steps: &'a Steps,
    k: usize,
}

impl AtStep<'_> {
    #[inline(always)]
    fn duration_s(&self) -> f64 {
        self.steps.of.at(COEFFICIENTS + 3, self.k)
    }
    #[inline(always)]
    fn coefficients<V: Lane>(&self, like: V) -> Coefficients<V> {
        let mut own = [like; COEFFICIENTS];
        for i in 0..COEFFICIENTS {
            own[i] = like.splat(self.steps.of.at(i, self.k));
        }
        Coefficients::from_array(own)
    }
    #[inline(always)]
    fn turn_t(&self) -> V3<f64> {
        let at = |i: usize| self.steps.of.at(COEFFICIENTS + i, self.k);
        [at(0), at(1), at(2)]
    }
}

/// The rows of Φ x at a step, over numbers or vectors.
macro_rules! phi {
    ($at:ident, $like:expr, $phi:ident => $rows:expr) => {{
        let sum = $at.coefficients($like);
        let $phi = FirstOrder::of(&sum, splat3($like, $at.turn_t()), $like.splat(-$at.duration_s()));
        $rows
    }};
}

impl Transition<f64> for AtStep<'_> {
    #[inline(always)]
    fn position(&self, x: &Parts<f64>) -> V3<f64> {
        phi!(self, x.r[0], phi => phi.position(x))
    }
    #[inline(always)]
    fn attitude(&self, x: &Parts<f64>) -> V3<f64> {
        phi!(self, x.r[0], phi => phi.attitude(x))
    }
    #[inline(always)]
    fn velocity(&self, x: &Parts<f64>) -> V3<f64> {
        phi!(self, x.r[0], phi => phi.velocity(x))
    }
}

impl Spread for AtStep<'_> {
    #[inline(always)]
    fn apply_over<V: Lane>(&self, x: &[V; DVL_BIAS]) -> [V; DYNAMIC] {
        phi!(self, x[0], phi => phi.apply(x))
    }
}
