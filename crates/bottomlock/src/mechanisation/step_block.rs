//! Strapdown steps of one filter, eight in the lanes of vectors.
//!
//! Of a step only a little waits for the step before: the product of the attitude with a rotation that follows from the readings
//! alone, and the sums that velocity and position are. That is done number by number; all else for eight steps at once.

use fearless_simd::f64x8;
use fearless_simd::prelude::*;

use super::{
    EarthTerms, ImuSample, Inertial, KINEMATICS, Kinematics, Sampling, frame_turn, integrate_velocity_position,
    platform_turn, rotation_matrix, turned, velocity_increment_t,
};
use crate::simd::{Lane, M3, V3, scale, splat3, sub, tmul};

/// Steps side by side.
pub(crate) const STEPS: usize = 8;

/// M numbers of each of the steps.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Table<const M: usize>([[f64; STEPS]; M]);

impl<const M: usize> Table<M> {
    /// Nothing yet.
    pub(crate) const EMPTY: Self = Self([[0.0; STEPS]; M]);

    #[inline(always)]
    pub(crate) fn put<S: Simd>(&mut self, numbers: &[f64x8<S>; M]) {
        for i in 0..M {
            numbers[i].store_array(&mut self.0[i]);
        }
    }
    #[inline(always)]
    pub(crate) fn vectors<S: Simd>(&self, simd: S) -> [f64x8<S>; M] {
        let mut vectors = [f64x8::simd_from(simd, 0.0); M];
        for i in 0..M {
            vectors[i] = f64x8::load_array_ref(simd, &self.0[i]);
        }
        vectors
    }
    /// Number i of step k.
    #[inline(always)]
    pub(crate) fn at(&self, i: usize, k: usize) -> f64 {
        // Never out of bounds, which the compiler need not check then.
        self.0[i][k % STEPS]
    }
    /// All numbers of step k.
    #[inline(always)]
    pub(crate) fn of(&self, k: usize) -> [f64; M] {
        let mut own = [0.0; M];
        for i in 0..M {
            own[i] = self.at(i, k);
        }
        own
    }
    #[inline(always)]
    fn put_at(&mut self, k: usize, numbers: &[f64; M]) {
        for i in 0..M {
            self.0[i][k % STEPS] = numbers[i];
        }
    }
}

/// The step before each, where `last` holds the eight before these.
#[inline(always)]
pub(crate) fn before<S: Simd>(last: f64x8<S>, these: f64x8<S>) -> f64x8<S> {
    last.slide::<{ STEPS - 1 }>(these)
}

/// Biases of gyros and accelerometers, platform frame.
pub(crate) struct Biases {
    pub(crate) gyro_p_radps: V3<f64>,
    pub(crate) accel_p_mps2: V3<f64>,
}

/// At most eight steps ahead: what follows from their readings, and the attitudes as they come to be known.
pub(crate) struct Ahead {
    dt_s: Table<1>,
    start: Table<6>,
    end: Table<6>,
    turn_p: Table<4>,
    turn_t: Table<4>,
    attitude: Table<4>,
}

impl Ahead {
    pub(crate) const EMPTY: Self = Self {
        dt_s: Table::EMPTY,
        start: Table::EMPTY,
        end: Table::EMPTY,
        turn_p: Table::EMPTY,
        turn_t: Table::EMPTY,
        attitude: Table::EMPTY,
    };

    /// From the sample before and those at the ends of the steps; steps that are not there repeat the last.
    #[inline(always)]
    pub(crate) fn read<S: Simd>(
        &mut self,
        simd: S,
        samples: &[ImuSample],
        biases: &Biases,
        sampling: Sampling,
        earth: &EarthTerms,
    ) {
        let last = samples.len() - 1;
        let mut raw = [[0.0; 2 * STEPS]; 6];
        let (mut dt_s, mut twelfth) = ([0.0; STEPS], [0.0; STEPS]);
        for k in 0..=STEPS {
            let sample = &samples[k.min(last)];
            let (rate, force) = (&sample.rate_p_radps.0, &sample.force_p_mps2.0);
            for (raw, number) in raw.iter_mut().zip([rate.x, rate.y, rate.z, force.x, force.y, force.z]) {
                raw[k] = number;
            }
        }
        for k in 0..STEPS {
            let at = (k + 1).min(last);
            dt_s[k] = (samples[at].time_ns - samples[at - 1].time_ns) as f64 * 1e-9;
            twelfth[k] = dt_s[k] * dt_s[k] / 12.0;
        }
        let zero = f64x8::simd_from(simd, 0.0);
        let (gyro, accel) = (splat3(zero, biases.gyro_p_radps), splat3(zero, biases.accel_p_mps2));
        let end = corrected(simd, &raw, 1, gyro, accel);
        let start = match sampling {
            Sampling::Instantaneous => corrected(simd, &raw, 0, gyro, accel),
            Sampling::Averaged => end,
        };
        let dt = f64x8::load_array_ref(simd, &dt_s);
        let twelfth = f64x8::load_array_ref(simd, &twelfth);
        let rate_t = splat3(zero, earth.rate_t);
        self.dt_s.put(&[dt]);
        self.start.put(&flat(&start));
        self.end.put(&flat(&end));
        self.turn_p
            .put(&platform_turn(&start, &end, dt * dt.splat(0.5), twelfth));
        self.turn_t.put(&frame_turn(scale(rate_t, dt * Lane::splat(dt, -0.5))));
    }

    /// The attitude after step k.
    #[inline(always)]
    pub(crate) fn turn(&mut self, k: usize, attitude: &mut [f64; 4]) {
        *attitude = turned(*attitude, self.turn_t.of(k), self.turn_p.of(k));
        self.attitude.put_at(k, attitude);
    }

    /// Length of step k.
    #[inline(always)]
    pub(crate) fn dt_s(&self, k: usize) -> f64 {
        self.dt_s.at(0, k)
    }
}

/// Eight steps side by side.
pub(crate) struct Course<S: Simd> {
    /// After each.
    pub(crate) after: Kinematics<f64x8<S>>,
    /// R before each.
    pub(crate) rotation_before: M3<f64x8<S>>,
    /// Readings at the end of each.
    pub(crate) end: Inertial<f64x8<S>>,
    /// Length of each.
    pub(crate) dt_s: f64x8<S>,
}

/// Where the last eight steps have come to; only the last of them counts.
pub(crate) struct Wake<S: Simd> {
    position_t: V3<f64>,
    velocity_t: V3<f64>,
    rotation: M3<f64x8<S>>,
}

impl<S: Simd> Wake<S> {
    #[inline(always)]
    pub(crate) fn of(simd: S, start: &Kinematics<f64>) -> Self {
        let zero = f64x8::simd_from(simd, 0.0);
        Self {
            position_t: start.position_t_m,
            velocity_t: start.velocity_t_mps,
            rotation: [
                splat3(zero, start.rotation_t_p[0]),
                splat3(zero, start.rotation_t_p[1]),
                splat3(zero, start.rotation_t_p[2]),
            ],
        }
    }

    /// The first `count` steps of eight whose attitudes are known; none where a position is no number.
    #[inline(always)]
    pub(crate) fn follow(&mut self, simd: S, ahead: &Ahead, count: usize, earth: &EarthTerms) -> Option<Course<S>> {
        let (start, end) = (inertial(ahead.start.vectors(simd)), inertial(ahead.end.vectors(simd)));
        let [dt] = ahead.dt_s.vectors(simd);
        let attitude = ahead.attitude.vectors(simd);
        let rotation = rotation_matrix(attitude);
        let rotation_before = both(&self.rotation, &rotation);
        let half = dt * dt.splat(0.5);
        let rate_t = splat3(dt, earth.rate_t);
        let fall = dt * dt.splat(earth.gravity_mps2);
        let gain_t = velocity_increment_t(&rotation_before, &start, &rotation, &end, half, fall);
        let twice_turn_t = scale(rate_t, dt * dt.splat(2.0));

        let (mut gains, mut turns, mut halves) = (Table::<3>::EMPTY, Table::<3>::EMPTY, Table::<1>::EMPTY);
        gains.put(&gain_t);
        turns.put(&twice_turn_t);
        halves.put(&[half]);
        let (mut positions, mut velocities) = (Table::<3>::EMPTY, Table::<3>::EMPTY);
        let (mut position_t, mut velocity_t) = (self.position_t, self.velocity_t);
        let mut is_finite = true;
        for k in 0..count {
            (position_t, velocity_t) =
                integrate_velocity_position(position_t, velocity_t, gains.of(k), turns.of(k), halves.at(0, k));
            is_finite &= (position_t[0] + position_t[1] + position_t[2]).is_finite();
            positions.put_at(k, &position_t);
            velocities.put_at(k, &velocity_t);
        }
        if !is_finite {
            return None;
        }
        *self = Self {
            position_t,
            velocity_t,
            rotation,
        };
        let velocity_t = velocities.vectors(simd);
        Some(Course {
            after: Kinematics {
                position_t_m: positions.vectors(simd),
                attitude_t_p: attitude,
                rotation_t_p: rotation,
                velocity_p_mps: tmul(&rotation, velocity_t),
                velocity_t_mps: velocity_t,
            },
            rotation_before,
            end,
            dt_s: dt,
        })
    }
}

impl Table<KINEMATICS> {
    /// The motion after step k.
    #[inline(always)]
    pub(crate) fn kinematics(&self, k: usize) -> Kinematics<f64> {
        Kinematics::from_array(self.of(k))
    }
}

/// Readings from the one at `from` on, less the biases.
#[inline(always)]
fn corrected<S: Simd>(
    simd: S,
    raw: &[[f64; 2 * STEPS]; 6],
    from: usize,
    gyro: V3<f64x8<S>>,
    accel: V3<f64x8<S>>,
) -> Inertial<f64x8<S>> {
    let mut x = [gyro[0]; 6];
    for i in 0..6 {
        x[i] = f64x8::from_slice(simd, &raw[i][from..from + STEPS]);
    }
    let Inertial {
        rate_p_radps,
        force_p_mps2,
    } = inertial(x);
    Inertial {
        rate_p_radps: sub(rate_p_radps, gyro),
        force_p_mps2: sub(force_p_mps2, accel),
    }
}

#[inline(always)]
fn both<S: Simd>(last: &M3<f64x8<S>>, these: &M3<f64x8<S>>) -> M3<f64x8<S>> {
    let mut rotation = *these;
    for i in 0..3 {
        for j in 0..3 {
            rotation[i][j] = before(last[i][j], these[i][j]);
        }
    }
    rotation
}

#[inline(always)]
fn flat<T: Copy>(inertial: &Inertial<T>) -> [T; 6] {
    let (rate, force) = (inertial.rate_p_radps, inertial.force_p_mps2);
    [rate[0], rate[1], rate[2], force[0], force[1], force[2]]
}

#[inline(always)]
fn inertial<T: Copy>(x: [T; 6]) -> Inertial<T> {
    Inertial {
        rate_p_radps: [x[0], x[1], x[2]],
        force_p_mps2: [x[3], x[4], x[5]],
    }
}
