//! Filters side by side in every kind of vector that this machine has, against each of them predicted step by step.

use super::*;
use crate::simd::vectors;
use crate::testing::*;

const FILTERS: usize = 4;
const SAMPLES: usize = 40;

fn filters(period_ns: i64) -> Vec<Eskf> {
    let options = Options {
        covariance_period_ns: period_ns,
        ..Options::default()
    };
    let one = |k: usize| {
        let mut start = NavState::at_rest(0);
        start.velocity_p_mps = Vec3::new(2.0, 0.1 * k as f64, -0.05);
        start.attitude_t_p = Rot::from_euler_rad(0.1, -0.2, 0.7 * k as f64);
        let mut model = Model::table_2();
        model.imu.gyro_misalignment_sd_rad = if k == 2 { 1e-3 } else { 0.0 };
        let Ok(filter) = Eskf::new(start, &model, &options) else {
            unreachable!("the model of the paper is a good one");
        };
        filter.with_water((k == 1).then(|| WaterBlock::new(&WaterPrior::default())))
    };
    (0..FILTERS).map(one).collect()
}

/// Readings of filter k; the last spins so fast that its rotation leaves the series that its neighbours' stays in.
fn stream(k: usize) -> Vec<ImuSample> {
    let spin = if k + 1 == FILTERS { 180.0 } else { 0.2 };
    let sample = |at: usize| {
        imu(
            at as i64 * 6_666_667,
            [0.01, spin * (0.1 * at as f64).cos(), 0.02 * k as f64],
            [(at as f64).sin(), 0.1, -9.8 + 0.01 * k as f64],
        )
    };
    (0..SAMPLES).map(sample).collect()
}

/// The covariance also as it is stored, rows of an earlier time included.
fn bits(filter: &Eskf) -> Vec<u64> {
    let mut numbers = filter.covariance().as_slice().to_vec();
    numbers.extend(filter.covariance.iter());
    numbers.extend(filter.kinematics.to_array());
    if let Some(water) = filter.water_states() {
        numbers.extend(water.estimate.iter().chain(&filter.water_covariance().unwrap()));
    }
    numbers.into_iter().map(f64::to_bits).collect()
}

/// The bits of every filter, each predicted by itself, step by step.
fn step_by_step(period_ns: i64, streams: &[Vec<ImuSample>]) -> Vec<Vec<u64>> {
    let mut alone = filters(period_ns);
    for (filter, samples) in alone.iter_mut().zip(streams) {
        for step in samples.windows(2) {
            assert_eq!(filter.predict(&step[0], &step[1]), Ok(()));
        }
    }
    alone.iter().map(bits).collect()
}

/// The bits of every filter, all predicted side by side.
fn side_by_side(period_ns: i64, streams: &[Vec<ImuSample>]) -> Vec<Vec<u64>> {
    let mut together = filters(period_ns);
    let pairs = together.iter_mut().zip(streams);
    let mut spans: Vec<_> = pairs
        .map(|(filter, samples)| FilterSpan::new(filter, samples))
        .collect();
    predict_together(&mut spans);
    assert!(spans.iter().all(|span| span.failure.is_none()));
    together.iter().map(bits).collect()
}

/// Also the narrowest vectors, which fuse in software, give the bits of this machine's own.
#[test]
fn every_kind_of_vector_gives_the_same_bits() {
    let streams: Vec<_> = (0..FILTERS).map(stream).collect();
    for period_ns in [0, 100_000_000] {
        let own = step_by_step(period_ns, &streams);
        on_every_level(|| {
            let vectors = vectors();
            assert_eq!(
                step_by_step(period_ns, &streams),
                own,
                "{vectors:?}, period {period_ns} ns"
            );
            assert_eq!(
                side_by_side(period_ns, &streams),
                own,
                "{vectors:?}, period {period_ns} ns"
            );
        });
    }
}

/// Filters whose times agree at both ends and not between go on by themselves from where they differ; a time that does not rise
/// stops its own filter alone.
#[test]
fn times_that_differ_between_part_the_filters() {
    let mut streams: Vec<_> = (0..FILTERS).map(stream).collect();
    streams[1][20].time_ns += 1000;
    streams[2][25].time_ns = streams[2][24].time_ns;
    check(&filters(0), &streams, Some((2, 25)));
}

/// Predicts the filters side by side and each by itself, and compares failures and bits.
fn check(filters: &[Eskf], streams: &[Vec<ImuSample>], failing: Option<(usize, usize)>) {
    on_every_level(|| {
        let (mut together, mut alone) = (filters.to_vec(), filters.to_vec());
        let pairs = together.iter_mut().zip(streams);
        let mut spans: Vec<_> = pairs
            .map(|(filter, samples)| FilterSpan::new(filter, samples))
            .collect();
        predict_together(&mut spans);
        let failures: Vec<_> = spans.iter().map(|span| span.failure.clone()).collect();
        for (k, filter) in alone.iter_mut().enumerate() {
            let failure = filter.predict_along(&streams[k]).err();
            let expected = failing.filter(|&(of, _)| of == k).map(|(_, at)| at);
            assert_eq!(failure.as_ref().map(|(at, _)| *at), expected, "filter {k}");
            assert_eq!(failures[k], failure, "filter {k}");
            assert_eq!(bits(&together[k]), bits(filter), "filter {k}");
        }
    });
}

/// Filters of another noise, another period, another number of samples or another end keep to themselves.
#[test]
fn filters_that_differ_do_not_share() {
    let streams: Vec<_> = (0..FILTERS).map(stream).collect();
    let mut noisy = filters(100_000_000);
    noisy[1].settings.noise.gyro *= 9.0;
    noisy[2].settings.covariance_period_s = 0.05;
    check(&noisy, &streams, None);

    let mut shorter = streams.clone();
    shorter[1].pop();
    shorter[2][SAMPLES - 1].time_ns += 500;
    shorter[3][0].time_ns -= 500;
    check(&filters(100_000_000), &shorter, None);

    let mut begun = filters(100_000_000);
    begun[1].predict_along(&streams[1][..4]).unwrap();
    let mut later = streams.clone();
    later
        .iter_mut()
        .flatten()
        .for_each(|sample| sample.time_ns += 1_000_000_000);
    check(&begun, &later, None);
}

/// A filter that runs out of numbers stops where it does alone, and its neighbours go on; if all do, so do all.
#[test]
fn a_filter_that_is_lost_stops_alone() {
    let mut streams: Vec<_> = (0..FILTERS).map(stream).collect();
    for axis in 0..3 {
        streams[1][20].force_p_mps2.0[axis] = f64::MAX;
        streams[1][21].force_p_mps2.0[axis] = f64::MAX;
    }
    let mut alone = filters(100_000_000);
    let at = alone[1].predict_along(&streams[1]).unwrap_err().0;
    assert!((20..SAMPLES - 1).contains(&at), "{at}");
    check(&filters(100_000_000), &streams, Some((1, at)));
    check(&filters(0), &streams, Some((1, at)));
    let all = vec![streams[1].clone(); FILTERS];
    let mut together = filters(100_000_000);
    let pairs = together.iter_mut().zip(&all);
    let mut spans: Vec<_> = pairs
        .map(|(filter, samples)| FilterSpan::new(filter, samples))
        .collect();
    predict_together(&mut spans);
    assert!(
        spans
            .iter()
            .all(|span| span.failure.as_ref().is_some_and(|(failed, _)| *failed == at))
    );
}

/// States beside the others follow also where every filter has them.
#[test]
fn all_filters_have_further_states() {
    let streams: Vec<_> = (0..FILTERS).map(stream).collect();
    let with_water = |filter: Eskf| filter.with_water(Some(WaterBlock::new(&WaterPrior::default())));
    let all: Vec<_> = filters(100_000_000).into_iter().map(with_water).collect();
    check(&all, &streams, None);
}
