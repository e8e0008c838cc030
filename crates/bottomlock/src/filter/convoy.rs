//! Filters side by side, over IMU samples between which nothing is measured.
//!
//! The arms of a run, and the runs of a batch, sit in the lanes of vectors; each lane does what [`Eskf::predict`] does, bit for
//! bit, whoever its neighbours are. Only filters whose covariance falls due at the same steps sit together.

use fearless_simd::f64x4;
#[cfg(target_arch = "x86_64")]
use fearless_simd::f64x8;
use fearless_simd::prelude::*;

use super::Eskf;
use crate::error::NavError;
use crate::error_model::{Partitioned, SideBySide, Step, Stretch};
use crate::imu::{EarthTerms, ImuSample, Inertial, KINEMATICS, Kinematics, Sampling};
use crate::lane::{Lane, Lanes, V3, Vectors, WIDEST, gather, scatter, splat3, sub, vectors};
use crate::layout::DIM;
use crate::state::Covariance;

/// A filter and the samples that it takes; the first of them it has taken already.
#[derive(Debug)]
pub struct Seat<'a> {
    /// The filter.
    pub filter: &'a mut Eskf,
    /// Its samples.
    pub samples: &'a [ImuSample],
    /// What went wrong, and at which sample.
    pub failure: Option<(usize, NavError)>,
}

impl<'a> Seat<'a> {
    /// A filter with its samples, of which it has taken the first.
    pub fn new(filter: &'a mut Eskf, samples: &'a [ImuSample]) -> Self {
        Self {
            filter,
            samples,
            failure: None,
        }
    }

    /// True where two filters do the same operations at the same steps.
    fn keeps_pace_with(&self, other: &Self) -> bool {
        let (own, its) = (&*self.filter, &*other.filter);
        let times = |seat: &Self| seat.samples.iter().map(|sample| sample.time_ns);
        (std::ptr::eq(self.samples, other.samples) || times(self).eq(times(other)))
            && own.interval.duration_s().to_bits() == its.interval.duration_s().to_bits()
            && own.earth == its.earth
            && own.noise == its.noise
            && own.sampling == its.sampling
            && own.covariance_period_s == its.covariance_period_s
    }

    fn times_rise(&self) -> bool {
        self.samples.windows(2).all(|step| step[0].time_ns < step[1].time_ns)
    }

    fn predict_alone(&mut self) {
        self.failure = self.filter.predict_along(self.samples).err();
    }
}

/// Leads every filter over its samples, as [`Eskf::predict`] does step by step.
///
/// What goes wrong for a filter is noted at its seat, and no other feels it. Filters whose samples are at the same times and whose
/// covariances fall due together are led side by side.
pub fn predict_together(seats: &mut [Seat<'_>]) {
    let mut waiting: Vec<&mut Seat<'_>> = seats.iter_mut().collect();
    while !waiting.is_empty() {
        let leader = &waiting[0];
        let joins: Vec<bool> = waiting.iter().map(|seat| seat.keeps_pace_with(leader)).collect();
        let (mut group, mut others) = (Vec::new(), Vec::new());
        for (seat, joins) in waiting.into_iter().zip(joins) {
            if joins { group.push(seat) } else { others.push(seat) }
        }
        waiting = others;
        for part in group.chunks_mut(width()) {
            // A smoother wants to see every transition.
            let watched = part.iter().any(|seat| seat.filter.tape.is_some());
            if part.len() == 1 || watched || part[0].samples.len() < 2 || !part[0].times_rise() {
                part.iter_mut().for_each(|seat| seat.predict_alone());
            } else {
                board(part);
            }
        }
    }
}

/// How many filters sit together: the widest vectors of the machine.
#[must_use]
pub fn width() -> usize {
    match vectors() {
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx512(_) => WIDEST,
        _ => 4,
    }
}

fn board(seats: &mut [&mut Seat<'_>]) {
    let many_steps = seats[0].filter.covariance_period_s > 0.0;
    match vectors() {
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx512(simd) => simd.vectorize(
            #[inline(always)]
            || fly_any::<_, f64x8<_>>(simd, seats, many_steps),
        ),
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx2(simd) => simd.vectorize(
            #[inline(always)]
            || fly_any::<_, f64x4<_>>(simd, seats, many_steps),
        ),
        #[cfg(target_arch = "x86_64")]
        Vectors::Sse2(simd) => simd.vectorize(
            #[inline(always)]
            || fly_any::<_, f64x4<_>>(simd, seats, many_steps),
        ),
        #[cfg(not(target_arch = "x86_64"))]
        Vectors::Others(level) => {
            fearless_simd::dispatch!(level, simd => fly_any::<_, f64x4<_>>(simd, seats, many_steps))
        }
    }
}

#[inline(always)]
fn fly_any<S: Simd, T: Lanes<S>>(simd: S, seats: &mut [&mut Seat<'_>], many_steps: bool) {
    if many_steps {
        fly::<_, T, Stretch<T>>(simd, seats);
    } else {
        fly::<_, T, Step<T>>(simd, seats);
    }
}

#[inline(always)]
fn corrected<T: Lane>(sample: &Inertial<T>, gyro_bias: V3<T>, accel_bias: V3<T>) -> Inertial<T> {
    Inertial {
        rate_p_radps: sub(sample.rate_p_radps, gyro_bias),
        force_p_mps2: sub(sample.force_p_mps2, accel_bias),
    }
}

/// The samples of all lanes at one time; arms of a run have them in common.
#[inline(always)]
fn readings<S: Simd, T: Lanes<S>>(simd: S, streams: &[&[ImuSample]; WIDEST], at: usize, common: bool) -> Inertial<T> {
    let zero = T::gather(simd, |_| 0.0);
    let first = &streams[0][at];
    if common {
        return Inertial {
            rate_p_radps: splat3(zero, first.rate_p_radps.to_array()),
            force_p_mps2: splat3(zero, first.force_p_mps2.to_array()),
        };
    }
    let own = streams.map(|stream| &stream[at]);
    let (rate, force) = (own.map(|own| &own.rate_p_radps.0), own.map(|own| &own.force_p_mps2.0));
    Inertial {
        rate_p_radps: [
            T::gather(simd, |k| rate[k].x),
            T::gather(simd, |k| rate[k].y),
            T::gather(simd, |k| rate[k].z),
        ],
        force_p_mps2: [
            T::gather(simd, |k| force[k].x),
            T::gather(simd, |k| force[k].y),
            T::gather(simd, |k| force[k].z),
        ],
    }
}

/// At most as many filters as there are lanes; a lane left over repeats the last filter.
#[inline(always)]
fn fly<S: Simd, T: Lanes<S>, I: SideBySide<S, T>>(simd: S, seats: &mut [&mut Seat<'_>]) {
    let count = seats.len();
    let place = |k: usize| k.min(count - 1);
    let mut intervals = Vec::with_capacity(WIDEST);
    for seat in seats.iter_mut() {
        let (start, end) = (&seat.samples[0], &seat.samples[1]);
        seat.filter.gather_covariance();
        seat.filter.begin_interval(start, end);
        intervals.extend(I::one(&seat.filter.interval));
    }

    let mut streams: [&[ImuSample]; WIDEST] = [seats[0].samples; WIDEST];
    let mut kinematics = [[0.0; KINEMATICS]; WIDEST];
    let mut biases = [[0.0; 6]; WIDEST];
    let mut starts = [intervals[0]; WIDEST];
    for k in 0..WIDEST {
        let (seat, filter) = (&seats[place(k)], &seats[place(k)].filter);
        let (gyro, accel) = (filter.state.gyro_bias_p_radps.0, filter.state.accel_bias_p_mps2.0);
        streams[k] = seat.samples;
        kinematics[k] = filter.kinematics.to_array();
        biases[k] = [gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z];
        starts[k] = intervals[place(k)];
    }
    let mut interval = I::gathered(simd, &starts);
    let mut kinematics: Kinematics<T> = Kinematics::from_array(gather(simd, &kinematics));
    let biases: [T; 6] = gather(simd, &biases);
    let (gyro_bias, accel_bias) = ([biases[0], biases[1], biases[2]], [biases[3], biases[4], biases[5]]);
    let zero = T::gather(simd, |_| 0.0);
    let covariances: [&Covariance; WIDEST] = std::array::from_fn(|k| &seats[place(k)].filter.covariance);
    let mut p = Partitioned::from_fn(zero, |i, j| T::gather(simd, |k| covariances[k].data.0[j][i]));

    let (earth, noise) = (seats[0].filter.earth, seats[0].filter.noise);
    let (sampling, period_s) = (seats[0].filter.sampling, seats[0].filter.covariance_period_s);
    let samples = streams[0];
    let common = streams.iter().all(|stream| std::ptr::eq(*stream, samples));
    let mut first = corrected(&readings(simd, &streams, 0, common), gyro_bias, accel_bias);
    let mut dt_s = 0.0;
    let mut is_due = false;
    for at in 1..samples.len() {
        dt_s = (samples[at].time_ns - samples[at - 1].time_ns) as f64 * 1e-9;
        let last = corrected(&readings(simd, &streams, at, common), gyro_bias, accel_bias);
        if sampling == Sampling::Averaged {
            first = last;
        }
        let mut after = kinematics;
        after.step(&first, &last, dt_s, &earth);
        let taken = I::take(&kinematics, &after, &last, &earth);
        // The covariance comes a step late: its arithmetic fills the pauses in the chain of operations that the state is.
        if is_due {
            water_follows(seats, &interval, &kinematics, &earth);
            interval.propagate(&mut p, &kinematics, &noise, &earth);
        }
        interval.add(&taken, dt_s);
        kinematics = after;
        first = last;
        let position = kinematics.position_t_m;
        let sum = position[0] + position[1] + position[2];
        if !sum.all_finite() {
            note_failures(seats, &sum, at);
        }
        is_due = interval.duration_s() + 0.5 * dt_s >= period_s;
    }
    if is_due {
        water_follows(seats, &interval, &kinematics, &earth);
        interval.propagate(&mut p, &kinematics, &noise, &earth);
    }

    let end = samples.len() - 1;
    let mut lanes = [0.0; WIDEST];
    for i in 0..DIM {
        for j in 0..=i {
            p.lower(i, j).put(&mut lanes);
            for (seat, value) in seats.iter_mut().zip(lanes) {
                let covariance = &mut seat.filter.covariance.data.0;
                covariance[j][i] = value;
                covariance[i][j] = value;
            }
        }
    }
    let kinematics = kinematics.to_array();
    for (k, seat) in seats.iter_mut().enumerate() {
        let reading = &seat.samples[end];
        let filter = &mut *seat.filter;
        filter.kinematics = Kinematics::from_array(scatter(&kinematics, k));
        filter.interval = interval.lane(k);
        filter.state.time_ns = reading.time_ns;
        filter.last_rate_p_radps = reading.rate_p_radps.0;
        filter.last_step_s = dt_s;
    }
}

/// The further states of those filters that have some, over an interval that has come to `end`.
#[inline(always)]
fn water_follows<S: Simd, T: Lanes<S>, I: SideBySide<S, T>>(
    seats: &mut [&mut Seat<'_>],
    interval: &I,
    end: &Kinematics<T>,
    earth: &EarthTerms,
) {
    for (k, seat) in seats.iter_mut().enumerate() {
        if let Some(water) = &mut seat.filter.water {
            let end = Kinematics::from_array(scatter(&end.to_array(), k));
            water.propagate(&interval.lane(k), &end, earth);
        }
    }
}

/// Each lane's first sample at which its position is no number any more.
#[cold]
fn note_failures<S: Simd, T: Lanes<S>>(seats: &mut [&mut Seat<'_>], sum: &T, at: usize) {
    for (k, seat) in seats.iter_mut().enumerate() {
        if seat.failure.is_none() && !sum.get(k).is_finite() {
            let time_ns = seat.samples[at].time_ns;
            seat.failure = Some((at, Eskf::ran_out_of_numbers(time_ns)));
        }
    }
}

#[cfg(test)]
#[path = "convoy_tests.rs"]
mod tests;
