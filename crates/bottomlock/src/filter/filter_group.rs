//! DualFilter side by side, over IMU samples between which nothing is measured.
//!
//! The methods of a run, and the runs of a batch, sit in the lanes of vectors; each lane does what [`Eskf::predict`] does, bit for
//! bit, whoever its neighbours are. Only filters whose covariance falls due at the same steps sit together.

use fearless_simd::f64x4;
#[cfg(target_arch = "x86_64")]
use fearless_simd::f64x8;
use fearless_simd::prelude::*;

use super::Eskf;
use super::ahead::{Ahead, Streams};
use super::packed::{PACKED, place as place_of};
use crate::error::NavError;
use crate::error_model::{Partitioned, SideBySide, Step, Stretch};
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, ImuSample, KINEMATICS, Kinematics};
use crate::simd::{Lanes, Vectors, WIDEST, gather, scatter, scatter_into, three, vectors};

/// A filter and the samples that it takes; the first of them it has taken already.
#[derive(Debug)]
pub struct FilterSpan<'a> {
    /// The filter.
    pub filter: &'a mut Eskf,
    /// Its samples.
    pub samples: &'a [ImuSample],
    /// What went wrong, and at which sample.
    pub failure: Option<(usize, NavError)>,
}

impl<'a> FilterSpan<'a> {
    /// A filter with its samples, of which it has taken the first.
    pub fn new(filter: &'a mut Eskf, samples: &'a [ImuSample]) -> Self {
        Self {
            filter,
            samples,
            failure: None,
        }
    }

    /// True where two filters do the same operations at the same steps, as far as the ends of their samples tell.
    fn keeps_pace_with(&self, other: &Self) -> bool {
        let (own, its) = (&*self.filter, &*other.filter);
        let ends = |seat: &Self| {
            let [first, second, .., last] = seat.samples else {
                return None;
            };
            Some([first.time_ns, second.time_ns, last.time_ns])
        };
        (std::ptr::eq(self.samples, other.samples)
            || self.samples.len() == other.samples.len() && ends(self) == ends(other))
            && own.interval.duration_s().to_bits() == its.interval.duration_s().to_bits()
            && own.earth == its.earth
            && own.noise == its.noise
            && own.sampling == its.sampling
            && own.covariance_period_s == its.covariance_period_s
    }

    /// Takes what comes after sample `taken`, which it has taken already.
    fn predict_alone(&mut self, taken: usize) {
        if self.failure.is_none() {
            let outcome = self.filter.predict_along(&self.samples[taken..]);
            self.failure = outcome.err().map(|(at, error)| (taken + at, error));
        }
    }
}

/// Leads every filter over its samples, as [`Eskf::predict`] does step by step.
///
/// What goes wrong for a filter is noted at its seat, and no other feels it. DualFilter whose samples are at the same times and whose
/// covariances fall due together are led side by side.
pub fn predict_together(seats: &mut [FilterSpan<'_>]) {
    let mut waiting: Vec<&mut FilterSpan<'_>> = seats.iter_mut().collect();
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
            let begins = matches!(part[0].samples, [first, second, ..] if first.time_ns < second.time_ns);
            let taken = if part.len() > 1 && !watched && begins {
                board(part)
            } else {
                0
            };
            part.iter_mut().for_each(|seat| seat.predict_alone(taken));
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

fn board(seats: &mut [&mut FilterSpan<'_>]) -> usize {
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
fn fly_any<S: Simd, T: Lanes<S>>(simd: S, seats: &mut [&mut FilterSpan<'_>], many_steps: bool) -> usize {
    if many_steps {
        fly::<_, T, Stretch<T>>(simd, seats)
    } else {
        fly::<_, T, Step<T>>(simd, seats)
    }
}

/// At most as many filters as there are lanes; a lane left over correlated_noise the last filter.
///
/// Returns the last sample taken: that before times differ or do not rise. A filter that runs out of numbers on the way is led
/// anew by itself, to the sample where it does.
#[inline(always)]
fn fly<S: Simd, T: Lanes<S>, I: SideBySide<S, T>>(simd: S, seats: &mut [&mut FilterSpan<'_>]) -> usize {
    let count = seats.len();
    let place = |k: usize| k.min(count - 1);
    let mut intervals = Vec::with_capacity(WIDEST);
    for seat in seats.iter_mut() {
        let (start, end) = (&seat.samples[0], &seat.samples[1]);
        seat.filter.gather_covariance();
        seat.filter.begin_interval(start, end);
        intervals.extend(I::one(&seat.filter.interval));
    }

    let mut of: [&[ImuSample]; WIDEST] = [seats[0].samples; WIDEST];
    let mut kinematics = [[0.0; KINEMATICS]; WIDEST];
    let mut biases = [[0.0; WIDEST]; WIDEST];
    let mut starts = [intervals[0]; WIDEST];
    for k in 0..WIDEST {
        let (seat, filter) = (&seats[place(k)], &seats[place(k)].filter);
        let (gyro, accel) = (filter.state.gyro_bias_p_radps.0, filter.state.accel_bias_p_mps2.0);
        of[k] = seat.samples;
        kinematics[k] = filter.kinematics.to_array();
        biases[k] = [gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z, 0.0, 0.0];
        starts[k] = intervals[place(k)];
    }
    let mut interval = I::gathered(simd, &starts);
    let mut kinematics: Kinematics<T> = Kinematics::from_array(gather(simd, kinematics.each_ref()));
    let biases: [T; WIDEST] = gather(simd, biases.each_ref());
    let mut covariances: [T; PACKED] = gather(simd, std::array::from_fn(|k| &seats[place(k)].filter.covariance.0));
    let mut p = Partitioned::from_fn(biases[0], |i, j| covariances[place_of(i, j)]);

    let (earth, noise) = (seats[0].filter.earth, seats[0].filter.noise);
    let period_s = seats[0].filter.covariance_period_s;
    let streams = Streams {
        are_one: of.iter().all(|stream| std::ptr::eq(*stream, of[0])),
        of,
        gyro_bias_p_radps: three(&biases, 0),
        accel_bias_p_mps2: three(&biases, 3),
        sampling: seats[0].filter.sampling,
    };
    let mut ahead = Ahead::nothing(biases[0]);
    let (mut taken, mut dt_s) = (0, 0.0);
    loop {
        let (count, mut attitude) = ahead.read(simd, &streams, taken, kinematics.attitude_t_p, &earth);
        if count == 0 {
            break;
        }
        for k in 0..count {
            dt_s = ahead.dt_s(k);
            let (start, end) = ahead.ends(k);
            // The chain of rotations goes a step ahead of the rest, which fills its pauses; what comes after the last is not used.
            let next = ahead.turn((k + 1).min(count - 1)).after(attitude);
            let before = kinematics;
            kinematics.follow(attitude, start, end, dt_s, &earth);
            interval.add(&I::take(&before, &kinematics, end, &earth), dt_s);
            attitude = next;
            if interval.duration_s() + 0.5 * dt_s >= period_s {
                water_follows(seats, &interval, &kinematics, &earth);
                interval.propagate(&mut p, &kinematics, &noise, &earth);
            }
        }
        taken += count;
    }

    let [x, y, z] = kinematics.position_t_m;
    let lost = lost(seats, &(x + y + z));
    for j in 0..DIM {
        for i in j..DIM {
            covariances[place_of(i, j)] = *p.lower(i, j);
        }
    }
    let mut places: Vec<_> = seats.iter_mut().map(|seat| &mut seat.filter.covariance.0).collect();
    scatter_into(&covariances, &mut places);
    let kinematics = kinematics.to_array();
    for (k, seat) in seats.iter_mut().enumerate() {
        let reading = &seat.samples[taken];
        let filter = &mut *seat.filter;
        filter.kinematics = Kinematics::from_array(scatter(&kinematics, k));
        filter.interval = interval.lane(k);
        filter.state.time_ns = reading.time_ns;
        filter.last_rate_p_radps = reading.rate_p_radps.0;
        filter.last_step_s = dt_s;
    }
    for (k, filter) in lost {
        *seats[k].filter = filter;
        seats[k].predict_alone(0);
    }
    taken
}

/// The filters whose numbers have run out, as they were before; their further states alone have gone on.
fn lost<S: Simd, T: Lanes<S>>(seats: &[&mut FilterSpan<'_>], sum: &T) -> Vec<(usize, Eskf)> {
    let is_lost = |(k, _): &(usize, &&mut FilterSpan<'_>)| !sum.get(*k).is_finite();
    let filters = seats.iter().enumerate().filter(is_lost);
    filters.map(|(k, seat)| (k, seat.filter.clone())).collect()
}

/// The further states of those filters that have some, over an interval that has come to `end`.
#[inline(always)]
fn water_follows<S: Simd, T: Lanes<S>, I: SideBySide<S, T>>(
    seats: &mut [&mut FilterSpan<'_>],
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

#[cfg(test)]
#[path = "filter_group_tests.rs"]
mod tests;
